// Runs the built program as its users do.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/recording/recording_files.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;
using test::TempPath;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

Outcome Adhesim(const std::string& arguments) {
  const std::string out = TempPath("out"), err = TempPath("err");
  const std::string command =
      std::string(ADHESIM_PROGRAM) + " " + arguments + " >" + out + " 2>" + err + " </dev/null";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, test::ReadWholeFile(out),
          test::ReadWholeFile(err)};
}

constexpr char kScene[] = ADHESIM_SOURCE_DIR "/scenes/training/needle_organ.yaml";

// A recording of 300 steps; the hash at its end.
std::string Record(const std::string& path, const std::string& arguments = "") {
  const Outcome run = Adhesim(std::string("run ") + kScene + " --steps 300 --json --record " +
                              path + " " + arguments);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Json report = Json::parse(run.out);
  EXPECT_EQ(report["recording"]["bytes"], test::ReadWholeFile(path).size());
  return report["state_hash"];
}

TEST(ReplayCommand, VerifiesARun) {
  const std::string path = TempPath("run.mcap");
  const std::string hash = Record(path);
  for (const char* threads : {"1", "2"}) {
    const Outcome replay =
        Adhesim("replay " + path + " --verify --json --threads " + std::string(threads));
    EXPECT_EQ(replay.exit_code, 0) << replay.err;
    EXPECT_EQ(replay.err, "");
    const Json json = Json::parse(replay.out);
    EXPECT_EQ(json["scene"], "needle_organ");
    EXPECT_EQ(json["steps"], 300);
    EXPECT_EQ(json["verified_steps"], 300);
    EXPECT_EQ(json["frames"], 1 + 18);
    EXPECT_EQ(json["identical"], true);
    EXPECT_EQ(json["truncated"], false);
    EXPECT_EQ(json["state_hash"], hash);
    EXPECT_FALSE(json["recorded_by"]["build"].get<std::string>().empty());
  }
  const Outcome text = Adhesim("replay " + path + " --verify");
  EXPECT_THAT(text.out, HasSubstr("300 steps are identical"));
}

TEST(ReplayCommand, RecordsSettingsAndFrameRates) {
  const std::string path = TempPath("set.mcap");
  const std::string hash = Record(path, "--rate 500 --record-frames 100");
  const Json json = Json::parse(Adhesim("replay --json --verify " + path).out);
  EXPECT_EQ(json["state_hash"], hash);
  EXPECT_EQ(json["seconds"], 0.6);
  EXPECT_EQ(json["frames"], 1 + 60);
}

TEST(ReplayCommand, EndsWithOneAtADamagedFile) {
  const std::string path = TempPath("damaged.mcap");
  Record(path);
  std::string bytes = test::ReadWholeFile(path);
  bytes[bytes.size() * 2 / 3] ^= 0x10;
  test::WriteFile(path, bytes);
  const Outcome replay = Adhesim("replay --verify --json " + path);
  EXPECT_EQ(replay.exit_code, 1);
  EXPECT_THAT(replay.err, HasSubstr("damaged at byte"));
  EXPECT_FALSE(Json::parse(replay.out)["damaged"].empty());
}

TEST(ReplayCommand, ReadsATruncatedFileAndSaysSo) {
  const std::string path = TempPath("short.mcap");
  Record(path);
  const std::string bytes = test::ReadWholeFile(path);
  test::WriteFile(path, bytes.substr(0, bytes.size() * 3 / 4));
  const Outcome replay = Adhesim("replay --verify --json " + path);
  EXPECT_EQ(replay.exit_code, 0);
  EXPECT_THAT(replay.err, HasSubstr("cut short at byte"));
  const Json json = Json::parse(replay.out);
  EXPECT_EQ(json["truncated"], true);
  EXPECT_LE(json["truncated_at_byte"], bytes.size() * 3 / 4);
  EXPECT_GT(json["verified_steps"], 100);
  EXPECT_LT(json["verified_steps"], 300);
  EXPECT_EQ(json["identical"], true);
}

TEST(ReplayCommand, EndsWithTwoOnBadInput) {
  test::WriteFile(TempPath("text.mcap"), "not MCAP at all");
  for (const std::string& arguments :
       {std::string("replay"), std::string("replay no/such/file.mcap"),
        "replay " + TempPath("text.mcap"), std::string("replay ") + kScene,
        "replay " + TempPath("text.mcap") + " --threads 0",
        std::string("run ") + kScene + " --steps 1 --record no/such/folder/a.mcap",
        std::string("run ") + kScene + " --steps 1 --record-frames 10",
        std::string("run ") + kScene + " --steps 1 --record-frames 0 --record " + TempPath("x"),
        std::string("serve --record /dev/null/recordings")}) {
    const Outcome outcome = Adhesim(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("error: ")) << arguments;
  }
}

TEST(ReplayCommand, NothingInARecordingReachesTheTerminal) {
  const std::string path = TempPath("escapes.mcap");
  Record(path);
  std::string bytes = test::ReadWholeFile(path);
  // In the metadata, as long as before.
  bytes.replace(bytes.find("needle_organ", bytes.find("scene_name")), 12,
                "\x1b]0;\x9b"
                "31mno\x07\x7f");
  test::WriteFile(path, bytes);
  const Outcome replay = Adhesim("replay " + path);
  EXPECT_THAT(replay.out, HasSubstr("\\x1b]0;\\x9b"));
  for (const char c : replay.out + replay.err) EXPECT_TRUE(c == '\n' || (c >= 0x20 && c < 0x7f));
}

TEST(ReplayCommand, ARunOutlivesAFullDisk) {
  // A limit of the file's size stands for the disk's: 100 kB hold the beginning, not all of it.
  const std::string out = TempPath("full_out"), err = TempPath("full_err");
  const std::string command = std::string("trap '' XFSZ; ulimit -f 200; ") + ADHESIM_PROGRAM +
                              " run " + kScene + " --steps 300 --json --record " +
                              TempPath("full.mcap") + " >" + out + " 2>" + err;
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_THAT(test::ReadWholeFile(err), HasSubstr("File too large"));
  EXPECT_EQ(Json::parse(test::ReadWholeFile(out))["steps"], 300);
}

TEST(ReplayCommand, ARecordingReplacesNothingButARecording) {
  const std::string run = std::string("run ") + kScene + " --steps 5 --json --record ";
  const std::string scene = TempPath("mine.yaml");
  test::WriteFile(scene, "name: mine\n");
  const Outcome refused = Adhesim(run + scene);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("exists and is not a recording; permitted: a new file"));
  EXPECT_EQ(test::ReadWholeFile(scene), "name: mine\n");

  // Nobody reads the pipe: a run that opened it like a file would wait for ever.
  const std::string pipe = TempPath("pipe");
  unlink(pipe.c_str());
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& special : {pipe, std::string("/dev/null"), ::testing::TempDir()}) {
    EXPECT_EQ(Adhesim(run + special).exit_code, 2) << special;
  }

  const std::string path = TempPath("again.mcap");
  test::WriteFile(path, "");
  EXPECT_EQ(Adhesim(run + path).exit_code, 0);
  Record(path);  // over the one before, whatever its length
  EXPECT_EQ(Adhesim(run + path).exit_code, 0);
  EXPECT_EQ(Json::parse(Adhesim("replay --verify --json " + path).out)["verified_steps"], 5);
}

}  // namespace
}  // namespace adhesim
