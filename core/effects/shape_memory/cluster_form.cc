#include "core/effects/shape_memory/cluster_form.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "core/effects/registry.h"
#include "core/model/polar.h"

namespace adhesim {
namespace {

constexpr int kBatchGrain = 64;       // batches: about 40 us of work
constexpr int kParticleGrain = 4096;  // particles: likewise
constexpr int kBlockGrain = 16;       // blocks of a body each: likewise
// Clusters whose forces are summed as soon as they are known, while the first-level cache has them.
constexpr int kBlockClusters = 128;

int ClusterSize(const Model& model, int particle) {
  return 1 + model.neighbour_start[particle + 1] - model.neighbour_start[particle];
}

// A cluster whose every member is fixed exerts nothing that moves anything.
bool Moves(const Model& model, int particle) {
  bool moves = !model.fixed[particle];
  for (int n = model.neighbour_start[particle]; n < model.neighbour_start[particle + 1]; ++n) {
    moves = moves || !model.fixed[model.neighbours[n]];
  }
  return moves;
}

}  // namespace

ClusterForm::ClusterForm(const Model& model, const v1::ShapeMemory& message)
    : stiffness_n_m_(message.stiffness_n_m()), damping_n_s_m_(message.damping_n_s_m()) {
  std::vector<int> centres;
  for (int b : SelectBodies(model, message.bodies(), [](const Body& body) {
         return !body.rigid && !body.all_fixed && body.tetrahedron_count == 0;
       })) {
    const Body& body = model.bodies[b];
    for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
      if (Moves(model, p)) centres.push_back(p);
    }
    // Whole bodies: clusters of one have no particles of another. What may sleep is apart.
    if (static_cast<int>(centres.size()) >= kBlockClusters || (model.sleep && !centres.empty())) {
      AddBlock(model, &centres);
    }
  }
  if (!centres.empty()) AddBlock(model, &centres);
  elastic_n_.resize(entry_.size());
  if (damping_n_s_m_ > 0) damping_n_.resize(entry_.size());
  energy_j_.resize(batch_.size());
}

void ClusterForm::AddBlock(const Model& model, std::vector<int>* centres) {
  // Clusters of a size share batches, so that few lanes idle.
  std::stable_sort(centres->begin(), centres->end(),
                   [&](int p, int q) { return ClusterSize(model, p) < ClusterSize(model, q); });
  const int first_entry = static_cast<int>(entry_.size());
  Block block{static_cast<int>(batch_.size()), 0, static_cast<int>(particle_.size()), 0, -1};
  if (!centres->empty()) block.body = model.body_of[centres->back()];
  for (std::size_t first = 0; first < centres->size(); first += kLanes) {
    AddBatch(model, std::span(*centres).subspan(
                        first, std::min<std::size_t>(kLanes, centres->size() - first)));
  }
  CollectSlots(first_entry);
  block.end_batch = static_cast<int>(batch_.size());
  block.end_particle = static_cast<int>(particle_.size());
  block_.push_back(block);
  centres->clear();
}

void ClusterForm::AddBatch(const Model& model, std::span<const int> particles) {
  ClusterBatch batch;
  batch.first_entry = static_cast<int>(entry_.size());
  batch.members = ClusterSize(model, particles.back());
  entry_.resize(entry_.size() + batch.members);
  for (int lane = 0; lane < kLanes; ++lane) {
    const bool used = lane < static_cast<int>(particles.size());
    const int centre = particles[used ? lane : 0];
    const int size = ClusterSize(model, centre);
    const auto member = [&](int m) {
      return m == 0 ? centre : model.neighbours[model.neighbour_start[centre] + m - 1];
    };
    Vec3 mean = Vec3::Zero();
    for (int m = 0; m < size; ++m)
      mean += model.rest_position_m[member(m)] - model.rest_position_m[centre];
    mean = model.rest_position_m[centre] + mean / size;
    batch.inverse_count.v[lane] = 1.0 / size;
    Vec3 left = Vec3::Zero();
    for (int m = 0; m < batch.members; ++m) {
      ClusterEntry& entry = entry_[batch.first_entry + m];
      entry.particle[lane] = m < size ? member(m) : centre;
      entry.present.v[lane] = used && m < size ? 1 : 0;
      const Vec3 offset = m < size ? Vec3(model.rest_position_m[member(m)] - mean) : Vec3::Zero();
      entry.rest_offset_m.x.v[lane] = offset.x();
      entry.rest_offset_m.y.v[lane] = offset.y();
      entry.rest_offset_m.z.v[lane] = offset.z();
      left += offset;
    }
    batch.rest_mean_m.x.v[lane] = left.x() / size;
    batch.rest_mean_m.y.v[lane] = left.y() / size;
    batch.rest_mean_m.z.v[lane] = left.z() / size;
  }
  batch_.push_back(batch);
}

void ClusterForm::CollectSlots(int first_entry) {
  std::map<int, std::vector<int>> slots;  // by particle
  for (int e = first_entry; e < static_cast<int>(entry_.size()); ++e) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (entry_[e].present.v[lane] > 0)
        slots[entry_[e].particle[lane]].push_back(e * kSlotStride + lane);
    }
  }
  for (const auto& [particle, of_particle] : slots) {
    particle_.push_back(particle);
    slot_.insert(slot_.end(), of_particle.begin(), of_particle.end());
    slot_start_.push_back(static_cast<int>(slot_.size()));
  }
}

void ClusterForm::InitialState(std::span<double> state) const {
  for (std::size_t k = 0; k < state.size(); ++k) state[k] = (k / kLanes) % 4 == 3 ? 1 : 0;
}

// E_i is a minimum over rotations and the mean, so its Hessian is at most that of 1/2 k sum w
// |x_j|^2: diagonal.
void ClusterForm::AddBounds(std::span<double> stiffness_n_m,
                            std::span<double> damping_n_s_m) const {
  for (const ClusterBatch& batch : batch_) {
    for (int e = batch.first_entry; e < batch.first_entry + batch.members; ++e) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const double weight = entry_[e].present.v[lane] * batch.inverse_count.v[lane];
        stiffness_n_m[entry_[e].particle[lane]] += stiffness_n_m_ * weight;
        damping_n_s_m[entry_[e].particle[lane]] += damping_n_s_m_ * weight;
      }
    }
  }
}

double ClusterForm::AddForces(const ForceInput& in, const ForceOutput& out) const {
  if (!in.asleep.empty()) return AddForcesOfAwake(in, out);
  const auto evaluate = [&](int begin, int end) {
    for (int b = begin; b < end; ++b) EvaluateBatch(b, in);
  };
  const auto sum = [&](int begin, int end) {
    SumForces(elastic_n_, begin, end, out.elastic);
    if (damping_n_s_m_ > 0) SumForces(damping_n_, begin, end, out.damping);
  };
  if (in.parallel->threads() == 1) {
    for (const Block& block : block_) {
      evaluate(block.first_batch, block.end_batch);
      sum(block.first_particle, block.end_particle);
    }
  } else {
    in.parallel->For(static_cast<int>(batch_.size()), kBatchGrain, evaluate);
    in.parallel->For(static_cast<int>(particle_.size()), kParticleGrain, sum);
  }
  double energy = 0;
  for (const Lanes& lanes : energy_j_) {
    for (double e : lanes.v) energy += e;
  }
  return energy;
}

// Block by block, each of one body: the same bits for any number of threads.
double ClusterForm::AddForcesOfAwake(const ForceInput& in, const ForceOutput& out) const {
  in.parallel->For(static_cast<int>(block_.size()), kBlockGrain, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      const Block& block = block_[k];
      if (in.asleep[block.body]) continue;
      for (int b = block.first_batch; b < block.end_batch; ++b) EvaluateBatch(b, in);
      SumForces(elastic_n_, block.first_particle, block.end_particle, out.elastic);
      if (damping_n_s_m_ <= 0) continue;
      SumForces(damping_n_, block.first_particle, block.end_particle, out.damping);
    }
  });
  double energy = 0;
  for (const Block& block : block_) {
    if (in.asleep[block.body]) continue;
    for (int b = block.first_batch; b < block.end_batch; ++b) {
      for (double e : energy_j_[b].v) energy += e;
    }
  }
  return energy;
}

void ClusterForm::SumForces(const std::vector<Lanes3>& entries, int begin, int end,
                            std::span<Vec3> force_n) const {
  const double* lanes = entries[0].x.v;
  for (int k = begin; k < end; ++k) {
    double x = 0, y = 0, z = 0;
    for (int s = slot_start_[k]; s < slot_start_[k + 1]; ++s) {
      const double* at = lanes + slot_[s];
      x += at[0];
      y += at[kLanes];
      z += at[2 * kLanes];
    }
    force_n[particle_[k]] += Vec3(x, y, z);
  }
}

// The whole energy of a cluster is its centre's, the first member. Idle lanes have none.
void ClusterForm::AddEnergies(std::span<double> energy_j) const {
  for (std::size_t b = 0; b < batch_.size(); ++b) {
    const ClusterEntry& centre = entry_[batch_[b].first_entry];
    for (int lane = 0; lane < kLanes; ++lane)
      energy_j[centre.particle[lane]] += energy_j_[b].v[lane];
  }
}

void ClusterForm::EvaluateBatch(int b, const ForceInput& in) const {
  const ClusterBatch& batch = batch_[b];
  const std::span<const ClusterEntry> entries =
      std::span(entry_).subspan(batch.first_entry, batch.members);
  const ClusterForces forces{std::span(elastic_n_).subspan(batch.first_entry, batch.members),
                             damping_n_.empty()
                                 ? std::span<Lanes3>()
                                 : std::span(damping_n_).subspan(batch.first_entry, batch.members),
                             &energy_j_[b]};
  double* stored = &in.effect_state[4 * kLanes * b];
  Lanes rotation[4];
  std::memcpy(static_cast<void*>(rotation), stored, sizeof(rotation));
  const unsigned failed =
      EvaluateClusters(in.parallel->simd(), batch, entries, in.position_m, in.velocity_m_s,
                       stiffness_n_m_, damping_n_s_m_, rotation, forces);
  if (failed != 0) {
    // Tumbling or inverted: start afresh where the maximum is, and go on from there.
    for (int lane = 0; lane < kLanes; ++lane) {
      if (failed & (1u << lane)) RestartRotation(b, lane, in.position_m, rotation);
    }
    EvaluateClusters(in.parallel->simd(), batch, entries, in.position_m, in.velocity_m_s,
                     stiffness_n_m_, damping_n_s_m_, rotation, forces);
  }
  std::memcpy(stored, rotation, sizeof(rotation));
}

void ClusterForm::RestartRotation(int b, int lane, std::span<const Vec3> position_m,
                                  Lanes rotation[4]) const {
  const ClusterBatch& batch = batch_[b];
  Mat3 a = Mat3::Zero();
  const Vec3& origin = position_m[entry_[batch.first_entry].particle[lane]];
  for (int e = batch.first_entry; e < batch.first_entry + batch.members; ++e) {
    const Lanes3& rest = entry_[e].rest_offset_m;
    a += (position_m[entry_[e].particle[lane]] - origin) *
         Vec3(rest.x.v[lane], rest.y.v[lane], rest.z.v[lane]).transpose();
  }
  const Quat best = PolarRotation(
      a, Quat(rotation[3].v[lane], rotation[0].v[lane], rotation[1].v[lane], rotation[2].v[lane])
             .normalized());
  for (int k = 0; k < 4; ++k) rotation[k].v[lane] = best.coeffs()(k);
}

}  // namespace adhesim
