#include "server/recording/recorder.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <time.h>

#include <algorithm>
#include <cmath>

#include "server/encode.h"

namespace adhesim {
namespace {

constexpr std::int64_t kChunkNs = 100'000'000;
constexpr std::size_t kChunkBytes = std::size_t{1} << 20;
constexpr int kPollMs = 20;
// A message of hashes is of no use before it is whole: few, so that little is lost with it.
constexpr int kHashesAtOnce = 32;
// How long steps without a deadline wait for a writer that does not move.
constexpr std::int64_t kPatienceNs = 10'000'000'000;

bool SameBits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

bool Same(const Pose& a, const Pose& b) {
  for (int i = 0; i < 3; ++i) {
    if (!SameBits(a.position_m[i], b.position_m[i])) return false;
  }
  for (int i = 0; i < 4; ++i) {
    if (!SameBits(a.orientation.coeffs()[i], b.orientation.coeffs()[i])) return false;
  }
  return true;
}

bool Same(const ToolInput& a, const ToolInput& b) {
  return a.has_target == b.has_target && (!a.has_target || Same(a.target, b.target)) &&
         SameBits(a.strength_scale, b.strength_scale) && a.retracted == b.retracted;
}

std::size_t RingSize(double buffer_s, double dt_s) {
  return std::max<std::size_t>(64, static_cast<std::size_t>(std::ceil(buffer_s / dt_s)));
}

}  // namespace

Recorder::Recorder(ByteSink sink, const Options& options, const RecordingAbout& about,
                   const std::vector<SceneAsset>& assets, const Engine& engine)
    : options_(options),
      about_(about),
      dt_s_(engine.model().dt_s),
      entries_(RingSize(options.buffer_s, dt_s_),
               [tools = engine.model().tools.size()] {
                 Entry entry;
                 entry.inputs.resize(tools);
                 entry.tools.resize(tools);
                 entry.target_jumps.resize(tools);
                 return entry;
               }),
      frames_(options.buffered_frames, [&] { return MakeSessionFrame(engine); }),
      writer_(std::move(sink), "", absl::StrCat("adhesim ", about.version)),
      inputs_before_(engine.model().tools.size()),
      flags_before_(engine.model().tools.size()) {
  for (const ToolModel& tool : engine.model().tools) tool_names_.push_back(tool.name);
  for (const FidelityRung& rung : engine.rungs()) rung_names_.push_back(rung.name);
  channels_ = WriteBeginning(about, engine.model().scene, assets, &writer_);
  view_.set_session(about.session);
  EncodeTopology(engine.model(), view_.mutable_topology());
  Write(channels_.topology, 0, view_);
  WriteFrame(MakeSessionFrame(engine), 0);
  writer_.FlushChunk();
  flushed_ns_ = MonotonicNs();
  thread_ = std::thread([this] { WriteLoop(); });
}

Recorder::~Recorder() { OnEnd(); }

absl::Status Recorder::status() const {
  if (!writer_.status().ok()) return writer_.status();
  if (overflow_.load()) return absl::ResourceExhaustedError("the writer was too far behind");
  return absl::OkStatus();
}

// ---------------------------------------------------------------- the stepping thread

// A slot to fill, or null. Who may wait waits for it, and gives up at last.
template <typename T>
T* Recorder::WaitForRoom(SlotRing<T>* ring, bool may_wait) {
  T* slot = ring->Back();
  if (slot != nullptr || !may_wait) return slot;
  const std::int64_t until_ns = MonotonicNs() + kPatienceNs;
  while (slot == nullptr && !ended_.load(std::memory_order_relaxed)) {
    if (MonotonicNs() > until_ns) {
      GiveUp();
      return nullptr;
    }
    waker_.Wake();
    const timespec pause{0, 500'000};
    nanosleep(&pause, nullptr);
    slot = ring->Back();
  }
  return slot;
}

void Recorder::GiveUp() {
  overflow_.store(true);
  ended_.store(true);
  waker_.Wake();
}

// The next entry to fill; null when the recording has ended, or ends here.
Recorder::Entry* Recorder::NewEntry(EntryKind kind, bool may_wait) {
  if (ended_.load(std::memory_order_relaxed)) return nullptr;
  Entry* entry = WaitForRoom(&entries_, may_wait);
  if (entry == nullptr) {
    GiveUp();
    return nullptr;
  }
  entry->kind = kind;
  entry->has_frame = false;
  entry->frozen = false;
  entry->report = StepReport{};
  return entry;
}

void Recorder::PushEntry() {
  entries_.Push();
  // The writer looks every 20 ms by itself; steps without a deadline fill the ring sooner.
  if (entries_.size() == entries_.capacity() / 4) waker_.Wake();
}

bool Recorder::KeepFrame(const SessionFrame& frame, bool may_wait) {
  SessionFrame* slot = WaitForRoom(&frames_, may_wait);
  if (slot == nullptr) {
    ++frames_dropped_;
    return false;
  }
  *slot = frame;
  frames_.Push();
  return true;
}

void Recorder::OnStep(const Engine& engine, std::span<const ToolInput> inputs,
                      const SessionFrame& frame, bool may_wait) noexcept {
  Entry* entry = NewEntry(EntryKind::kStep, may_wait);
  if (entry == nullptr) return;
  entry->index = ++index_;
  entry->step = engine.state().step;
  entry->time_s = engine.state().time_s;
  entry->hash = RecordedHash(engine);
  entry->fidelity = engine.fidelity();
  entry->frozen = engine.frozen();
  // Allocates, in the last step that there is.
  if (entry->frozen) entry->frozen_because = engine.FrozenBecause();
  std::copy(inputs.begin(), inputs.end(), entry->inputs.begin());
  if (inputs.empty()) std::fill(entry->inputs.begin(), entry->inputs.end(), ToolInput{});
  if (!entry->frozen) {
    entry->report = frame.frame.report;
    entry->tools = frame.frame.tools;
    entry->target_jumps = frame.target_jumps;
    const auto due = static_cast<std::int64_t>(index_ * dt_s_ * options_.frames_hz + 1e-6);
    if (due > frames_kept_) {
      frames_kept_ = due;
      entry->has_frame = KeepFrame(frame, may_wait);
    }
  }
  entry->frames_dropped = frames_dropped_;
  PushEntry();
}

void Recorder::OnReset(const SessionFrame& frame) noexcept {
  Entry* entry = NewEntry(EntryKind::kReset, false);
  if (entry == nullptr) return;
  entry->index = index_;
  entry->step = frame.frame.step;
  entry->time_s = frame.frame.time_s;
  entry->has_frame = KeepFrame(frame, false);
  entry->frames_dropped = frames_dropped_;
  PushEntry();
}

void Recorder::OnState(v1::SessionState state) noexcept {
  Entry* entry = NewEntry(EntryKind::kState, false);
  if (entry == nullptr) return;
  entry->index = index_;
  entry->state = state;
  entry->frames_dropped = frames_dropped_;
  PushEntry();
}

void Recorder::OnEnd() noexcept {
  std::call_once(end_once_, [this] {
    stop_.store(true);
    waker_.Wake();
    thread_.join();
  });
}

// ---------------------------------------------------------------- the writing thread

void Recorder::WriteLoop() {
  while (true) {
    const bool last = stop_.load() || overflow_.load();  // read before draining
    Drain();
    if (MonotonicNs() - flushed_ns_ >= kChunkNs) Flush();
    if (last || !writer_.status().ok()) break;
    waker_.Wait(kPollMs);
  }
  WriteEnd();
  ended_.store(true);
  finished_.store(true);
}

void Recorder::WriteEnd() {
  if (overflow_.load()) {
    Entry here;
    here.index = last_index_;
    WriteEvent(here, v1::EVENT_KIND_TRUNCATED, 0,
               "the writer was too far behind: the recording ends here");
    Warn(absl::StrCat("the writer was more than ", options_.buffer_s,
                      " s behind: the recording ends after step ", last_index_,
                      ", the session goes on"));
  }
  WriteHashes();
  writer_.Finish();
  if (!writer_.status().ok()) Warn(std::string(writer_.status().message()));
}

void Recorder::Warn(const std::string& what) {
  if (!warned_ && options_.warn) options_.warn(what);
  warned_ = true;
}

void Recorder::Drain() {
  while (const Entry* entry = entries_.Front()) {
    WriteEntry(*entry);
    entries_.Pop();
    if (writer_.chunk_bytes() >= kChunkBytes) Flush();
    if (!writer_.status().ok()) return;
  }
}

void Recorder::Flush() {
  WriteHashes();
  writer_.FlushChunk();
  flushed_ns_ = MonotonicNs();
}

// In the order of log times: everything of one step, then its frame, then hashes.
void Recorder::WriteEntry(const Entry& entry) {
  last_index_ = entry.index;
  if (entry.frames_dropped > frames_dropped_before_) {
    WriteEvent(entry, v1::EVENT_KIND_FRAMES_DROPPED, 0,
               absl::StrCat(entry.frames_dropped - frames_dropped_before_,
                            " frames left out: the writer was behind"));
    frames_dropped_before_ = entry.frames_dropped;
  }
  switch (entry.kind) {
    case EntryKind::kStep:
      WriteInputs(entry);
      WriteStepEvents(entry);
      if (!entry.frozen) WriteForces(entry);
      break;
    case EntryKind::kReset:
      reset_ = true;
      std::fill(inputs_before_.begin(), inputs_before_.end(), ToolInput{});
      std::fill(flags_before_.begin(), flags_before_.end(), 0);
      bits_before_ = 0;
      fidelity_before_ = 0;
      WriteEvent(entry, v1::EVENT_KIND_RESET, 0, "");
      break;
    case EntryKind::kState:
      WriteEvent(
          entry,
          entry.state == v1::SESSION_STATE_PAUSED ? v1::EVENT_KIND_PAUSED : v1::EVENT_KIND_RESUMED,
          0, "");
      break;
  }
  if (entry.has_frame) {
    WriteFrame(*frames_.Front(), entry.index);
    frames_.Pop();
  }
  if (entry.kind != EntryKind::kStep) return;
  if (hashes_.hashes().empty()) hashes_.set_first_index(entry.index);
  hashes_.add_hashes(entry.hash);
  if (hashes_.hashes_size() >= kHashesAtOnce) WriteHashes();
}

void Recorder::WriteInputs(const Entry& entry) {
  step_inputs_.Clear();
  for (std::size_t i = 0; i < entry.inputs.size(); ++i) {
    const ToolInput& input = entry.inputs[i];
    if (Same(input, inputs_before_[i])) continue;
    inputs_before_[i] = input;
    v1::ToolInput* out = step_inputs_.add_tools();
    out->set_tool(i);
    if (input.has_target) EncodePose(input.target, out->mutable_target());
    if (!SameBits(input.strength_scale, 1)) out->set_strength_scale(input.strength_scale);
    out->set_retracted(input.retracted);
  }
  if (entry.fidelity != fidelity_before_) {
    fidelity_before_ = entry.fidelity;
    step_inputs_.set_fidelity(entry.fidelity);
    WriteFidelityEvent(entry);
  }
  if (step_inputs_.tools().empty() && !step_inputs_.has_fidelity() && !reset_) return;
  step_inputs_.set_index(entry.index);
  step_inputs_.set_reset(reset_);
  reset_ = false;
  Write(channels_.inputs, entry.index, step_inputs_);
}

void Recorder::WriteFidelityEvent(const Entry& entry) {
  const auto lowered = std::span(rung_names_).first(entry.fidelity);
  WriteEvent(
      entry, v1::EVENT_KIND_FIDELITY, 0,
      lowered.empty() ? "full fidelity" : absl::StrCat("lowered: ", absl::StrJoin(lowered, ", ")));
}

void Recorder::WriteForces(const Entry& entry) {
  if (entry.tools.empty()) return;
  forces_.set_step(entry.step);
  forces_.set_time_s(entry.time_s);
  forces_.clear_tools();
  for (std::size_t i = 0; i < entry.tools.size(); ++i) {
    EncodeTool(entry.tools[i], entry.target_jumps[i], forces_.add_tools());
  }
  Write(channels_.forces, entry.index, forces_);
}

void Recorder::WriteStepEvents(const Entry& entry) {
  if (entry.frozen) {
    WriteEvent(entry, v1::EVENT_KIND_FROZEN, 0, entry.frozen_because);
    return;
  }
  if (entry.report.captures > 0) {
    WriteEvent(entry, v1::EVENT_KIND_CAPTURE, entry.report.captures, "");
  }
  if (entry.report.releases > 0) {
    WriteEvent(entry, v1::EVENT_KIND_RELEASE, entry.report.releases, "");
  }
  // Once for each run of steps that meet the same limit.
  if ((entry.report.bits & ~bits_before_) != 0) {
    WriteEvent(entry, v1::EVENT_KIND_REPORT, 0,
               absl::StrCat("report_bits ", entry.report.bits & ~bits_before_));
  }
  bits_before_ = entry.report.bits;
  for (std::size_t i = 0; i < entry.tools.size(); ++i) {
    const std::uint32_t flags = entry.tools[i].flags;
    if (flags & ~flags_before_[i] & kToolOperatorLost) {
      WriteEvent(entry, v1::EVENT_KIND_OPERATOR_LOST, 0, tool_names_[i]);
    }
    flags_before_[i] = flags;
  }
}

void Recorder::WriteEvent(const Entry& entry, v1::EventKind kind, std::uint32_t particles,
                          const std::string& text) {
  v1::Event event;
  event.set_step(entry.step);
  event.set_time_s(entry.time_s);
  event.set_kind(kind);
  event.set_particles(particles);
  event.set_text(text);
  Write(channels_.events, entry.index, event);
}

void Recorder::WriteFrame(const SessionFrame& frame, std::uint64_t index) {
  view_.set_step(frame.frame.step);
  view_.set_time_s(frame.frame.time_s);
  EncodeFrame(frame, {v1::POSITION_ENCODING_FLOAT32, true}, view_.mutable_frame());
  Write(channels_.frames, index, view_);
}

void Recorder::WriteHashes() {
  if (hashes_.hashes().empty()) return;
  Write(channels_.hashes, hashes_.first_index() + hashes_.hashes_size() - 1, hashes_);
  hashes_.clear_hashes();
}

void Recorder::Write(std::uint16_t channel, std::uint64_t index,
                     const google::protobuf::MessageLite& message) {
  message.SerializeToString(&scratch_);
  writer_.AddMessage(channel, LogTime(index, dt_s_), scratch_);
}

}  // namespace adhesim
