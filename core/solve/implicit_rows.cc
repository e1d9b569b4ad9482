#include "core/solve/implicit_rows.h"

#include <algorithm>
#include <cmath>

#include "core/model/carried.h"

namespace adhesim {
namespace {

// Less than this share of what its particles would yield if each were alone: nothing can move.
constexpr double kNoMobility = 1e-9;

double Dot(const Vec3& a, const Padded& b) {
  return (a.x() * b.v[0] + a.y() * b.v[1]) + a.z() * b.v[2];
}

}  // namespace

ImplicitRows::ImplicitRows(const Model& model, std::vector<const Effect*> effects)
    : model_(model), effects_(std::move(effects)) {
  for (const Effect* effect : effects_) {
    for (const ConstraintRow& row : effect->constraints()) row_.push_back(row);
  }
  const std::size_t rows = row_.size(), n = model.rest_position_m.size();
  if (rows == 0) return;
  row_of_.assign(n, -1);
  for (std::size_t r = 0; r < rows; ++r) {
    std::fill_n(row_of_.begin() + row_[r].first, row_[r].count, static_cast<std::int32_t>(r));
  }
  gradient_.assign(n, Vec3::Zero());
  scratch_.assign(n, Padded{});
  response_.assign(rows, std::vector<Padded>(n));
  left_.assign(rows, std::vector<Padded>(n));
  mobility_.assign(rows * rows, 0);
  factor_.assign(rows * rows, 0);
  dropped_.assign(rows, 0);
  for (auto* array : {&multiplier_ns_, &start_ns_, &speed_, &change_}) array->assign(rows, 0);
}

void ImplicitRows::Begin(std::span<const Vec3> position_m) {
  for (const Effect* effect : effects_) effect->ConstraintGradients(position_m, {}, gradient_);
  GiveToCarriers(model_, gradient_);
  std::fill(start_ns_.begin(), start_ns_.end(), 0);
}

int ImplicitRows::Respond(double tolerance, int max_iterations, SubspaceSystem* system,
                          Parallel* parallel, StepReport* report) {
  const std::size_t rows = row_.size();
  int iterations = 0;
  for (std::size_t r = 0; r < rows; ++r) {
    const int first = row_[r].first, last = first + row_[r].count;
    std::vector<Padded>&response = response_[r], &left = left_[r];
    std::fill(response.begin(), response.end(), Padded{});
    std::fill(left.begin(), left.end(), Padded{});
    double alone = 0;
    for (int p = first; p < last; ++p) {
      if (system->active(p)) left[p].Set(gradient_[p]);
      alone += gradient_[p].dot(system->inverse_diagonal(p) * gradient_[p]);
    }
    const double start_sq = system->Precondition(left, scratch_, parallel);
    const SubspaceSystem::Result result =
        system->Solve(tolerance * std::sqrt(start_sq), max_iterations, response, left, parallel);
    system->Balance(response, left);
    iterations += result.iterations;
    if (!result.converged) report->bits |= kStepNotConverged;
    dropped_[r] = !(SpeedOf(r, response) > kNoMobility * alone);
  }
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t s = 0; s < rows; ++s) {
      const bool apart = dropped_[r] || dropped_[s];
      mobility_[r * rows + s] = apart ? static_cast<double>(r == s) : SpeedOf(r, response_[s]);
    }
  }
  return iterations;
}

double ImplicitRows::SpeedOf(std::size_t row, std::span<const Padded> velocity_m_s) const {
  double sum = 0;
  for (int p = row_[row].first; p < row_[row].first + row_[row].count; ++p) {
    sum += Dot(gradient_[p], velocity_m_s[p]);
  }
  return sum;
}

// By elimination: the matrix is positive definite but for what solves have left open.
void ImplicitRows::AnswerTo(std::span<const double> speed, std::span<double> answer) {
  const std::size_t rows = row_.size();
  factor_ = mobility_;
  for (std::size_t r = 0; r < rows; ++r) answer[r] = dropped_[r] ? 0 : speed[r];
  for (std::size_t k = 0; k < rows; ++k) {
    for (std::size_t r = k + 1; r < rows; ++r) {
      const double part = factor_[r * rows + k] / factor_[k * rows + k];
      if (part == 0) continue;
      for (std::size_t s = k; s < rows; ++s) factor_[r * rows + s] -= part * factor_[k * rows + s];
      answer[r] -= part * answer[k];
    }
  }
  for (std::size_t k = rows; k-- > 0;) {
    for (std::size_t s = k + 1; s < rows; ++s) answer[k] -= factor_[k * rows + s] * answer[s];
    answer[k] /= factor_[k * rows + k];
  }
}

void ImplicitRows::ResponsesTo(std::span<const Padded> impulse_ns, std::span<double> speed) const {
  for (std::size_t r = 0; r < row_.size(); ++r) {
    speed[r] = 0;
    if (dropped_[r]) continue;
    for (std::size_t p = 0; p < impulse_ns.size(); ++p) {
      speed[r] += Dot(response_[r][p].vec(), impulse_ns[p]);
    }
  }
}

double ImplicitRows::Measure(double dt_s, std::span<Vec3> position_m) {
  Carry(model_, position_m);
  std::size_t first = 0;
  for (const Effect* effect : effects_) {
    const std::size_t count = effect->constraints().size();
    effect->ConstraintResiduals(position_m, {}, std::span(speed_).subspan(first, count));
    first += count;
  }
  double worst = 0;
  for (std::size_t r = 0; r < row_.size(); ++r) {
    const double error = std::abs(speed_[r]) / row_[r].scale;
    if (!dropped_[r] && !(error <= worst)) worst = error;
    speed_[r] /= -dt_s;
  }
  return worst;
}

void ImplicitRows::Advance(std::span<Padded> velocity_m_s, std::span<Padded> left_ns) {
  AnswerTo(speed_, change_);
  AddChange(velocity_m_s, left_ns);
}

void ImplicitRows::GoBack(std::span<Padded> velocity_m_s, std::span<Padded> left_ns) {
  for (double& change : change_) change = -change;
  AddChange(velocity_m_s, left_ns);
}

void ImplicitRows::AddChange(std::span<Padded> velocity_m_s, std::span<Padded> left_ns) {
  for (std::size_t r = 0; r < row_.size(); ++r) {
    if (dropped_[r]) continue;
    multiplier_ns_[r] += change_[r];
    for (std::size_t p = 0; p < velocity_m_s.size(); ++p) {
      for (int k = 0; k < 3; ++k) {
        velocity_m_s[p].v[k] += change_[r] * response_[r][p].v[k];
        left_ns[p].v[k] += change_[r] * left_[r][p].v[k];
      }
    }
  }
}

}  // namespace adhesim
