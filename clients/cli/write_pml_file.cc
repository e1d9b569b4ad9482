#include "clients/cli/write_pml_file.h"

#include <fstream>
#include <iostream>

#include "clients/cli/commands.h"
#include "core/scene/mesh/write_pml.h"

namespace adhesim {

int WritePmlFile(const PmlModel& model, const std::string& path) {
  const absl::StatusOr<std::string> text = WritePml(model);
  if (!text.ok()) {
    std::cerr << "error: '" << path << "': " << text.status().message() << "\n";
    return kExitBadInput;
  }
  std::ofstream file(path, std::ios::binary);
  file << *text;
  file.close();
  if (!file) {
    std::cerr << "error: '" << path << "': cannot be written\n";
    return kExitBadInput;
  }
  std::cerr << path << ": " << model.atoms.size() << " atoms, " << model.cells.size() << " cells\n";
  return kExitOk;
}

}  // namespace adhesim
