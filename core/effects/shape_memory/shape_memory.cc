#include "core/effects/shape_memory/shape_memory.h"

#include "core/effects/shape_memory/centre_form.h"
#include "core/effects/shape_memory/cluster_form.h"

namespace adhesim {

ShapeMemoryEffect::ShapeMemoryEffect(const Model& model, const v1::ShapeMemory& message) {
  if (message.form() == v1::SHAPE_MEMORY_FORM_CENTRE) {
    form_ = std::make_unique<CentreForm>(model, message);
  } else {
    form_ = std::make_unique<ClusterForm>(model, message);
  }
}

}  // namespace adhesim
