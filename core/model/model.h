#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/model/geometry.h"

namespace adhesim {

// One body: a contiguous range of the model's particles, of its triangles and of its tetrahedra.
struct Body {
  std::string name;
  std::string scene_name;  // of the scene's body that it is, or is a copy of
  bool rigid = false;      // all its particles are one rigid zone
  bool closed = false;     // its surface encloses a volume
  bool all_fixed = false;  // none of its particles can move: an obstacle
  std::int32_t first_particle = 0;
  std::int32_t particle_count = 0;
  std::int32_t first_triangle = 0;
  std::int32_t triangle_count = 0;
  std::int32_t first_tetrahedron = 0;
  std::int32_t tetrahedron_count = 0;  // 0: the body is its surface only
  double rest_volume_m3 = 0;           // of the mesh; closed bodies only
  double size_m = 0;                   // diagonal of its bounding box at rest
};

struct NeedleShape {
  double length_m, radius_m, tip_length_m;
};
struct LancetShape {
  double blade_length_m, blade_width_m, blade_thickness_m, handle_length_m, handle_radius_m;
};
using ToolShape = std::variant<NeedleShape, LancetShape>;

// Parameters of the damped spring between a tool and its target (see VirtualCoupling in
// scene.proto).
struct CouplingParameters {
  double stiffness_n_m = 1000;
  double angular_stiffness_nm_rad = 5;
  double mass_kg = 0.05;
  double max_force_n = 10;
  double max_torque_nm = 1;
  double max_speed_m_s = 0.5;
};

// How velocities follow from forces (see Integrator in scene.proto).
enum class Integrator { kExplicit, kImplicit, kNewton };

// A tetrahedron's particles; (b - a) x (c - a) . (d - a) > 0 at rest.
using Tetrahedron = std::array<std::int32_t, 4>;

// A particle without mass or forces of its own: it moves with a tetrahedron of its body, as the
// weighted mean of its corners. Weights sum to 1 and may be negative (it lies outside).
struct CarriedParticle {
  std::int32_t particle;
  Tetrahedron carriers;
  std::array<double, 4> weights;
};

// Strength of a bond as tractions; infinite: it never lets go; zero: contact without stickiness.
struct Strength {
  double normal_pa = std::numeric_limits<double>::infinity();
  double shear_pa = std::numeric_limits<double>::infinity();
};

struct TimedPose {
  double t_s;
  Pose pose;
};

// A rigid instrument; its frame has the tip at the origin and the shaft along +z.
struct ToolModel {
  std::string name;
  ToolShape shape;
  Pose start;
  CouplingParameters coupling;
  Strength strength{0, 0};
  std::optional<double> work_of_adhesion_j_m2;  // as in AdhesiveParameters
  std::optional<double> friction_coefficient;   // absent: what is pressed sticks
  double sticky_length_m =
      std::numeric_limits<double>::infinity();  // behind the tip; further up nothing sticks
  std::vector<TimedPose> trajectory;            // by time; empty: none
};

// The paper's strength: a displacement per reference step (physics: F_c = kappa m / dt_ref^2).
struct KappaStrength {
  double kappa_adh_m;
  double dt_ref_s;
};

// Release by chance (Bell 1978): at force F it happens at the rate rate_per_s * exp(F / force_n).
struct BellRelease {
  double rate_per_s;
  double force_n;
};

// Parameters of the virtual adhesive between bodies; absent in a scene without it.
struct AdhesiveParameters {
  double capture_distance_m = 0;  // d_on
  double release_distance_m = 0;  // d_off > d_on
  Strength strength;
  std::optional<KappaStrength> kappa;  // used instead of `strength` when present
  std::optional<double> patch_size_m;  // absent: zones are not cut
  std::optional<BellRelease> bell;
  std::optional<double> friction_coefficient;   // absent: what sticks under pressure never slides
  bool self_collision = false;                  // surfaces stick to themselves too
  std::optional<double> work_of_adhesion_j_m2;  // lowers the strengths by mesh size and stiffness
  bool ties = false;                            // deformable bodies: points instead of zones
};

// When bodies fall asleep; absent: never.
struct SleepParameters {
  double speed_m_s;  // nothing of them has been faster
  double time_s;     // for so long
};

// Everything about a scene that does not change while it runs. Const after loading.
struct Model {
  std::string name;
  double dt_s = 1e-3;
  double stability_fraction = 0.5;
  int max_substeps = 64;
  Integrator integrator = Integrator::kExplicit;
  double tolerance = 0.01;   // of the implicit solver: relative residual
  int max_iterations = 200;  // and its limit
  std::uint64_t seed = 1;
  std::optional<SleepParameters> sleep;

  std::vector<Body> bodies;
  // Particles [#particles].
  std::vector<Vec3> rest_position_m;  // placed in the world, at the start of the scene
  std::vector<Vec3> initial_velocity_m_s;
  std::vector<double> mass_kg;        // > 0; carried particles: 0
  std::vector<double> area_m2;        // a third of the incident triangles' area at rest
  std::vector<std::uint8_t> fixed;    // 1: never moves
  std::vector<std::int32_t> body_of;  // index into `bodies`
  // Surface [#triangles], global particle indices.
  std::vector<Triangle> triangles;
  // 1-ring neighbours: those of particle i are neighbours[neighbour_start[i] .. neighbour_start[i +
  // 1]), ascending.
  std::vector<std::int32_t> neighbour_start;  // [#particles + 1]
  std::vector<std::int32_t> neighbours;
  // Triangles at a particle, the same way.
  std::vector<std::int32_t> incident_start;  // [#particles + 1]
  std::vector<std::int32_t> incident;

  // Volume [#tetrahedra], global particle indices; empty in scenes of surfaces.
  std::vector<Tetrahedron> tetrahedra;
  std::vector<double> fill;  // part of it inside the surface, 0..1: scales stiffness and mass
  std::vector<std::int32_t> tet_label;   // label of the image or number in the file; -1: none
  std::vector<std::int32_t> tet_group;   // index into `group_names`; -1: none
  std::vector<std::string> group_names;  // physical groups of mesh files
  std::vector<CarriedParticle> carried;  // ascending by particle

  std::vector<ToolModel> tools;
  std::optional<AdhesiveParameters> adhesive;
  // [#particles] (1 - nu^2) / E of the tissue there, 1/Pa; empty: no effect needs it.
  std::vector<double> compliance_per_pa;
  // The scene that this was made from, with defaults filled in: the effects read their messages
  // here.
  v1::Scene scene;

  int particle_count() const { return static_cast<int>(rest_position_m.size()); }
  // Only these touch: not what is inside, and not the nodes of a lattice that carries a surface,
  // some of which are outside it.
  bool OnSurface(int particle) const {
    return incident_start[particle] < incident_start[particle + 1];
  }
};

}  // namespace adhesim
