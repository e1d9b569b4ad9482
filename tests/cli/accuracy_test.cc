#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/command_test.h"

namespace adhesim {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

constexpr char kScene[] =
    "# A small block that sinks under its weight.\n"
    "rate_hz: 100  # of the author\n"
    "integration: {max_substeps: 1}\n"
    "bodies:\n"
    "  - name: block\n"
    "    block: {size_m: [0.1, 0.1, 0.1]}\n"
    "    tetrahedra: {cells: 2}\n"
    "    density_kg_m3: 1000\n"
    "    fixed: [half_space: {point_m: [0, 0, -0.0499], normal: [0, 0, 1]}]\n"
    "effects:\n"
    "  - elasticity: {young_modulus_pa: 1e5}\n"
    "  - uniform_gravity: {}\n"
    "  - drag: {rate_per_s: 20}\n";

class AccuracyCommand : public test::CommandTest {
 protected:
  AccuracyCommand() : CommandTest("accuracy") {}
  void SetUp() override {
    CommandTest::SetUp();
    std::ofstream(File("block.yaml")) << kScene;
  }
  const std::string quick_ = " --quick --repeats 1 --seconds 0.4";
};

TEST_F(AccuracyCommand, WritesNumbersAndAPageThatStandsAlone) {
  ASSERT_EQ(Run(File("block.yaml") + quick_ + " --json - --html " + File("new/folder/page.html")),
            0)
      << Read("err");
  const Json report = Json::parse(Read("out"));
  for (const char* field :
       {"scene", "seconds", "instants", "reference", "second_reference", "references_share", "band",
        "chaotic", "dials", "points", "orders", "recommendation", "left_out", "machine"}) {
    EXPECT_TRUE(report.contains(field)) << field;
  }
  const Json& first = report["points"][0];
  EXPECT_EQ(first["settings"].size(), 0u);  // the scene as it is
  EXPECT_GT(first["cost"]["wall_s_per_s"]["min"], 0);
  EXPECT_GT(first["error"]["position_m"]["l2"], 0);
  EXPECT_GE(first["error"]["position_m"]["linf"], first["error"]["position_m"]["l2"]);
  int failed = 0, rivals = 0;
  for (const Json& point : report["points"]) {
    rivals += point["kind"] == "rival" && point.contains("error");
    if (!point["failed"] || point["kind"] == "rival") continue;
    ++failed;
    EXPECT_THAT(point["reason"].get<std::string>(), HasSubstr("sub-steps"));
  }
  EXPECT_EQ(failed, 1);
  EXPECT_GE(rivals, 3);
  EXPECT_THAT(report["rival"].get<std::string>(), HasSubstr("Bullet"));

  const std::string page = Read("new/folder/page.html");
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("class=\"fails\">failed"));
  EXPECT_THAT(page, HasSubstr("Recommendation"));
  EXPECT_THAT(page, HasSubstr("Another engine on the same mesh"));
  EXPECT_THAT(page, HasSubstr("difference of the two references"));
  for (const char* outside : {"http:", "https:", "<script", "<link", "@import", "src="}) {
    EXPECT_THAT(page, Not(HasSubstr(outside)));
  }
}

TEST_F(AccuracyCommand, AppliesWhatItRecommendsAndKeepsTheRest) {
  // Wide enough for any rate: the cheapest is another than the scene's own, or nothing is to do.
  ASSERT_EQ(Run(File("block.yaml") + quick_ + " --tolerance-mm 1000 --apply"), 0) << Read("err");
  const std::string text = Read("block.yaml");
  EXPECT_THAT(text, HasSubstr("# A small block that sinks under its weight.\n"));
  EXPECT_THAT(text, HasSubstr("  # of the author\n"));
  EXPECT_THAT(text, HasSubstr("bodies:\n  - name: block\n"));
  // With what giving up fidelity costs at that setting; the scene has no tool to feel a force.
  EXPECT_THAT(text, ContainsRegex("rungs:  # measured by adhesim accuracy --apply: 0.4 s at .* Hz\n"
                                  "  iterations: .position_error: [^,]*.\n"));
  const std::string run = std::string(ADHESIM_PROGRAM) + " run " + File("block.yaml") +
                          " --steps 1 >" + File("out") + " 2>" + File("err");
  EXPECT_EQ(std::system(run.c_str()), 0) << Read("err");
}

TEST_F(AccuracyCommand, WritesWhatRungsCostAtTheScenesOwnSetting) {
  const std::string command = File("block.yaml") + " --seconds 0.4 --apply-rungs";
  ASSERT_EQ(Run(command), 0) << Read("err");
  std::string text = Read("block.yaml");
  const std::size_t rungs = text.find("rungs:"), bodies = text.find("bodies:");
  ASSERT_LT(rungs, bodies);
  EXPECT_THAT(text.substr(rungs, bodies - rungs),
              ContainsRegex("^rungs:  # measured by adhesim accuracy --apply-rungs: 0.4 s at 100 "
                            "Hz\n  iterations: [^\n]*\n  stiffness: [^\n]*\n$"));
  EXPECT_EQ(text.erase(rungs, bodies - rungs), kScene);
  // The same bits, and nothing to write.
  ASSERT_EQ(Run(command), 0) << Read("err");
  EXPECT_THAT(Read("err"), HasSubstr("already"));
  EXPECT_EQ(Run(command + " --json -"), 2);
}

TEST_F(AccuracyCommand, ChangesNothingWhenNoSettingIsWithinTheTolerance) {
  EXPECT_EQ(Run(File("block.yaml") + quick_ + " --tolerance-mm 1e-9 --apply"), 1);
  EXPECT_THAT(Read("err"), HasSubstr("no setting is within the tolerance"));
  EXPECT_EQ(Read("block.yaml"), kScene);
}

TEST_F(AccuracyCommand, RefusesBadInputAndTellsWhenTheTimeIsTooShort) {
  EXPECT_EQ(Run(File("none.yaml")), 2);
  EXPECT_EQ(Run(File("block.yaml") + " --repeats 0"), 2);
  EXPECT_EQ(Run(File("block.yaml") + " --apply --set rate_hz=50"), 2);
  EXPECT_EQ(Run(File("block.yaml") + quick_ + " --html " + File("block.yaml") + "/page.html"), 2);
  EXPECT_THAT(Read("err"), HasSubstr("cannot write " + File("block.yaml") + "/page.html"));
  EXPECT_THAT(Read("err"), Not(HasSubstr("...")));  // before the study, not after it
  // Hours of simulated time do not fit into a tenth of a second.
  EXPECT_EQ(Run(File("block.yaml") + " --seconds 10000 --budget-s 0.1"), 1);
  EXPECT_THAT(Read("err"), HasSubstr("budget"));
}

}  // namespace
}  // namespace adhesim
