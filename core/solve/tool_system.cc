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
    array->assign(model.rest_position_m.size() + 2 * tools_.size(), Padded{});
  }
  if (rows > 0) position_m_ = model.rest_position_m;
  for (Tool& tool : tools_) tool.gradient.assign(rows, Vec6::Zero());
}

Vec6 ToolSystem::Of(int tool, std::span<const Padded> x) const {
  const std::size_t at = model_.rest_position_m.size() + 2 * static_cast<std::size_t>(tool);
  Vec6 both;
  both << x[at].vec(), x[at + 1].vec();
  return both;
}

void ToolSystem::Add(int tool, const Vec6& change, std::span<Padded> x) const {
  const std::size_t at = model_.rest_position_m.size() + 2 * static_cast<std::size_t>(tool);
  x[at].Set(x[at].vec() + change.head<3>());
  x[at + 1].Set(x[at + 1].vec() + change.tail<3>());
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
double ToolSystem::RowSpeed(std::size_t row, std::span<const Padded> x) const {
  double sum = 0;
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    if (tools_[t].zone >= 0) sum += tools_[t].gradient[row].dot(Of(static_cast<int>(t), x));
  }
  return sum;
}

bool ToolSystem::Begin(const State& state, std::span<const RigidGroup> groups,
                       std::span<const Mat6> own, double dt_s, ImplicitSolver* solver,
                       Parallel* parallel, const SlidingContacts& slides) {
  solver_ = solver;
  state_ = &state;
  groups_ = groups;
  slides_ = slides.rows && slides.rows->possible() ? slides.rows : nullptr;
  slides_met_ = false;
  for (Tool& tool : tools_) {
    tool.zone = -1;
    tool.slides = false;
  }
  for (std::size_t z = 0; z < state.contacts.zones.size(); ++z) {
    const Zone& zone = state.contacts.zones[z];
    if (zone.tool >= 0 && !zone.holds_sleepers) tools_[zone.tool].zone = static_cast<int>(z);
  }
  SubspaceSystem& system = solver->system();
  MakeRows(groups, dt_s);
  if (slides_) {
    system.SetZones(state, groups);
    slides_->ForgetStart();
    ContactRows::Tools still = slides.tools;
    still.coming = still.before;
    slides_->Collect(state, solver->MotionAt(change_m_s_, groups, state), still, dt_s, true);
    slides_->ForEachOnTool(
        [this](const ContactRows::OnTool& on) { tools_[on.tool].slides = true; });
  }
  bool stiff = false;
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    Tool& tool = tools_[t];
    if (!has(static_cast<int>(t))) continue;
    tool.members.setZero();
    Mat6 spare = own[t];
    if (tool.slides) spare -= slides_->Stiffness(static_cast<int>(t), state, groups, system);
    if (tool.zone >= 0) {
      tool.members = system.BlockOf(state, tool.zone, state.tools[t].pose.position_m);
      Mat6 mass;
      for (int k = 0; k < 6; ++k) {
        SetMembers(tool, Vec6::Unit(k), direction_);
        mass.col(k) = SumOverMembers(
            tool, [&](int p) -> Vec3 { return model_.mass_kg[p] * direction_[p].vec(); });
      }
      spare += 2 * mass - tool.members;  // the stiffness is members - mass
    }
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      tool.gradient[r] = tool.zone >= 0 ? GradientOf(tool, r) : Vec6::Zero();
      const Mat6 square = tool.gradient[r] * tool.gradient[r].transpose();
      tool.members += rows_[r].stiffness * square;
      spare -= rows_[r].stiffness * square;
    }
    stiff = stiff || Eigen::LLT<Mat6>(spare).info() != Eigen::Success;
  }
  if (!stiff) return false;
  pushed_ = false;
  std::fill(change_m_s_.begin(), change_m_s_.end(), Padded{});
  std::fill(residual_ns_.begin(), residual_ns_.end(), Padded{});
  solver->StartResidual(groups, dt_s, state, parallel, residual_ns_);
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    Tool& tool = tools_[t];
    tool.law = {};
    if (tool.zone < 0) continue;
    const Vec6 sum = SumOverMembers(tool, [&](int p) { return residual_ns_[p].vec(); });
    Add(static_cast<int>(t), sum, residual_ns_);
    SetMembers(tool, Vec6::Zero(), residual_ns_);  // the tool has it
  }
  return true;
}

double ToolSystem::Precondition(std::span<const Padded> r, std::span<Padded> z,
                                Parallel* parallel) const {
  double norm_sq = solver_->system().Precondition(r, z, parallel);
  std::fill(z.begin() + model_.particle_count(), z.end(), Padded{});
  for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
    if (!has(t)) continue;
    const Vec6 residual = Of(t, r), step = tools_[t].inverse * residual;
    Add(t, step, z);
    if (tools_[t].zone >= 0) SetMembers(tools_[t], step, z);
    norm_sq += step.dot(residual);
  }
  return norm_sq;
}

double ToolSystem::Multiply(std::span<const Padded> x, std::span<Padded> y,
                            Parallel* parallel) const {
  const SubspaceSystem& system = solver_->system();
  double sum = system.Multiply(x, y, parallel);
  std::fill(y.begin() + model_.particle_count(), y.end(), Padded{});
  for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
    if (!has(t)) continue;
    const Tool& tool = tools_[t];
    const Vec6 twist = Of(t, x);
    Vec6 product = tool.law.matrix * twist;
    if (tool.zone >= 0) {
      product += SumOverMembers(tool, [&](int p) { return system.MultiplyRow(p, x); });
    }
    Add(t, product, y);
    sum += twist.dot(product);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double speed = RowSpeed(r, x);
    const double push = rows_[r].stiffness * speed;
    for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
      if (tools_[t].zone >= 0) Add(t, push * tools_[t].gradient[r], y);
    }
    sum += push * speed;
  }
  return sum;
}

void ToolSystem::Push(int p, const Vec3& impulse_ns, std::span<Padded> r) const {
  solver_->system().Push(p, impulse_ns, r);
  const int zone = state_->contacts.zone_of[p];
  const int tool = zone >= 0 && !model_.fixed[p] ? state_->contacts.zones[zone].tool : -1;
  if (tool >= 0 && tools_[tool].zone == zone) PushTool(tool, state_->position_m[p], impulse_ns, r);
}

void ToolSystem::PushTool(int tool, const Vec3& point_m, const Vec3& impulse_ns,
                          std::span<Padded> r) const {
  Vec6 wrench;
  wrench << impulse_ns, (point_m - state_->tools[tool].pose.position_m).cross(impulse_ns);
  Add(tool, wrench, r);
}

Vec3 ToolSystem::ToolVelocity(int tool, const Vec3& point_m, std::span<const Padded> x) const {
  const Vec6 twist = Of(tool, x);
  return twist.head<3>() +
         Vec3(twist.tail<3>()).cross(point_m - state_->tools[tool].pose.position_m);
}

void ToolSystem::Solve(std::span<const Law> laws, StepReport* report, Parallel* parallel) {
  for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
    if (!has(t)) continue;
    Tool& tool = tools_[t];
    Add(t, (laws[t].impulse - tool.law.impulse) - (laws[t].matrix - tool.law.matrix) * change(t),
        residual_ns_);
    tool.law = laws[t];
    tool.inverse = (tool.members + tool.law.matrix).llt().solve(Mat6::Identity());
  }
  if (!slides_met_) {
    double rz = Precondition(residual_ns_, step_, parallel);
    const double target = solver_->Target(std::sqrt(rz));  // of forces, not of springs
    if (!pushed_) {
      for (std::size_t r = 0; r < rows_.size(); ++r) {
        for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
          if (tools_[t].zone < 0) continue;
          Add(t, rows_[r].stiffness * rows_[r].lacks * tools_[t].gradient[r], residual_ns_);
        }
      }
      pushed_ = true;
      rz = Precondition(residual_ns_, step_, parallel);
    }
    Iterate(target, rz, report, parallel);
  }
  MeetSlides(report, parallel);
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double lacks = rows_[r].lacks - RowSpeed(r, change_m_s_);
    solver_->rows().SetStart(r, rows_[r].stiffness * lacks);
  }
}

void ToolSystem::Iterate(double target, double rz, StepReport* report, Parallel* parallel) {
  const std::size_t n = change_m_s_.size();
  double beta = 0;
  for (int iteration = 0; rz > target * target; ++iteration) {
    for (std::size_t p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) {
        direction_[p].v[k] = step_[p].v[k] + (iteration > 0 ? beta * direction_[p].v[k] : 0);
      }
    }
    const double curvature = Multiply(direction_, product_, parallel);
    if (iteration == model_.max_iterations || !(curvature > 0) || !std::isfinite(curvature)) {
      report->bits |= kStepNotConverged;
      break;
    }
    const double alpha = rz / curvature;
    for (std::size_t p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) {
        change_m_s_[p].v[k] += alpha * direction_[p].v[k];
        residual_ns_[p].v[k] -= alpha * product_[p].v[k];
      }
    }
    const double next = Precondition(residual_ns_, step_, parallel);
    beta = next / rz;
    rz = next;
  }
}

void ToolSystem::MeetSlides(StepReport* report, Parallel* parallel) {
  if (!slides_ || slides_->empty()) return;
  const ContactRows::Within within{this,
                                   &solver_->system(),
                                   change_m_s_,
                                   residual_ns_,
                                   solver_->Target(0),
                                   solver_->tolerance(),
                                   model_.max_iterations,
                                   parallel,
                                   report};
  if (slides_met_) {
    slides_->MeetFurther(*state_, within);
  } else {
    const ContactRows::Motion motion = solver_->MotionAt(change_m_s_, groups_, *state_);
    for (int t = 0; t < static_cast<int>(tools_.size()); ++t) {
      if (tools_[t].zone < 0) continue;
      Twist& twist = motion.groups[tools_[t].zone].twist;
      twist.linear_m_s += change(t).head<3>();
      twist.angular_rad_s += change(t).tail<3>();
    }
    slides_->MeetWithin(*state_, motion, within);
    slides_met_ = true;
  }
  slides_->KeepAsStart();
}

}  // namespace adhesim
