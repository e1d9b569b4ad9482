#pragma once

#include <string>
#include <vector>

#include "adhesim/v1/scene.pb.h"

namespace adhesim {

// Visits (name, error) of each rung that is set, in the order of their fields.
template <typename Visit>
void ForEachRung(const v1::Rungs& rungs, const Visit& visit) {
  const auto* reflection = rungs.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection->ListFields(rungs, &fields);
  for (const auto* field : fields) {
    visit(field->name(), static_cast<const v1::RungError&>(reflection->GetMessage(rungs, field)));
  }
}

}  // namespace adhesim
