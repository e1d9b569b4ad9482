#include "core/scene/message_reader.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <google/protobuf/descriptor.h>

#include <cstdint>
#include <limits>
#include <map>
#include <vector>

#include "core/scene/did_you_mean.h"
#include "core/scene/field_options.h"
#include "core/scene/quantity.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;
using Kind = YamlNode::Kind;

std::string KindText(const YamlNode& node) {
  switch (node.kind) {
    case Kind::kNull:
      return "nothing";
    case Kind::kScalar:
      return Quoted(node.text);
    case Kind::kSequence:
      return absl::StrCat("a list of ", node.children.size());
    case Kind::kMap:
      return "a mapping";
  }
  return "";
}

// What a value of this field looks like, for messages.
std::string Expected(const Field* field) {
  switch (field->cpp_type()) {
    case Field::CPPTYPE_MESSAGE:
      return absl::StrCat(
          "a mapping (fields: ", absl::StrJoin(FieldNames(field->message_type()), ", "), ")");
    case Field::CPPTYPE_STRING:
      return "a text";
    case Field::CPPTYPE_BOOL:
      return "true or false";
    case Field::CPPTYPE_ENUM:
      return absl::StrCat("one of ", absl::StrJoin(ShortNames(field->enum_type()), ", "));
    case Field::CPPTYPE_DOUBLE:
    case Field::CPPTYPE_FLOAT:
      return "a number";
    default:
      return "a whole number";
  }
}

std::string ExpectedList(const Field* field) {
  const std::uint32_t size = field->options().GetExtension(v1::size);
  return size > 0 ? absl::StrCat("a list of ", size, " numbers: [",
                                 absl::StrJoin(std::vector<std::string>(size, "..."), ", "), "]")
                  : absl::StrCat("a list, each element ", Expected(field));
}

absl::Status ReadEnum(absl::string_view text, const Field* field, pb::Message* message) {
  const pb::EnumValueDescriptor* value = FindEnumValue(field->enum_type(), text);
  if (value == nullptr) {
    const std::vector<std::string> names = ShortNames(field->enum_type());
    return absl::InvalidArgumentError(absl::StrCat("unknown value ", Quoted(text),
                                                   DidYouMean(text, names),
                                                   "; permitted: ", absl::StrJoin(names, ", ")));
  }
  const pb::Reflection* reflection = message->GetReflection();
  field->is_repeated() ? reflection->AddEnum(message, field, value)
                       : reflection->SetEnum(message, field, value);
  return absl::OkStatus();
}

absl::Status ReadBool(absl::string_view text, const Field* field, pb::Message* message) {
  if (text != "true" && text != "false") {
    return absl::InvalidArgumentError(absl::StrCat("expected true or false, got ", Quoted(text)));
  }
  const pb::Reflection* reflection = message->GetReflection();
  const bool value = text == "true";
  field->is_repeated() ? reflection->AddBool(message, field, value)
                       : reflection->SetBool(message, field, value);
  return absl::OkStatus();
}

absl::Status ReadDouble(absl::string_view text, const Field* field, pb::Message* message) {
  const absl::StatusOr<double> value = ParseQuantity(text, DimensionOf(field->name()));
  if (!value.ok()) return value.status();
  const pb::Reflection* reflection = message->GetReflection();
  field->is_repeated() ? reflection->AddDouble(message, field, *value)
                       : reflection->SetDouble(message, field, *value);
  return absl::OkStatus();
}

// Scenes have no other whole numbers than unsigned ones, and those not in lists.
absl::Status ReadUnsigned(absl::string_view text, const Field* field, pb::Message* message) {
  const bool wide = field->cpp_type() == Field::CPPTYPE_UINT64;
  const absl::StatusOr<std::uint64_t> value =
      ParseUnsigned(text, wide ? std::numeric_limits<std::uint64_t>::max()
                               : std::numeric_limits<std::uint32_t>::max());
  if (!value.ok()) return value.status();
  const pb::Reflection* reflection = message->GetReflection();
  wide ? reflection->SetUInt64(message, field, *value)
       : reflection->SetUInt32(message, field, static_cast<std::uint32_t>(*value));
  return absl::OkStatus();
}

}  // namespace

absl::Status ReadScalar(absl::string_view text, const Field* field, pb::Message* message) {
  const pb::Reflection* reflection = message->GetReflection();
  switch (field->cpp_type()) {
    case Field::CPPTYPE_STRING:
      field->is_repeated() ? reflection->AddString(message, field, std::string(text))
                           : reflection->SetString(message, field, std::string(text));
      return absl::OkStatus();
    case Field::CPPTYPE_BOOL:
      return ReadBool(text, field, message);
    case Field::CPPTYPE_ENUM:
      return ReadEnum(text, field, message);
    case Field::CPPTYPE_DOUBLE:
      return ReadDouble(text, field, message);
    case Field::CPPTYPE_UINT32:
    case Field::CPPTYPE_UINT64:
      if (!field->is_repeated()) return ReadUnsigned(text, field, message);
      [[fallthrough]];
    default:
      return absl::UnimplementedError(
          absl::StrCat("no scene holds a field of type ", field->cpp_type_name()));
  }
}

void MessageReader::Report(const std::string& path, int at, std::string message) {
  spoiled_.insert(path);
  if (problems_->size() > kMostProblems) return;
  if (problems_->size() == kMostProblems) message = "more mistakes follow; mend these first";
  problems_->push_back(
      {path, std::move(message), false, tree_.nodes[at].line, tree_.nodes[at].column});
}

void MessageReader::ReportUnknown(int key, const std::string& path, const pb::Descriptor* type) {
  const std::string& name = tree_.nodes[key].text;
  const std::string field_path = JoinPath(path, PathKey(name));
  // A oneof that lacks a member probably lacks the misspelt one.
  for (int i = 0; i < type->real_oneof_decl_count(); ++i) {
    spoiled_.insert(JoinPath(path, type->oneof_decl(i)->name()));
  }
  if (problems_->size() > kMostProblems) return;
  if (name == "<<") return Report(field_path, key, "merge keys (<<) are not permitted");
  const std::vector<std::string> names = FieldNames(type);
  const std::string nearest = NearestName(name, names);
  if (!nearest.empty()) spoiled_.insert(JoinPath(path, nearest));
  Report(field_path, key,
         absl::StrCat("unknown field ", Quoted(name), " in ", type->name(), DidYouMean(name, names),
                      "; permitted: ", absl::StrJoin(names, ", ")));
}

void MessageReader::ReadMessage(int node, const std::string& path, pb::Message* message) {
  const std::vector<int>& children = tree_.nodes[node].children;
  const pb::Descriptor* type = message->GetDescriptor();
  std::map<std::string, int> seen;                           // line of each name
  std::map<const pb::OneofDescriptor*, std::string> chosen;  // member of each oneof
  for (std::size_t i = 0; i + 1 < children.size(); i += 2) {
    const YamlNode& key = tree_.nodes[children[i]];
    if (key.kind != Kind::kScalar) {
      Report(
          path, children[i],
          absl::StrCat("expected the name of a field of ", type->name(), ", got ", KindText(key)));
      continue;
    }
    const std::string field_path = JoinPath(path, PathKey(key.text));
    const auto [first, is_new] = seen.emplace(key.text, key.line);
    if (!is_new) {
      Report(field_path, children[i],
             absl::StrCat(Quoted(key.text), " is written twice; first on line ", first->second));
      continue;
    }
    const Field* field = type->FindFieldByName(key.text);
    if (field == nullptr) {
      ReportUnknown(children[i], path, type);
      continue;
    }
    if (const pb::OneofDescriptor* oneof = field->real_containing_oneof(); oneof != nullptr) {
      const auto [other, is_first] = chosen.emplace(oneof, key.text);
      if (!is_first) {
        Report(field_path, children[i],
               absl::StrCat("only one of ", absl::StrJoin(MemberNames(oneof), ", "),
                            " may be written; ", Quoted(other->second), " already is"));
        continue;
      }
    }
    ReadField(children[i + 1], children[i], field_path, field, message);
  }
}

void MessageReader::ReadField(int node, int at, const std::string& path, const Field* field,
                              pb::Message* message) {
  if (!field->is_repeated()) {
    ReadElement(node, tree_.nodes[node].kind == Kind::kScalar ? node : at, path, field, message);
    return;
  }
  const YamlNode& list = tree_.nodes[node];
  const std::uint32_t size = field->options().GetExtension(v1::size);
  const bool nothing = list.kind == Kind::kNull && size == 0;  // "effects:" with nothing below
  if (nothing) return;
  if (list.kind != Kind::kSequence || (size > 0 && list.children.empty())) {
    Report(path, list.kind == Kind::kScalar ? node : at,
           absl::StrCat("expected ", ExpectedList(field), ", got ", KindText(list)));
    return;
  }
  for (std::size_t i = 0; i < list.children.size(); ++i) {
    const std::string element = IndexPath(path, static_cast<int>(i));
    const std::size_t before = problems_->size();
    ReadElement(list.children[i], list.children[i], element, field, message);
    // A list of numbers with one that cannot be read has no right size.
    if (problems_->size() != before && field->cpp_type() != Field::CPPTYPE_MESSAGE)
      spoiled_.insert(path);
  }
}

void MessageReader::ReadElement(int node, int at, const std::string& path, const Field* field,
                                pb::Message* message) {
  const YamlNode& value = tree_.nodes[node];
  if (field->cpp_type() == Field::CPPTYPE_MESSAGE) {
    const pb::Reflection* reflection = message->GetReflection();
    pb::Message* part = field->is_repeated() ? reflection->AddMessage(message, field)
                                             : reflection->MutableMessage(message, field);
    if (value.kind == Kind::kMap) {
      ReadMessage(node, path, part);
    } else if (value.kind != Kind::kNull) {  // "volume_preservation:" with nothing below
      Report(path, at, absl::StrCat("expected ", Expected(field), ", got ", KindText(value)));
    }
    return;
  }
  if (value.kind != Kind::kScalar) {
    Report(path, at, absl::StrCat("expected ", Expected(field), ", got ", KindText(value)));
    return;
  }
  const absl::Status status = ReadScalar(value.text, field, message);
  if (!status.ok()) Report(path, at, std::string(status.message()));
}

bool MessageReader::Repeats(const Problem& problem) const {
  for (std::size_t end = 1; end <= problem.path.size(); ++end) {
    const bool part =
        end == problem.path.size() || problem.path[end] == '.' || problem.path[end] == '[';
    if (part && spoiled_.contains(problem.path.substr(0, end))) return true;
  }
  return false;
}

}  // namespace adhesim
