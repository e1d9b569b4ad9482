#pragma once

#include <span>
#include <vector>

#include "core/contact/adhesive.h"
#include "core/contact/detector.h"
#include "core/model/state.h"
#include "core/tools/tool_set.h"

namespace adhesim {

// Finds the triangles near tools: the detector's trees against the tools' boxes, then the tools'
// own shapes.
class ToolContacts {
 public:
  ToolContacts(const Model& model, const ToolSet& tools);

  // Ascending by (tool, triangle); tools that `retracted` [#tools] names touch nothing. Valid until
  // the next call.
  std::span<const Adhesive::NearTool> Find(const State& state, const Detector& detector,
                                           std::span<const std::uint8_t> retracted, double dt_s);

 private:
  const Model& model_;
  const ToolSet& tools_;
  std::vector<std::int32_t> triangles_;
  std::vector<Adhesive::NearTool> near_;
};

}  // namespace adhesim
