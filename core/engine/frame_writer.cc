#include "core/engine/frame_writer.h"

#include <algorithm>

namespace adhesim {

FrameWriter::FrameWriter(const Model& model, std::span<const std::unique_ptr<Effect>> effects)
    : model_(model), contact_frames_(model), collides_(model.rest_position_m.size()) {
  for (const auto& effect : effects) {
    if (effect->force_kinds() & kElastic) elastic_.push_back(effect.get());
  }
  if (!elastic_.empty()) energy_j_.resize(model.rest_position_m.size());
}

Frame FrameWriter::Make() const {
  const std::size_t particles = model_.rest_position_m.size();
  Frame frame;
  frame.position_m.resize(3 * particles);
  frame.zone_of.resize(particles);
  frame.zones.reserve(particles);
  frame.tools.resize(model_.tools.size());
  frame.contact_forces.reserve(particles);
  if (model_.adhesive) frame.contacts.reserve(ContactFrames::Capacity(model_));
  frame.strain_energy_j.resize(energy_j_.size());
  return frame;
}

void FrameWriter::Write(const State& state, Frame* frame) const {
  frame->step = state.step;
  frame->time_s = state.time_s;
  frame->kinetic_energy_j = state.ledger.kinetic_j;
  frame->colliding_particles = state.contacts.colliding_particles;
  for (std::size_t p = 0; p < state.position_m.size(); ++p) {
    for (int k = 0; k < 3; ++k)
      frame->position_m[3 * p + k] = static_cast<float>(state.position_m[p](k));
    const int zone = state.contacts.zone_of[p];
    frame->zone_of[p] = zone >= 0 ? state.contacts.zones[zone].id : -1;
  }
  frame->zones.clear();
  for (const Zone& zone : state.contacts.zones) {
    frame->zones.push_back({zone.id, zone.count, zone.bodies, zone.tool, zone.centre_m, zone.load});
  }
  frame->contact_forces.clear();
  frame->contacts.clear();
  std::fill(frame->strain_energy_j.begin(), frame->strain_energy_j.end(), 0.0f);
  WriteTools(state, frame);
}

void FrameWriter::WriteTools(const State& state, Frame* frame) const {
  for (std::size_t t = 0; t < state.tools.size(); ++t) {
    const ToolState& tool = state.tools[t];
    ToolFrame& out = frame->tools[t];
    out.pose = tool.pose;
    out.target = tool.target;
    out.twist = tool.twist;
    out.tissue = tool.tissue;
    out.coupling = tool.coupling;
    out.flags = tool.flags;
    out.colliding_particles = 0;
    out.contact_area_m2 = 0;
    out.depth_m = 0;
    out.force_error_n = out.torque_error_nm = -1;
    out.stiffness_n_m.setZero();
  }
  for (const Zone& zone : state.contacts.zones) {
    if (zone.tool < 0) continue;
    ToolFrame& tool = frame->tools[zone.tool];
    const Vec3 inward = tool.pose.orientation * Vec3(0, 0, -1);  // from the shaft to the tip
    for (int k = zone.first; k < zone.first + zone.count; ++k) {
      const int p = state.contacts.zone_members[k];
      if (!(model_.area_m2[p] > 0)) continue;  // it only carries what touches
      ++tool.colliding_particles;
      tool.contact_area_m2 += model_.area_m2[p];
      tool.depth_m += inward.dot(state.position_m[p] - model_.rest_position_m[p]);
    }
  }
  for (ToolFrame& tool : frame->tools) {
    if (tool.colliding_particles > 0) tool.depth_m /= tool.colliding_particles;
  }
}

void FrameWriter::WriteForces(const State& state, std::span<const Vec3> load_n,
                              std::span<const ForceError::Bar> error_bar, Frame* frame) const {
  for (std::size_t t = 0; t < error_bar.size(); ++t) {
    if (!error_bar[t].known) continue;
    frame->tools[t].force_error_n = error_bar[t].force_n;
    frame->tools[t].torque_error_nm = error_bar[t].torque_nm;
    frame->tools[t].stiffness_n_m = error_bar[t].stiffness_n_m;
  }
  std::fill(energy_j_.begin(), energy_j_.end(), 0.0);
  for (const Effect* effect : elastic_) effect->AddEnergies(energy_j_);
  for (std::size_t b = 0; b < model_.bodies.size() && !energy_j_.empty(); ++b) {
    if (!state.sleep.Of(static_cast<int>(b))) continue;
    std::copy_n(state.sleep.strain_energy_j.begin() + model_.bodies[b].first_particle,
                model_.bodies[b].particle_count,
                energy_j_.begin() + model_.bodies[b].first_particle);
  }
  std::copy(energy_j_.begin(), energy_j_.end(), frame->strain_energy_j.begin());

  if (model_.adhesive) contact_frames_.Write(state, load_n, &frame->contacts);
  // A fixed particle's load, and a rigid body's, is not of the contact alone.
  const auto mark = [this](int p) {
    if (!model_.fixed[p] && !model_.bodies[model_.body_of[p]].rigid) collides_[p] = 1;
  };
  for (const Bond& bond : state.contacts.bonds) bond.ForEachMember(mark);
  for (std::size_t p = 0; p < collides_.size(); ++p) {
    if (!collides_[p]) continue;
    collides_[p] = 0;
    const Eigen::Vector3f force = -load_n[p].cast<float>();  // what carries the load
    frame->contact_forces.push_back(
        {static_cast<std::uint32_t>(p), {force.x(), force.y(), force.z()}});
  }
}

}  // namespace adhesim
