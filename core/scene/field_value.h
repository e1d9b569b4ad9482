#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>

#include "core/model/geometry.h"

namespace adhesim {

// Reading scene messages whose defaults may or may not have been filled in: what is written, else
// the field's (default_value) option, so that no default number is repeated in code. `field` must
// name a field of the message.

// A numeric or enum field. A field without either value is 0.
double NumberOf(const google::protobuf::Message& message, const char* field);

// Three numbers; zero when there is no such value or it does not have three elements.
Vec3 Vec3Of(const google::protobuf::Message& message, const char* field);

// A rotation written w, x, y, z, normalised; nothing when its length is too small to tell a
// direction.
std::optional<Quat> QuatOf(const google::protobuf::Message& message, const char* field);

// "x -0.05 to 0.05, y 0 to 0.1, z 0 to 0.2 m", for messages.
std::string ExtentText(const Aabb& box);

}  // namespace adhesim
