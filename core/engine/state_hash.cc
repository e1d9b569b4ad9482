#include "core/engine/state_hash.h"

#include <bit>
#include <cstddef>
#include <span>

namespace adhesim {
namespace {

// Multiply and fold, as in wyhash; the word itself goes in once more, so that a factor of zero does
// not hide it.
std::uint64_t Mix(std::uint64_t hash, std::uint64_t word) {
  const auto product = static_cast<unsigned __int128>(hash ^ word) * 0x9e3779b97f4a7c15ull;
  return static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64) ^
         (word << 1);
}

// A running hash. Long arrays go through four side by side: one alone would wait for each
// multiplication.
class Hasher {
 public:
  void Add(std::uint64_t word) { hash_ = Mix(hash_, word); }
  void Add(double value) { Add(std::bit_cast<std::uint64_t>(value)); }
  void Add(std::span<const double> values) {
    std::uint64_t lane[4] = {hash_, 0x452821e638d01377ull, 0xbe5466cf34e90c6cull,
                             0xc0ac29b7c97c50ddull};
    std::size_t i = 0;
    for (; i + 4 <= values.size(); i += 4) {
      for (int l = 0; l < 4; ++l) {
        lane[l] = Mix(lane[l], std::bit_cast<std::uint64_t>(values[i + l]));
      }
    }
    hash_ = lane[0];
    for (int l = 1; l < 4; ++l) Add(lane[l]);
    for (; i < values.size(); ++i) Add(values[i]);
  }
  void Add(std::span<const Vec3> vectors) {
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    if (!vectors.empty()) Add(std::span(vectors[0].data(), 3 * vectors.size()));
  }
  void Add(const Vec3& v) {
    for (int k = 0; k < 3; ++k) Add(v(k));
  }
  void Add(const Pose& pose) {
    Add(pose.position_m);
    for (int k = 0; k < 4; ++k) Add(pose.orientation.coeffs()(k));
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0x243f6a8885a308d3ull;
};

}  // namespace

std::uint64_t HashState(const State& state) {
  Hasher hash;
  hash.Add(state.step);
  hash.Add(std::span(state.position_m));
  hash.Add(std::span(state.velocity_m_s));
  hash.Add(std::span(state.velocity_change_m_s));
  hash.Add(std::span(state.effect_state));
  for (std::size_t b = 0; b < state.sleep.asleep.size(); ++b) {
    hash.Add((static_cast<std::uint64_t>(state.sleep.calm_steps[b]) << 1) | state.sleep.asleep[b]);
  }
  if (state.contacts.draws > 0) hash.Add(state.contacts.draws);
  for (const Zone& zone : state.contacts.zones) {
    hash.Add(static_cast<std::uint64_t>(zone.id));
    hash.Add(zone.momentum_kg_m_s);
    hash.Add(zone.angular_momentum_kg_m2_s);
  }
  for (int zone : state.contacts.zone_of) hash.Add(static_cast<std::uint64_t>(zone));
  for (const Bond& bond : state.contacts.bonds) {
    for (int value :
         {bond.particle, bond.partner, bond.tool, bond.triangle, bond.vertices[0], bond.vertices[1],
          bond.vertices[2], bond.holds_particle + 2 * bond.holds_partner}) {
      hash.Add(static_cast<std::uint64_t>(value));
    }
    // Ages count where they scale strengths; elsewhere nothing depends on them.
    if (bond.strength_scale != 1) hash.Add(bond.since_s);
  }
  for (const ReleasedPair& pair : state.contacts.released) {
    hash.Add(static_cast<std::uint64_t>(pair.particle));
    hash.Add(static_cast<std::uint64_t>(pair.other));
    hash.Add(pair.gap_m);
  }
  for (const ToolState& tool : state.tools) {
    hash.Add(tool.pose);
    hash.Add(tool.twist.linear_m_s);
    hash.Add(tool.twist.angular_rad_s);
    hash.Add(tool.target);
  }
  return hash.value();
}

}  // namespace adhesim
