#include "core/study/shape_error.h"

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

double SixVolumes(std::span<const Vec3> x, const Tetrahedron& t) {
  return (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]);
}

// Mean square of the strains of edges.
struct Strains {
  double sum = 0;
  int count = 0;
  void Add(const Vec3& a, const Vec3& b, const Vec3& rest_a, const Vec3& rest_b) {
    const double strain = (a - b).norm() / (rest_a - rest_b).norm() - 1;
    sum += strain * strain;
    ++count;
  }
  double rms() const { return count > 0 ? std::sqrt(sum / count) : 0; }
};

double EnclosedVolume(const Model& model, const Body& body, std::span<const Vec3> x) {
  double six = 0;
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model.triangles[t];
    six += x[tri[0]].dot(x[tri[1]].cross(x[tri[2]]));
  }
  return six / 6;
}

double SurfaceError(const Model& model, const Body& body, std::span<const Vec3> x) {
  const std::vector<Vec3>& rest = model.rest_position_m;
  Strains strains;
  for (int t = body.first_triangle; t < body.first_triangle + body.triangle_count; ++t) {
    const Triangle& tri = model.triangles[t];
    for (int k = 0; k < 3; ++k) {
      const int a = tri[k], b = tri[(k + 1) % 3];
      strains.Add(x[a], x[b], rest[a], rest[b]);
    }
  }
  if (!body.closed) return strains.rms();
  const double volume = EnclosedVolume(model, body, x) / body.rest_volume_m3;
  return std::max(strains.rms(), std::abs(volume - 1));
}

}  // namespace

ShapeError MeasureShapeError(const Model& model, std::span<const Vec3> position_m) {
  const std::vector<Vec3>& rest = model.rest_position_m;
  ShapeError result;
  for (const Body& body : model.bodies) {
    if (body.rigid || body.all_fixed) continue;
    if (body.tetrahedron_count == 0) {
      result.error = std::max(result.error, SurfaceError(model, body, position_m));
      continue;
    }
    Strains strains;
    const int end = body.first_tetrahedron + body.tetrahedron_count;
    for (int i = body.first_tetrahedron; i < end; ++i) {
      const Tetrahedron& t = model.tetrahedra[i];
      if (!(SixVolumes(position_m, t) > 0)) ++result.inverted;
      for (int a = 0; a < 4; ++a) {
        for (int b = a + 1; b < 4; ++b) {
          strains.Add(position_m[t[a]], position_m[t[b]], rest[t[a]], rest[t[b]]);
        }
      }
    }
    result.error = std::max(result.error, strains.rms());
  }
  return result;
}

int CountPierced(const Model& model, std::span<const Vec3> position_m, const Pose& tool,
                 double length_m, double depth_m) {
  const Vec3 from = tool * Vec3(0, 0, depth_m);
  const Vec3 along = tool * Vec3(0, 0, length_m) - from;
  int count = 0;
  for (const Triangle& tri : model.triangles) {
    // Moeller and Trumbore 1997.
    const Vec3 u = position_m[tri[1]] - position_m[tri[0]];
    const Vec3 v = position_m[tri[2]] - position_m[tri[0]];
    const Vec3 p = along.cross(v);
    const double determinant = u.dot(p);
    if (determinant == 0) continue;
    const Vec3 s = from - position_m[tri[0]];
    const Vec3 q = s.cross(u);
    const double a = s.dot(p) / determinant, b = along.dot(q) / determinant;
    const double at = v.dot(q) / determinant;
    if (a >= 0 && b >= 0 && a + b <= 1 && at >= 0 && at <= 1) ++count;
  }
  return count;
}

}  // namespace adhesim
