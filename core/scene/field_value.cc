#include "core/scene/field_value.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <string>
#include <vector>

#include "adhesim/v1/options.pb.h"

namespace adhesim {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

const FieldDescriptor& FieldOf(const Message& message, const char* name) {
  const FieldDescriptor* field = message.GetDescriptor()->FindFieldByName(name);
  GOOGLE_CHECK(field != nullptr) << message.GetTypeName() << " has no field " << name;
  return *field;
}

// The numbers of the field's (default_value): "0.5", "[0, 0, -9.81]" or the name of an enum value.
std::vector<double> DefaultNumbers(const FieldDescriptor& field) {
  std::vector<double> numbers;
  for (absl::string_view word : absl::StrSplit(field.options().GetExtension(v1::default_value),
                                               absl::ByAnyChar("[], "), absl::SkipEmpty())) {
    double number = 0;
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_ENUM) {
      const auto* value = field.enum_type()->FindValueByName(std::string(word));
      if (value != nullptr) numbers.push_back(value->number());
    } else if (absl::SimpleAtod(word, &number)) {
      numbers.push_back(number);
    }
  }
  return numbers;
}

std::vector<double> NumbersOf(const Message& message, const char* name) {
  const FieldDescriptor& field = FieldOf(message, name);
  const auto& reflection = *message.GetReflection();
  std::vector<double> numbers;
  for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
    numbers.push_back(reflection.GetRepeatedDouble(message, &field, i));
  }
  return numbers.empty() ? DefaultNumbers(field) : numbers;
}

}  // namespace

double NumberOf(const Message& message, const char* name) {
  const FieldDescriptor& field = FieldOf(message, name);
  const auto& reflection = *message.GetReflection();
  if (!reflection.HasField(message, &field)) {
    const std::vector<double> numbers = DefaultNumbers(field);
    return numbers.empty() ? 0 : numbers[0];
  }
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return reflection.GetDouble(message, &field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return reflection.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_ENUM:
      return reflection.GetEnumValue(message, &field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return static_cast<double>(reflection.GetUInt64(message, &field));
    default:
      GOOGLE_LOG(FATAL) << field.full_name() << " is not a number";
      return 0;
  }
}

Vec3 Vec3Of(const Message& message, const char* name) {
  const std::vector<double> numbers = NumbersOf(message, name);
  return numbers.size() == 3 ? Vec3(numbers[0], numbers[1], numbers[2]) : Vec3::Zero();
}

std::optional<Quat> QuatOf(const Message& message, const char* name) {
  const std::vector<double> numbers = NumbersOf(message, name);
  if (numbers.size() != 4) return std::nullopt;
  const Quat q(numbers[0], numbers[1], numbers[2], numbers[3]);
  const double norm = q.norm();
  if (!(norm > 1e-6)) return std::nullopt;
  return Quat(q.coeffs() / norm);
}

std::string ExtentText(const Aabb& box) {
  return absl::StrCat("x ", box.min.x(), " to ", box.max.x(), ", y ", box.min.y(), " to ",
                      box.max.y(), ", z ", box.min.z(), " to ", box.max.z(), " m");
}

}  // namespace adhesim
