#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <google/protobuf/descriptor.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/scene/field_options.h"
#include "core/scene/message_reader.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

// The release distance of an adhesive that names none, in capture distances.
constexpr double kReleaseRatio = 1.5;

// Sets a field to what its default_value option says: a scalar, or "[a, b, c]".
void SetToDefault(const Field* field, const std::string& text, pb::Message* message) {
  absl::string_view list = text;
  if (absl::ConsumePrefix(&list, "[")) absl::ConsumeSuffix(&list, "]");
  for (const absl::string_view element : absl::StrSplit(list, ", ")) {
    const absl::Status status = ReadScalar(element, field, message);
    if (status.ok()) continue;
    // The option in scene.proto is wrong: no scene can be completed. A test fills in every message.
    std::fprintf(stderr, "default of %s: %s\n", field->full_name().c_str(),
                 status.ToString().c_str());
    std::abort();
  }
}

// Whether a part that is not written says something all the same.
bool SaysSomething(const pb::Descriptor* type) {
  if (HasRequiredField(type)) return false;
  for (int i = 0; i < type->field_count(); ++i) {
    if (!type->field(i)->options().GetExtension(v1::default_value).empty()) return true;
  }
  return false;
}

void FillMessage(pb::Message* message) {
  const pb::Reflection* reflection = message->GetReflection();
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const Field* field = message->GetDescriptor()->field(i);
    const bool present = IsPresent(*message, field);
    if (field->cpp_type() != Field::CPPTYPE_MESSAGE) {
      const std::string& text = field->options().GetExtension(v1::default_value);
      if (!present && !text.empty()) SetToDefault(field, text, message);
    } else if (field->is_repeated()) {
      for (int j = 0; j < reflection->FieldSize(*message, field); ++j) {
        FillMessage(reflection->MutableRepeatedMessage(message, field, j));
      }
    } else if (present || (field->real_containing_oneof() == nullptr &&
                           SaysSomething(field->message_type()))) {
      // A part that can be empty says how; one that cannot, or that has no defaults, says whether,
      // so that its absence means something.
      FillMessage(reflection->MutableMessage(message, field));
    }
  }
}

}  // namespace

v1::Scene WithDefaults(const v1::Scene& scene) {
  v1::Scene filled = scene;
  FillMessage(&filled);
  for (v1::Tool& tool : *filled.mutable_tools()) {
    if (tool.has_adhesion() && !tool.adhesion().has_shear_strength_pa()) {
      tool.mutable_adhesion()->set_shear_strength_pa(tool.adhesion().normal_strength_pa());
    }
    for (v1::Waypoint& waypoint : *tool.mutable_trajectory()) {
      if (waypoint.orientation_wxyz().empty())
        *waypoint.mutable_orientation_wxyz() = tool.orientation_wxyz();
    }
  }
  for (v1::Effect& effect : *filled.mutable_effects()) {
    if (!effect.has_virtual_adhesive()) continue;
    v1::VirtualAdhesive* adhesive = effect.mutable_virtual_adhesive();
    if (!adhesive->has_release_distance_m()) {
      adhesive->set_release_distance_m(kReleaseRatio * adhesive->capture_distance_m());
    }
    if (adhesive->has_normal_strength_pa() && !adhesive->has_shear_strength_pa()) {
      adhesive->set_shear_strength_pa(adhesive->normal_strength_pa());
    }
  }
  return filled;
}

}  // namespace adhesim
