#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace adhesim {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Quat = Eigen::Quaterniond;
// Three particle (or vertex) indices, counter-clockwise seen from outside.
using Triangle = std::array<std::int32_t, 3>;

// A rigid placement: p_world = orientation * p_local + position_m. The quaternion is unit.
struct Pose {
  Vec3 position_m = Vec3::Zero();
  Quat orientation = Quat::Identity();

  Vec3 operator*(const Vec3& local) const { return orientation * local + position_m; }
};

// A rigid motion about a stated point: the point's velocity [m/s] and the angular velocity [rad/s],
// world axes.
struct Twist {
  Vec3 linear_m_s = Vec3::Zero();
  Vec3 angular_rad_s = Vec3::Zero();
};

// A force [N] and its torque [N m] about a stated point, world axes.
struct Wrench {
  Vec3 force_n = Vec3::Zero();
  Vec3 torque_nm = Vec3::Zero();
};

// An axis-aligned box; empty until something is added.
struct Aabb {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());

  void Add(const Vec3& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  void Add(const Aabb& other) {
    min = min.cwiseMin(other.min);
    max = max.cwiseMax(other.max);
  }
  // The same box, `margin` larger on every side.
  Aabb Grown(double margin) const { return {min.array() - margin, max.array() + margin}; }
  bool Overlaps(const Aabb& other) const {
    return (min.array() <= other.max.array()).all() && (other.min.array() <= max.array()).all();
  }
  bool Contains(const Vec3& p) const {
    return (min.array() <= p.array()).all() && (p.array() <= max.array()).all();
  }
};

// A surface as it is read or generated, before it becomes the particles of a body.
struct TriangleMesh {
  std::vector<Vec3> vertices;       // [#vertices] m
  std::vector<Triangle> triangles;  // [#triangles] indices into `vertices`
};

// The matrix with CrossMatrix(a) * b == a.cross(b).
inline Mat3 CrossMatrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

}  // namespace adhesim
