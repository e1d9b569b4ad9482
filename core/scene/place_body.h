#pragma once

#include <string>

#include "adhesim/v1/scene.pb.h"
#include "core/model/model.h"
#include "core/scene/mesh/tet_mesh.h"
#include "core/scene/problem.h"

namespace adhesim {

// Rotation about x, then y, then z (fixed axes). Multiples of 90 degrees are exact, and no libm
// function is called: the same bits on every machine.
Mat3 RotationFromDegrees(const Vec3& degrees);

// Appends a body made of this mesh (checked; in the shape's own coordinates) to the model: places
// it, spreads its mass (over surfaces by area, over tetrahedra by volume), marks its fixed
// particles, sets its velocity. Connectivity lists are not touched. A body's particles are the
// mesh's nodes in their order: those of its surface come before those without area. Problems are
// about fields of `body`; `path` is the body's own ("bodies[1]").
void PlaceBody(const v1::Body& body, const TetMesh& mesh, const std::string& path, Model* model,
               Problems* problems);

}  // namespace adhesim
