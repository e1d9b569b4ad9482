#include "core/solve/force_error.h"

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

constexpr double kConverged = 1e-3;  // a column needs no better residual, relative
constexpr double kWiden = 3;         // c above: measured, see docs/decisions/0011-implicit-step.md
constexpr int kLeastIterations = 2;  // of the column whose turn it is
constexpr int kShare = 4;            // and one for so many of the solve

}  // namespace

ForceError::ForceError(const Model& model, std::size_t rows)
    : model_(model), row_speed_(rows), row_answer_(rows) {
  const std::size_t n = model.rest_position_m.size();
  columns_.resize(kColumns * model.tools.size());
  for (Column& column : columns_) {
    column.w.assign(n, Padded{});
    column.row_speed.assign(rows, 0);
  }
  members_.assign(model.tools.size(), 0);
  bars_.resize(model.tools.size());
  motion_.assign(n, Padded{});
  lacking_.assign(n, Padded{});
}

void ForceError::Forget() {
  std::fill(members_.begin(), members_.end(), 0);
  std::fill(bars_.begin(), bars_.end(), Bar{});
  next_ = 0;
}

// Of all zones, since the subspace is everyone's; 0 when the tool holds nothing.
std::uint64_t ForceError::MembersOf(const State& state, int tool) const {
  std::uint64_t hash = 1;
  bool holds = false;
  for (const Zone& zone : state.contacts.zones) {
    holds = holds || zone.tool == tool;
    hash = hash * 0x9e3779b97f4a7c15ull + static_cast<std::uint64_t>(zone.count);
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const auto member = static_cast<std::uint64_t>(state.contacts.zone_members[k]);
      hash = (hash ^ member) * 0x9e3779b97f4a7c15ull;
    }
  }
  return holds ? hash | 1 : 0;
}

void ForceError::Update(const State& state, std::span<const RigidGroup> groups, double dt_s,
                        ImplicitSolver* solver, Parallel* parallel) {
  SubspaceSystem& system = solver->system();
  const int iterations = kLeastIterations + solver->iterations() / kShare;
  int held = 0;
  for (int tool = 0; tool < static_cast<int>(bars_.size()); ++tool) {
    const std::uint64_t members = MembersOf(state, tool);
    if (members == 0) {
      members_[tool] = 0;
      bars_[tool] = {};
      continue;
    }
    ++held;
    if (members == members_[tool]) continue;
    // Other members: what the columns were is where they go on from.
    for (int k = 0; k < kColumns; ++k) {
      Column& column = ColumnOf(tool, k);
      if (members_[tool] == 0) std::fill(column.w.begin(), column.w.end(), Padded{});
      system.Project(state, groups, column.w);
      Renew(state, groups, tool, k, 0, &system, parallel);
    }
    members_[tool] = members;
  }
  if (held == 0) return;
  do {
    next_ = (next_ + 1) % static_cast<int>(columns_.size());
  } while (members_[next_ / kColumns] == 0);
  Renew(state, groups, next_ / kColumns, next_ % kColumns, iterations, &system, parallel);

  ImplicitRows& rows = solver->rows();
  if (!rows.empty()) {
    rows.ResponsesTo(solver->residual_ns(), row_speed_);
    rows.AnswerTo(row_speed_, row_answer_);
  }
  const double left = kWiden * std::sqrt(solver->residual_sq());
  for (int tool = 0; tool < static_cast<int>(bars_.size()); ++tool) {
    if (members_[tool] == 0) continue;
    Bar& bar = bars_[tool];
    double error_sq[2] = {0, 0};
    if (!rows.empty()) MeasureRows(state, groups, tool, rows);
    for (int k = 0; k < kColumns; ++k) {
      const Column& column = ColumnOf(tool, k);
      double seen = 0;
      for (std::size_t r = 0; r < rows.count(); ++r) seen += column.row_speed[r] * row_answer_[r];
      for (std::size_t p = 0; p < column.w.size(); ++p) {
        for (int c = 0; c < 3; ++c) seen += column.w[p].v[c] * solver->residual_ns()[p].v[c];
      }
      const double error = (std::abs(seen) + left * std::sqrt(column.lacking_sq)) / dt_s;
      error_sq[k / 3] += error * error;
      if (k < 3) bar.stiffness_n_m.col(k) = -column.force_ns / (dt_s * dt_s);
    }
    if (!rows.empty()) AddRowStiffness(tool, dt_s, &rows, &bar);
    bar.known = true;
    bar.force_n = std::sqrt(error_sq[0]);
    bar.torque_nm = std::sqrt(error_sq[1]);
  }
}

// Visits (zone, particle) of all that the tool moves.
template <typename Visit>
void ForceError::ForEachMember(const State& state, int tool, const Visit& visit) const {
  for (std::size_t z = 0; z < state.contacts.zones.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    if (zone.tool != tool) continue;
    for (int i = zone.first; i < zone.first + zone.count; ++i) {
      const int p = state.contacts.zone_members[i];
      if (!model_.fixed[p]) visit(z, p);
    }
  }
}

// motion_: the tool's members move by unit k, all else by its column.
void ForceError::SetMotion(const State& state, std::span<const RigidGroup> groups, int tool,
                           int k) {
  const std::vector<Padded>& w = ColumnOf(tool, k).w;
  for (std::size_t p = 0; p < motion_.size(); ++p) {
    for (int c = 0; c < 3; ++c) motion_[p].v[c] = -w[p].v[c];
  }
  ForEachMember(state, tool, [&](std::size_t zone, int p) {
    const Vec3 unit = Vec3::Unit(k % 3);
    motion_[p].Set(k < 3 ? unit : Vec3(unit.cross(state.position_m[p] - groups[zone].pivot_m)));
  });
}

// What a tool's unit motions do to the rows when everything follows by its columns.
void ForceError::MeasureRows(const State& state, std::span<const RigidGroup> groups, int tool,
                             const ImplicitRows& rows) {
  for (int k = 0; k < kColumns; ++k) {
    SetMotion(state, groups, tool, k);
    std::vector<double>& speed = ColumnOf(tool, k).row_speed;
    for (std::size_t r = 0; r < rows.count(); ++r) speed[r] = rows.SpeedOf(r, motion_);
  }
}

// Rows that hold answer such motions by their own impulses.
void ForceError::AddRowStiffness(int tool, double dt_s, ImplicitRows* rows, Bar* bar) {
  for (int k = 0; k < 3; ++k) {
    rows->AnswerTo(ColumnOf(tool, k).row_speed, row_speed_);
    for (int j = 0; j < 3; ++j) {
      const std::vector<double>& speed = ColumnOf(tool, j).row_speed;
      for (std::size_t r = 0; r < rows->count(); ++r)
        bar->stiffness_n_m(j, k) -= speed[r] * row_speed_[r] / (dt_s * dt_s);
    }
  }
}

// What column k lacks now, after some more iterations, and the force that goes with it.
void ForceError::Renew(const State& state, std::span<const RigidGroup> groups, int tool, int k,
                       int iterations, SubspaceSystem* system, Parallel* parallel) {
  Column& column = ColumnOf(tool, k);
  SetMotion(state, groups, tool, k);
  system->Multiply(motion_, lacking_, parallel);
  double size_sq = 0;  // (J e_k)^T A_cc J e_k bounds w.A w
  ForEachMember(state, tool, [&](std::size_t, int p) {
    const Mat3& inverse = system->inverse_diagonal(p);
    if (inverse.trace() > 0) size_sq += motion_[p].vec().squaredNorm() / (inverse.trace() / 3);
  });
  column.lacking_sq =
      system->Solve(kConverged * std::sqrt(size_sq), iterations, column.w, lacking_, parallel)
          .residual_sq;
  if (k >= 3) return;
  SetMotion(state, groups, tool, k);
  column.force_ns.setZero();
  ForEachMember(state, tool, [&](std::size_t, int p) {
    column.force_ns += system->MultiplyRow(p, motion_) - model_.mass_kg[p] * motion_[p].vec();
  });
}

}  // namespace adhesim
