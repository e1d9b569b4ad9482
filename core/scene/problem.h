#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace adhesim {

// One mistake (or doubt) about a scene, tied to the field it is about.
struct Problem {
  std::string path;     // of the field: "bodies[1].icosphere.radius_m"; empty: the scene as a whole
  std::string message;  // what is wrong, the value, what is permitted
  bool warning = false;  // true: the scene loads all the same
  int line = 0;          // in the scene file, from 1; 0: where the path points to
  int column = 0;        // in bytes, from 1
};

using Problems = std::vector<Problem>;

// Readers stop collecting here: more would hide the first ones, and a hostile scene could hold a
// million.
inline constexpr std::size_t kMostProblems = 500;

}  // namespace adhesim
