#include "core/solve/subspace_system.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>

namespace adhesim {
namespace {

// GCC's vectors, as in core/effects/shape_memory/cluster_batch.cc: they never cross a call.
#pragma GCC diagnostic ignored "-Wpsabi"
#define ADHESIM_INLINE __attribute__((always_inline)) static inline

constexpr int kChunk = 256;       // particles of one partial sum
constexpr int kRowGrain = 4;      // chunks that are worth a thread: about 20 us of rows
constexpr int kVectorGrain = 16;  // and of plain vector work

typedef double V4 __attribute__((vector_size(32)));
typedef std::int64_t Mask4 __attribute__((vector_size(32)));

ADHESIM_INLINE V4 Load(const double* from) {
  V4 v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}
ADHESIM_INLINE void Store(const V4& v, double* to) { std::memcpy(to, &v, sizeof(v)); }
// The fourth lane of a block's column is the next column's first number.
ADHESIM_INLINE V4 Only3(const V4& v) { return (V4)((Mask4)v & Mask4{-1, -1, -1, 0}); }

// A block times a vector; lane 3 is rubbish.
ADHESIM_INLINE V4 Times(const double* block, const double* x) {
  return (Load(block) * x[0] + Load(block + 3) * x[1]) + Load(block + 6) * x[2];
}

// Three chains of sums, so that additions need not wait for each other.
ADHESIM_INLINE V4 RowTimes(const double* values, const std::int32_t* column, int begin, int end,
                           const Padded* x) {
  V4 sum0{}, sum1{}, sum2{};
  for (int k = begin; k < end; ++k) {
    const double* block = values + 9 * static_cast<std::size_t>(k);
    const double* xj = x[column[k]].v;
    sum0 += Load(block) * xj[0];
    sum1 += Load(block + 3) * xj[1];
    sum2 += Load(block + 6) * xj[2];
  }
  return Only3((sum0 + sum1) + sum2);
}

ADHESIM_INLINE double SumLanes(const V4& v) {
  double lane[4];
  Store(v, lane);
  return (lane[0] + lane[1]) + lane[2];
}

}  // namespace

SubspaceSystem::SubspaceSystem(const Model& model, const BlockMatrix& matrix)
    : model_(model), matrix_(matrix) {
  const std::size_t n = model.rest_position_m.size();
  inverse_diagonal_.assign(n + 1, Mat3::Zero());
  active_.assign(n, 0);
  free_.assign(n, 0);
  loose_.assign(n, 0);
  joined_ = DisjointSets(model.bodies.size());
  component_.assign(model.bodies.size(), 0);
  stiffness_sum_.assign(model.bodies.size(), Mat3::Zero());
  balance_.assign(model.bodies.size(), Vec3::Zero());
  wholes_.resize(model.bodies.size());
  zones_.reserve(n);
  chunk_sum_.assign((n + kChunk - 1) / kChunk, 0);
  for (auto* array : {&p_, &ap_, &z_}) array->assign(n, Padded{});
}

void SubspaceSystem::InvertDiagonal(Parallel* parallel) {
  parallel->For(model_.particle_count(), kChunk, [&](int begin, int end) {
    for (int p = begin; p < end; ++p) {
      if (!(model_.mass_kg[p] > 0)) continue;  // carried: no row of its own
      const Mat3& block = matrix_.At(matrix_.Slot(p, p));
      const Mat3 inverse = (0.5 * (block + block.transpose())).inverse();
      inverse_diagonal_[p] = 0.5 * (inverse + inverse.transpose());
    }
  });
}

Mat6 SubspaceSystem::BlockOf(const State& state, int zone, const Vec3& pivot_m) const {
  const Zone& held = state.contacts.zones[zone];
  const auto moves = [&](int p) { return !model_.fixed[p] && model_.mass_kg[p] > 0; };
  const auto motions = [&](int p) {  // [3 x 6]
    Eigen::Matrix<double, 3, 6> j;
    j << Mat3::Identity(), -CrossMatrix(state.position_m[p] - pivot_m);
    return j;
  };
  Mat6 whole = Mat6::Zero();
  for (int m = held.first; m < held.first + held.count; ++m) {
    const int p = state.contacts.zone_members[m];
    if (!moves(p)) continue;
    Eigen::Matrix<double, 3, 6> row = Eigen::Matrix<double, 3, 6>::Zero();
    for (int k = matrix_.row_start()[p]; k < matrix_.row_start()[p + 1]; ++k) {
      const int q = matrix_.column()[k];
      if (state.contacts.zone_of[q] == zone && moves(q)) row += matrix_.At(k) * motions(q);
    }
    whole += motions(p).transpose() * row;
  }
  return 0.5 * (whole + whole.transpose());
}

// Of the twists that the group leaves, in a basis whose rotations are scaled to the translations.
Mat6 SubspaceSystem::InverseOf(const RigidGroup& group, const State& state, int zone) const {
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> basis(6, 0);
  const auto add = [&](const Vec3& linear, const Vec3& angular) {
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.col(basis.cols() - 1) << linear, angular;
  };
  if (group.freedom == RigidGroup::Freedom::kFree) {
    for (int k = 0; k < 3; ++k) add(Vec3::Unit(k), Vec3::Zero());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(group.inverse_inertia);
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.eigenvalues()(k);
    if (value > 1e-14 * eigen.eigenvalues()(2)) {
      add(Vec3::Zero(), std::sqrt(value * group.mass_kg) * eigen.eigenvectors().col(k));
    }
  }
  const Mat6 whole = BlockOf(state, zone, group.pivot_m);
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6> small =
      basis.transpose() * whole * basis;
  const Eigen::LLT<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>>
      factor(small);
  const Mat6 inverse = basis * factor.solve(basis.transpose());
  return 0.5 * (inverse + inverse.transpose());
}

void SubspaceSystem::SetZones(const State& state, std::span<const RigidGroup> groups) {
  members_ = state.contacts.zone_members;
  contacts_zones_ = state.contacts.zones;
  position_m_ = state.position_m;
  for (int p = 0; p < model_.particle_count(); ++p) {
    const int zone = state.contacts.zone_of[p];
    const bool held = zone >= 0 && (groups[zone].freedom == RigidGroup::Freedom::kDriven ||
                                    groups[zone].freedom == RigidGroup::Freedom::kLocked);
    active_[p] = !model_.fixed[p] && model_.mass_kg[p] > 0 && !held;
    free_[p] = active_[p] && zone < 0;
  }
  zones_.clear();
  for (int z = 0; z < static_cast<int>(groups.size()); ++z) {
    const RigidGroup& group = groups[z];
    // Without mass: corners that are carried and stick in another patch than what carries them.
    if (group.freedom == RigidGroup::Freedom::kDriven ||
        group.freedom == RigidGroup::Freedom::kLocked || !(group.mass_kg > 0)) {
      continue;
    }
    zones_.push_back({z, group.pivot_m, InverseOf(group, state, z)});
  }
  FindLoose(state, groups);
}

Twist SubspaceSystem::Response(int zone, const Vec3& impulse, const Vec3& moment) const {
  const auto at = std::lower_bound(zones_.begin(), zones_.end(), zone,
                                   [](const ZoneInverse& z, int id) { return z.zone < id; });
  if (at == zones_.end() || at->zone != zone) return {};
  Vec6 wrench;
  wrench << impulse, moment;
  const Vec6 twist = at->inverse * wrench;
  return {twist.head<3>(), twist.tail<3>()};
}

double SubspaceSystem::SumChunks() const {
  double sum = 0;
  for (double part : chunk_sum_) sum += part;
  return sum;
}

double SubspaceSystem::Multiply(std::span<const Padded> x, std::span<Padded> y,
                                Parallel* parallel) const {
  const int n = model_.particle_count();
  parallel->VectorFor(static_cast<int>(chunk_sum_.size()), kRowGrain, [&](int first, int last) {
    const std::int32_t *start = matrix_.row_start().data(), *column = matrix_.column().data();
    const double* values = matrix_.values();
    for (int chunk = first; chunk < last; ++chunk) {
      V4 dot{};
      for (int p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
        if (!active_[p]) {
          y[p] = Padded{};
          continue;
        }
        const V4 row = RowTimes(values, column, start[p], start[p + 1], x.data());
        Store(row, y[p].v);
        dot += row * Load(x[p].v);
      }
      chunk_sum_[chunk] = SumLanes(dot);
    }
  });
  return SumChunks();
}

Vec3 SubspaceSystem::MultiplyRow(int row, std::span<const Padded> x) const {
  Vec3 sum = Vec3::Zero();
  for (int k = matrix_.row_start()[row]; k < matrix_.row_start()[row + 1]; ++k) {
    sum += matrix_.At(k) * x[matrix_.column()[k]].vec();
  }
  return sum;
}

void SubspaceSystem::SubtractHeld(std::span<const Padded> x, std::span<Padded> y) const {
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (active_[p] || (x[p].v[0] == 0 && x[p].v[1] == 0 && x[p].v[2] == 0)) continue;
    for (int k = matrix_.row_start()[p]; k < matrix_.row_start()[p + 1]; ++k) {
      const int q = matrix_.column()[k];
      if (active_[q]) y[q].Set(y[q].vec() - matrix_.At(k).transpose() * x[p].vec());
    }
  }
}

// Members get their zone's answer, and the zone's share of r.z goes to the first chunk.
void SubspaceSystem::PreconditionZones(std::span<const Padded> r, std::span<Padded> z,
                                       double* chunk_sums) const {
  for (const ZoneInverse& zone : zones_) {
    const auto members =
        members_.subspan(contacts_zones_[zone.zone].first, contacts_zones_[zone.zone].count);
    Vec6 sum = Vec6::Zero();
    for (int p : members) {
      if (!active_[p]) continue;
      const Vec3 force = r[p].vec();
      sum.head<3>() += force;
      sum.tail<3>() += (position_m_[p] - zone.pivot_m).cross(force);
    }
    const Vec6 twist = zone.inverse * sum;
    for (int p : members) {
      if (!active_[p]) continue;
      z[p].Set(twist.head<3>() + Vec3(twist.tail<3>()).cross(position_m_[p] - zone.pivot_m));
    }
    chunk_sums[0] += sum.dot(twist);
  }
}

double SubspaceSystem::Precondition(std::span<const Padded> r, std::span<Padded> z,
                                    Parallel* parallel) const {
  const int n = model_.particle_count();
  parallel->VectorFor(static_cast<int>(chunk_sum_.size()), kVectorGrain, [&](int first, int last) {
    for (int chunk = first; chunk < last; ++chunk) {
      V4 dot{};
      for (int p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
        V4 zp{};
        if (free_[p]) zp = Only3(Times(inverse_diagonal_[p].data(), r[p].v));
        Store(zp, z[p].v);
        dot += zp * Load(r[p].v);
      }
      chunk_sum_[chunk] = SumLanes(dot);
    }
  });
  PreconditionZones(r, z, chunk_sum_.data());
  return SumChunks();
}

double SubspaceSystem::Advance(double alpha, std::span<Padded> x, std::span<Padded> r,
                               Parallel* parallel) {
  const int n = model_.particle_count();
  parallel->VectorFor(static_cast<int>(chunk_sum_.size()), kVectorGrain, [&](int first, int last) {
    for (int chunk = first; chunk < last; ++chunk) {
      V4 dot{};
      for (int p = chunk * kChunk; p < std::min(n, (chunk + 1) * kChunk); ++p) {
        Store(Load(x[p].v) + alpha * Load(p_[p].v), x[p].v);
        const V4 rp = Load(r[p].v) - alpha * Load(ap_[p].v);
        Store(rp, r[p].v);
        V4 zp{};
        if (free_[p]) zp = Only3(Times(inverse_diagonal_[p].data(), r[p].v));
        Store(zp, z_[p].v);
        dot += zp * rp;
      }
      chunk_sum_[chunk] = SumLanes(dot);
    }
  });
  PreconditionZones(r, z_, chunk_sum_.data());
  return SumChunks();
}

SubspaceSystem::Result SubspaceSystem::Solve(double target, int max_iterations, std::span<Padded> x,
                                             std::span<Padded> r, Parallel* parallel) {
  const int n = model_.particle_count();
  Result result;
  double rz = Precondition(r, z_, parallel);
  std::copy(z_.begin(), z_.end(), p_.begin());
  for (; rz > target * target; ++result.iterations) {
    if (result.iterations == max_iterations) {
      result.converged = false;
      break;
    }
    const double curvature = Multiply(p_, ap_, parallel);
    if (!(curvature > 0) || !std::isfinite(curvature)) {
      result.converged = false;
      break;
    }
    const double next = Advance(rz / curvature, x, r, parallel);
    const double beta = next / rz;
    parallel->VectorFor(n, kVectorGrain * kChunk, [&](int begin, int end) {
      for (int p = begin; p < end; ++p) Store(Load(z_[p].v) + beta * Load(p_[p].v), p_[p].v);
    });
    rz = next;
  }
  if (!std::isfinite(rz)) result.converged = false;
  result.residual_sq = rz;
  return result;
}

void SubspaceSystem::Project(const State& state, std::span<const RigidGroup> groups,
                             std::span<Padded> velocity) const {
  for (int p = 0; p < model_.particle_count(); ++p) {
    if (!active_[p]) velocity[p] = Padded{};
  }
  for (const ZoneInverse& zone : zones_) {
    const RigidGroup& group = groups[zone.zone];
    const auto members =
        members_.subspan(contacts_zones_[zone.zone].first, contacts_zones_[zone.zone].count);
    Vec3 momentum = Vec3::Zero(), moment = Vec3::Zero();
    for (int p : members) {
      const Vec3 share = model_.mass_kg[p] * velocity[p].vec();
      momentum += share;
      moment += (state.position_m[p] - group.pivot_m).cross(share);
    }
    const Twist twist = group.Response(momentum, moment);
    for (int p : members) {
      if (!active_[p]) continue;
      velocity[p].Set(twist.linear_m_s +
                      twist.angular_rad_s.cross(state.position_m[p] - group.pivot_m));
    }
  }
}

double SubspaceSystem::DiagonalNormSq(std::span<const Vec3> f) const {
  double sum = 0;
  for (int p = 0; p < model_.particle_count(); ++p) sum += f[p].dot(inverse_diagonal_[p] * f[p]);
  return sum;
}

}  // namespace adhesim
