#pragma once

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "core/solve/implicit_solver.h"
#include "core/solve/ledger.h"
#include "core/solve/subspace_solver.h"

namespace adhesim::test {

// Springs between particles with their exact stiffness: what implicit steps are tested on without
// a scene.
class Springs : public Effect {
 public:
  struct Spring {
    int i, j;
    double stiffness_n_m;
    double damping_n_s_m = 0;
    double length_m = 0;  // 0: a linear spring, force -k (x_i - x_j)
  };
  std::vector<Spring> springs;

  std::string_view name() const override { return "springs"; }
  unsigned force_kinds() const override {
    const bool damped = std::any_of(springs.begin(), springs.end(),
                                    [](const Spring& s) { return s.damping_n_s_m > 0; });
    return damped ? kElastic | kDamping : kElastic;
  }
  double AddForces(const ForceInput& in, const ForceOutput& out) const override {
    double energy_j = 0;
    for (const Spring& s : springs) {
      const Vec3 d = in.position_m[s.i] - in.position_m[s.j];
      const double stretch = d.norm() - s.length_m;
      const Vec3 n = s.length_m > 0 ? Vec3(d / d.norm()) : Vec3::Zero();
      const Vec3 elastic =
          s.length_m > 0 ? Vec3(s.stiffness_n_m * stretch * n) : Vec3(s.stiffness_n_m * d);
      out.elastic[s.i] -= elastic;
      out.elastic[s.j] += elastic;
      energy_j += 0.5 * s.stiffness_n_m * stretch * stretch;
      if (s.damping_n_s_m > 0) {
        const Vec3 damping =
            Direction(s, d) * (s.damping_n_s_m * (in.velocity_m_s[s.i] - in.velocity_m_s[s.j]));
        out.damping[s.i] -= damping;
        out.damping[s.j] += damping;
      }
    }
    return energy_j;
  }
  bool has_stiffness() const override { return true; }
  void AddPairs(BlockMatrix::Pattern* pattern) const override {
    for (const Spring& s : springs) pattern->Add(s.i, s.j);
  }
  void AddStiffness(const ForceInput& in, double stiffness_scale, double damping_scale,
                    BlockMatrix* matrix) const override {
    for (const Spring& s : springs) {
      const Vec3 d = in.position_m[s.i] - in.position_m[s.j];
      Mat3 block = Direction(s, d);
      if (s.length_m > 0) {
        block += std::max(0.0, 1 - s.length_m / d.norm()) * (Mat3::Identity() - block);
      }
      block *= stiffness_scale * s.stiffness_n_m;
      block += damping_scale * s.damping_n_s_m * Direction(s, d);
      matrix->Add(matrix->Slot(s.i, s.i), block);
      matrix->Add(matrix->Slot(s.j, s.j), block);
      matrix->Add(matrix->Slot(s.i, s.j), -block);
      matrix->Add(matrix->Slot(s.j, s.i), -block);
    }
  }

 private:
  static Mat3 Direction(const Spring& s, const Vec3& d) {
    if (s.length_m == 0) return Mat3::Identity();
    return d * d.transpose() / d.squaredNorm();
  }
};

// Particles, springs and zones without a scene, stepped as the pipeline steps them.
class SpringWorld {
 public:
  Model model;
  State state;
  Springs springs;
  Vec3 gravity_m_s2 = Vec3::Zero();
  std::vector<Twist> tool_twist;
  StepReport report;
  std::vector<Wrench> tool_impulse;
  std::unique_ptr<ImplicitSolver> implicit;
  std::unique_ptr<SubspaceSolver> subspace;
  std::unique_ptr<Parallel> parallel = std::make_unique<Parallel>(1);
  std::array<std::vector<Vec3>, kForceKinds> force_n;
  std::vector<Vec3> total_n;

  SpringWorld() {
    model.integrator = Integrator::kImplicit;
    model.tolerance = 1e-12;
    model.max_iterations = 10000;
  }

  int AddParticle(const Vec3& x, const Vec3& v = Vec3::Zero(), double mass_kg = 1,
                  bool fixed = false) {
    model.rest_position_m.push_back(x);
    model.initial_velocity_m_s.push_back(v);
    model.mass_kg.push_back(mass_kg);
    model.area_m2.push_back(1);
    model.fixed.push_back(fixed);
    model.body_of.push_back(0);
    return model.particle_count() - 1;
  }

  // The solvers and the state at the start; nothing may be added afterwards.
  void Start() {
    const std::size_t n = model.rest_position_m.size();
    model.bodies.resize(1);
    model.bodies[0].particle_count = static_cast<int>(n);
    state.position_m = model.rest_position_m;
    state.velocity_m_s = model.initial_velocity_m_s;
    state.velocity_change_m_s.assign(n, Vec3::Zero());
    state.contacts.zone_of.assign(n, -1);
    state.tools.resize(model.tools.size());
    tool_twist.resize(model.tools.size());
    tool_impulse.resize(model.tools.size());
    for (auto& force : force_n) force.assign(n, Vec3::Zero());
    total_n.assign(n, Vec3::Zero());
    subspace = std::make_unique<SubspaceSolver>(model, std::vector<const Effect*>{});
    implicit = std::make_unique<ImplicitSolver>(
        model, std::vector{ImplicitSolver::StiffEffect{&springs, 0}});
    OpenLedgers(model, &state);
  }

  // Makes these zones (ascending members), each held by a tool (or -1): capture by projection.
  void SetZones(const std::vector<std::pair<std::vector<int>, int>>& zones) {
    Contacts& contacts = state.contacts;
    contacts.zones.clear();
    contacts.zone_members.clear();
    std::fill(contacts.zone_of.begin(), contacts.zone_of.end(), -1);
    for (const auto& [members, tool] : zones) {
      Zone& zone = contacts.zones.emplace_back();
      zone.first = static_cast<int>(contacts.zone_members.size());
      zone.count = static_cast<int>(members.size());
      zone.tool = tool;
      for (int p : members) {
        zone.pins += model.fixed[p];
        contacts.zone_members.push_back(p);
        contacts.zone_of[p] = static_cast<int>(contacts.zones.size()) - 1;
      }
    }
    subspace->Capture(&state, tool_impulse);
  }

  void Forces() {
    for (auto& force : force_n) std::fill(force.begin(), force.end(), Vec3::Zero());
    std::vector<Vec3> unused(total_n.size());
    const double energy_j =
        springs.AddForces({state.position_m, state.velocity_m_s, 0, {}, parallel.get()},
                          {force_n[0], unused, {}, {}});
    BookElastic(energy_j, &state);
    for (std::size_t p = 0; p < total_n.size(); ++p) {
      force_n[2][p] = model.mass_kg[p] * gravity_m_s2;
      total_n[p] = force_n[0][p] + force_n[2][p];
    }
  }

  void Solve(double dt_s) {
    Forces();
    const ImplicitSolver::Forces forces{{force_n[0], force_n[1], force_n[2], force_n[3]}, total_n};
    implicit->Begin(state, {}, forces, dt_s, parallel.get());
    subspace->FormGroups(state, tool_twist);
    implicit->Solve(subspace->groups(), dt_s, &state, forces, parallel.get(), &report);
    subspace->Try(state, total_n, dt_s, parallel.get(), &report);
  }

  void Step(double dt_s) {
    Solve(dt_s);
    BookStep(model, {force_n[0], force_n[1], force_n[2], force_n[3]}, total_n, *subspace,
             tool_twist, dt_s, &state, tool_impulse);
    subspace->Accept(&state, dt_s);
    for (std::size_t t = 0; t < state.tools.size(); ++t) {
      state.tools[t].twist = tool_twist[t];
      state.tools[t].pose.position_m += dt_s * tool_twist[t].linear_m_s;
      state.tools[t].pose.orientation =
          (RotationStep(tool_twist[t].angular_rad_s, dt_s) * state.tools[t].pose.orientation)
              .normalized();
    }
    ++state.step;
  }
};

// A cloud of particles joined at random, moving at random; the last four may be fixed.
inline SpringWorld Cloud(bool pins, double damping_n_s_m = 0, double length_m = 0) {
  SpringWorld world;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  for (int p = 0; p < 40; ++p) {
    world.AddParticle(vector(), pins && p >= 36 ? Vec3(0, 0, 0) : vector(),
                      1 + 0.5 * uniform(random), pins && p >= 36);
  }
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 3; ++k) {
      const int j = (i + 1 + static_cast<int>(random() % 38)) % 40;
      world.springs.springs.push_back(
          {i, j, 500 * (1.5 + uniform(random)), damping_n_s_m, length_m});
    }
  }
  return world;
}

}  // namespace adhesim::test
