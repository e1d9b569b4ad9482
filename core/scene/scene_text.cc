#include "core/scene/scene_text.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <array>
#include <vector>

#include "core/scene/did_you_mean.h"
#include "core/scene/field_options.h"
#include "core/scene/message_reader.h"
#include "core/scene/quantity.h"
#include "core/scene/text_check.h"
#include "core/scene/validate.h"
#include "core/scene/yaml_tree.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

// Words that some readers of YAML take for something else than a text.
constexpr std::array<absl::string_view, 9> kReserved = {"null", "true", "false", "yes", "no",
                                                        "on",   "off",  "y",     "n"};

bool CanBePlain(const std::string& text) {
  const auto is_plain = [](char c) {
    return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '.' || c == '/' || c == ' ';
  };
  const std::string lower = absl::AsciiStrToLower(text);
  return !text.empty() && absl::ascii_isalpha(text[0]) && text.back() != ' ' &&
         std::all_of(text.begin(), text.end(), is_plain) &&
         std::find(kReserved.begin(), kReserved.end(), lower) == kReserved.end();
}

std::string TextValue(const std::string& text) {
  if (CanBePlain(text)) return text;
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      absl::StrAppend(&out, "\\", std::string(1, c));
    } else if (c == '\n') {
      out += "\\n";
    } else if (byte < 0x20 || byte == 0x7F) {
      absl::StrAppend(&out, "\\x", absl::Hex(byte, absl::kZeroPad2));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

// The value of a scalar field, or (index >= 0) an element of its list.
std::string ScalarText(const pb::Message& message, const Field* field, int index) {
  const pb::Reflection* reflection = message.GetReflection();
  const bool one = index < 0;
  switch (field->cpp_type()) {
    case Field::CPPTYPE_DOUBLE:
      return NumberText(one ? reflection->GetDouble(message, field)
                            : reflection->GetRepeatedDouble(message, field, index));
    case Field::CPPTYPE_UINT32:
      return absl::StrCat(reflection->GetUInt32(message, field));
    case Field::CPPTYPE_UINT64:
      return absl::StrCat(reflection->GetUInt64(message, field));
    case Field::CPPTYPE_BOOL:
      return reflection->GetBool(message, field) ? "true" : "false";
    case Field::CPPTYPE_ENUM: {
      const int value = reflection->GetEnumValue(message, field);
      const pb::EnumValueDescriptor* known = field->enum_type()->FindValueByNumber(value);
      return known == nullptr ? absl::StrCat(value) : ShortName(known);
    }
    case Field::CPPTYPE_STRING:
      return TextValue(one ? reflection->GetString(message, field)
                           : reflection->GetRepeatedString(message, field, index));
    default:
      return "";
  }
}

void WriteMessage(const pb::Message& message, int indent, std::string* out);

// A message after "name:" or "-": below it, indented, or as {} when it is empty.
std::string Block(const pb::Message& message, int indent) {
  std::string text;
  WriteMessage(message, indent, &text);
  return text;
}

void WriteField(const pb::Message& message, const Field* field, int indent, std::string* out) {
  const pb::Reflection* reflection = message.GetReflection();
  const std::string space(indent, ' ');
  absl::StrAppend(out, space, field->name(), ":");
  if (field->cpp_type() != Field::CPPTYPE_MESSAGE) {
    if (!field->is_repeated()) {
      absl::StrAppend(out, " ", ScalarText(message, field, -1), "\n");
      return;
    }
    std::vector<std::string> elements;
    for (int i = 0; i < reflection->FieldSize(message, field); ++i)
      elements.push_back(ScalarText(message, field, i));
    absl::StrAppend(out, " [", absl::StrJoin(elements, ", "), "]\n");
    return;
  }
  if (!field->is_repeated()) {
    const std::string block = Block(reflection->GetMessage(message, field), indent + 2);
    absl::StrAppend(out, block.empty() ? " {}\n" : "\n", block);
    return;
  }
  absl::StrAppend(out, "\n");
  for (int i = 0; i < reflection->FieldSize(message, field); ++i) {
    std::string block = Block(reflection->GetRepeatedMessage(message, field, i), indent + 4);
    if (block.empty()) block = std::string(indent + 4, ' ') + "{}\n";
    block[indent + 2] = '-';
    absl::StrAppend(out, block);
  }
}

void WriteMessage(const pb::Message& message, int indent, std::string* out) {
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const Field* field = message.GetDescriptor()->field(i);
    if (IsPresent(message, field)) WriteField(message, field, indent, out);
  }
}

// A field of a message in the scene; index >= 0: an element of its list.
struct Place {
  pb::Message* message = nullptr;
  const Field* field = nullptr;
  int index = -1;
};

// Finds the field and the index that one part of a path ("bodies[1]") names.
absl::Status ReadPart(absl::string_view part, const std::string& path, Place* place) {
  std::string name(part.substr(0, part.find('[')));
  const pb::Descriptor* type = place->message->GetDescriptor();
  place->field = type->FindFieldByName(name);
  if (place->field == nullptr) {
    const std::vector<std::string> names = FieldNames(type);
    return absl::InvalidArgumentError(absl::StrCat(path, ": unknown field ", Quoted(name), " in ",
                                                   type->name(), DidYouMean(name, names),
                                                   "; permitted: ", absl::StrJoin(names, ", ")));
  }
  place->index = -1;
  if (name.size() == part.size()) return absl::OkStatus();
  absl::string_view index = part.substr(name.size() + 1);
  const bool closed = absl::ConsumeSuffix(&index, "]");
  const int count = place->field->is_repeated()
                        ? place->message->GetReflection()->FieldSize(*place->message, place->field)
                        : 0;
  if (!closed || !absl::SimpleAtoi(index, &place->index) || place->index < 0 ||
      place->index >= count) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": there is no ", Quoted(part), ": ", name,
                                                   " has ", count, " elements"));
  }
  return absl::OkStatus();
}

// Goes down into the message that `place` names.
absl::Status Enter(const std::string& path, Place* place) {
  const pb::Reflection* reflection = place->message->GetReflection();
  const Field* field = place->field;
  if (field->cpp_type() != Field::CPPTYPE_MESSAGE || field->is_repeated() != (place->index >= 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", field->name(), " is ",
                     field->is_repeated() ? "a list: choose an element, as in " : "a value",
                     field->is_repeated() ? field->name() + "[0]" : "",
                     field->is_repeated() ? "" : " without fields"));
  }
  const pb::OneofDescriptor* oneof = field->real_containing_oneof();
  const Field* chosen =
      oneof == nullptr ? nullptr : reflection->GetOneofFieldDescriptor(*place->message, oneof);
  if (chosen != nullptr && chosen != field) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": the scene has ", chosen->name(), " there, not ", field->name()));
  }
  place->message = field->is_repeated()
                       ? reflection->MutableRepeatedMessage(place->message, field, place->index)
                       : reflection->MutableMessage(place->message, field);
  return absl::OkStatus();
}

absl::StatusOr<Place> FindPlace(pb::Message* scene, const std::string& path) {
  Place place;
  place.message = scene;
  const std::vector<std::string> parts = absl::StrSplit(path, '.');
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) {
      if (absl::Status status = Enter(path, &place); !status.ok()) return status;
    }
    if (absl::Status status = ReadPart(parts[i], path, &place); !status.ok()) return status;
  }
  return place;
}

// Writes the value where it belongs; an element of a list is read as a new last one and moved
// there.
void ReadInto(const Place& place, const YamlTree& tree, const std::string& path,
              MessageReader* reader) {
  const pb::Reflection* reflection = place.message->GetReflection();
  if (place.index < 0) {
    reflection->ClearField(place.message, place.field);
    reader->ReadField(tree.root, tree.root, path, place.field, place.message);
    return;
  }
  const int count = reflection->FieldSize(*place.message, place.field);
  reader->ReadElement(tree.root, tree.root, path, place.field, place.message);
  if (reflection->FieldSize(*place.message, place.field) == count) return;  // it could not be read
  reflection->SwapElements(place.message, place.field, place.index, count);
  reflection->RemoveLast(place.message, place.field);
}

}  // namespace

std::string SceneToYaml(const v1::Scene& scene) {
  const std::string text = Block(scene, 0);
  return text.empty() ? "{}\n" : text;
}

absl::Status SetField(v1::Scene* scene, const std::string& path, const std::string& value) {
  v1::Scene changed = *scene;
  const absl::StatusOr<Place> place = FindPlace(&changed, path);
  if (!place.ok()) return place.status();

  YamlTree tree;
  std::optional<Problem> problem = CheckText(value);
  if (!problem) problem = ParseYaml(value, &tree);
  if (problem) return absl::InvalidArgumentError(absl::StrCat(path, ": ", problem->message));
  Problems problems;
  MessageReader reader(tree, &problems);
  ReadInto(*place, tree, path, &reader);
  if (problems.empty()) {
    for (const Problem& found : ValidateScene(changed)) {
      if (absl::StartsWith(found.path, path)) problems.push_back(found);
    }
  }
  if (!problems.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(problems[0].path, ": ", problems[0].message));
  }
  *scene = std::move(changed);
  return absl::OkStatus();
}

}  // namespace adhesim
