#include "core/effects/shape_memory/centre_form.h"

#include <Eigen/Eigenvalues>

#include "core/effects/registry.h"
#include "core/model/polar.h"

namespace adhesim {
namespace {

constexpr int kGrain = 512;  // clusters: about 50 us of work

}  // namespace

CentreForm::CentreForm(const Model& model, const v1::ShapeMemory& message)
    : model_(model),
      stiffness_n_m_(message.stiffness_n_m()),
      damping_n_s_m_(message.damping_n_s_m()) {
  const std::vector<int> bodies = SelectBodies(model, message.bodies(), [](const Body& b) {
    return !b.rigid && !b.all_fixed && b.tetrahedron_count == 0;
  });
  cluster_start_.push_back(0);
  for (int b : bodies) {
    const Body& body = model.bodies[b];
    for (int i = 0; i < body.particle_count; ++i) AddCluster(model, body.first_particle + i);
  }

  std::vector<int> count(model.particle_count() + 1, 0);
  for (int p : member_) ++count[p];
  entry_start_.push_back(0);
  std::vector<int> slot(model.particle_count(), -1);
  for (int p = 0; p < model.particle_count(); ++p) {
    if (count[p] == 0) continue;
    slot[p] = static_cast<int>(particle_.size());
    particle_.push_back(p);
    entry_start_.push_back(entry_start_.back() + count[p]);
  }
  entry_.resize(member_.size());
  std::vector<int> next(entry_start_.begin(), entry_start_.end() - 1);
  for (int e = 0; e < static_cast<int>(member_.size()); ++e) entry_[next[slot[member_[e]]]++] = e;

  entry_force_n_.resize(member_.size());
  if (damping_n_s_m_ > 0) entry_damping_n_.resize(member_.size());
  energy_j_.resize(cluster_count());
}

void CentreForm::AddCluster(const Model& model, int particle) {
  const int begin = cluster_start_.back();
  bool moves = !model.fixed[particle];
  for (int n = model.neighbour_start[particle]; n < model.neighbour_start[particle + 1]; ++n) {
    moves = moves || !model.fixed[model.neighbours[n]];
  }
  if (!moves) return;
  member_.push_back(particle);
  for (int n = model.neighbour_start[particle]; n < model.neighbour_start[particle + 1]; ++n) {
    member_.push_back(model.neighbours[n]);
  }
  const int end = static_cast<int>(member_.size());
  const int averaged = begin + 1;
  Vec3 mean = Vec3::Zero();
  for (int e = averaged; e < end; ++e) mean += model.rest_position_m[member_[e]];
  mean /= std::max(1, end - averaged);
  for (int e = begin; e < end; ++e)
    rest_offset_.push_back(model.rest_position_m[member_[e]] - mean);
  cluster_start_.push_back(end);
}

void CentreForm::InitialState(std::span<double> state) const {
  for (int c = 0; c < cluster_count(); ++c) Eigen::Map<Quat>(&state[4 * c]).setIdentity();
}

void CentreForm::AddBounds(std::span<double> stiffness_n_m, std::span<double> damping_n_s_m) const {
  // |x_i - C - R q|^2 <= 2 |x_i|^2 + 2 |C|^2, doubled once more for the rotation's part.
  for (int c = 0; c < cluster_count(); ++c) {
    const int begin = cluster_start_[c], end = cluster_start_[c + 1];
    const double weight = 1.0 / (end - begin);
    for (int e = begin; e < end; ++e) {
      const double centre_weight = e == begin ? 2.0 : 4.0 / std::max(1, end - begin - 1);
      stiffness_n_m[member_[e]] += stiffness_n_m_ * centre_weight;
      damping_n_s_m[member_[e]] += damping_n_s_m_ * weight;
    }
  }
}

double CentreForm::AddForces(const ForceInput& in, const ForceOutput& out) const {
  in.parallel->For(cluster_count(), kGrain, [&](int begin, int end) {
    for (int c = begin; c < end; ++c) {
      if (!Sleeps(c, in)) EvaluateCluster(c, in);
    }
  });
  in.parallel->For(static_cast<int>(particle_.size()), 4 * kGrain, [&](int begin, int end) {
    for (int p = begin; p < end; ++p) {
      if (in.Sleeps(model_.body_of[particle_[p]])) continue;
      Vec3 elastic = Vec3::Zero(), damping = Vec3::Zero();
      for (int k = entry_start_[p]; k < entry_start_[p + 1]; ++k)
        elastic += entry_force_n_[entry_[k]];
      out.elastic[particle_[p]] += elastic;
      if (damping_n_s_m_ > 0) {
        for (int k = entry_start_[p]; k < entry_start_[p + 1]; ++k)
          damping += entry_damping_n_[entry_[k]];
        out.damping[particle_[p]] += damping;
      }
    }
  });
  double energy = 0;
  for (int c = 0; c < cluster_count(); ++c) energy += Sleeps(c, in) ? 0 : energy_j_[c];
  return energy;
}

// The whole energy of a cluster is its own particle's.
void CentreForm::AddEnergies(std::span<double> energy_j) const {
  for (std::size_t c = 0; c < energy_j_.size(); ++c)
    energy_j[member_[cluster_start_[c]]] += energy_j_[c];
}

void CentreForm::EvaluateCluster(int c, const ForceInput& in) const {
  const int begin = cluster_start_[c], end = cluster_start_[c + 1];
  const int averaged = begin + 1;
  // About the cluster's own particle: near the origin of nothing in particular, so that no digits
  // are lost. The offsets sum to zero, so that A = sum (x_j - C) q_j^T needs no mean; a common
  // factor does not change its rotation.
  const Vec3 origin = in.position_m[member_[begin]];
  Vec3 sum = Vec3::Zero();
  Mat3 a = Mat3::Zero();
  for (int e = averaged; e < end; ++e) {
    const Vec3 r = in.position_m[member_[e]] - origin;
    sum += r;
    for (int k = 0; k < 3; ++k) a.col(k) += r * rest_offset_[e](k);
  }
  const Vec3 mean = origin + sum / std::max(1, end - averaged);
  Eigen::Map<Quat> stored(&in.effect_state[4 * c]);
  const Quat rotation = PolarRotation(a, Quat(stored));
  stored = rotation;
  AddForce(c, rotation.toRotationMatrix(), mean, in);
  if (damping_n_s_m_ > 0) AddDampingForces(c, in);
}

// f_i = -k e and f_j = k w_j (e + t x (R q_j)) with e = x_i - C - R q_i, t = K^-1 ((R q_i) x e),
// K = R (tr(S) I - S) R^T, S = R^T A (A with weights w_j): the exact gradient, the rotation's own
// change included.
void CentreForm::AddForce(int c, const Mat3& rotation, const Vec3& mean,
                          const ForceInput& in) const {
  const int begin = cluster_start_[c], end = cluster_start_[c + 1];
  const double w = 1.0 / std::max(1, end - begin - 1);
  Mat3 a = Mat3::Zero();
  for (int e = begin + 1; e < end; ++e) {
    a += w * (in.position_m[member_[e]] - mean) * rest_offset_[e].transpose();
  }
  const Vec3 target = rotation * rest_offset_[begin];
  const Vec3 error = in.position_m[member_[begin]] - mean - target;
  const Mat3 s = rotation.transpose() * a;
  const Mat3 stiffness =
      rotation * (Mat3::Identity() * s.trace() - 0.5 * (s + s.transpose())) * rotation.transpose();
  // Neighbours on a line leave the spin about it undetermined: the pseudo-inverse transmits no
  // torque about that line.
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(stiffness);
  const Vec3 torque = target.cross(error);
  Vec3 t = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.eigenvalues()(k);
    if (std::abs(value) > 1e-9 * a.norm()) {
      t += eigen.eigenvectors().col(k) * (eigen.eigenvectors().col(k).dot(torque) / value);
    }
  }
  entry_force_n_[begin] = -stiffness_n_m_ * error;
  for (int e = begin + 1; e < end; ++e) {
    entry_force_n_[e] = stiffness_n_m_ * w * (error + t.cross(rotation * rest_offset_[e]));
  }
  energy_j_[c] = 0.5 * stiffness_n_m_ * error.squaredNorm();
}

// f_j = -c w_j (v_j - V - W x r_j), with (V, W) the cluster's own rigid motion: both momenta
// conserved, rotation free.
void CentreForm::AddDampingForces(int c, const ForceInput& in) const {
  const int begin = cluster_start_[c], end = cluster_start_[c + 1];
  const double w = 1.0 / (end - begin);
  Vec3 mean = Vec3::Zero(), velocity = Vec3::Zero();
  for (int e = begin; e < end; ++e) {
    mean += w * in.position_m[member_[e]];
    velocity += w * in.velocity_m_s[member_[e]];
  }
  Mat3 inertia = Mat3::Zero();
  Vec3 spin = Vec3::Zero();
  for (int e = begin; e < end; ++e) {
    const Vec3 r = in.position_m[member_[e]] - mean;
    inertia += w * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    spin += w * r.cross(in.velocity_m_s[member_[e]]);
  }
  // A cluster on a line has no inertia about it, and no motion about it either.
  inertia += 1e-12 * inertia.trace() * Mat3::Identity();
  const double determinant = inertia.determinant();
  const Vec3 omega = determinant > 0 ? Vec3(inertia.inverse() * spin) : Vec3::Zero();
  for (int e = begin; e < end; ++e) {
    const int p = member_[e];
    entry_damping_n_[e] = -damping_n_s_m_ * w *
                          (in.velocity_m_s[p] - velocity - omega.cross(in.position_m[p] - mean));
  }
}

}  // namespace adhesim
