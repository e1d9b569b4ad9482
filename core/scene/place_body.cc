#include "core/scene/place_body.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/scene/field_value.h"
#include "core/scene/mesh/topology.h"

namespace adhesim {
namespace {

// Cosine and sine by their series within 45 degrees of a multiple of 90; the first omitted term is
// below 1e-17.
std::pair<double, double> CosSin(double degrees) {
  const double quarters = std::nearbyint(degrees / 90);
  const double x = (degrees - 90 * quarters) * (std::numbers::pi / 180);
  double cosine = 0, sine = 0;
  for (int k = 16; k >= 2; k -= 2) {  // Horner's scheme from the last term
    cosine = (1 - cosine) * x * x / (k * (k - 1));
    sine = (1 - sine) * x * x / (k * (k + 1));
  }
  cosine = 1 - cosine;
  sine = x * (1 - sine);
  switch (((static_cast<int>(quarters) % 4) + 4) % 4) {
    case 0:
      return {cosine, sine};
    case 1:
      return {-sine, cosine};
    case 2:
      return {-cosine, -sine};
    default:
      return {sine, -cosine};
  }
}

// Whether a region holds a particle. `on_border`: the particle is a boundary vertex of its surface.
bool Holds(const v1::Region& region, const Vec3& point, bool on_border) {
  switch (region.kind_case()) {
    case v1::Region::kAll:
      return region.all();
    case v1::Region::kBorder:
      return region.border() && on_border;
    case v1::Region::kHalfSpace: {
      const Vec3 origin = Vec3Of(region.half_space(), "point_m");
      return (point - origin).dot(Vec3Of(region.half_space(), "normal")) <= 0;
    }
    case v1::Region::kBall:
      return (point - Vec3Of(region.ball(), "centre_m")).norm() <= region.ball().radius_m();
    case v1::Region::KIND_NOT_SET:
      return false;
  }
  return false;
}

// Marks the particles of all regions of a body; each region must select at least one.
void Fix(const v1::Body& body, const std::vector<std::uint8_t>& on_border, const std::string& path,
         const Body& placed, Model* model, Problems* problems) {
  for (int r = 0; r < body.fixed_size(); ++r) {
    const v1::Region& region = body.fixed(r);
    const std::string region_path = absl::StrCat(path, ".fixed[", r, "]");
    if (region.has_half_space() && Vec3Of(region.half_space(), "normal").isZero(0)) {
      problems->push_back({absl::StrCat(region_path, ".half_space.normal"),
                           "the direction has no length; any other length is permitted"});
      continue;
    }
    int selected = 0;
    for (int i = 0; i < placed.particle_count; ++i) {
      const int particle = placed.first_particle + i;
      if (!Holds(region, model->rest_position_m[particle], on_border[i])) continue;
      model->fixed[particle] = 1;
      ++selected;
    }
    if (selected > 0) continue;
    std::string why = absl::StrCat("selects no particle of body '", body.name(), "'");
    if (region.has_border() && placed.closed)
      absl::StrAppend(&why, ": its surface is closed and has no border");
    problems->push_back({region_path, why});
  }
}

// Velocities at the start: linear + angular x (position - centre of mass); fixed particles have
// none.
void SetVelocities(const v1::Body& body, const Body& placed, Model* model) {
  const int first = placed.first_particle, last = first + placed.particle_count;
  Vec3 weighted = Vec3::Zero();
  double mass = 0;
  for (int i = first; i < last; ++i) {
    weighted += model->mass_kg[i] * model->rest_position_m[i];
    mass += model->mass_kg[i];
  }
  const Vec3 centre = weighted / mass;
  const Vec3 linear = Vec3Of(body, "velocity_m_s"),
             angular = Vec3Of(body, "angular_velocity_rad_s");
  for (int i = first; i < last; ++i) {
    if (model->fixed[i]) continue;
    model->initial_velocity_m_s[i] = linear + angular.cross(model->rest_position_m[i] - centre);
  }
}

// A rigid body that is fixed in three points off one line cannot move at all.
bool PinsLock(const Model& model, const Body& body) {
  std::vector<Vec3> pins;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    if (model.fixed[p]) pins.push_back(model.rest_position_m[p]);
  }
  double widest_sq = 0;
  for (const Vec3& a : pins) {
    const Vec3 first = a - pins[0];
    for (const Vec3& b : pins)
      widest_sq = std::max(widest_sq, first.cross(b - pins[0]).squaredNorm());
    if (widest_sq > 1e-16 * body.size_m * body.size_m * body.size_m * body.size_m) return true;
  }
  return false;
}

}  // namespace

Mat3 RotationFromDegrees(const Vec3& degrees) {
  const auto [cx, sx] = CosSin(degrees.x());
  const auto [cy, sy] = CosSin(degrees.y());
  const auto [cz, sz] = CosSin(degrees.z());
  Mat3 about_x, about_y, about_z;
  about_x << 1, 0, 0, 0, cx, -sx, 0, sx, cx;
  about_y << cy, 0, sy, 0, 1, 0, -sy, 0, cy;
  about_z << cz, -sz, 0, sz, cz, 0, 0, 0, 1;
  return about_z * about_y * about_x;
}

void PlaceBody(const v1::Body& body, const TriangleMesh& mesh, const std::string& path,
               Model* model, Problems* problems) {
  Body placed;
  placed.name = placed.scene_name = body.name();
  placed.rigid = static_cast<int>(NumberOf(body, "kind")) == v1::BODY_KIND_RIGID;
  placed.first_particle = model->particle_count();
  placed.particle_count = static_cast<int>(mesh.vertices.size());
  placed.first_triangle = static_cast<int>(model->triangles.size());
  placed.triangle_count = static_cast<int>(mesh.triangles.size());

  const Mat3 rotation = RotationFromDegrees(Vec3Of(body, "rotation_deg"));
  const Vec3 position = Vec3Of(body, "position_m");
  TriangleMesh world{{}, mesh.triangles};
  Aabb box;
  for (const Vec3& vertex : mesh.vertices) {
    world.vertices.push_back(rotation * vertex + position);
    box.Add(world.vertices.back());
  }
  placed.size_m = (box.max - box.min).norm();

  // A third of each triangle's area belongs to each of its corners; mass follows area.
  std::vector<double> area(mesh.vertices.size(), 0);
  double total_area = 0;
  for (const auto [a, b, c] : world.triangles) {
    const double triangle_area =
        AreaVector(world.vertices[a], world.vertices[b], world.vertices[c]).norm();
    total_area += triangle_area;
    for (const int v : {a, b, c}) area[v] += triangle_area / 3;
    model->triangles.push_back(
        {a + placed.first_particle, b + placed.first_particle, c + placed.first_particle});
  }
  const std::vector<TriangleSide> sides = SortedSides(mesh.triangles);
  const std::vector<std::uint8_t> on_border = BoundaryVertices(sides, placed.particle_count);
  placed.closed = std::find(on_border.begin(), on_border.end(), 1) == on_border.end();
  if (placed.closed) placed.rest_volume_m3 = EnclosedVolume(world);
  if (body.has_density_kg_m3() && !placed.closed) {
    problems->push_back(
        {path + ".density_kg_m3", "needs a volume, and the surface is open; permitted: mass_kg"});
  }
  const double mass_kg =
      body.has_density_kg_m3() ? body.density_kg_m3() * placed.rest_volume_m3 : body.mass_kg();
  const int body_index = static_cast<int>(model->bodies.size());
  for (std::size_t i = 0; i < world.vertices.size(); ++i) {
    model->rest_position_m.push_back(world.vertices[i]);
    model->initial_velocity_m_s.push_back(Vec3::Zero());
    model->area_m2.push_back(area[i]);
    model->mass_kg.push_back(mass_kg * (area[i] / total_area));
    model->fixed.push_back(0);
    model->body_of.push_back(body_index);
  }

  Fix(body, on_border, path, placed, model, problems);
  if (placed.rigid && PinsLock(*model, placed)) {
    std::fill_n(model->fixed.begin() + placed.first_particle, placed.particle_count, 1);
  }
  SetVelocities(body, placed, model);
  placed.all_fixed = true;
  for (int i = 0; i < placed.particle_count; ++i) {
    if (!model->fixed[placed.first_particle + i]) placed.all_fixed = false;
  }
  model->bodies.push_back(std::move(placed));
}

}  // namespace adhesim
