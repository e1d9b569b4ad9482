#pragma once

#include <string>
#include <vector>

namespace adhesim {

// One mistake (or doubt) about a scene, tied to the field it is about.
struct Problem {
  std::string path;       // of the field: "bodies[1].icosphere.radius_m"; empty: the scene as a whole
  std::string message;    // what is wrong, the value, what is permitted
  bool warning = false;   // true: the scene loads all the same
};

using Problems = std::vector<Problem>;

}  // namespace adhesim
