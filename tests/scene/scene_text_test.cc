#include "core/scene/scene_text.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <string>

#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "tests/scene/sample_scene.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

v1::Scene Sample() { return ParseScene(SampleScene(), "sample.yaml", "").scene; }

void ExpectReadsBack(const v1::Scene& scene) {
  const std::string text = SceneToYaml(scene);
  const SceneFile file = ParseScene(text, "shown.yaml", "");
  ASSERT_TRUE(file.ok()) << file.Format(file.problems) << text;
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(scene, file.scene)) << text;
}

TEST(SceneToYaml, ReadsBackEqual) {
  ExpectReadsBack(Sample());
  ExpectReadsBack(WithDefaults(Sample()));
}

TEST(SceneToYaml, QuotesTextsThatYamlWouldTakeForSomethingElse) {
  for (const char* name : {"no",   "null", "1",    "- a",    "a: b", " a",   "a ", "\"", "\\",
                           "a\nb", "#",    "\x01", "\u00e9", "~",    "a #b", "[",  "*a", "&a",
                           "!a",   "%",    "yes",  "True",   "0x10", "\ta",  "a\r"}) {
    v1::Scene scene = Sample();
    scene.set_name(name);
    ExpectReadsBack(scene);
  }
}

TEST(SetField, SetsWhatAFileCouldSay) {
  v1::Scene scene = Sample();
  EXPECT_TRUE(SetField(&scene, "effects[5].drag.rate_per_s", "0.25").ok());
  EXPECT_EQ(scene.effects(5).drag().rate_per_s(), 0.25);
  EXPECT_TRUE(SetField(&scene, "bodies[0].icosphere.radius_m", "20 mm").ok());
  EXPECT_EQ(scene.bodies(0).icosphere().radius_m(), 0.02);
  EXPECT_TRUE(SetField(&scene, "bodies[0].position_m", "[1, 2, 3 mm]").ok());
  EXPECT_EQ(scene.bodies(0).position_m(2), 0.003);
  EXPECT_TRUE(SetField(&scene, "bodies[0].position_m[1]", "5").ok());
  EXPECT_EQ(scene.bodies(0).position_m(1), 5);
  EXPECT_EQ(scene.bodies(0).position_m_size(), 3);
  EXPECT_TRUE(SetField(&scene, "bodies[1].kind", "deformable").ok());
  EXPECT_EQ(scene.bodies(1).kind(), v1::BODY_KIND_DEFORMABLE);
  EXPECT_TRUE(SetField(&scene, "integration", "{max_substeps: 3}").ok());
  EXPECT_EQ(scene.integration().max_substeps(), 3u);
  EXPECT_TRUE(SetField(&scene, "rate_hz", "500").ok());
  EXPECT_EQ(scene.rate_hz(), 500);
}

TEST(SetField, RefusesWithAReasonAndLeavesTheSceneAlone) {
  const v1::Scene before = Sample();
  const auto error = [&](const std::string& path, const std::string& value) {
    v1::Scene scene = before;
    const absl::Status status = SetField(&scene, path, value);
    EXPECT_FALSE(status.ok()) << path;
    EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(before, scene)) << path;
    return std::string(status.message());
  };
  EXPECT_THAT(error("rate", "1"),
              HasSubstr("unknown field 'rate' in Scene (did you mean 'rate_hz'?)"));
  EXPECT_THAT(error("effects[9].drag.rate_per_s", "1"),
              HasSubstr("there is no 'effects[9]': effects has 7 elements"));
  EXPECT_THAT(error("effects[0].drag.rate_per_s", "1"),
              HasSubstr("the scene has shape_memory there, not drag"));
  EXPECT_THAT(error("effects.drag", "1"),
              HasSubstr("effects is a list: choose an element, as in effects[0]"));
  EXPECT_THAT(error("rate_hz.x", "1"), HasSubstr("rate_hz is a value without fields"));
  EXPECT_THAT(error("rate_hz", "fast"), StartsWith("rate_hz: expected a finite decimal number"));
  EXPECT_THAT(error("rate_hz", "-1"), StartsWith("rate_hz: is -1; permitted: at least 1"));
  EXPECT_THAT(error("rate_hz", "["), HasSubstr("not valid YAML"));
  EXPECT_THAT(error("bodies[0].position_m[3]", "1"), HasSubstr("has 3 elements"));
  EXPECT_THAT(error("bodies[0].position_m[1]", "1 kg"), HasSubstr("is not a unit of a length"));
  EXPECT_THAT(error("bodies[0].position_m", "[1]"), HasSubstr("has 1 elements; permitted: 3"));
  for (const char* path : {"", ".", "..", "[0]", "bodies[", "bodies[]", "bodies[0", "bodies[-1]",
                           "bodies[0].", "a]"}) {
    error(path, "1");
  }
  error("rate_hz", "");
}

}  // namespace
}  // namespace adhesim
