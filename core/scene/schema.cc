#include "core/scene/schema.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <google/protobuf/descriptor.h>

#include <nlohmann/json.hpp>
#include <set>

#include "adhesim/v1/scene.pb.h"
#include "core/scene/field_options.h"
#include "core/scene/quantity.h"
#include "core/scene/scene_comments.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;
using Json = nlohmann::ordered_json;

constexpr char kNumberPattern[] = R"([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)";

void AddRange(const v1::Range& range, Json* number) {
  if (range.has_min()) (*number)[range.above_min() ? "exclusiveMinimum" : "minimum"] = range.min();
  if (range.has_max()) (*number)["maximum"] = range.max();
}

// "18 mm": the units as alternatives of a regular expression.
std::string QuantityPattern(const Dimension& dimension) {
  const std::string units =
      absl::StrJoin(dimension.units, "|", [](std::string* out, const Unit& unit) {
        absl::StrAppend(
            out, absl::StrReplaceAll(unit.symbol, {{"^", "\\^"}, {"/", "\\/"}, {" ", "[ *]"}}));
      });
  return absl::StrCat("^", kNumberPattern, "( *(", units, "))?$");
}

Json NumberSchema(const Field* field) {
  Json number = {{"type", "number"}};
  AddRange(field->options().GetExtension(v1::range), &number);
  const Dimension* dimension = DimensionOf(field->name());
  if (dimension == nullptr) return number;
  return {{"anyOf", {number, {{"type", "string"}, {"pattern", QuantityPattern(*dimension)}}}}};
}

Json EnumSchema(const pb::EnumDescriptor* type) {
  Json names = Json::array();
  for (const std::string& name : ShortNames(type)) names.push_back(name);
  for (int i = 1; i < type->value_count(); ++i) names.push_back(type->value(i)->name());
  return {{"enum", names}};
}

// A value of the field, or an element of its list.
Json ElementSchema(const Field* field) {
  switch (field->cpp_type()) {
    case Field::CPPTYPE_MESSAGE:
      return {{"$ref", absl::StrCat("#/$defs/", field->message_type()->name())}};
    case Field::CPPTYPE_DOUBLE:
      return NumberSchema(field);
    case Field::CPPTYPE_BOOL:
      return {{"type", "boolean"}};
    case Field::CPPTYPE_ENUM:
      return EnumSchema(field->enum_type());
    case Field::CPPTYPE_STRING:
      // Plain words of YAML that look like numbers are texts here too.
      return {{"type", {"string", "number"}}};
    default: {
      Json integer = {{"type", "integer"}, {"minimum", 0}};
      AddRange(field->options().GetExtension(v1::range), &integer);
      return integer;
    }
  }
}

// The default as a JSON value: the option holds numbers and lists as JSON does, enum values by
// their full name.
Json DefaultOf(const Field* field) {
  const std::string& text = field->options().GetExtension(v1::default_value);
  if (field->cpp_type() != Field::CPPTYPE_ENUM) return Json::parse(text);
  return ShortName(field->enum_type()->FindValueByName(text));
}

class SchemaWriter {
 public:
  std::string Write() {
    Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                   {"title", "adhesim scene"}};
    const Json scene = MessageSchema(v1::Scene::descriptor());
    schema.update(scene);
    schema["$defs"] = definitions_;
    return schema.dump(2);
  }

 private:
  Json MessageSchema(const pb::Descriptor* type) {
    Json schema = {{"description", comments_.Of(type)}};
    // A message that can be empty may be written as a name with nothing after it.
    schema["type"] = HasRequiredField(type) ? Json("object") : Json({"object", "null"});
    schema["additionalProperties"] = false;
    Json properties = Json::object(), required = Json::array();
    for (int i = 0; i < type->field_count(); ++i) {
      const Field* field = type->field(i);
      properties[field->name()] = FieldSchema(field);
      if (field->options().GetExtension(v1::required)) required.push_back(field->name());
    }
    schema["properties"] = properties;
    if (!required.empty()) schema["required"] = required;
    for (int i = 0; i < type->real_oneof_decl_count(); ++i)
      schema["allOf"].push_back(Json::object({{"oneOf", OneofSchema(type->oneof_decl(i))}}));
    return schema;
  }

  static Json OneofSchema(const pb::OneofDescriptor* oneof) {
    Json members = Json::array();
    for (const std::string& name : MemberNames(oneof)) members.push_back({{"required", {name}}});
    return members;
  }

  Json FieldSchema(const Field* field) {
    if (field->cpp_type() == Field::CPPTYPE_MESSAGE) Define(field->message_type());
    Json element = ElementSchema(field);
    if (field->is_repeated()) {
      element = {{"type", "array"}, {"items", element}};
      if (const auto size = field->options().GetExtension(v1::size); size > 0) {
        element["minItems"] = size;
        element["maxItems"] = size;
      }
    }
    Json schema = {{"description", Description(field)}};
    schema.update(element);
    if (!field->options().GetExtension(v1::default_value).empty())
      schema["default"] = DefaultOf(field);
    return schema;
  }

  std::string Description(const Field* field) const {
    std::string text = comments_.Of(field);
    if (field->cpp_type() == Field::CPPTYPE_ENUM) {
      for (int i = 1; i < field->enum_type()->value_count(); ++i) {
        const pb::EnumValueDescriptor* value = field->enum_type()->value(i);
        absl::StrAppend(&text, " ", ShortName(value), ": ", comments_.Of(value));
      }
    }
    if (const Dimension* dimension = DimensionOf(field->name()); dimension != nullptr) {
      absl::StrAppend(&text, " Unit: ", dimension->units[0].symbol, ", or as text with one of ",
                      UnitList(*dimension), ".");
    }
    return text;
  }

  void Define(const pb::Descriptor* type) {
    if (!defined_.insert(type->name()).second) return;
    const Json schema = MessageSchema(type);
    definitions_[type->name()] = schema;
  }

  SceneComments comments_;
  std::set<std::string> defined_;
  Json definitions_ = Json::object();
};

}  // namespace

std::string SceneJsonSchema() { return SchemaWriter().Write(); }

}  // namespace adhesim
