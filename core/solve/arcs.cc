#include "core/solve/arcs.h"

#include <Eigen/LU>
#include <algorithm>

#include "core/solve/rigid_group.h"

namespace adhesim {
namespace {

// rad in a step: below it, what is left out is less than rounded positions are.
constexpr double kLeastAngle = 1e-7;
constexpr double kRank = 1e-6;  // of inertias: on a line, nothing can be said of turning about it

}  // namespace

Arcs::Arcs(const Model& model) : model_(model) {
  for (const Body& body : model.bodies) {
    bool free = body.tetrahedron_count > 0 && !body.rigid;
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      free = free && !model.fixed[p];
    }
    of_.push_back({free, false, Vec3::Zero(), Mat3::Zero()});
  }
}

void Arcs::Update(const State& state, double dt_s) {
  widest_rad_ = 0;
  for (std::size_t b = 0; b < of_.size(); ++b) {
    Arc& arc = of_[b];
    arc.turns = false;
    if (!arc.free || state.sleep.Of(static_cast<int>(b))) continue;
    const int first = model_.bodies[b].first_particle;
    const int end = first + model_.bodies[b].particle_count;
    // About the first particle, so that far from the origin nothing is lost.
    const Vec3 &origin = state.position_m[first], &along = state.velocity_m_s[first];
    double mass = 0;
    Vec3 centre = Vec3::Zero(), momentum = Vec3::Zero(), moment = Vec3::Zero();
    Mat3 spread = Mat3::Zero();
    for (int p = first; p < end; ++p) {
      const double m = model_.mass_kg[p];
      const Vec3 r = state.position_m[p] - origin, v = state.velocity_m_s[p] - along;
      mass += m;
      centre += m * r;
      momentum += m * v;
      moment += m * r.cross(v);
      spread += m * r * r.transpose();
    }
    centre /= mass;
    moment -= centre.cross(momentum);
    spread -= mass * centre * centre.transpose();
    const Mat3 inertia = spread.trace() * Mat3::Identity() - spread;
    const double size = inertia.trace() / 3;
    if (!(inertia.determinant() > kRank * size * size * size)) continue;
    const Vec3 w = inertia.inverse() * moment;
    if (!(dt_s * w.norm() > kLeastAngle)) continue;
    arc.turns = true;
    widest_rad_ = std::max(widest_rad_, dt_s * w.norm());
    arc.centre_m = origin + centre;
    arc.bend = (RotationStep(w, dt_s).toRotationMatrix() - Mat3::Identity()) / dt_s;
    arc.bend -= CrossMatrix(w);
  }
}

}  // namespace adhesim
