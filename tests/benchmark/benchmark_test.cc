#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace adhesim::test {
namespace {

int Bench(const std::string& arguments) {
  const std::string command = std::string(ADHESIM_BENCH) +
                              " --scenes " ADHESIM_SOURCE_DIR "/scenes " + arguments +
                              " > /dev/null";
  return WEXITSTATUS(std::system(command.c_str()));
}

// What it measures is the machine's; that it measures both on every scene is checked.
TEST(Benchmark, RunsBothEnginesAndWritesEveryFigure) {
  const std::string file = testing::TempDir() + "adhesim_bench.json";
  ASSERT_EQ(Bench("two_cells_sticky cell_aggregation --seconds 0.04 --repeats 2 --json " + file),
            0);
  const nlohmann::json report = nlohmann::json::parse(std::ifstream(file));
  EXPECT_TRUE(report.contains("load_before"));
  EXPECT_TRUE(report.contains("simd"));
  ASSERT_EQ(report.at("scenes").size(), 2u);
  for (const auto& scene : report.at("scenes")) {
    EXPECT_EQ(scene.at("repeats"), 2);
    EXPECT_EQ(scene.at("steps"), 40);
    EXPECT_GT(scene.at("cpu_ms_per_step").at("median"), 0.0);
    EXPECT_GT(scene.at("bullet").at("cpu_ms_per_step").at("median"), 0.0);
    EXPECT_TRUE(scene.at("bullet").at("finite"));
    EXPECT_LE(scene.at("ratio").at("min"), scene.at("ratio").at("max"));
    EXPECT_TRUE(scene.at("colliding_share").contains("mean"));
    EXPECT_FALSE(scene.at("stages").empty());
  }
  std::remove(file.c_str());
}

// Counting instructions takes a minute, and valgrind; every effect of the build has its lines.
TEST(Benchmark, TellsWhatEveryEffectAdds) {
  const std::string file = testing::TempDir() + "adhesim_bench_effects.json";
  ASSERT_EQ(Bench("effects --no-instructions --steps 2 --repeats 1 --json " + file), 0);
  const nlohmann::json report = nlohmann::json::parse(std::ifstream(file));
  EXPECT_GE(report.at("effects").size(), 12u);
  for (const auto& row : report.at("effects")) {
    EXPECT_GT(row.at("with").at("cpu_us_per_step"), 0.0) << row;
    EXPECT_GE(row.at("with").at("bytes"), row.at("without").at("bytes")) << row;
  }
  std::remove(file.c_str());
}

TEST(Benchmark, RefusesWhatItCannotRun) {
  EXPECT_EQ(Bench("no_such_scene 2> /dev/null"), 2);
  EXPECT_EQ(Bench("--repeats 0 2> /dev/null"), 2);
}

}  // namespace
}  // namespace adhesim::test
