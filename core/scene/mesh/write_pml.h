#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/scene/mesh/pml_model.h"

namespace adhesim {

// A physical model as the text of a PML 0.6 file, which ParsePml reads back to an equal model:
// coordinates are written with the fewest digits that give the same bits.
//
// An error when the model cannot be written: a text that XML cannot hold (control characters), or
// a cell that several components share but that has no index. Positions in lists must be in range.
absl::StatusOr<std::string> WritePml(const PmlModel& model);

// The shortest decimal number that reads back to the same bits.
std::string ShortestNumber(double value);

}  // namespace adhesim
