#include "core/study/accuracy_apply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "core/study/accuracy_rungs.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

using ::testing::HasSubstr;

AccuracyRung Rung(const std::string& name, std::optional<double> force,
                  std::optional<double> position) {
  AccuracyRung rung;
  rung.name = name;
  rung.force = force;
  rung.position = position;
  return rung;
}

TEST(AccuracyRungs, AreWrittenAsNoLessThanWasMeasured) {
  const auto message = RungsMessage(
      std::vector{Rung("iterations", 0.02101, 3.31e-7), Rung("stiffness", 0.99, 0)}, true);
  ASSERT_TRUE(message.ok()) << message.status();
  EXPECT_EQ(message->iterations().force_error(), 0.022);
  EXPECT_EQ(message->iterations().position_error(), 3.4e-7);
  EXPECT_FALSE(message->has_detection());
  EXPECT_EQ(message->stiffness().force_error(), 0.99);
  EXPECT_EQ(message->stiffness().position_error(), 0);
  const auto without_tools = RungsMessage(std::vector{Rung("iterations", {}, 0.01)}, false);
  ASSERT_TRUE(without_tools.ok());
  EXPECT_FALSE(without_tools->iterations().has_force_error());
  const auto why = [](const AccuracyRung& rung) {
    return std::string(RungsMessage(std::vector{rung}, true).status().message());
  };
  EXPECT_THAT(why(Rung("iterations", 0.01, {})), HasSubstr("was not measured"));
  EXPECT_THAT(why(Rung("iterations", {}, 0.01)), HasSubstr("no tool feels a force"));
  EXPECT_THAT(why(Rung("iterations", 1.2, 0.01)), HasSubstr("by more than the peak force"));
  EXPECT_THAT(why(Rung("iterations", 0.1, 1.01)), HasSubstr("by more than the size of a body"));
}

TEST(AccuracyApply, ChangesTheNumbersAndNothingElse) {
  const SceneFile file = SceneFileOf(BeamScene());
  const auto text = TextWithEdits(
      file,
      {{"rate_hz", "50"}, {"integration.tolerance", "0.01"}, {"integration.max_substeps", "9"}});
  ASSERT_TRUE(text.ok()) << text.status();
  std::string expected = BeamScene();
  expected.replace(expected.find("400  # kept"), 3, "50");
  expected.replace(expected.find("max_substeps: 1"), 15, "max_substeps: 9");
  expected.replace(expected.find("1e-8"), 4, "0.01");
  EXPECT_EQ(*text, expected);
}

TEST(AccuracyApply, AddsWhatTheFileDoesNotHaveInFrontOfTheBodies) {
  std::string yaml = BeamScene();
  yaml.erase(0, yaml.find("bodies:"));
  const auto text = TextWithEdits(
      SceneFileOf(yaml),
      {{"rate_hz", "50"}, {"integration.integrator", "newton"}, {"integration.tolerance", "0.01"}});
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_EQ(*text, "rate_hz: 50\nintegration: {tolerance: 0.01, integrator: newton}\n" + yaml);
  const auto block = TextWithEdits(SceneFileOf("integration:\n  max_substeps: 9  # many\n" + yaml),
                                   {{"integration.tolerance", "0.01"}});
  ASSERT_TRUE(block.ok()) << block.status();
  EXPECT_EQ(*block, "integration:\n  tolerance: 0.01\n  max_substeps: 9  # many\n" + yaml);
}

RungsEntry TwoRungs(double force, double position) {
  RungsEntry entry;
  entry.comment = "of a test";
  entry.rungs.mutable_iterations()->set_position_error(position);
  entry.rungs.mutable_stiffness()->set_force_error(force);
  entry.rungs.mutable_stiffness()->set_position_error(2 * position);
  return entry;
}

// Written in front of the bodies, renewed where they stand, and taken out with the setting that
// they were measured at.
TEST(AccuracyApply, WritesWhatRungsCostBesideTheirSetting) {
  const std::string yaml = BeamScene();
  const std::string entry =
      "rungs:  # of a test\n"
      "  iterations: {position_error: 0.001}\n"
      "  stiffness: {force_error: 0.02, position_error: 0.002}\n";
  const auto text = TextWithEdits(SceneFileOf(yaml), {}, TwoRungs(0.02, 1e-3));
  ASSERT_TRUE(text.ok()) << text.status();
  const std::size_t bodies = yaml.find("bodies:");
  EXPECT_EQ(*text, yaml.substr(0, bodies) + entry + yaml.substr(bodies));
  const SceneFile written = SceneFileOf(*text);
  EXPECT_EQ(written.scene.rungs().stiffness().force_error(), 0.02);
  EXPECT_FALSE(written.scene.rungs().iterations().has_force_error());

  std::string renewed = entry;
  renewed.replace(renewed.find("0.02"), 4, "0.04");
  std::string last = yaml + "# the last\n" + entry;
  const auto again = TextWithEdits(SceneFileOf(last), {}, TwoRungs(0.04, 1e-3));
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(*again, yaml + "# the last\n" + renewed);

  const auto without = TextWithEdits(written, {{"rate_hz", "50"}});
  ASSERT_TRUE(without.ok()) << without.status();
  std::string expected = yaml;
  expected.replace(expected.find("400  # kept"), 3, "50");
  EXPECT_EQ(*without, expected);
  EXPECT_EQ(*TextWithEdits(written, {}), yaml);
}

TEST(AccuracyApply, RefusesWhatItCannotWriteSafely) {
  EXPECT_FALSE(TextWithEdits(SceneFileOf(BeamScene()), {{"rate_hz", "-1"}}).ok());
  EXPECT_FALSE(
      TextWithEdits(SceneFileOf(BeamScene()), {{"bodies[0].tetrahedra.cells", "16"}}).ok());
  const std::string json =
      "{\"bodies\": [{\"name\": \"a\", \"icosphere\": {\"radius_m\": 1}, \"mass_kg\": 1}]}";
  EXPECT_FALSE(TextWithEdits(SceneFileOf(json), {{"rate_hz", "50"}}).ok());
  EXPECT_FALSE(TextWithEdits(SceneFileOf(json), {}, TwoRungs(0.02, 1e-3)).ok());
}

}  // namespace
}  // namespace adhesim::test
