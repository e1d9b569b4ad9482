#pragma once

#include <absl/strings/string_view.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "adhesim/v1/options.pb.h"

namespace adhesim {

// What options.proto says about a field, in words and lists that the reader, validation and the
// schema share.

// "above 0, at most 1000"; empty: any value.
std::string RangeText(const v1::Range& range);

// Whether a finite value is permitted.
bool InRange(const v1::Range& range, double value);

// The short form of an enum value, as scenes write it: "rigid" for BODY_KIND_RIGID.
std::string ShortName(const google::protobuf::EnumValueDescriptor* value);

// The short forms of all values but the unspecified one.
std::vector<std::string> ShortNames(const google::protobuf::EnumDescriptor* type);

// The value with this short or full name; null: none. The unspecified value has no name.
const google::protobuf::EnumValueDescriptor* FindEnumValue(
    const google::protobuf::EnumDescriptor* type, absl::string_view name);

std::vector<std::string> FieldNames(const google::protobuf::Descriptor* type);
std::vector<std::string> MemberNames(const google::protobuf::OneofDescriptor* oneof);

// Whether a message of this type cannot be empty: such a message is never filled in by itself.
bool HasRequiredField(const google::protobuf::Descriptor* type);

// Whether the message holds this field (a list: at least one element; an enum: a value other than
// unspecified).
bool IsPresent(const google::protobuf::Message& message,
               const google::protobuf::FieldDescriptor* field);

// "bodies" and "name" -> "bodies.name"; "" and "bodies" -> "bodies".
std::string JoinPath(absl::string_view path, absl::string_view name);
std::string IndexPath(absl::string_view path, int index);

}  // namespace adhesim
