#include "core/effects/elasticity/elasticity.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/model/polar.h"
#include "core/model/tissue.h"

namespace adhesim {
namespace {

constexpr int kBatchGrain = 64;  // batches: about 15 us of work
constexpr int kParticleGrain = 512;

// Angle [rad] by which a tetrahedron may have turned before its stiffness turns along (decision
// 20).
constexpr double kLag = 0.001;

// |F - R| at which a tetrahedron that was inside out has its shape again: the two laws then differ
// by about this part of its energy and force.
constexpr double kRecoveredStrain = 0.05;
// |F - R| from which one recovers with those it touches. Without this, tetrahedra of positive
// volume held scrambled blocks in a tangle (decision 12).
constexpr double kSpreadStrain = 0.25;

// Largest singular value of lambda p q^T + mu (q p^T + (p . q) I). In the plane of p and q, whose
// bisectors are its axes, this is a matrix (a b; -b d); across it, mu p . q.
double BlockNorm(const Vec3& p, const Vec3& q, double lambda, double mu) {
  const double size = p.norm() * q.norm();
  if (!(size > 0)) return 0;
  const double cosine = std::clamp(p.dot(q) / size, -1.0, 1.0);
  const double a = (lambda + mu) * (1 + cosine) / 2 + mu * cosine;
  const double d = -(lambda + mu) * (1 - cosine) / 2 + mu * cosine;
  const double b = (mu - lambda) * std::sqrt(1 - cosine * cosine) / 2;
  const double sum = a * a + d * d + 2 * b * b;
  const double difference = std::hypot(a * a - d * d, 2 * b * (a - d));
  return size * std::max(mu * std::abs(cosine), std::sqrt((sum + difference) / 2));
}

}  // namespace

ElasticityEffect::ElasticityEffect(const Model& model, const v1::Elasticity& message)
    : damping_s_(message.stiffness_damping_s()),
      neo_hookean_(message.model() == v1::ELASTIC_MODEL_NEO_HOOKEAN) {
  std::vector<std::int32_t> tetrahedra;
  for (const std::int32_t t : TetrahedraOf(message, model)) {
    const Tetrahedron& tet = model.tetrahedra[t];
    const bool moves =
        std::any_of(tet.begin(), tet.end(), [&](std::int32_t p) { return !model.fixed[p]; });
    if (moves && model.fill[t] > 0) tetrahedra.push_back(t);
  }
  tet_count_ = static_cast<int>(tetrahedra.size());
  if (tet_count_ > 0) body_ = model.body_of[model.tetrahedra[tetrahedra[0]][0]];
  lags_ = !neo_hookean_ && damping_s_ == 0 && model.integrator == Integrator::kImplicit;
  MakeBatches(model, message, tetrahedra);
  FindEdges();
  ListCorners();
  energy_j_.resize(batch_.size());
  if (neo_hookean_) recovers_.resize(model.particle_count());
  elastic_n_.resize(4 * tet_count_);
  if (damping_s_ > 0) damping_n_.resize(4 * tet_count_);
}

void ElasticityEffect::MakeBatches(const Model& model, const v1::Elasticity& message,
                                   std::span<const std::int32_t> tetrahedra) {
  batch_.resize((tet_count_ + kLanes - 1) / kLanes);
  for (int k = 0; k < static_cast<int>(batch_.size()) * kLanes; ++k) {
    TetBatch& batch = batch_[k / kLanes];
    const int lane = k % kLanes;
    const bool idle = k >= tet_count_;
    const std::int32_t t = tetrahedra[idle ? k - lane : k];
    Tetrahedron tet = model.tetrahedra[t];
    std::sort(tet.begin(), tet.end());
    Mat3 sides;
    for (int a = 0; a < 3; ++a) {
      sides.col(a) = model.rest_position_m[tet[a + 1]] - model.rest_position_m[tet[0]];
    }
    const Mat3 inverse = sides.inverse();
    for (int a = 0; a < 4; ++a) batch.particle[a][lane] = tet[a];
    for (int a = 0; a < 3; ++a) SetLane(inverse.row(a), lane, &batch.gradient_1_m[a]);
    const double volume_m3 = idle ? 0 : std::abs(sides.determinant()) / 6 * model.fill[t];
    const Material material = MaterialOf(message, model, t);
    batch.shear_j.v[lane] = volume_m3 * material.mu();
    batch.lame_j.v[lane] = volume_m3 * material.lambda();
  }
}

void ElasticityEffect::FindEdges() {
  static constexpr int kPairs[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  const auto before = [](const Edge& a, const Edge& b) {
    return std::pair(a.low, a.high) < std::pair(b.low, b.high);
  };
  const auto edge_of = [&](const TetBatch& batch, int pair, int lane) {
    return Edge{batch.particle[kPairs[pair][0]][lane], batch.particle[kPairs[pair][1]][lane]};
  };
  for (const TetBatch& batch : batch_) {
    for (int pair = 0; pair < 6; ++pair) {
      for (int lane = 0; lane < kLanes; ++lane) edge_.push_back(edge_of(batch, pair, lane));
    }
  }
  std::sort(edge_.begin(), edge_.end(), before);
  edge_.erase(
      std::unique(edge_.begin(), edge_.end(),
                  [](const Edge& a, const Edge& b) { return a.low == b.low && a.high == b.high; }),
      edge_.end());
  edge_.shrink_to_fit();
  for (TetBatch& batch : batch_) {
    batch.first_edge = static_cast<int>(edge_.size());
    for (int pair = 0; pair < 6; ++pair) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const auto at =
            std::lower_bound(edge_.begin(), edge_.end(), edge_of(batch, pair, lane), before);
        const auto e = static_cast<std::int32_t>(at - edge_.begin());
        batch.edge[pair][lane] = e;
        batch.first_edge = std::min(batch.first_edge, e);
        batch.end_edge = std::max(batch.end_edge, e + 1);
      }
    }
  }
}

void ElasticityEffect::ListCorners() {
  std::vector<std::pair<std::int32_t, std::int32_t>> corners;  // (particle, corner)
  for (int t = 0; t < tet_count_; ++t) {
    for (int a = 0; a < 4; ++a) {
      corners.emplace_back(batch_[t / kLanes].particle[a][t % kLanes], 4 * t + a);
    }
  }
  std::sort(corners.begin(), corners.end());
  for (const auto& [particle, corner] : corners) {
    if (particle_.empty() || particle_.back() != particle) {
      particle_.push_back(particle);
      corner_start_.push_back(static_cast<std::int32_t>(corner_.size()));
    }
    corner_.push_back(corner);
  }
  corner_start_.push_back(static_cast<std::int32_t>(corner_.size()));
}

void ElasticityEffect::InitialState(std::span<double> state) const {
  const bool turns = !neo_hookean_;
  for (std::size_t k = 0; k < state.size(); ++k) {
    state[k] = turns && (k / kLanes) % 4 == 3 ? 1 : 0;
  }
}

// Gershgorin: no eigenvalue of M^-1 K exceeds the largest sum of a row's block norms over its mass.
// Those of a sum of tetrahedra are at most the sums of theirs, and turning one changes none. Of the
// state at rest: strain of the order of 1 can exceed it.
void ElasticityEffect::AddBounds(std::span<double> stiffness_n_m,
                                 std::span<double> damping_n_s_m) const {
  for (int t = 0; t < tet_count_; ++t) {
    const TetBatch& batch = batch_[t / kLanes];
    const int lane = t % kLanes;
    const std::array<Vec3, 4> b = GradientsOf(batch, lane);
    for (int i = 0; i < 4; ++i) {
      double row_n_m = 0;
      for (int j = 0; j < 4; ++j) {
        row_n_m += BlockNorm(b[i], b[j], batch.lame_j.v[lane], batch.shear_j.v[lane]);
      }
      stiffness_n_m[batch.particle[i][lane]] += row_n_m;
      damping_n_s_m[batch.particle[i][lane]] += damping_s_ * row_n_m;
    }
  }
}

double ElasticityEffect::AddForces(const ForceInput& in, const ForceOutput& out) const {
  if (body_ >= 0 && in.Sleeps(body_)) return 0;
  if (neo_hookean_ && !in.trial) SpreadRecovery(in);
  const bool damped = damping_s_ > 0;
  const bool alone = in.parallel->threads() == 1;
  in.parallel->For(static_cast<int>(batch_.size()), kBatchGrain, [&](int begin, int end) {
    TetForces forces;
    for (int b = begin; b < end; ++b) {
      EvaluateBatch(b, in, &forces);
      energy_j_[b] = forces.energy_j;
      for (int lane = 0; lane < LanesOf(b); ++lane) {
        for (int a = 0; a < 4; ++a) {
          // One thread adds in the order in which several sum below: the same bits.
          const int corner = 4 * (b * kLanes + lane) + a, p = batch_[b].particle[a][lane];
          if (alone) {
            out.elastic[p] += LaneOf(forces.elastic_n[a], lane);
            if (damped) out.damping[p] += LaneOf(forces.damping_n[a], lane);
          } else {
            elastic_n_[corner] = LaneOf(forces.elastic_n[a], lane);
            if (damped) damping_n_[corner] = LaneOf(forces.damping_n[a], lane);
          }
        }
      }
    }
  });
  if (!alone) {
    in.parallel->For(static_cast<int>(particle_.size()), kParticleGrain, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) {
        for (int c = corner_start_[k]; c < corner_start_[k + 1]; ++c) {
          out.elastic[particle_[k]] += elastic_n_[corner_[c]];
          if (damped) out.damping[particle_[k]] += damping_n_[corner_[c]];
        }
      }
    });
  }
  Lanes sum;
  for (const Lanes& energy : energy_j_) {
    for (int lane = 0; lane < kLanes; ++lane) sum.v[lane] += energy.v[lane];
  }
  double total = 0;
  for (const double energy : sum.v) total += energy;
  return total;
}

void ElasticityEffect::EvaluateBatch(int b, const ForceInput& in, TetForces* forces) const {
  const TetBatch& batch = batch_[b];
  const Simd simd = in.parallel->simd();
  if (neo_hookean_) {
    EvaluateNeoHookean(b, in, forces);
  } else {
    EvaluateCorotational(b, in, forces);
  }
  if (damping_s_ > 0) {
    DampingForces(simd, batch, in.position_m, in.velocity_m_s, damping_s_, forces);
  }
}

// What touches a tetrahedron that recovers, and is strained itself, recovers with it: it could hold
// the other in a tangle.
void ElasticityEffect::SpreadRecovery(const ForceInput& in) const {
  const auto does = [](double recovers) { return recovers != 0; };
  if (std::none_of(in.effect_state.begin(), in.effect_state.end(), does)) return;
  std::fill(recovers_.begin(), recovers_.end(), 0);
  for (int t = 0; t < tet_count_; ++t) {
    if (in.effect_state[t] == 0) continue;
    for (const auto& corner : batch_[t / kLanes].particle) recovers_[corner[t % kLanes]] = 1;
  }
  for (int t = 0; t < tet_count_; ++t) {
    const TetBatch& batch = batch_[t / kLanes];
    const int lane = t % kLanes;
    const bool touches = std::any_of(std::begin(batch.particle), std::end(batch.particle),
                                     [&](const auto& corner) { return recovers_[corner[lane]]; });
    if (touches && StrainSq(batch, lane, in.position_m) > kSpreadStrain * kSpreadStrain) {
      in.effect_state[t] = 1;
    }
  }
}

void ElasticityEffect::EvaluateNeoHookean(int b, const ForceInput& in, TetForces* forces) const {
  const TetBatch& batch = batch_[b];
  double* recovers = &in.effect_state[kLanes * b];
  const unsigned crushed = NeoHookeanForces(in.parallel->simd(), batch, in.position_m, forces);
  for (int lane = 0; lane < kLanes; ++lane) {
    const bool is_crushed = crushed & (1u << lane);
    if (is_crushed && !in.trial && IsInsideOut(batch, lane, in.position_m)) recovers[lane] = 1;
    if (recovers[lane] != 0) {
      const TetForces law = *forces;
      const double strain_sq = SetRecoveryForces(batch, lane, in.position_m, forces);
      if (in.trial || strain_sq > kRecoveredStrain * kRecoveredStrain) continue;
      recovers[lane] = 0;
      *forces = law;
    } else if (is_crushed) {
      AddCollapseForces(batch, lane, in.position_m, forces);
    }
  }
}

void ElasticityEffect::EvaluateCorotational(int b, const ForceInput& in, TetForces* forces) const {
  const TetBatch& batch = batch_[b];
  const Simd simd = in.parallel->simd();
  double* stored = &in.effect_state[numbers_a_lane() * kLanes * b];
  TetRotations rotation;
  std::memcpy(static_cast<void*>(rotation), stored, sizeof(rotation));
  const unsigned failed = CorotationalForces(simd, batch, in.position_m, rotation, forces);
  if (failed != 0) {
    // Inverted, flat or tumbling: start afresh where the maximum is, and go on from there.
    for (int lane = 0; lane < kLanes; ++lane) {
      if (!(failed & (1u << lane))) continue;
      const Quat guess =
          Quat(rotation[3].v[lane], rotation[0].v[lane], rotation[1].v[lane], rotation[2].v[lane])
              .normalized();
      const Quat best = PolarRotation(DeformationGradient(batch, lane, in.position_m), guess);
      for (int k = 0; k < 4; ++k) rotation[k].v[lane] = best.coeffs()(k);
    }
    CorotationalForces(simd, batch, in.position_m, rotation, forces);
  }
  std::memcpy(stored, rotation, sizeof(rotation));
  if (!lags_ || in.trial) return;
  const double* lagging = stored + 4 * kLanes;
  double least = 1;  // (q . q_lag)^2 = cos^2 of half the angle
  for (int lane = 0; lane < kLanes; ++lane) {
    double dot = 0;
    for (int k = 0; k < 4; ++k) dot += rotation[k].v[lane] * lagging[k * kLanes + lane];
    least = std::min(least, dot * dot);
  }
  if (!(least >= 1 - 0.25 * kLag * kLag)) {
    std::memcpy(stored + 4 * kLanes, rotation, sizeof(rotation));
  }
}

// A tetrahedron's energy belongs to its corners in equal parts.
void ElasticityEffect::AddEnergies(std::span<double> energy_j) const {
  for (int t = 0; t < tet_count_; ++t) {
    for (int a = 0; a < 4; ++a) {
      energy_j[batch_[t / kLanes].particle[a][t % kLanes]] +=
          0.25 * energy_j_[t / kLanes].v[t % kLanes];
    }
  }
}

}  // namespace adhesim
