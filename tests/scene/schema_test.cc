#include "core/scene/schema.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "adhesim/v1/scene.pb.h"

namespace adhesim {
namespace {

using Json = nlohmann::json;

// Every field of the message, and of the messages below it, is in the schema with a description.
void ExpectDescribed(const google::protobuf::Descriptor* type, const Json& schema,
                     const Json& definitions) {
  ASSERT_TRUE(schema.contains("properties")) << type->full_name();
  EXPECT_FALSE(schema["description"].get<std::string>().empty()) << type->full_name();
  for (int i = 0; i < type->field_count(); ++i) {
    const google::protobuf::FieldDescriptor* field = type->field(i);
    ASSERT_TRUE(schema["properties"].contains(field->name())) << field->full_name();
    EXPECT_FALSE(schema["properties"][field->name()]["description"].get<std::string>().empty())
        << field->full_name();
    if (field->message_type() == nullptr) continue;
    ASSERT_TRUE(definitions.contains(field->message_type()->name())) << field->full_name();
    ExpectDescribed(field->message_type(), definitions[field->message_type()->name()], definitions);
  }
}

TEST(SceneJsonSchema, DescribesEveryField) {
  const Json schema = Json::parse(SceneJsonSchema());
  EXPECT_EQ(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
  ExpectDescribed(v1::Scene::descriptor(), schema, schema["$defs"]);
}

TEST(SceneJsonSchema, StatesRangesDefaultsUnitsAndWhatIsRequired) {
  const Json schema = Json::parse(SceneJsonSchema());
  const Json body = schema["$defs"]["Body"];
  EXPECT_EQ(body["required"], Json({"name"}));
  EXPECT_EQ(body["allOf"][0]["oneOf"].size(), 7u);
  EXPECT_EQ(body["allOf"][1]["oneOf"],
            Json::parse(R"([{"required": ["mass_kg"]}, {"required": ["density_kg_m3"]}])"));
  EXPECT_EQ(body["additionalProperties"], false);
  const Json mass = body["properties"]["mass_kg"]["anyOf"];
  EXPECT_EQ(mass[0]["exclusiveMinimum"], 0);
  EXPECT_EQ(mass[0]["maximum"], 1e6);
  EXPECT_EQ(mass[1]["type"], "string");
  EXPECT_EQ(body["properties"]["position_m"]["minItems"], 3);
  EXPECT_EQ(body["properties"]["position_m"]["default"], Json({0, 0, 0}));
  EXPECT_EQ(body["properties"]["kind"]["default"], "deformable");
  EXPECT_EQ(body["properties"]["kind"]["enum"][1], "rigid");
}

}  // namespace
}  // namespace adhesim
