#include "core/scene/mesh/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

constexpr double kPi = std::numbers::pi;

// The angle of (x, y) in (-pi, pi], to 1e-12.
double Angle(double y, double x) {
  const double length = std::sqrt(x * x + y * y);
  if (!(length > 0)) return 0;
  // tan(a/2) = sin a / (1 + cos a), for the angle to the nearer half axis, three times.
  double sine = std::abs(y) / length, cosine = std::abs(x) / length;
  double t = sine / (1 + cosine);  // <= 1
  for (int halving = 0; halving < 2; ++halving) t = t / (1 + std::sqrt(1 + t * t));
  // The series of atan for t <= 0.2; the first omitted term is below 1e-13.
  const double t_sq = t * t;
  double sum = 0;
  for (int k = 17; k >= 1; k -= 2) sum = 1.0 / k - t_sq * sum;
  const double acute = 8 * t * sum;
  const double upper = x < 0 ? kPi - acute : acute;
  return y < 0 ? -upper : upper;
}

// Signed solid angle of a triangle seen from the origin (van Oosterom, Strackee 1983).
double SolidAngle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * Angle(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

Vec3 CentreOf(const TriangleMesh& mesh, std::int32_t triangle) {
  const auto [a, b, c] = mesh.triangles[triangle];
  return (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3;
}

}  // namespace

WindingNumber::WindingNumber(const TriangleMesh& mesh) {
  std::vector<std::int32_t> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), 0);
  if (!order.empty()) Build(mesh, order.data(), order.data() + order.size());
}

void WindingNumber::Build(const TriangleMesh& mesh, std::int32_t* first, std::int32_t* last) {
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Node node;
  node.centre = node.area_m2 = Vec3::Zero();
  Aabb box;
  double weight = 0;
  for (const std::int32_t* t = first; t != last; ++t) {
    const auto [a, b, c] = mesh.triangles[*t];
    const Vec3 area = AreaVector(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
    node.area_m2 += area;
    node.centre += area.norm() * CentreOf(mesh, *t);
    weight += area.norm();
    for (const int v : {a, b, c}) box.Add(mesh.vertices[v]);
  }
  node.centre = weight > 0 ? Vec3(node.centre / weight) : Vec3(0.5 * (box.min + box.max));
  double radius_sq = 0;
  for (const std::int32_t* t = first; t != last; ++t) {
    for (const int v : mesh.triangles[*t]) {
      radius_sq = std::max(radius_sq, (mesh.vertices[v] - node.centre).squaredNorm());
    }
  }
  node.far_sq = kFar * kFar * radius_sq;
  if (last - first <= kLeafTriangles) {
    node.first = static_cast<std::int32_t>(corners_.size());
    node.count = static_cast<std::int32_t>(last - first);
    for (; first != last; ++first) {
      const auto [a, b, c] = mesh.triangles[*first];
      corners_.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
    }
  } else {
    int axis = 0;
    (box.max - box.min).maxCoeff(&axis);
    std::int32_t* middle = first + (last - first) / 2;
    std::nth_element(first, middle, last, [&](std::int32_t t, std::int32_t u) {
      const double at = CentreOf(mesh, t)[axis], au = CentreOf(mesh, u)[axis];
      return at < au || (at == au && t < u);
    });
    Build(mesh, first, middle);
    Build(mesh, middle, last);
  }
  node.next = static_cast<std::int32_t>(nodes_.size());
  nodes_[index] = node;
}

double WindingNumber::At(const Vec3& point) const {
  double sum = 0;
  for (std::size_t i = 0; i < nodes_.size();) {
    const Node& node = nodes_[i];
    const Vec3 to = node.centre - point;
    const double distance_sq = to.squaredNorm();
    if (distance_sq > node.far_sq) {
      sum += node.area_m2.dot(to) / (distance_sq * std::sqrt(distance_sq));
      i = node.next;
      continue;
    }
    for (std::int32_t t = node.first; t < node.first + node.count; ++t) {
      const auto& [a, b, c] = corners_[t];
      sum += SolidAngle(a - point, b - point, c - point);
    }
    i = node.count > 0 ? node.next : i + 1;
  }
  return sum / (4 * kPi);
}

}  // namespace adhesim
