#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "adhesim/v1/recording.pb.h"
#include "adhesim/v1/view_service.pb.h"
#include "core/engine/engine.h"
#include "server/realtime.h"
#include "server/recording/mcap_writer.h"
#include "server/recording/recording_format.h"
#include "server/recording/slot_ring.h"
#include "server/session.h"
#include "server/step_observer.h"

namespace adhesim {

// Records what a session does, without keeping it waiting.
//
// The stepping thread copies what a step used and gave into a ring of four seconds, and sixty times
// a second a frame into a smaller one: wait-free, nothing is allocated. A thread of the plain class
// takes it from there, encodes it and writes chunks of 100 ms.
//
// Nothing that a replay needs is ever left out. When the writer is so far behind that the ring is
// full, the recording ends there, with an event that says so, and the session goes on; frames alone
// may be left out, also with an event. An error of the file ends the recording likewise. Both are
// told once, to `warn`.
class Recorder : public StepObserver {
 public:
  struct Options {
    double frames_hz = 60;
    double buffer_s = 4;  // of simulated time
    std::size_t buffered_frames = 16;
    // Called once at most, on any thread.
    std::function<void(const std::string&)> warn;
  };

  // Begins the file, with the engine's present state as first frame.
  Recorder(ByteSink sink, const Options& options, const RecordingAbout& about,
           const std::vector<SceneAsset>& assets, const Engine& engine);
  // OnEnd().
  ~Recorder() override;

  void OnStep(const Engine& engine, std::span<const ToolInput> inputs, const SessionFrame& frame,
              bool may_wait) noexcept override;
  void OnReset(const SessionFrame& frame) noexcept override;
  void OnState(v1::SessionState state) noexcept override;
  // Writes what is left and the end of the file.
  void OnEnd() noexcept override;

  // Any thread: the file still grows.
  bool open() const { return !finished_.load(); }
  // Any thread, after OnEnd(): what went wrong, if anything.
  absl::Status status() const;
  // Likewise.
  std::uint64_t bytes_written() const { return writer_.bytes_written(); }

 private:
  enum class EntryKind : std::uint8_t { kStep, kReset, kState };
  // Something that happened on the stepping thread.
  struct Entry {
    EntryKind kind = EntryKind::kStep;
    bool has_frame = false;  // one of the frames in the ring is of this entry
    bool frozen = false;
    std::string frozen_because;  // of the step that froze it only
    std::uint64_t index = 0;     // steps since the recording began
    std::uint64_t step = 0;
    double time_s = 0;
    std::uint64_t hash = 0;
    std::int32_t fidelity = 0;  // rungs that the step did without
    StepReport report;
    v1::SessionState state = v1::SESSION_STATE_UNSPECIFIED;
    std::uint64_t frames_dropped = 0;         // so far
    std::vector<ToolInput> inputs;            // [#tools]
    std::vector<ToolFrame> tools;             // [#tools]
    std::vector<std::uint64_t> target_jumps;  // [#tools]
  };

  // The stepping thread.
  Entry* NewEntry(EntryKind kind, bool may_wait);
  void PushEntry();
  bool KeepFrame(const SessionFrame& frame, bool may_wait);
  void GiveUp();
  template <typename T>
  T* WaitForRoom(SlotRing<T>* ring, bool may_wait);

  // The writing thread.
  void WriteLoop();
  void WriteEnd();
  void Drain();
  void WriteEntry(const Entry& entry);
  void WriteInputs(const Entry& entry);
  void WriteFidelityEvent(const Entry& entry);
  void WriteForces(const Entry& entry);
  void WriteStepEvents(const Entry& entry);
  void WriteEvent(const Entry& entry, v1::EventKind kind, std::uint32_t particles,
                  const std::string& text);
  void WriteFrame(const SessionFrame& frame, std::uint64_t index);
  void WriteHashes();
  void Flush();
  void Write(std::uint16_t channel, std::uint64_t index,
             const google::protobuf::MessageLite& message);
  void Warn(const std::string& what);

  const Options options_;
  const RecordingAbout about_;
  const double dt_s_;
  std::vector<std::string> tool_names_, rung_names_;

  // Owned by the stepping thread.
  std::uint64_t index_ = 0;
  std::int64_t frames_kept_ = 0;  // number, on the grid of frames, of the last one
  std::uint64_t frames_dropped_ = 0;

  // Between the threads.
  SlotRing<Entry> entries_;
  SlotRing<SessionFrame> frames_;
  std::atomic<bool> ended_{false};     // nothing more is taken
  std::atomic<bool> overflow_{false};  // because the ring was full
  std::atomic<bool> stop_{false};
  std::atomic<bool> finished_{false};
  Waker waker_;

  // Owned by the writing thread.
  McapWriter writer_;
  RecordingChannels channels_{};
  std::vector<ToolInput> inputs_before_;  // [#tools]
  std::vector<std::uint32_t> flags_before_;
  std::uint32_t bits_before_ = 0;
  std::int32_t fidelity_before_ = 0;
  std::uint64_t frames_dropped_before_ = 0;
  bool reset_ = false;  // since the last step
  std::uint64_t last_index_ = 0;
  std::int64_t flushed_ns_ = 0;
  v1::StateHashes hashes_;
  // Filled again and again, so that little is allocated.
  v1::WatchResponse view_;
  v1::StepInputs step_inputs_;
  v1::ToolForces forces_;
  std::string scratch_;

  bool warned_ = false;
  std::once_flag end_once_;
  std::thread thread_;
};

// The hash that a recording keeps of a state: a frozen one has none that is the same everywhere.
inline std::uint64_t RecordedHash(const Engine& engine) {
  return engine.frozen() ? 0 : engine.StateHash();
}

}  // namespace adhesim
