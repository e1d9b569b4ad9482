#include "core/solve/tool_system.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

// A row's spring against what its particles would yield if each were alone.
constexpr double kRowStiffness = 1e8;
// Of what a row's particles would yield: less is nothing.
constexpr double kNothingFree = 1e-9;

}  // namespace

ToolSystem::ToolSystem(const Model& model, std::size_t rows)
    : model_(model), tools_(model.tools.size()), rows_(rows) {
  for (auto* array : {&change_m_s_, &residual_ns_, &direction_, &product_, &step_}) {
    array->assign(model.rest_position_m.size(), Padded{});
  }
  if (rows > 0) position_m_ = model.rest_position_m;
  for (Tool& tool : tools_) tool.gradient.assign(rows, Vec6::Zero());
}

template <typename Row>
Vec6 ToolSystem::SumOverMembers(const Tool& tool, const Row& row) const {
  const Contacts& contacts = state_->contacts;
  const Zone& zone = contacts.zones[tool.zone];
  const Vec3& tip = state_->tools[zone.tool].pose.position_m;
  Vec6 sum = Vec6::Zero();
  for (int k = zone.first; k < zone.first + zone.count; ++k) {
    const int p = contacts.zone_members[k];
    if (model_.fixed[p] || !(model_.mass_kg[p] > 0)) continue;
    const Vec3 r = row(p);
    sum.head<3>() += r;
    sum.tail<3>() += (state_->position_m[p] - tip).cross(r);
  }
  return sum;
}

void ToolSystem::SetMembers(const Tool& tool, const Vec6& twist, std::span<Padded> x) const {
  const Contacts& contacts = state_->contacts;
  const Zone& zone = contacts.zones[tool.zone];
  const Vec3& tip = state_->tools[zone.tool].pose.position_m;
  for (int k = zone.first; k < zone.first + zone.count; ++k) {
    const int p = contacts.zone_members[k];
    if (model_.fixed[p] || !(model_.mass_kg[p] > 0)) continue;
    x[p].Set(twist.head<3>() + Vec3(twist.tail<3>()).cross(state_->position_m[p] - tip));
  }
}

void ToolSystem::MakeRows(std::span<const RigidGroup> groups, double dt_s) {
  if (rows_.empty()) return;
  ImplicitRows& rows = solver_->rows();
  position_m_ = state_->position_m;
  rows.Measure(dt_s, position_m_);
  SubspaceSystem& system = solver_->system();
  system.SetZones(*state_, groups);
  for (std::size_t r = 0; r < rows.count(); ++r) {
    const ConstraintRow& row = rows.row(r);
    double alone = 0, free = 0, speed = 0;
    for (int p = row.first; p < row.first + row.count; ++p) {
      const Vec3& g = rows.gradient(p);
      if (model_.fixed[p] || !(model_.mass_kg[p] > 0)) continue;
      const double yields = g.dot(system.inverse_diagonal(p) * g);
      alone += yields;
      if (system.active(p)) free += yields;
      speed += g.dot(state_->velocity_m_s[p]);
    }
    const bool covered = alone > 0 && free <= kNothingFree * alone;
    // What has grown, as by a tool that tilts, is taken back at once.
    const double lacks = std::min(rows.MissingSpeed(r), 0.0) - speed;
    rows_[r] = covered ? Spring{kRowStiffness / alone, lacks} : Spring{};
  }
}

Vec6 ToolSystem::GradientOf(const Tool& tool, std::size_t row) const {
  const ImplicitRows& rows = solver_->rows();
  const ConstraintRow& range = rows.row(row);
  return SumOverMembers(tool, [&](int p) -> Vec3 {
    const bool inside = p >= range.first && p < range.first + range.count;
    return inside ? rows.gradient(p) : Vec3(Vec3::Zero());
  });
}

// g.v of tools' motions: of a covered row nothing else moves.
double ToolSystem::RowSpeed(std::size_t row, Vec6 Tool::*motion) const {
  double sum = 0;
  for (const Tool& tool : tools_) {
    if (tool.zone >= 0) sum += tool.gradient[row].dot(tool.*motion);
  }
  return sum;
}

bool ToolSystem::Begin(const State& state, std::span<const RigidGroup> groups,
                       std::span<const Mat6> own, double dt_s, ImplicitSolver* solver,
                       Parallel* parallel) {
  solver_ = solver;
  state_ = &state;
  for (Tool& tool : tools_) tool.zone = -1;
  for (std::size_t z = 0; z < state.contacts.zones.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    if (zone.tool >= 0 && !zone.holds_sleepers) tools_[zone.tool].zone = static_cast<int>(z);
  }
  const SubspaceSystem& system = solver->system();
  MakeRows(groups, dt_s);
  bool stiff = false;
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    Tool& tool = tools_[t];
    if (tool.zone < 0) continue;
    tool.members = system.BlockOf(state, tool.zone, state.tools[t].pose.position_m);
    Mat6 mass;
    for (int k = 0; k < 6; ++k) {
      SetMembers(tool, Vec6::Unit(k), direction_);
      mass.col(k) = SumOverMembers(
          tool, [&](int p) -> Vec3 { return model_.mass_kg[p] * direction_[p].vec(); });
    }
    Mat6 spare = own[t] + 2 * mass - tool.members;  // the stiffness is members - mass
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      tool.gradient[r] = GradientOf(tool, r);
      const Mat6 square = tool.gradient[r] * tool.gradient[r].transpose();
      tool.members += rows_[r].stiffness * square;
      spare -= rows_[r].stiffness * square;
    }
    stiff = stiff || Eigen::LLT<Mat6>(spare).info() != Eigen::Success;
  }
  if (!stiff) return false;
  pushed_ = false;
  solver->StartResidual(groups, dt_s, state, parallel, residual_ns_);
  std::fill(change_m_s_.begin(), change_m_s_.end(), Padded{});
  for (Tool& tool : tools_) {
    tool.law = {};
    tool.change.setZero();
    if (tool.zone < 0) continue;
    tool.residual = SumOverMembers(tool, [&](int p) { return residual_ns_[p].vec(); });
  }
  return true;
}

double ToolSystem::Precondition(Parallel* parallel) {
  double norm_sq = solver_->system().Precondition(residual_ns_, step_, parallel);
  for (Tool& tool : tools_) {
    if (tool.zone < 0) continue;
    tool.step = tool.inverse * tool.residual;
    SetMembers(tool, tool.step, step_);
    norm_sq += tool.step.dot(tool.residual);
  }
  return norm_sq;
}

// product = matrix direction; returns direction.product.
double ToolSystem::Multiply(Parallel* parallel) {
  const SubspaceSystem& system = solver_->system();
  double sum = system.Multiply(direction_, product_, parallel);
  for (Tool& tool : tools_) {
    if (tool.zone < 0) continue;
    tool.product = tool.law.matrix * tool.direction +
                   SumOverMembers(tool, [&](int p) { return system.MultiplyRow(p, direction_); });
    sum += tool.direction.dot(tool.product);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double speed = RowSpeed(r, &Tool::direction);
    const double push = rows_[r].stiffness * speed;
    for (Tool& tool : tools_) {
      if (tool.zone >= 0) tool.product += push * tool.gradient[r];
    }
    sum += push * speed;
  }
  return sum;
}

void ToolSystem::Solve(std::span<const Law> laws, StepReport* report, Parallel* parallel) {
  const int n = model_.particle_count();
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    Tool& tool = tools_[t];
    if (tool.zone < 0) continue;
    tool.residual +=
        (laws[t].impulse - tool.law.impulse) - (laws[t].matrix - tool.law.matrix) * tool.change;
    tool.law = laws[t];
    tool.inverse = (tool.members + tool.law.matrix).llt().solve(Mat6::Identity());
  }
  const auto add = [n](double factor, std::span<const Padded> to, std::span<Padded> x) {
    for (int p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) x[p].v[k] += factor * to[p].v[k];
    }
  };
  double rz = Precondition(parallel), beta = 0;
  const double target = solver_->Target(std::sqrt(rz));  // of forces, not of springs
  if (!pushed_) {
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      for (Tool& tool : tools_) {
        if (tool.zone < 0) continue;
        tool.residual += rows_[r].stiffness * rows_[r].lacks * tool.gradient[r];
      }
    }
    pushed_ = true;
    rz = Precondition(parallel);
  }
  for (int iteration = 0; rz > target * target; ++iteration) {
    for (int p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) {
        direction_[p].v[k] = step_[p].v[k] + (iteration > 0 ? beta * direction_[p].v[k] : 0);
      }
    }
    for (Tool& tool : tools_) {
      if (tool.zone < 0) continue;
      tool.direction = tool.step + (iteration > 0 ? Vec6(beta * tool.direction) : Vec6::Zero());
    }
    const double curvature = Multiply(parallel);
    if (iteration == model_.max_iterations || !(curvature > 0) || !std::isfinite(curvature)) {
      report->bits |= kStepNotConverged;
      break;
    }
    const double alpha = rz / curvature;
    add(alpha, direction_, change_m_s_);
    add(-alpha, product_, residual_ns_);
    for (Tool& tool : tools_) {
      if (tool.zone < 0) continue;
      tool.change += alpha * tool.direction;
      tool.residual -= alpha * tool.product;
    }
    const double next = Precondition(parallel);
    beta = next / rz;
    rz = next;
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double lacks = rows_[r].lacks - RowSpeed(r, &Tool::change);
    solver_->rows().SetStart(r, rows_[r].stiffness * lacks);
  }
}

}  // namespace adhesim
