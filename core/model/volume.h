#pragma once

#include <span>

#include "core/model/model.h"

namespace adhesim {

// Volume enclosed by a closed, outward-oriented body, m^3. Sums about the body's first particle, so
// that it is as exact far from the origin as near it.
double EnclosedVolume(const Model& model, const Body& body, std::span<const Vec3> position_m);

}  // namespace adhesim
