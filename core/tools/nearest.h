#pragma once

#include "core/tools/solid.h"

namespace adhesim {

// Signed distance of the profile of a solid of revolution at (rho >= 0, z): exact outside and
// inside, convex, and never falling with rho.
double ProfileDistance(const Round& round, double rho, double z);

// NearestOnTriangle for one solid each; the triangle is finite.
bool NearestToRound(const Round& round, const TriangleCorners& corners, double within_m,
                    SolidNearest* nearest);
bool NearestToBlade(const Blade& blade, const TriangleCorners& corners, double within_m,
                    SolidNearest* nearest);

// The unit normal of contact from solid to triangle at a minimum of the signed distance. Inside the
// triangle the optimality condition says that it is the triangle's own normal, whatever corner of
// the solid is there; on its border it is the gradient of the signed distance.
Vec3 ContactNormal(const TriangleCorners& corners, const Vec3& weights, const Vec3& gradient);

}  // namespace adhesim
