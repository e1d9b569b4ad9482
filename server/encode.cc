#include "server/encode.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "core/model/effect_name.h"

namespace adhesim {
namespace {

static_assert(std::endian::native == std::endian::little, "frames are memory copies");

template <typename T>
void AssignBytes(const std::vector<T>& values, std::string* bytes) {
  bytes->assign(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

void EncodeWrench(const Wrench& wrench, v1::Wrench* message) {
  message->set_fx_n(wrench.force_n.x());
  message->set_fy_n(wrench.force_n.y());
  message->set_fz_n(wrench.force_n.z());
  message->set_tx_nm(wrench.torque_nm.x());
  message->set_ty_nm(wrench.torque_nm.y());
  message->set_tz_nm(wrench.torque_nm.z());
}

void EncodeZone(const ZoneFrame& zone, v1::ZoneState* message) {
  message->set_id(zone.id);
  message->set_members(zone.members);
  message->set_bodies(zone.bodies);
  if (zone.tool >= 0) message->set_tool(zone.tool);
  message->set_x_m(zone.centre_m.x());
  message->set_y_m(zone.centre_m.y());
  message->set_z_m(zone.centre_m.z());
  message->set_load(zone.load);
}

// q = round((p - min) / size * 65535) by axis, within the box of all particles.
void EncodeQ16(std::span<const float> position_m, v1::Frame* message) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::array<float, 3> min{kInfinity, kInfinity, kInfinity};
  std::array<float, 3> max{-kInfinity, -kInfinity, -kInfinity};
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    min[i % 3] = std::min(min[i % 3], position_m[i]);
    max[i % 3] = std::max(max[i % 3], position_m[i]);
  }
  std::array<float, 3> scale{};
  for (int axis = 0; axis < 3; ++axis) {
    if (position_m.empty()) min[axis] = max[axis] = 0;
    const float size = max[axis] - min[axis];
    scale[axis] = size > 0 ? 65535.0f / size : 0.0f;
    message->add_box_min_m(min[axis]);
    message->add_box_size_m(size);
  }
  std::string* bytes = message->mutable_positions();
  bytes->resize(position_m.size() * sizeof(std::uint16_t));
  char* out = bytes->data();
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    const float scaled = (position_m[i] - min[i % 3]) * scale[i % 3];
    const auto q = static_cast<std::uint16_t>(std::min(scaled + 0.5f, 65535.0f));
    std::memcpy(out + i * sizeof(q), &q, sizeof(q));
  }
}

void EncodeContact(const ContactFrame& contact, v1::ContactState* message) {
  message->set_x_m(contact.point_m.x());
  message->set_y_m(contact.point_m.y());
  message->set_z_m(contact.point_m.z());
  message->set_nx(contact.normal.x());
  message->set_ny(contact.normal.y());
  message->set_nz(contact.normal.z());
  message->set_normal_force_n(contact.normal_force_n);
  message->set_tangential_force_n(contact.tangential_force_n);
  if (contact.zone >= 0) message->set_zone(contact.zone);
  message->set_margin(contact.margin);
  message->set_body(contact.body);
  if (contact.other_body >= 0) message->set_other_body(contact.other_body);
  if (contact.tool >= 0) message->set_tool(contact.tool);
}

void EncodeFidelity(const SessionFidelity& fidelity, v1::FidelityState* message) {
  message->set_rungs(fidelity.rungs);
  message->clear_lowered();
  for (int r = 0; r < fidelity.rungs; ++r) message->add_lowered(fidelity.lowered[r].name);
  // A rung's errors are those with all before it.
  const FidelityRung last =
      fidelity.rungs > 0 ? fidelity.lowered[fidelity.rungs - 1] : FidelityRung{};
  message->set_expected_force_error(last.force_error);
  message->set_expected_position_error(last.position_error);
  message->set_measured(last.measured);
  message->set_changes(fidelity.changes);
  message->set_step_budget_s(fidelity.budget_s);
}

}  // namespace

void EncodePose(const Pose& pose, v1::Pose* message) {
  message->set_x_m(pose.position_m.x());
  message->set_y_m(pose.position_m.y());
  message->set_z_m(pose.position_m.z());
  message->set_qw(pose.orientation.w());
  message->set_qx(pose.orientation.x());
  message->set_qy(pose.orientation.y());
  message->set_qz(pose.orientation.z());
}

void EncodeTool(const ToolFrame& tool, std::uint64_t target_jumps, v1::ToolState* message) {
  EncodePose(tool.pose, message->mutable_pose());
  EncodePose(tool.target, message->mutable_target());
  EncodeWrench(tool.tissue, message->mutable_tissue());
  EncodeWrench(tool.coupling, message->mutable_coupling());
  message->set_colliding_particles(tool.colliding_particles);
  message->set_contact_area_m2(tool.contact_area_m2);
  message->set_depth_m(tool.depth_m);
  if (tool.force_error_n >= 0) {  // an implicit step
    message->set_force_error_n(tool.force_error_n);
    message->set_torque_error_nm(tool.torque_error_nm);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        message->add_stiffness_n_m(tool.stiffness_n_m(row, column));
    }
  }
  message->set_speed_limited(tool.flags & kToolSpeedLimited);
  message->set_force_limited(tool.flags & kToolForceLimited);
  message->set_obstructed(tool.flags & kToolObstructed);
  message->set_target_jumped(tool.flags & kToolTargetJumped);
  message->set_operator_lost(tool.flags & kToolOperatorLost);
  message->set_retracted(tool.flags & kToolRetracted);
  message->set_target_jumps(target_jumps);
}

void EncodeTiming(const SessionTiming& timing, v1::SessionTiming* message) {
  message->set_deadline_misses(timing.deadline_misses);
  message->set_skipped_steps(timing.skipped_steps);
  message->set_lag_s(timing.lag_s);
  message->set_step_duration_s(timing.step_duration_s);
  message->set_lowered_rungs(timing.lowered_rungs);
}

void EncodeHeartbeat(const SessionFrame& frame, bool draining, v1::Heartbeat* message) {
  message->set_server_time_ns(MonotonicNs());
  message->set_state(frame.state);
  EncodeTiming(frame.timing, message->mutable_timing());
  message->set_draining(draining);
}

void EncodeTopology(const Model& model, v1::Topology* message) {
  message->set_scene(model.name);
  message->set_rate_hz(1.0 / model.dt_s);
  message->set_particles(model.particle_count());
  AssignBytes(model.triangles, message->mutable_triangles());
  std::vector<Eigen::Vector3f> rest;
  for (const Vec3& x : model.rest_position_m) rest.push_back(x.cast<float>());
  AssignBytes(rest, message->mutable_rest_positions());
  for (const v1::Effect& effect : model.scene.effects()) message->add_effects(EffectName(effect));
  for (const Body& body : model.bodies) {
    v1::BodyTopology* out = message->add_bodies();
    out->set_name(body.name);
    out->set_first_particle(body.first_particle);
    out->set_particles(body.particle_count);
    out->set_first_triangle(body.first_triangle);
    out->set_triangles(body.triangle_count);
    out->set_rigid(body.rigid);
  }
  for (const ToolModel& tool : model.tools) {
    v1::ToolTopology* out = message->add_tools();
    out->set_name(tool.name);
    EncodePose(tool.start, out->mutable_start());
    if (const auto* needle = std::get_if<NeedleShape>(&tool.shape)) {
      out->mutable_needle()->set_length_m(needle->length_m);
      out->mutable_needle()->set_radius_m(needle->radius_m);
      out->mutable_needle()->set_tip_length_m(needle->tip_length_m);
    } else if (const auto* lancet = std::get_if<LancetShape>(&tool.shape)) {
      out->mutable_lancet()->set_blade_length_m(lancet->blade_length_m);
      out->mutable_lancet()->set_blade_width_m(lancet->blade_width_m);
      out->mutable_lancet()->set_blade_thickness_m(lancet->blade_thickness_m);
      out->mutable_lancet()->set_handle_length_m(lancet->handle_length_m);
      out->mutable_lancet()->set_handle_radius_m(lancet->handle_radius_m);
    }
  }
}

void EncodeFrame(const SessionFrame& frame, const FrameFormat& format, v1::Frame* message) {
  const Frame& from = frame.frame;
  message->clear_box_min_m();
  message->clear_box_size_m();
  if (format.positions == v1::POSITION_ENCODING_Q16) {
    message->set_encoding(v1::POSITION_ENCODING_Q16);
    EncodeQ16(from.position_m, message);
  } else {
    message->set_encoding(v1::POSITION_ENCODING_FLOAT32);
    AssignBytes(from.position_m, message->mutable_positions());
  }
  message->clear_zones();
  message->clear_tools();
  message->mutable_zone_of()->clear();
  if (!from.zones.empty()) AssignBytes(from.zone_of, message->mutable_zone_of());
  for (const ZoneFrame& zone : from.zones) EncodeZone(zone, message->add_zones());
  for (std::size_t i = 0; i < from.tools.size(); ++i) {
    EncodeTool(from.tools[i], frame.target_jumps[i], message->add_tools());
  }
  message->set_colliding_particles(from.colliding_particles);
  message->set_captures(frame.captures);
  message->set_releases(frame.releases);
  message->set_report_bits(frame.report_bits);
  message->set_kinetic_energy_j(from.kinetic_energy_j);
  message->set_published_ns(frame.published_ns);
  message->set_deadline_misses(frame.timing.deadline_misses);
  message->set_skipped_steps(frame.timing.skipped_steps);
  message->set_step_duration_s(frame.timing.step_duration_s);
  if (frame.fidelity.possible) EncodeFidelity(frame.fidelity, message->mutable_fidelity());
  AssignBytes(from.contact_forces, message->mutable_contact_forces());
  message->mutable_strain_energy()->clear();
  if (format.strain_energy) AssignBytes(from.strain_energy_j, message->mutable_strain_energy());
  message->clear_contacts();
  if (format.contacts) {
    for (const ContactFrame& contact : from.contacts)
      EncodeContact(contact, message->add_contacts());
  }
}

v1::RealtimeClass EncodeRealtimeClass(RealtimeClass realtime_class) {
  switch (realtime_class) {
    case RealtimeClass::kFifo:
      return v1::REALTIME_CLASS_FIFO;
    case RealtimeClass::kShortSlice:
      return v1::REALTIME_CLASS_SHORT_SLICE;
    case RealtimeClass::kPlain:
      return v1::REALTIME_CLASS_PLAIN;
  }
  return v1::REALTIME_CLASS_UNSPECIFIED;
}

}  // namespace adhesim
