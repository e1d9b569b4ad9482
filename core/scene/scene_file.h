#pragma once

#include <absl/strings/string_view.h>

#include <string>

#include "adhesim/v1/scene.pb.h"
#include "core/scene/problem.h"
#include "core/scene/yaml_tree.h"

namespace adhesim {

// A scene as it was read from YAML or JSON, with all that is needed to say where in the text
// something is wrong.
struct SceneFile {
  v1::Scene scene;        // as written, without defaults; complete only when ok()
  std::string file;       // its name, for messages
  std::string directory;  // that its meshes are relative to
  std::string text;
  Problems problems;  // every mistake in it, in the order of its lines, each with line and column
  YamlTree tree;      // where each value stands

  // True when nothing is worse than a warning.
  bool ok() const;

  // The same problems with line and column filled in from their paths, ordered by them. A path that
  // the text does not have (a missing field) points to the nearest part above it that is there.
  Problems Located(Problems problems) const;

  // As compilers print them: "file:line:column: error: path: message", the line, and a caret; one
  // after the other.
  std::string Format(const Problems& problems, bool colour = false) const;

  // The line (from 1) that holds the value of a path; 0: none.
  int LineOf(absl::string_view path) const;
};

// Reads and validates a scene. Never fails otherwise than by problems. A scene without a name gets
// the file's.
SceneFile ReadSceneFile(const std::string& path);

// The same for a text at hand; `display_name` stands for the file's name.
SceneFile ParseScene(std::string text, const std::string& display_name,
                     const std::string& directory);

// True when none of the problems is worse than a warning.
bool AllWarnings(const Problems& problems);

}  // namespace adhesim
