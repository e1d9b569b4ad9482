// Sliding contacts within an implicit step: an augmented Lagrangian (Simo and Laursen 1992). Each
// direction of a row is a spring of its own beside its multiplier; a law that is none, since it
// ends at Coulomb's limit or pushes only, is taken as the quadratic one that touches it from above
// at the velocities of the last solve. So every solve is symmetric and positive definite:
//   (A + sum_r w_r g_r g_r^T) dx = r + sum_r J_r g_r,
// with a search along dx, since rows close and open on the way.

#include <algorithm>
#include <cmath>

#include "core/solve/contact_rows.h"

namespace adhesim {
namespace {

constexpr double kStiffer = 20;   // a row than what it acts on: multipliers err by less, a turn
constexpr int kMostSolves = 100;  // of one step
// Limits renewed whole so often, and by half from then on: where friction presses what it holds,
// they swing for ever.
constexpr int kWholeLimits = 4;
constexpr double kMissed = 2e-4;  // by rows, of the speeds that they end
constexpr double kLimitMissed = 1e-3;
constexpr double kSolveLeaves = 0.03;  // of what it starts with
constexpr int kSearchAttempts = 60;
constexpr double kFurthest = 256;   // of the way found
constexpr double kSlopeLeft = 0.1;  // of the slope at the start, where a line search ends

// What springs answer to speeds. Where a row slips, friction keeps its size: it answers across its
// direction only.
template <typename Row, typename Law>
Vec3 Answer(const Row& row, const Law& law, const Vec3& speed_m_s) {
  Vec3 answer = law.weight_kg.cwiseProduct(speed_m_s);
  if (!(law.weight_kg(1) < law.most_kg[1])) return answer;
  const Eigen::Vector2d missing = row.rub_speed_m_s +
                                  law.multiplier_ns.template tail<2>() / law.most_kg[1] -
                                  law.speed_m_s.template tail<2>();
  const Eigen::Vector2d along = missing.normalized();
  answer.template tail<2>() -= law.weight_kg(1) * along.dot(speed_m_s.tail<2>()) * along;
  return answer;
}

// Along the row's normal and tangents.
template <typename Row>
Vec3 Along(const Row& row, const Vec3& x) {
  return {row.direction[0].dot(x), row.direction[1].dot(x), row.direction[2].dot(x)};
}

}  // namespace

Mat6 ContactRows::Stiffness(int tool, const State& state, std::span<const RigidGroup> groups,
                            const SubspaceSystem& system) const {
  Mat6 sum = Mat6::Zero();
  for (const Row& row : rows_) {
    if (row.tool != tool) continue;
    const Vec3 arm = row.point_m - state.tools[tool].pose.position_m;
    for (int k = 0; k < 3; ++k) {
      const double answer = Mobility(row, k, state, groups, &system);
      Vec6 gradient;
      gradient << row.direction[k], arm.cross(row.direction[k]);
      if (answer > 0) sum += gradient * gradient.transpose() / answer;
    }
  }
  return sum;
}

void ContactRows::StartLaw(const Row& row, const State& state, const Motion& motion,
                           const Within& within, Law* law) const {
  std::array<double, 3> answer{};
  for (int k = 0; k < 3; ++k) {
    law->speed_m_s(k) = Speed(row, k, state, motion);
    answer[k] = Mobility(row, k, state, motion.groups, within.tissue);
  }
  if (row.tool >= 0) {
    law->speed_m_s -=
        Along(row, within.system->ToolVelocity(row.tool, row.point_m, within.change_m_s));
  }
  const auto most = [](double mobility, double within) {
    return mobility > 0 && within > 0 ? kStiffer / within : 0;
  };
  law->most_kg = {most(row.mobility[0], answer[0]),
                  most(row.mobility[1], std::max(answer[1], answer[2]))};
  law->multiplier_ns = law->impulse_ns = row.impulse;
  law->weight_kg.setZero();
  law->limit_ns = FrictionLimit(row, row.impulse(0));
}

// What Sweep() would make of the multipliers at these speeds, and at the limit of friction given.
Vec3 ContactRows::ImpulseOf(const Row& row, const Law& law, const Vec3& speed_m_s) {
  Vec3 impulse;
  const auto& [normal_kg, tangent_kg] = law.most_kg;
  const double push = law.multiplier_ns(0) + normal_kg * (row.least_speed_m_s - speed_m_s(0));
  const double pull = law.multiplier_ns(0) + normal_kg * (row.most_speed_m_s - speed_m_s(0));
  const double tension = row.touches ? row.tension_ns : 0;
  impulse(0) = push > 0 ? push : std::max(std::min(pull, 0.0), -tension);
  Eigen::Vector2d rub =
      law.multiplier_ns.tail<2>() + tangent_kg * (row.rub_speed_m_s - speed_m_s.tail<2>());
  if (const double size = rub.norm(); size > law.limit_ns) rub *= law.limit_ns / size;
  impulse.tail<2>() = rub;
  return impulse;
}

// The springs that change impulses as the laws do at these speeds: none beyond what the adhesive
// holds.
void ContactRows::Linearise(const Row& row, Law* law) {
  const auto& [normal_kg, tangent_kg] = law->most_kg;
  const double tension = row.touches ? row.tension_ns : 0;
  const bool holds =
      law->impulse_ns(0) > 0 || (law->impulse_ns(0) < 0 && law->impulse_ns(0) > -tension);
  law->weight_kg << (holds ? normal_kg : 0), 0, 0;
  if (!(tangent_kg > 0)) return;
  const double missing =
      (row.rub_speed_m_s + law->multiplier_ns.tail<2>() / tangent_kg - law->speed_m_s.tail<2>())
          .norm();
  const bool slips = tangent_kg * missing > law->limit_ns;
  law->weight_kg.tail<2>().setConstant(slips ? law->limit_ns / missing : tangent_kg);
}

// Impulses from the laws as they are; the residual follows.
void ContactRows::Renew(const Within& within) {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    Law& law = laws_[r];
    const Vec3 impulse = ImpulseOf(rows_[r], law, law.speed_m_s);
    AddTo(within.residual_ns, rows_[r], impulse - law.impulse_ns, *within.system);
    law.impulse_ns = impulse;
  }
}

int ContactRows::MeetWithin(const State& state, const Motion& motion, const Within& within) {
  laws_.clear();
  for (const Row& row : rows_) {
    StartLaw(row, state, motion, within, &laws_.emplace_back());
  }
  Renew(within);
  ended_sq_ = std::max(ended_sq_, MissedSq());
  return MeetFurther(state, within);
}

int ContactRows::MeetFurther(const State& state, const Within& within) {
  int iterations = 0, renewals = 0;
  for (int solve = 0;; ++solve) {
    const double left = Norm(within), impulses = ImpulseNorm();
    const bool solved = left <= std::max(within.target, within.tolerance * impulses);
    if (solved) {
      if (MissedSq() <= kMissed * kMissed * ended_sq_ && LimitsMissed() <= kLimitMissed) break;
      const double part = renewals < kWholeLimits ? 1 : 0.5;
      for (std::size_t r = 0; r < rows_.size(); ++r) {
        laws_[r].multiplier_ns = laws_[r].impulse_ns;
        const double limit_ns = FrictionLimit(rows_[r], laws_[r].impulse_ns(0));
        laws_[r].limit_ns += part * (limit_ns - laws_[r].limit_ns);
      }
      ++renewals;
      Renew(within);
    }
    if (solve == kMostSolves || !std::isfinite(left)) {
      if (!solved) within.report->bits |= kStepNotConverged;
      break;
    }
    for (std::size_t r = 0; r < rows_.size(); ++r) Linearise(rows_[r], &laws_[r]);
    iterations += SolveLaws(within);
    SearchAlong(within);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Vec3& impulse = laws_[r].impulse_ns;
    for (int k = 0; k < 3; ++k)
      Apply(rows_[r], k, impulse(k) - rows_[r].impulse(k), state, nullptr);
    rows_[r].impulse = impulse;
  }
  return iterations;
}

void ContactRows::KeepAsStart() {
  started_.clear();
  for (const Row& row : rows_) started_.push_back({row.particle, row.tool, row.impulse});
  started_ended_sq_ = ended_sq_;
}

void ContactRows::StartAsKept(const State& state) {
  ended_sq_ = started_ended_sq_;
  for (std::size_t r = 0; r < std::min(rows_.size(), started_.size()); ++r) {
    const Started& started = started_[r];
    Row& row = rows_[r];
    if (started.particle != row.particle || started.tool != row.tool) continue;
    row.impulse = started.impulse;
    for (int k = 0; k < 3; ++k) Apply(row, k, row.impulse(k), state, nullptr);
  }
}

double ContactRows::Norm(const Within& within) {
  return std::sqrt(within.system->Precondition(within.residual_ns, step_, within.parallel));
}

// Of all impulses together, in the preconditioner's norm.
double ContactRows::ImpulseNorm() const {
  double sum = 0;
  for (const Law& law : laws_) {
    for (int k = 0; k < 3; ++k) {
      const double most_kg = law.most_kg[k > 0];
      if (most_kg > 0) sum += law.impulse_ns(k) * law.impulse_ns(k) * kStiffer / most_kg;
    }
  }
  return std::sqrt(sum);
}

// By friction's limits of what normal impulses make them, relative, of all rows.
double ContactRows::LimitsMissed() const {
  double missed = 0, sum = 0;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double limit_ns = FrictionLimit(rows_[r], laws_[r].impulse_ns(0));
    missed += std::abs(limit_ns - laws_[r].limit_ns);
    sum += limit_ns;
  }
  return sum > 0 ? missed / sum : 0;
}

// What springs beside the multipliers still end, of all rows: (m/s)^2.
double ContactRows::MissedSq() const {
  double sum = 0;
  for (const Law& law : laws_) {
    for (int k = 0; k < 3; ++k) {
      const double most_kg = law.most_kg[k > 0];
      if (!(most_kg > 0)) continue;
      const double missed = (law.impulse_ns(k) - law.multiplier_ns(k)) / most_kg;
      sum += missed * missed;
    }
  }
  return sum;
}

// Conjugate gradients, as SubspaceSystem::Solve(), with the rows' springs in the matrix: the way
// from the unknown, what is left, and what the way does to the rows' speeds.
int ContactRows::SolveLaws(const Within& within) {
  const RowSystem& system = *within.system;
  const std::size_t n = within.change_m_s.size();
  std::copy(within.residual_ns.begin(), within.residual_ns.end(), left_ns_.begin());
  std::fill(way_m_s_.begin(), way_m_s_.end(), Padded{});
  for (Law& law : laws_) law.way_m_s.setZero();
  double rz = system.Precondition(left_ns_, step_, within.parallel), beta = 0;
  const double target = kSolveLeaves * std::sqrt(rz);
  int iteration = 0;
  for (; rz > target * target; ++iteration) {
    for (std::size_t p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) {
        direction_[p].v[k] = step_[p].v[k] + (iteration > 0 ? beta * direction_[p].v[k] : 0);
      }
    }
    const double curvature = Multiply(within);
    if (iteration == within.max_iterations || !(curvature > 0) || !std::isfinite(curvature)) break;
    const double alpha = rz / curvature;
    for (std::size_t p = 0; p < n; ++p) {
      for (int k = 0; k < 3; ++k) {
        way_m_s_[p].v[k] += alpha * direction_[p].v[k];
        left_ns_[p].v[k] -= alpha * product_[p].v[k];
      }
    }
    for (Law& law : laws_) law.way_m_s += alpha * law.along_m_s;
    const double next = system.Precondition(left_ns_, step_, within.parallel);
    beta = next / rz;
    rz = next;
  }
  return iteration;
}

// Goes along the way that was found until laws and matrix balance: all of it, where rows neither
// close nor open on it; further, where what slips was taken for stiffer than it turns out. What is
// minimised along it is convex (friction's limits do not change), so that its slope is enough. r =
// (1 - t) r_0 + t r_left + sum (J(t) - J(0) + t w way) g.
void ContactRows::SearchAlong(const Within& within) {
  const std::size_t n = within.change_m_s.size();
  double start = 0, curvature = 0;
  for (std::size_t p = 0; p < n; ++p) {
    const Vec3 way = way_m_s_[p].vec(), residual = within.residual_ns[p].vec();
    start += way.dot(residual);
    curvature += way.dot(residual - left_ns_[p].vec());
  }
  for (std::size_t r = 0; r < rows_.size(); ++r)
    curvature -= laws_[r].way_m_s.dot(Answer(rows_[r], laws_[r], laws_[r].way_m_s));
  const auto descent = [&](double part) {  // minus the slope
    double sum = start - part * curvature;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      const Law& law = laws_[r];
      sum += (ImpulseOf(rows_[r], law, law.speed_m_s + part * law.way_m_s) - law.impulse_ns)
                 .dot(law.way_m_s);
    }
    return sum;
  };
  double near = 0, near_descent = start, far = 1, far_descent = descent(1);
  while (far_descent > kSlopeLeft * start && far < kFurthest) {
    near = far;
    near_descent = far_descent;
    far *= 4;
    far_descent = descent(far);
  }
  double part = far;
  for (int attempt = 0; attempt < kSearchAttempts && far_descent < -kSlopeLeft * start; ++attempt) {
    part = near + std::clamp(near_descent / (near_descent - far_descent), 0.1, 0.9) * (far - near);
    const double now = descent(part);
    if (std::abs(now) <= kSlopeLeft * start) break;
    (now > 0 ? near : far) = part;
    (now > 0 ? near_descent : far_descent) = now;
  }
  for (std::size_t p = 0; p < n; ++p) {
    for (int k = 0; k < 3; ++k) {
      double& residual = within.residual_ns[p].v[k];
      within.change_m_s[p].v[k] += part * way_m_s_[p].v[k];
      residual += part * (left_ns_[p].v[k] - residual);
    }
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    Law& law = laws_[r];
    const Vec3 answer = Answer(rows_[r], law, law.way_m_s);
    law.speed_m_s += part * law.way_m_s;
    const Vec3 impulse = ImpulseOf(rows_[r], law, law.speed_m_s);
    AddTo(within.residual_ns, rows_[r], impulse - law.impulse_ns + part * answer, *within.system);
    law.impulse_ns = impulse;
  }
}

// product = (A + sum of w g g^T) direction; returns direction.product.
double ContactRows::Multiply(const Within& within) {
  double sum = within.system->Multiply(direction_, product_, within.parallel);
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    Law& law = laws_[r];
    law.along_m_s.setZero();
    for (int i = 0; i < kNodes; ++i) {
      const Vec3 velocity = Moved(rows_[r].particle[i]);
      for (int k = 0; k < 3; ++k) law.along_m_s(k) += rows_[r].gradient[k][i].dot(velocity);
    }
    if (rows_[r].tool >= 0) {
      law.along_m_s -=
          Along(rows_[r], within.system->ToolVelocity(rows_[r].tool, rows_[r].point_m, direction_));
    }
    const Vec3 impulse = Answer(rows_[r], law, law.along_m_s);
    AddTo(product_, rows_[r], impulse, *within.system);
    sum += impulse.dot(law.along_m_s);
  }
  return sum;
}

Vec3 ContactRows::Moved(int p) const {
  const CarriedParticle* carried = carried_.Find(p);
  if (!carried) return direction_[p].vec();
  Vec3 sum = Vec3::Zero();
  for (int k = 0; k < 4; ++k) sum += carried->weights[k] * direction_[carried->carriers[k]].vec();
  return sum;
}

void ContactRows::AddTo(std::span<Padded> to, const Row& row, const Vec3& impulse,
                        const RowSystem& system) const {
  const auto give = [&](int p, const Vec3& share) { system.Push(p, share, to); };
  for (int i = 0; i < kNodes; ++i) {
    const Vec3 share = impulse(0) * row.gradient[0][i] + impulse(1) * row.gradient[1][i] +
                       impulse(2) * row.gradient[2][i];
    if (const CarriedParticle* carried = carried_.Find(row.particle[i])) {
      for (int k = 0; k < 4; ++k) give(carried->carriers[k], carried->weights[k] * share);
    } else {
      give(row.particle[i], share);
    }
  }
  if (row.tool < 0) return;
  const Vec3 all =
      impulse(0) * row.direction[0] + impulse(1) * row.direction[1] + impulse(2) * row.direction[2];
  system.PushTool(row.tool, row.point_m, -all, to);
}

}  // namespace adhesim
