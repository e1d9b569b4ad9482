// Recordings as files: what they need, what in them is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "adhesim/v1/recording.pb.h"
#include "tests/recording/recording_files.h"
#include "tests/recording/replay_fixture.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim {
namespace {

using test::RecordInto;
using test::TempPath;
using test::Verify;
using ::testing::HasSubstr;

constexpr char kOctahedron[] =
    "v 0.05 0 0\nv -0.05 0 0\nv 0 0.05 0\nv 0 -0.05 0\nv 0 0 0.05\nv 0 0 -0.05\n"
    "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

std::string MeshScene(const std::string& file) {
  return "bodies:\n  - {name: a, mesh: {file: \"" + file +
         "\", scale_m: 1}, mass_kg: 0.1}\neffects:\n  - shape_memory: {stiffness_n_m: 10}\n"
         "  - uniform_gravity: {}\n";
}

// Records ten steps of a scene with a mesh file.
void RecordMesh(const std::string& directory, const std::string& file, const std::string& path) {
  const auto model = test::ModelOf(ParseScene(MeshScene(file), "mesh.yaml", directory));
  const auto engine = test::EngineOf(model);
  const auto assets = ReadSceneAssets(model->scene, directory);
  ASSERT_TRUE(assets.ok()) << assets.status();
  ASSERT_EQ(assets->size(), 1u);
  const auto recorder = RecordInto(path, *engine, *assets);
  SessionFrame frame;
  frame.frame = engine->MakeFrame();
  for (int i = 0; i < 10; ++i) {
    engine->Step({});
    engine->WriteFrame(&frame.frame);
    recorder->OnStep(*engine, {}, frame, true);
  }
}

TEST(Replay, NeedsNoFileButTheRecording) {
  const std::string directory = TempPath("scene");
  const std::string path = TempPath("mesh.mcap");
  std::filesystem::create_directories(directory + "/meshes");
  test::WriteFile(directory + "/meshes/body.obj", kOctahedron);
  RecordMesh(directory, "meshes/body.obj", path);
  std::filesystem::remove_all(directory);
  EXPECT_EQ(Verify(path).verified, 10u);
}

TEST(Replay, NamesInARecordingLeadNowhere) {
  const std::string directory = TempPath("outside");
  std::filesystem::create_directories(directory + "/below");
  test::WriteFile(directory + "/evil.obj", kOctahedron);
  const std::string path = TempPath("evil.mcap");
  RecordMesh(directory + "/below", "../evil.obj", path);
  std::filesystem::remove_all(directory);
  EXPECT_EQ(Verify(path).verified, 10u);
  EXPECT_FALSE(std::filesystem::exists(directory));

  // A file that is not attached is not looked for.
  const auto model = test::ModelOf(test::NeedleScene(test::kPressAndPull));
  v1::Scene scene = model->scene;
  scene.mutable_bodies(0)->mutable_mesh()->set_file("/etc/passwd");
  std::string bytes;
  McapWriter writer(test::SinkInto(&bytes), "", "");
  WriteBeginning({"1", "b", "s", "n", 1000, 1}, scene, {}, &writer);
  writer.Finish();
  test::WriteFile(path, bytes);
  EXPECT_THAT(std::string(Replay(path, {}).status().message()), HasSubstr("not attached"));
}

TEST(Replay, RefusesWhatIsNoRecording) {
  const std::string path = TempPath("foreign.mcap");
  std::string bytes;
  McapWriter foreign(test::SinkInto(&bytes), "ros2", "other");
  foreign.AddMessage(foreign.AddChannel(0, "/chatter", "cdr"), 1, "hello");
  foreign.Finish();
  test::WriteFile(path, bytes);
  EXPECT_THAT(std::string(Replay(path, {}).status().message()),
              HasSubstr("not a recording of adhesim"));

  bytes.clear();
  McapWriter later(test::SinkInto(&bytes), "", "adhesim 9");
  later.AddMetadata("adhesim", {{"format", "2"}});
  later.Finish();
  test::WriteFile(path, bytes);
  EXPECT_THAT(std::string(Replay(path, {}).status().message()), HasSubstr("format \"2\""));

  test::WriteFile(path, bytes.substr(0, 20));
  EXPECT_THAT(std::string(Replay(path, {}).status().message()), HasSubstr("ends at byte"));
  EXPECT_FALSE(Replay("no/such/file", {}).ok());
}

TEST(Replay, RefusesMetadataThatContradictTheScene) {
  const std::string path = TempPath("contradiction.mcap");
  const auto model = test::ModelOf(test::NeedleScene(test::kPressAndPull));
  const auto replayed = [&](double rate_hz, std::uint64_t seed) {
    std::string bytes;
    McapWriter writer(test::SinkInto(&bytes), "", "");
    WriteBeginning({"1", "b", "s", "n", rate_hz, seed}, model->scene, {}, &writer);
    writer.Finish();
    test::WriteFile(path, bytes);
    return std::string(Replay(path, {}).status().message());
  };
  const double rate_hz = 1 / model->dt_s;
  EXPECT_EQ(replayed(rate_hz, model->seed), "");
  EXPECT_THAT(replayed(rate_hz, model->seed + 1), HasSubstr("metadata say that the seed is"));
  EXPECT_THAT(replayed(rate_hz * 2, model->seed), HasSubstr("metadata say that rate_hz is"));
  EXPECT_THAT(replayed(std::nan(""), model->seed), HasSubstr("metadata say that rate_hz is"));
}

// The metadata has the scene as text, for people: it must be the scene that is replayed.
TEST(Replay, TheSceneInTheMetadataIsTheOneReplayed) {
  const std::string path = TempPath("text.mcap");
  const auto model = test::ModelOf(test::kChurningCells);
  { RecordInto(path, *test::EngineOf(model)); }
  const auto reader = *McapReader::Open(path);
  const SceneFile text = ParseScene(reader->metadata().at("adhesim").at("scene"), "text", ".");
  ASSERT_TRUE(text.ok()) << text.Format(text.problems);
  // Every number, to the last bit.
  EXPECT_EQ(text.scene.SerializeAsString(), model->scene.SerializeAsString());
  EXPECT_EQ(ReadBeginning(*reader, path)->scene.SerializeAsString(),
            model->scene.SerializeAsString());
}

}  // namespace
}  // namespace adhesim
