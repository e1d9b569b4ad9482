#pragma once

#include <string>

#include "core/scene/mesh/pml_model.h"

namespace adhesim {

// Writes a model as a PML file, replacing one that is there, and prints what it wrote or why it
// could not to stderr. Returns an ExitCode.
int WritePmlFile(const PmlModel& model, const std::string& path);

}  // namespace adhesim
