#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/command_test.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

class StressCommand : public test::CommandTest {
 protected:
  StressCommand() : CommandTest("stress") {}
  const std::string scenes_ = " --scenes " ADHESIM_SOURCE_DIR "/scenes/stress";
};

TEST_F(StressCommand, WritesNumbersAndAPageThatStandsAlone) {
  ASSERT_EQ(Run("inverted flat_tet --json - --html " + File("page.html") + scenes_), 0)
      << Read("err");
  const Json report = Json::parse(Read("out"));
  EXPECT_EQ(report["counts"]["survived"], 1);
  EXPECT_EQ(report["counts"]["refused"], 1);
  ASSERT_EQ(report["cells"].size(), 2u);
  EXPECT_EQ(report["cells"][0]["case"], "inverted");
  EXPECT_GT(report["cells"][0]["figures"]["steps"], 0);
  // Bullet has the one and not the other, and neither counts among ours.
  EXPECT_EQ(report["bullet"]["counts"]["Bullet"]["survived"], 1);
  EXPECT_EQ(report["bullet"]["counts"]["Bullet"]["not expressible"], 1);
  EXPECT_GT(report["bullet"]["cells"][0]["figures"]["steps"], 0);
  const std::string page = Read("page.html");
  EXPECT_THAT(page, HasSubstr("inverted"));
  EXPECT_THAT(page, HasSubstr("Beside Bullet"));
  EXPECT_EQ(page.find("src=\"http"), std::string::npos);
  EXPECT_EQ(page.find("href=\"http"), std::string::npos);
}

TEST_F(StressCommand, TakesOverTheCellsOfBothWhenItGoesOn) {
  const std::string all = "flat_tet --all --json " + File("all.json") + scenes_;
  ASSERT_EQ(Run(all), 0) << Read("err");
  const std::string first = Read("all.json");
  ASSERT_EQ(Json::parse(first)["bullet"]["cells"].size(), 2u);
  ASSERT_EQ(Run(all), 0) << Read("err");
  EXPECT_THAT(Read("err"), HasSubstr("1 cells taken over"));
  const Json second = Json::parse(Read("all.json"));
  EXPECT_EQ(second["bullet"]["cells"], Json::parse(first)["bullet"]["cells"]);
  EXPECT_EQ(second["cells"].size(), 1u);
}

// A case that is known to fail is red all the same.
TEST_F(StressCommand, EndsWithOneWhenACaseFails) { EXPECT_EQ(Run("cell_inside_out" + scenes_), 1); }

TEST_F(StressCommand, RefusesWhatIsNoCaseAndWhatIsNoNumber) {
  EXPECT_EQ(Run("no_such_case" + scenes_), 2);
  EXPECT_THAT(Read("err"), HasSubstr("no_such_case"));
  EXPECT_EQ(Run("--torture -3" + scenes_), 2);
  EXPECT_THAT(Read("err"), HasSubstr("range 1 to 1000000"));
  EXPECT_EQ(Run("flat_tet --json --all" + scenes_), 2);
  EXPECT_THAT(Read("err"), HasSubstr("'--all' is not permitted (a file's name"));
}

TEST_F(StressCommand, SaysBeforeItRunsWhatCannotBeWritten) {
  // A folder in the place of a file, and a file in the place of a folder.
  EXPECT_EQ(Run("inverted --html " + File("") + scenes_), 2);
  EXPECT_EQ(Read("err"), "error: cannot write " + File("") + "\n");
  EXPECT_EQ(Run("--torture 1 --failures " + File("out") + scenes_), 2);
  EXPECT_EQ(Read("err"), "error: cannot write " + File("out") + "/torture.yaml\n");
}

}  // namespace
}  // namespace adhesim
