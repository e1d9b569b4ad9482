#pragma once

#include <compare>
#include <string>

#include "adhesim/v1/frame.pb.h"
#include "adhesim/v1/status.pb.h"
#include "core/model/frame.h"
#include "core/model/model.h"
#include "server/session.h"

namespace adhesim {

// From the core's plain data to messages. Little-endian machines only (checked at compile time).

void EncodePose(const Pose& pose, v1::Pose* message);
void EncodeTool(const ToolFrame& tool, std::uint64_t target_jumps, v1::ToolState* message);
void EncodeTiming(const SessionTiming& timing, v1::SessionTiming* message);
void EncodeHeartbeat(const SessionFrame& frame, bool draining, v1::Heartbeat* message);
void EncodeTopology(const Model& model, v1::Topology* message);
// What a frame's reader asked for; frames of one format are made once for all who want it.
struct FrameFormat {
  v1::PositionEncoding positions = v1::POSITION_ENCODING_FLOAT32;  // or Q16
  bool strain_energy = false;
  bool contacts = false;

  auto operator<=>(const FrameFormat&) const = default;
};

// `message` is fresh or was filled by this function: its memory
// is used again.
void EncodeFrame(const SessionFrame& frame, const FrameFormat& format, v1::Frame* message);

v1::RealtimeClass EncodeRealtimeClass(RealtimeClass realtime_class);

}  // namespace adhesim
