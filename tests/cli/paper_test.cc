#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/command_test.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

class Paper : public test::CommandTest {
 protected:
  Paper() : CommandTest("paper") {}
  const std::string scenes_ = " --scenes " ADHESIM_SOURCE_DIR "/scenes/paper";
};

TEST_F(Paper, JudgesAFigureByItsNumbers) {
  ASSERT_EQ(Run("two_cells_sticky --quick --no-pictures --json -" + scenes_), 0) << Read("err");
  const Json report = Json::parse(Read("out"));
  EXPECT_EQ(report["holds"], true);
  EXPECT_THAT(report["no_pictures"].get<std::string>(), HasSubstr("--no-pictures"));
  for (const char* field : {"processor", "cores", "load", "build", "commit", "date"}) {
    EXPECT_TRUE(report["machine"].contains(field)) << field;
  }
  for (const char* id : {"depth", "inside", "contact_energy", "whole_energy", "ledger", "momentum",
                         "volume", "together"}) {
    bool found = false;
    for (const Json& claim : report["claims"]) {
      if (claim["id"] != id) continue;
      found = true;
      // The end of the run, which alone shows whether the cells stay together, is not there.
      EXPECT_EQ(claim["verdict"], id == std::string("together") ? "not_judged" : "holds") << claim;
      EXPECT_TRUE(claim.contains("value") && claim.contains("limit")) << claim;
    }
    EXPECT_TRUE(found) << id;
  }
  ASSERT_EQ(report["figures"].size(), 1u);
  const Json& figure = report["figures"][0];
  EXPECT_EQ(figure["particles"], figure["paper"]["particles"]);
  EXPECT_EQ(figure["triangles"], figure["paper"]["triangles"]);
  EXPECT_EQ(figure["paper"]["ms_below"], 10);
  EXPECT_GT(figure["cpu_ms_per_step"]["median"], 0);
  EXPECT_EQ(figure["samples"].size(), 41u);
  EXPECT_EQ(figure["instants"].size(), 4u);
  for (const char* field : {"time_s", "colliding_share", "energy_j", "permitted_j", "radius_m",
                            "separation_m", "max_depth_m", "volume_error"}) {
    EXPECT_TRUE(figure["samples"][5].contains(field)) << field;
  }
}

TEST_F(Paper, WritesAPageThatStandsAlone) {
  ASSERT_EQ(Run("two_cells_sticky two_cells_slippery --quick --no-pictures --html " +
                File("made/paper.html") + scenes_),
            0)
      << Read("err");
  const std::string page = Read("made/paper.html");
  for (const char* part : {"Fig. 3, top", "Fig. 3, bottom", "No pictures: ", "<svg ", "holds",
                           "not judged", "of 2006", "prefers-color-scheme"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
  for (const char* wrong : {"<script", "http:", "https:", "nan", ADHESIM_SOURCE_DIR}) {
    EXPECT_THAT(page, Not(HasSubstr(wrong)));
  }
  EXPECT_THAT(Read("out"), HasSubstr("holds "));
}

TEST_F(Paper, ComparesMethodsOfContact) {
  ASSERT_EQ(Run("rivals --no-pictures --html " + File("paper.html") + " --json " + File("json") +
                scenes_),
            0)
      << Read("err");
  const Json report = Json::parse(Read("json"));
  EXPECT_TRUE(report["figures"].empty());
  ASSERT_EQ(report["compared"].size(), 5u);
  for (const Json& method : report["compared"]) {
    ASSERT_EQ(method["runs"].size(), 3u);
    for (const Json& run : method["runs"]) {
      EXPECT_EQ(run["finite"], true);
      EXPECT_LE(run["identity_error"], 1e-9);  // the project's bound: what is added is booked
    }
  }
  // Penalty forces alone cannot hold: its cells part further than any that stick.
  const auto parted_m = [&](int method) -> double {
    return report["compared"][method]["runs"][2]["parted_to_m"];
  };
  EXPECT_EQ(report["compared"][1]["id"], "penalty");
  for (const int sticky : {0, 2, 3, 4}) EXPECT_LT(parted_m(sticky), parted_m(1) - 0.1) << sticky;
  const std::string page = Read("paper.html");
  for (const char* part : {"Compared with other methods", "virtual adhesive", "16000 Hz",
                           "attraction impulses", "id=\"rivals\""}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
}

TEST_F(Paper, ShowsWhatDoesNotHoldAndEndsWithOne) {
  // A scene whose bodies have fewer particles than the paper's.
  std::ofstream(File("two_cells_sticky.yaml"))
      << "rate_hz: 1000\nbodies:\n  - {name: a, icosphere: {radius_m: 0.6, subdivisions: 0}, "
         "mass_kg: 1}\neffects:\n  - shape_memory: {stiffness_n_m: 60}\n";
  EXPECT_EQ(Run("two_cells_sticky --no-pictures --html " + File("paper.html") + " --scenes " +
                directory_),
            1)
      << Read("err");
  EXPECT_THAT(Read("out"), HasSubstr("does not hold  particles, as in the paper"));
  EXPECT_THAT(Read("paper.html"), HasSubstr("does not hold"));
}

TEST_F(Paper, SaysThatAnAssetIsNotHere) {
  std::ofstream(File("two_cells_sticky.yaml"))
      << "bodies:\n  - {name: a, mesh: {file: 'asset:no_such.obj'}, mass_kg: 1}\n";
  EXPECT_EQ(Run("two_cells_sticky --no-pictures --scenes " + directory_), 0) << Read("err");
  EXPECT_THAT(Read("out"), HasSubstr("not run        two_cells_sticky: 'asset:no_such.obj'"));
}

TEST_F(Paper, EndsWithTwoAndOneErrorOnBadUsage) {
  const std::string absent = File("absent");
  for (const std::string& arguments :
       {" --scenes " + absent, "two_cells_stick" + scenes_, std::string("--nonsense"),
        "two_cells_sticky --no-pictures --scenes " + directory_,
        "two_cells_sticky --quick --browser " + absent + scenes_}) {
    EXPECT_EQ(Run(arguments), 2) << arguments;
    const std::string err = Read("err");
    EXPECT_THAT(err, HasSubstr("error: ")) << arguments;
    EXPECT_EQ(Read("out"), "") << arguments;
  }
  Run(" --scenes " + absent);
  EXPECT_EQ(Read("err"), "error: --scenes " + absent +
                             ": no such directory; run this at the root of the source tree, or "
                             "name the directory of the paper's scenes\n");
  Run("two_cells_stick" + scenes_);
  EXPECT_THAT(Read("err"), HasSubstr("did you mean 'two_cells_sticky'?"));
}

}  // namespace
}  // namespace adhesim
