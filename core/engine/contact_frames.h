#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/frame.h"
#include "core/model/model.h"
#include "core/model/state.h"

namespace adhesim {

// Tells what every contact carries. A member's load is shared evenly among the bonds that it is
// part of.
class ContactFrames {
 public:
  explicit ContactFrames(const Model& model);

  // At most as many are told.
  static std::size_t Capacity(const Model& model) { return model.rest_position_m.size(); }

  // `load_n` [#particles]: what zones and sliding contacts carry on each of their particles. Bonds
  // of which neither side can be told (fixed to rigid, rigid to rigid) are left out.
  void Write(const State& state, std::span<const Vec3> load_n, std::vector<ContactFrame>* contacts);

 private:
  // A side's force and strength, summed over its members.
  struct Side {
    Vec3 force_n = Vec3::Zero();
    double normal_n = 0, shear_n = 0;
    bool told = true;  // false: its load is not of the contact alone
  };
  void AddMember(int particle, const Bond& bond, std::span<const Vec3> load_n, Side* side) const;

  const Model& model_;
  std::vector<std::int32_t> bonds_of_;  // [#particles] scratch
};

}  // namespace adhesim
