#include "core/scene/scene_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/scene/validate.h"
#include "tests/scene/sample_scene.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;

SceneFile Parse(const std::string& text) { return ParseScene(text, "s.yaml", ""); }

std::string Errors(const std::string& text) {
  const SceneFile file = Parse(text);
  for (const Problem& problem : file.problems) {
    EXPECT_GE(problem.line, 1) << problem.message;
    EXPECT_GE(problem.column, 1) << problem.message;
  }
  return file.Format(file.problems);
}

// A scene that is right, with room for more lines at the end.
std::string WithBody(const std::string& more) {
  return "bodies:\n  - name: a\n    icosphere: {radius_m: 1}\n    mass_kg: 1\n" + more;
}

TEST(SceneFile, ReadsEveryKindOfValue) {
  const SceneFile file = Parse(SampleScene());
  ASSERT_TRUE(file.ok()) << file.Format(file.problems);
  const v1::Scene& scene = file.scene;
  EXPECT_EQ(scene.rate_hz(), 1000);
  EXPECT_EQ(scene.seed(), 7u);
  EXPECT_EQ(scene.bodies(0).icosphere().radius_m(), 0.018);
  EXPECT_EQ(scene.bodies(0).velocity_m_s(0), 0.01);
  EXPECT_EQ(scene.bodies(1).icosphere().radius_m(), 0.018);
  EXPECT_EQ(scene.bodies(1).kind(), v1::BODY_KIND_RIGID);
  EXPECT_EQ(scene.bodies(2).kind(), v1::BODY_KIND_DEFORMABLE);
  EXPECT_TRUE(scene.bodies(2).fixed(0).border());
  EXPECT_EQ(scene.tools(0).trajectory(1).t_s(), 0.5);
  EXPECT_TRUE(scene.effects(2).has_volume_preservation());
  EXPECT_EQ(scene.effects(0).shape_memory().form(), v1::SHAPE_MEMORY_FORM_CENTRE);
}

TEST(SceneFile, ReadsJson) {
  const SceneFile file =
      Parse(R"({"bodies": [{"name": "a", "mass_kg": 1, "icosphere": {"radius_m": "18 mm"}}]})");
  ASSERT_TRUE(file.ok()) << file.Format(file.problems);
  EXPECT_EQ(file.scene.bodies(0).icosphere().radius_m(), 0.018);
}

TEST(SceneFile, TakesItsNameFromTheFile) {
  EXPECT_EQ(ParseScene(WithBody(""), "dir/two_cells.yaml", "dir").scene.name(), "two_cells");
}

TEST(SceneFile, ReportsEveryMistakeWithItsPlace) {
  const std::string text = R"(rate_hz: fast
bodies:
  - name: a
    icospher: {radius_m: 1}
    mass: 3
  - name: a
    icosphere: {radius_m: 1 kg, subdivisions: 9}
    mass_kg: -1
    position_m: [0, 0]
    kind: rigit
effects:
  - drag: {bodies: [b], rate_per_s: .nan}
)";
  const SceneFile file = Parse(text);
  const std::string errors = file.Format(file.problems);
  EXPECT_THAT(errors,
              HasSubstr("s.yaml:1:10: error: rate_hz: expected a finite decimal number in Hz"));
  EXPECT_THAT(
      errors,
      HasSubstr("s.yaml:4:5: error: bodies[0].icospher: unknown field 'icospher' in Body (did you "
                "mean 'icosphere'?); permitted: name, icosphere, sheet"));
  EXPECT_THAT(
      errors,
      HasSubstr("s.yaml:5:5: error: bodies[0].mass: unknown field 'mass' in Body (did you mean "
                "'mass_kg'?)"));
  EXPECT_THAT(
      errors,
      HasSubstr("s.yaml:6:11: error: bodies[1].name: 'a' is already the name of bodies[0]"));
  EXPECT_THAT(
      errors,
      HasSubstr(
          "s.yaml:7:27: error: bodies[1].icosphere.radius_m: 'kg' is not a unit of a length"));
  EXPECT_THAT(
      errors,
      HasSubstr(
          "s.yaml:7:47: error: bodies[1].icosphere.subdivisions: is 9; permitted: at least 0, "
          "at most 6"));
  EXPECT_THAT(
      errors,
      HasSubstr(
          "s.yaml:8:14: error: bodies[1].mass_kg: is -1; permitted: above 0, at most 1000000"));
  EXPECT_THAT(errors,
              HasSubstr("s.yaml:9:5: error: bodies[1].position_m: has 2 elements; permitted: 3"));
  EXPECT_THAT(
      errors,
      HasSubstr("s.yaml:10:11: error: bodies[1].kind: unknown value 'rigit' (did you mean 'rigid'?)"
                "; permitted: deformable, rigid"));
  EXPECT_THAT(
      errors,
      HasSubstr("s.yaml:12:21: error: effects[0].drag.bodies[0]: there is no body named 'b'"));
  EXPECT_THAT(
      errors,
      HasSubstr(
          "s.yaml:12:37: error: effects[0].drag.rate_per_s: expected a finite decimal number"));
  // One problem a mistake: a misspelt field is not reported as missing as well.
  EXPECT_EQ(file.problems.size(), 11u) << errors;
}

TEST(SceneFile, ReportsErrorsOfRungsThatNobodyMeasured) {
  const auto errors = [](const std::string& rungs) {
    const SceneFile file =
        Parse("bodies: [{name: a, icosphere: {radius_m: 1}, mass_kg: 1}]\n" + ("rungs:\n" + rungs));
    return file.Format(file.problems);
  };
  EXPECT_EQ(errors("  detection: {position_error: 1}\n"), "");
  EXPECT_THAT(errors("  iterations: {position_error: -0.1}\n"),
              HasSubstr("s.yaml:3:32: error: rungs.iterations.position_error: is -0.1; permitted: "
                        "at least 0, at most 1"));
  EXPECT_THAT(errors("  iterations: {position_error: 1.1}\n"), HasSubstr("is 1.1; permitted"));
  EXPECT_THAT(errors("  iterations: {position_error: 0, force_error: 1.1}\n"),
              HasSubstr("s.yaml:3:48: error: rungs.iterations.force_error: is 1.1; permitted"));
  EXPECT_THAT(errors("  iterations: {position_error: .nan}\n"),
              HasSubstr("s.yaml:3:32: error: rungs.iterations.position_error: expected a finite"));
  EXPECT_THAT(errors("  iterations: {force_error: 0.1}\n"),
              HasSubstr("s.yaml:3:15: error: rungs.iterations.position_error: required"));
  EXPECT_THAT(errors("  stifness: {position_error: 0.1}\n"),
              HasSubstr("s.yaml:3:3: error: rungs.stifness: unknown field 'stifness' in Rungs (did "
                        "you mean 'stiffness'?)"));
  const std::string rung = "  iterations: {position_error: 0.1}\n";
  EXPECT_THAT(errors(rung + rung), HasSubstr("s.yaml:4:3: error: rungs.iterations: "));
}

TEST(SceneFile, ShowsTheLineWithACaret) {
  EXPECT_THAT(Errors(WithBody("    kind: rigit\n")), HasSubstr("    5 |     kind: rigit\n"
                                                               "      |           ^~~~~\n"));
}

TEST(SceneFile, RefusesRepeatedKeys) {
  EXPECT_THAT(
      Errors(WithBody("    mass_kg: 2\n")),
      HasSubstr(
          "s.yaml:5:5: error: bodies[0].mass_kg: 'mass_kg' is written twice; first on line 4"));
}

TEST(SceneFile, RefusesTwoMembersOfAOneof) {
  EXPECT_THAT(Errors(WithBody("    organ: {}\n")),
              HasSubstr("s.yaml:5:5: error: bodies[0].organ: only one of"));
}

TEST(SceneFile, RefusesNoMemberOfAOneof) {
  EXPECT_THAT(
      Errors("bodies:\n  - name: a\n    mass_kg: 1\n"),
      HasSubstr("s.yaml:2:5: error: bodies[0].shape: Body needs one of icosphere, sheet, block"));
}

TEST(SceneFile, PointsToTheBodyThatLacksAField) {
  EXPECT_THAT(Errors("bodies:\n  - name: a\n    icosphere: {}\n    mass_kg: 1\n"),
              HasSubstr("bodies[0].icosphere.radius_m: required, but missing; permitted: above 0"));
}

TEST(SceneFile, NeedsAMassOrADensity) {
  EXPECT_THAT(Errors("bodies:\n  - name: a\n    icosphere: {radius_m: 1}\n"),
              HasSubstr("s.yaml:2:5: error: bodies[0].mass: Body needs one of mass_kg, "
                        "density_kg_m3"));
}

TEST(SceneFile, RefusesWrongTypes) {
  EXPECT_THAT(Errors("bodies: 3\n"), HasSubstr("s.yaml:1:9: error: bodies: expected a list"));
  EXPECT_THAT(Errors(WithBody("    position_m: 3\n")),
              HasSubstr("5:17: error: bodies[0].position_m: expected a list of 3"));
  EXPECT_THAT(Errors(WithBody("    position_m: []\n")),
              HasSubstr("5:5: error: bodies[0].position_m: expected a list of 3"));
  EXPECT_THAT(Errors(WithBody("    position_m: [1, true, 0]\n")),
              HasSubstr("5:21: error: bodies[0].position_m[1]: exp"));
  EXPECT_THAT(Errors(WithBody("    kind: {a: b}\n")),
              HasSubstr("5:5: error: bodies[0].kind: expected one of"));
  EXPECT_THAT(
      Errors(WithBody("    kind:\n")),
      HasSubstr("5:5: error: bodies[0].kind: expected one of deformable, rigid, got nothing"));
  EXPECT_THAT(Errors(WithBody("    fixed: [{border: yes}]\n")),
              HasSubstr("5:22: error: bodies[0].fixed[0].border: expected true or false"));
  EXPECT_THAT(Errors(WithBody("integration: 4\n")),
              HasSubstr("5:14: error: integration: expected a mapping (fields: stab"));
  EXPECT_THAT(Errors(WithBody("seed: 1.5\n")),
              HasSubstr("5:7: error: seed: expected a whole number, got '1.5'"));
  EXPECT_THAT(Errors(WithBody("seed: -1\n")), HasSubstr("5:7: error: seed: '-1' is out of range"));
  EXPECT_THAT(Errors(WithBody("? [a, b]\n: c\n")),
              HasSubstr("error: expected the name of a field of Scene"));
}

TEST(SceneFile, RefusesWhatIsNoScene) {
  EXPECT_THAT(Errors(""), HasSubstr("s.yaml:1:1: error: the file is empty"));
  EXPECT_THAT(Errors("# only a comment\n"), HasSubstr("the file is empty"));
  EXPECT_THAT(Errors("---\n"), HasSubstr("the file is empty"));
  EXPECT_THAT(Errors("- a\n- b\n"), HasSubstr("s.yaml:1:1: error: expected a mapping"));
  EXPECT_THAT(Errors("hello"), HasSubstr("s.yaml:1:1: error: expected a mapping"));
  EXPECT_THAT(Errors("{}"), HasSubstr("error: bodies: the scene has no body"));
}

TEST(SceneFile, ReportsASyntaxErrorAlone) {
  const SceneFile file = Parse("rate_hz: fast\nbodies: [\n");
  EXPECT_EQ(file.problems.size(), 1u);
  EXPECT_THAT(file.Format(file.problems), HasSubstr("error: not valid YAML: "));
  EXPECT_THAT(Errors("bodies:\n\t- name: a\n"),
              HasSubstr("s.yaml:2:2: error: not valid YAML: indent with spaces"));
}

TEST(SceneFile, RefusesSeveralDocuments) {
  EXPECT_THAT(Errors(WithBody("---\nname: b\n")),
              HasSubstr("s.yaml:6:1: error: a second document"));
}

TEST(SceneFile, RefusesBinaryAndWronglyEncodedText) {
  EXPECT_THAT(Errors(std::string("name: a\nb\0c", 11)),
              HasSubstr("s.yaml:2:2: error: byte 0x00 is a control character"));
  EXPECT_THAT(Errors("name: \xff\xfe"),
              HasSubstr("s.yaml:1:7: error: byte 0xff is not valid UTF-8"));
  EXPECT_THAT(Errors("name: \xc0\x80"), HasSubstr("not valid UTF-8"));
  EXPECT_THAT(Errors("name: \xed\xa0\x80"), HasSubstr("not valid UTF-8"));  // a surrogate
  EXPECT_THAT(Errors(std::string((std::size_t{4} << 20) + 1, ' ')),
              HasSubstr("permitted: at most 4194304"));
}

TEST(SceneFile, FollowsAliasesButRefusesBombs) {
  const SceneFile file = Parse(
      "bodies:\n  - &a {name: x, mass_kg: &m 1, icosphere: &s {radius_m: 1}}\n"
      "  - {name: y, mass_kg: *m, icosphere: *s}\n");
  ASSERT_TRUE(file.ok()) << file.Format(file.problems);
  EXPECT_EQ(file.scene.bodies(1).icosphere().radius_m(), 1);

  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string last = absl::StrCat("*a", i - 1);
    absl::StrAppend(&bomb, "a", i, ": &a", i, " [", absl::StrJoin(std::vector(10, last), ", "),
                    "]\n");
  }
  EXPECT_THAT(Errors(bomb), HasSubstr("error: more than 1000000 values"));
  EXPECT_THAT(Errors("a: &a [*a]\n"),
              HasSubstr("error: an alias stands for something that contains it"));
  EXPECT_THAT(Errors("a: *b\n"), HasSubstr("error: not valid YAML"));
}

TEST(SceneFile, RefusesMergeKeysTagsAndDeepNesting) {
  EXPECT_THAT(Errors("bodies:\n  - &a {name: a, mass_kg: 1, organ: {}}\n  - {<<: *a, name: b}\n"),
              HasSubstr("s.yaml:3:6: error: bodies[1].<<: merge keys (<<) are not permitted"));
  EXPECT_THAT(Errors(WithBody("name: !!str a\n")), HasSubstr("error: tags are not permitted"));
  EXPECT_THAT(Errors("a: " + std::string(100, '[') + std::string(100, ']')),
              HasSubstr("more than 64 levels"));
  EXPECT_THAT(Errors("a: " + std::string(100000, '[')), HasSubstr("error: "));
}

TEST(SceneFile, StopsAfterManyMistakes) {
  std::string text;
  for (int i = 0; i < 2000; ++i) absl::StrAppend(&text, "unknown", i, ": 1\n");
  const SceneFile file = Parse(text);
  EXPECT_LE(file.problems.size(), 1002u);
  EXPECT_THAT(file.Format(file.problems), HasSubstr("more mistakes follow"));
}

TEST(SceneFile, FindsThePlaceOfALaterProblem) {
  const SceneFile file = Parse(SampleScene());
  const std::string text = file.Format({{"bodies[1].icosphere.radius_m", "too small"},
                                        {"bodies[2].mesh.file", "no such file"},
                                        {"effects[2].volume_preservation", "not needed", true}});
  EXPECT_THAT(text, HasSubstr("s.yaml:15:17: error: bodies[1].icosphere.radius_m: too small"));
  EXPECT_THAT(text, HasSubstr("s.yaml:19:5: error: bodies[2].mesh.file: no such file"));
  EXPECT_THAT(text, HasSubstr("s.yaml:42:5: warning: effects[2].volume_preservation: not needed"));
  EXPECT_EQ(file.LineOf("effects[2]"), 42);
}

TEST(SceneFile, SaysWhyAFileCannotBeRead) {
  const SceneFile missing = ReadSceneFile("/nonexistent/scene.yaml");
  EXPECT_THAT(missing.Format(missing.problems),
              HasSubstr("/nonexistent/scene.yaml:1:1: error: no such file"));
  const SceneFile folder = ReadSceneFile("/");
  EXPECT_THAT(folder.Format(folder.problems), HasSubstr("not a regular file"));
  const SceneFile device = ReadSceneFile("/dev/zero");
  EXPECT_THAT(device.Format(device.problems), HasSubstr("not a regular file"));
}

TEST(SceneFile, RemembersTheFolderOfItsMeshes) {
  const std::string path = ::testing::TempDir() + "scene_file_test.yaml";
  std::ofstream(path) << SampleScene();
  const SceneFile file = ReadSceneFile(path);
  EXPECT_TRUE(file.ok()) << file.Format(file.problems);
  EXPECT_EQ(std::filesystem::path(file.directory) / "scene_file_test.yaml",
            std::filesystem::path(path));
}

}  // namespace
}  // namespace adhesim
