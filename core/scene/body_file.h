#pragma once

#include <string>

#include "adhesim/v1/scene.pb.h"

namespace adhesim {

// The file that a body's shape is read from, as the scene writes it; null: its shape needs none.
const std::string* FileOf(const v1::Body& body);
std::string* MutableFileOf(v1::Body* body);

// The field that a body's shape comes from, for messages about it: "bodies[1].mesh.file". `path` is
// the body's own.
std::string ShapePath(const v1::Body& body, const std::string& path);

}  // namespace adhesim
