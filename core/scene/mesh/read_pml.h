#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "core/scene/mesh/pml_model.h"

namespace adhesim {

// The physical model in the bytes of a PML 0.6 file; docs/pml.md describes the subset. What the
// subset does not know is an error that names line and column, never dropped: reading and writing
// again loses nothing but comments and the counts, which are not trusted.
//
// A document type declaration is refused where it begins, so that no entity is ever expanded and no
// other file opened. Depth and numbers of elements are limited; memory grows with what was read,
// not with what the file promises.
absl::StatusOr<PmlModel> ParsePml(absl::string_view bytes);

}  // namespace adhesim
