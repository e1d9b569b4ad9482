#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/model/geometry.h"

namespace adhesim {

// Where one copy of a body is.
struct CopyPlace {
  Vec3 offset_m = Vec3::Zero();      // from the body's own position
  Vec3 rotation_deg = Vec3::Zero();  // instead of the body's own
};

// Random places within the ball, no two nearer than the spacing: darts are thrown and those too
// near another are thrown again. Without a radius the places are packed: those points of a
// face-centred cubic lattice, whose neighbours are at the spacing, that are nearest to its origin.
// Rotations are random. The same places for the same message and seed on every machine. Errors:
// InvalidArgument when they do not fit, or fit too tightly for darts.
absl::StatusOr<std::vector<CopyPlace>> PlaceCopies(const v1::Copies& copies, std::uint64_t seed);

}  // namespace adhesim
