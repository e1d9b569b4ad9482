#include "server/recording/paraview_export.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <map>
#include <regex>

#include "server/recording/file_sink.h"
#include "server/recording/recorder.h"
#include "tests/recording/recording_files.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

using test::TempPath;

constexpr int kSteps = 250;

// A needle that presses into a ball and holds; the last frame is `*last`.
std::string Record(Frame* last) {
  const std::string path = TempPath("export.mcap");
  const auto engine = test::EngineOf(test::NeedleScene(test::kPressAndPull));
  Recorder recorder(*OpenFileSink(path, false), {}, {"1", "b", "s", "n", 1000, 1}, {}, *engine);
  SessionFrame frame;
  frame.frame = engine->MakeFrame();
  frame.target_jumps.resize(1);
  frame.newest_pose.resize(1);
  for (int i = 0; i < kSteps; ++i) {
    engine->Step({});
    engine->WriteFrame(&frame.frame);
    recorder.OnStep(*engine, {}, frame, true);
  }
  *last = frame.frame;
  return path;
}

// The arrays of a file, by name, as a reader of the format finds them.
std::map<std::string, std::string> ReadArrays(const std::string& file) {
  const std::string::size_type data = file.find("\n_") + 2;
  const std::string xml = file.substr(0, data);
  std::map<std::string, std::string> arrays;
  const std::regex element("Name=\"(\\w+)\"[^>]*offset=\"(\\d+)\"");
  for (std::sregex_iterator it(xml.begin(), xml.end(), element), end; it != end; ++it) {
    const std::size_t at = data + std::stoul((*it)[2]);
    std::uint64_t size = 0;
    EXPECT_LT(at + sizeof(size), file.size());
    std::memcpy(&size, file.data() + at, sizeof(size));
    EXPECT_LE(at + sizeof(size) + size, file.size());
    arrays[(*it)[1]] = file.substr(at + sizeof(size), size);
  }
  return arrays;
}

TEST(ParaViewExport, HoldsWhatWasRecorded) {
  Frame last;
  const std::string recording = Record(&last);
  const std::string pvd = TempPath("out.pvd");
  const absl::StatusOr<ExportResult> result = ExportParaView(recording, pvd, false);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->frames, 1u + kSteps * 60 / 1000);
  EXPECT_TRUE(result->damage.empty());

  // The collection names every file, and each is there.
  const std::string collection = test::ReadWholeFile(pvd);
  const std::regex entry("timestep=\"([^\"]+)\" file=\"([^\"]+)\"");
  std::size_t files = 0;
  std::string file;
  double time_s = -1;
  for (std::sregex_iterator it(collection.begin(), collection.end(), entry), end; it != end; ++it) {
    EXPECT_GT(std::stod((*it)[1]), time_s);
    time_s = std::stod((*it)[1]);
    file = (fs::path(pvd).parent_path() / std::string((*it)[2])).string();
    EXPECT_TRUE(fs::is_regular_file(file)) << file;
    ++files;
  }
  EXPECT_EQ(files, result->frames);
  // 60 a second: the newest is of the last step, since 250 steps are 15 frames.
  EXPECT_EQ(time_s, 0.25);

  std::map<std::string, std::string> arrays = ReadArrays(test::ReadWholeFile(file));
  const std::size_t particles = last.position_m.size() / 3;
  EXPECT_EQ(arrays["position"],
            std::string(reinterpret_cast<const char*>(last.position_m.data()), 12 * particles));
  EXPECT_EQ(arrays["zone"],
            std::string(reinterpret_cast<const char*>(last.zone_of.data()), 4 * particles));
  EXPECT_EQ(arrays["strain_energy"],
            std::string(reinterpret_cast<const char*>(last.strain_energy_j.data()), 4 * particles));
  EXPECT_EQ(arrays["displacement"].size(), 12 * particles);
  EXPECT_EQ(arrays["contact_force"].size(), 12 * particles);
  ASSERT_FALSE(last.contact_forces.empty());
  const ContactForce& force = last.contact_forces[0];
  EXPECT_EQ(
      std::memcmp(arrays["contact_force"].data() + 12 * force.particle, force.force_n.data(), 12),
      0);
  EXPECT_EQ(arrays["connectivity"].size(), 3 * arrays["offsets"].size());
}

TEST(ParaViewExport, RefusesForeignFilesAndImpossiblePlaces) {
  Frame last;
  const std::string recording = Record(&last);
  EXPECT_FALSE(ExportParaView("no/such.mcap", TempPath("x.pvd"), false).ok());
  EXPECT_FALSE(ExportParaView(recording, "/dev/null/x.pvd", false).ok());
  EXPECT_FALSE(ExportParaView(recording, TempPath("x.vtk"), false).ok());
  EXPECT_FALSE(ExportParaView(recording, TempPath("x\"y.pvd"), false).ok());
}

TEST(ParaViewExport, WritesWhatIsWholeOfATruncatedRecording) {
  Frame last;
  const std::string recording = Record(&last);
  const std::string bytes = test::ReadWholeFile(recording);
  test::WriteFile(recording, bytes.substr(0, bytes.size() / 2));
  const absl::StatusOr<ExportResult> result =
      ExportParaView(recording, TempPath("short.pvd"), false);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->truncated_at);
  EXPECT_GT(result->frames, 3u);
  EXPECT_LT(result->frames, 15u);
}

// Wrong numbers in frames and topology would lead a reader outside of its arrays.
TEST(ParaViewExport, LeavesOutFramesThatContradictTheTopology) {
  v1::Scene scene;
  const auto write = [&](const v1::WatchResponse& topology, const v1::WatchResponse& frame) {
    std::string bytes;
    McapWriter writer(test::SinkInto(&bytes), "", "");
    const RecordingChannels channels =
        WriteBeginning({"1", "b", "s", "n", 1000, 1}, scene, {}, &writer);
    writer.AddMessage(channels.topology, 0, topology.SerializeAsString());
    writer.AddMessage(channels.frames, 0, frame.SerializeAsString());
    writer.Finish();
    const std::string path = TempPath("odd.mcap");
    test::WriteFile(path, bytes);
    return ExportParaView(path, TempPath("odd.pvd"), false);
  };
  const auto bytes_of = [](const std::vector<std::uint32_t>& values) {
    return std::string(reinterpret_cast<const char*>(values.data()), 4 * values.size());
  };
  v1::WatchResponse topology, frame;
  topology.mutable_topology()->set_particles(3);
  topology.mutable_topology()->set_rest_positions(std::string(36, '\0'));
  topology.mutable_topology()->set_triangles(bytes_of({0, 1, 2}));
  frame.mutable_frame()->set_positions(std::string(36, '\0'));
  EXPECT_EQ(write(topology, frame)->frames, 1u);

  frame.mutable_frame()->set_contact_forces(bytes_of({3, 0, 0, 0}));  // there is no particle 3
  EXPECT_EQ(write(topology, frame)->frames, 0u);
  EXPECT_EQ(write(topology, frame)->damage.size(), 1u);
  frame.mutable_frame()->clear_contact_forces();
  frame.mutable_frame()->set_positions(std::string(24, '\0'));
  EXPECT_EQ(write(topology, frame)->frames, 0u);
  topology.mutable_topology()->set_triangles(bytes_of({0, 1, 3}));
  EXPECT_FALSE(write(topology, frame).ok());
}

}  // namespace
}  // namespace adhesim
