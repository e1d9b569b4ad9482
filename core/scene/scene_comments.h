#pragma once

#include <google/protobuf/descriptor.h>

#include <string>

namespace adhesim {

// The comments of scene.proto. The descriptors that the program is linked with have none, so that a
// copy with comments is built into the library.
class SceneComments {
 public:
  SceneComments();

  // The comment above a message, a field or an enum value, on one line; empty: none.
  std::string Of(const google::protobuf::Descriptor* message) const;
  std::string Of(const google::protobuf::FieldDescriptor* field) const;
  std::string Of(const google::protobuf::EnumValueDescriptor* value) const;

 private:
  google::protobuf::DescriptorPool pool_;
};

}  // namespace adhesim
