#include "core/scene/place_body.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

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

// The part of a body that a region selects: 1 for each of its particles.
using Selection = std::vector<std::uint8_t>;

// `on_border`: the particle is a boundary vertex of its surface.
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
    default:
      return false;
  }
}

// The corners of tetrahedra with a label or in a group, and the nodes of a group of the surface.
void SelectByName(const v1::Region& region, const TetMesh& mesh, Selection* selected) {
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const bool has_label = region.has_label() && mesh.label[t] >= 0 &&
                           static_cast<std::uint32_t>(mesh.label[t]) == region.label();
    const bool has_group = region.has_group() && mesh.group[t] >= 0 &&
                           mesh.group_names[mesh.group[t]] == region.group();
    if (!has_label && !has_group) continue;
    for (const std::int32_t node : mesh.tetrahedra[t]) (*selected)[node] = 1;
  }
  for (const NodeGroup& group : mesh.node_groups) {
    if (!region.has_group() || group.name != region.group()) continue;
    for (const std::int32_t node : group.nodes) (*selected)[node] = 1;
  }
}

// Particles with a mass of their own take the place of those that are carried: a region that holds
// none but carried ones selects their carriers.
void GiveToCarriers(const TetMesh& mesh, Selection* selected) {
  std::vector<const CarriedParticle*> carried;
  for (const CarriedParticle& c : mesh.carried) {
    if ((*selected)[c.particle]) carried.push_back(&c);
    (*selected)[c.particle] = 0;
  }
  if (std::find(selected->begin(), selected->end(), 1) != selected->end()) return;
  for (const CarriedParticle* c : carried) {
    for (const std::int32_t carrier : c->carriers) (*selected)[carrier] = 1;
  }
}

// `box` holds the body.
std::string NothingSelected(const v1::Body& body, const v1::Region& region, const Body& placed,
                            const Aabb& box, const TetMesh& mesh) {
  std::string why = absl::StrCat("selects no particle of body '", body.name(), "'");
  if (region.has_border() && placed.closed)
    absl::StrAppend(&why, ": its surface is closed and has no border");
  if (region.has_group()) {
    std::vector<std::string> names = mesh.group_names;
    for (const NodeGroup& group : mesh.node_groups) names.push_back(group.name);
    absl::StrAppend(&why, names.empty() ? ": it has no groups"
                                        : ": its groups are " + absl::StrJoin(names, ", "));
  }
  if (region.has_ball() || region.has_half_space()) {
    absl::StrAppend(&why, ": its particles lie within ", ExtentText(box));
  }
  return why;
}

// Marks the particles of all regions of a body; each region must select at least one.
void Fix(const v1::Body& body, const Selection& on_border, const std::string& path,
         const Body& placed, const Aabb& box, const TetMesh& mesh, Model* model,
         Problems* problems) {
  std::uint8_t* fixed = model->fixed.data() + placed.first_particle;
  for (int r = 0; r < body.fixed_size(); ++r) {
    const v1::Region& region = body.fixed(r);
    const std::string region_path = absl::StrCat(path, ".fixed[", r, "]");
    if (region.has_half_space() && Vec3Of(region.half_space(), "normal").isZero(0)) {
      problems->push_back({absl::StrCat(region_path, ".half_space.normal"),
                           "the direction has no length; any other length is permitted"});
      continue;
    }
    Selection selected(placed.particle_count, 0);
    for (int i = 0; i < placed.particle_count; ++i) {
      selected[i] = Holds(region, model->rest_position_m[placed.first_particle + i], on_border[i]);
    }
    if (region.has_label() || region.has_group()) SelectByName(region, mesh, &selected);
    GiveToCarriers(mesh, &selected);
    bool any = false;
    for (int i = 0; i < placed.particle_count; ++i) {
      if (!selected[i]) continue;
      fixed[i] = 1;
      any = true;
    }
    if (!any) problems->push_back({region_path, NothingSelected(body, region, placed, box, mesh)});
  }
  for (const CarriedParticle& c : mesh.carried) {
    bool held = true;
    for (int k = 0; k < 4; ++k) held = held && (c.weights[k] == 0 || fixed[c.carriers[k]] == 1);
    fixed[c.particle] = held;
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

// What a whole is made of: each particle's share [#particles], and the sum, counted element by
// element.
struct Shares {
  std::vector<double> of;
  double total = 0;
};

// A third of each triangle's area belongs to each of its corners [m^2].
Shares SharesOfArea(const TriangleMesh& surface) {
  Shares shares{std::vector<double>(surface.vertices.size(), 0)};
  for (const auto [a, b, c] : surface.triangles) {
    const double area_m2 =
        AreaVector(surface.vertices[a], surface.vertices[b], surface.vertices[c]).norm();
    shares.total += area_m2;
    for (const int v : {a, b, c}) shares.of[v] += area_m2 / 3;
  }
  return shares;
}

// A quarter of each tetrahedron's filled volume belongs to each of its corners [m^3].
Shares SharesOfVolume(const std::vector<Vec3>& nodes, const TetMesh& mesh) {
  Shares shares{std::vector<double>(nodes.size(), 0)};
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double volume_m3 = mesh.fill[t] * TetVolume(nodes, mesh.tetrahedra[t]);
    shares.total += volume_m3;
    for (const std::int32_t node : mesh.tetrahedra[t]) shares.of[node] += volume_m3 / 4;
  }
  return shares;
}

// The model's number of a group; groups of the same name in several bodies are one.
std::int32_t GroupNumber(const std::string& name, Model* model) {
  const auto found = std::find(model->group_names.begin(), model->group_names.end(), name);
  const auto number = static_cast<std::int32_t>(found - model->group_names.begin());
  if (found == model->group_names.end()) model->group_names.push_back(name);
  return number;
}

void AppendTetrahedra(const TetMesh& mesh, Model* model, Body* placed) {
  placed->first_tetrahedron = static_cast<std::int32_t>(model->tetrahedra.size());
  placed->tetrahedron_count = static_cast<std::int32_t>(mesh.tetrahedra.size());
  std::vector<std::int32_t> group_number;
  for (const std::string& name : mesh.group_names) {
    group_number.push_back(GroupNumber(name, model));
  }
  const auto moved = [&](Tetrahedron tetrahedron) {
    for (std::int32_t& node : tetrahedron) node += placed->first_particle;
    return tetrahedron;
  };
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    model->tetrahedra.push_back(moved(mesh.tetrahedra[t]));
    model->fill.push_back(mesh.fill[t]);
    model->tet_label.push_back(mesh.label[t]);
    model->tet_group.push_back(mesh.group[t] < 0 ? -1 : group_number[mesh.group[t]]);
  }
  for (const CarriedParticle& c : mesh.carried) {
    model->carried.push_back({c.particle + placed->first_particle, moved(c.carriers), c.weights});
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

void PlaceBody(const v1::Body& body, const TetMesh& mesh, const std::string& path, Model* model,
               Problems* problems) {
  Body placed;
  placed.name = placed.scene_name = body.name();
  placed.rigid = static_cast<int>(NumberOf(body, "kind")) == v1::BODY_KIND_RIGID;
  placed.first_particle = model->particle_count();
  placed.particle_count = static_cast<int>(mesh.surface.vertices.size());
  placed.first_triangle = static_cast<int>(model->triangles.size());
  placed.triangle_count = static_cast<int>(mesh.surface.triangles.size());

  const Mat3 rotation = RotationFromDegrees(Vec3Of(body, "rotation_deg"));
  const Vec3 position = Vec3Of(body, "position_m");
  TriangleMesh world{{}, mesh.surface.triangles};
  Aabb box;
  for (const Vec3& vertex : mesh.surface.vertices) {
    world.vertices.push_back(rotation * vertex + position);
    box.Add(world.vertices.back());
  }
  placed.size_m = (box.max - box.min).norm();

  const Shares area = SharesOfArea(world);
  for (const auto [a, b, c] : world.triangles) {
    model->triangles.push_back(
        {a + placed.first_particle, b + placed.first_particle, c + placed.first_particle});
  }
  const std::vector<TriangleSide> sides = SortedSides(world.triangles);
  const Selection on_border = BoundaryVertices(sides, placed.particle_count);
  placed.closed = std::find(on_border.begin(), on_border.end(), 1) == on_border.end();
  if (placed.closed) placed.rest_volume_m3 = EnclosedVolume(world);
  const bool has_volume = placed.closed || !mesh.tetrahedra.empty();
  if (body.has_density_kg_m3() && !has_volume) {
    problems->push_back(
        {path + ".density_kg_m3", "needs a volume, and the surface is open; permitted: mass_kg"});
  }
  // Mass follows area, or volume where there is any.
  const bool solid = !mesh.tetrahedra.empty();
  const Shares share = solid ? SharesOfVolume(world.vertices, mesh) : area;
  const double volume_m3 = solid ? share.total : placed.rest_volume_m3;
  const double mass_kg =
      body.has_density_kg_m3() ? body.density_kg_m3() * volume_m3 : body.mass_kg();
  const int body_index = static_cast<int>(model->bodies.size());
  for (std::size_t i = 0; i < world.vertices.size(); ++i) {
    model->rest_position_m.push_back(world.vertices[i]);
    model->initial_velocity_m_s.push_back(Vec3::Zero());
    model->area_m2.push_back(area.of[i]);
    model->mass_kg.push_back(mass_kg * (share.of[i] / share.total));
    model->fixed.push_back(0);
    model->body_of.push_back(body_index);
  }
  AppendTetrahedra(mesh, model, &placed);

  Fix(body, on_border, path, placed, box, mesh, model, problems);
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
