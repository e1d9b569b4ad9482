#include "core/model/volume.h"

namespace adhesim {

double EnclosedVolume(const Model& model, const Body& body, std::span<const Vec3> position_m) {
  const Vec3 origin = position_m[body.first_particle];
  double six_volumes = 0;
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model.triangles[t];
    const Vec3 a = position_m[tri[0]] - origin, b = position_m[tri[1]] - origin,
               c = position_m[tri[2]] - origin;
    six_volumes += a.dot(b.cross(c));
  }
  return six_volumes / 6;
}

}  // namespace adhesim
