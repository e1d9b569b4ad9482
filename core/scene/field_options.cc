#include "core/scene/field_options.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include "core/scene/quantity.h"

namespace adhesim {

namespace pb = google::protobuf;

std::string RangeText(const v1::Range& range) {
  std::string text;
  if (range.has_min()) {
    text = absl::StrCat(range.above_min() ? "above " : "at least ", NumberText(range.min()));
  }
  if (range.has_max()) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", "at most ", NumberText(range.max()));
  }
  return text;
}

bool InRange(const v1::Range& range, double value) {
  if (range.has_min() && (range.above_min() ? value <= range.min() : value < range.min()))
    return false;
  return !range.has_max() || value <= range.max();
}

std::string ShortName(const pb::EnumValueDescriptor* value) {
  // The zero value is <TYPE>_UNSPECIFIED: what precedes "UNSPECIFIED" precedes every value.
  absl::string_view prefix = value->type()->value(0)->name();
  absl::ConsumeSuffix(&prefix, "UNSPECIFIED");
  absl::string_view name = value->name();
  absl::ConsumePrefix(&name, prefix);
  return absl::AsciiStrToLower(name);
}

std::vector<std::string> ShortNames(const pb::EnumDescriptor* type) {
  std::vector<std::string> names;
  for (int i = 1; i < type->value_count(); ++i) names.push_back(ShortName(type->value(i)));
  return names;
}

const pb::EnumValueDescriptor* FindEnumValue(const pb::EnumDescriptor* type,
                                             absl::string_view name) {
  for (int i = 1; i < type->value_count(); ++i) {
    if (name == type->value(i)->name() || name == ShortName(type->value(i))) return type->value(i);
  }
  return nullptr;
}

std::vector<std::string> FieldNames(const pb::Descriptor* type) {
  std::vector<std::string> names;
  for (int i = 0; i < type->field_count(); ++i) names.push_back(type->field(i)->name());
  return names;
}

std::vector<std::string> MemberNames(const pb::OneofDescriptor* oneof) {
  std::vector<std::string> names;
  for (int i = 0; i < oneof->field_count(); ++i) names.push_back(oneof->field(i)->name());
  return names;
}

bool HasRequiredField(const pb::Descriptor* type) {
  for (int i = 0; i < type->field_count(); ++i) {
    if (type->field(i)->options().GetExtension(v1::required)) return true;
  }
  for (int i = 0; i < type->real_oneof_decl_count(); ++i) {
    if (type->oneof_decl(i)->options().GetExtension(v1::one_required)) return true;
  }
  return false;
}

bool IsPresent(const pb::Message& message, const pb::FieldDescriptor* field) {
  const pb::Reflection* reflection = message.GetReflection();
  if (field->is_repeated()) return reflection->FieldSize(message, field) > 0;
  if (!reflection->HasField(message, field)) return false;
  return field->cpp_type() != pb::FieldDescriptor::CPPTYPE_ENUM ||
         reflection->GetEnumValue(message, field) != 0;
}

std::string JoinPath(absl::string_view path, absl::string_view name) {
  return path.empty() ? std::string(name) : absl::StrCat(path, ".", name);
}

std::string IndexPath(absl::string_view path, int index) {
  return absl::StrCat(path, "[", index, "]");
}

}  // namespace adhesim
