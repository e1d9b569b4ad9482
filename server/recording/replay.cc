#include "server/recording/replay.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>

#include "adhesim/v1/recording.pb.h"
#include "core/engine/engine.h"
#include "server/pose_check.h"
#include "server/recording/mcap_reader.h"
#include "server/recording/recorded_scene.h"
#include "server/recording/recorder.h"

namespace adhesim {
namespace {

constexpr std::size_t kMostDamage = 100;

// An engine that is fed the messages of a recording.
class Player {
 public:
  Player(std::unique_ptr<Engine> engine, const ReplayOptions& options, ReplayResult* result)
      : engine_(std::move(engine)),
        options_(options),
        stop_(options.stop ? &options.stop() : nullptr),
        inputs_(engine_->model().tools.size()),
        result_(*result) {}

  void TakeInputs(const McapMessage& message);
  // Steps as often as there are hashes. False: the replay is over.
  bool TakeHashes(const McapMessage& message);
  void TakeEvent(const McapMessage& message);
  // A message of a step: when the file is whole, that step has a hash.
  void NoteStep(const McapMessage& message);
  // At the end of a whole file: steps without a hash are a difference, not a shorter recording.
  void CheckAllWereHashed();
  std::uint64_t Hash() const { return RecordedHash(*engine_); }

 private:
  void Apply(const v1::StepInputs& inputs);
  bool Decode(const v1::ToolInput& message, ToolInput* input) const;
  bool Step(std::optional<std::uint64_t> expected);
  void Damaged(const McapMessage& message, const std::string& what);

  const std::unique_ptr<Engine> engine_;
  const ReplayOptions& options_;
  const std::atomic<bool>* const stop_;
  std::vector<ToolInput> inputs_;       // [#tools]
  std::deque<v1::StepInputs> pending_;  // of steps to come
  std::uint64_t last_made_ = 0;         // the latest step that anything in the file is of
  ReplayResult& result_;
};

void Player::Damaged(const McapMessage& message, const std::string& what) {
  if (result_.damage.size() < kMostDamage) {
    result_.damage.push_back({message.offset, what, message.log_time, message.log_time});
  }
}

void Player::TakeInputs(const McapMessage& message) {
  v1::StepInputs inputs;
  if (!inputs.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    return Damaged(message, "inputs that cannot be decoded");
  }
  last_made_ = std::max(last_made_, inputs.index());
  pending_.push_back(std::move(inputs));
}

void Player::NoteStep(const McapMessage& message) {
  // Log times are whole ns, steps at least microseconds: rounding finds the step again.
  const double index = 1e-9 * static_cast<double>(message.log_time) / engine_->model().dt_s;
  last_made_ = std::max(last_made_, static_cast<std::uint64_t>(std::llround(index)));
}

void Player::CheckAllWereHashed() {
  if (!options_.verify || result_.difference || result_.interrupted) return;
  if (last_made_ > result_.steps) Step(std::nullopt);
}

void Player::TakeEvent(const McapMessage& message) {
  v1::Event event;
  if (!event.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) return;
  if (event.kind() == v1::EVENT_KIND_TRUNCATED) result_.writer_was_behind = true;
}

// Recorded poses were checked, and their quaternions normalised; doing so again would change bits.
// False: no session would have used it.
bool Player::Decode(const v1::ToolInput& message, ToolInput* input) const {
  *input = ToolInput{};
  input->retracted = message.retracted();
  if (message.has_strength_scale()) input->strength_scale = message.strength_scale();
  if (!(input->strength_scale >= 0 && input->strength_scale <= 1)) return false;
  if (!message.has_target()) return true;
  if (!CheckPose(message.target()).ok()) return false;
  const v1::Pose& pose = message.target();
  input->has_target = true;
  input->target.position_m = {pose.x_m(), pose.y_m(), pose.z_m()};
  input->target.orientation = Quat(pose.qw(), pose.qx(), pose.qy(), pose.qz());
  return true;
}

void Player::Apply(const v1::StepInputs& step) {
  if (step.reset()) {
    engine_->Reset();
    engine_->SetFidelity(0);
    inputs_.assign(inputs_.size(), ToolInput{});
  }
  // More rungs than the engine has, in a damaged file, are as many as it has.
  if (step.has_fidelity()) engine_->SetFidelity(static_cast<int>(std::min(step.fidelity(), 100u)));
  for (const v1::ToolInput& message : step.tools()) {
    ToolInput input;
    // What cannot be applied shows as a difference of this step.
    if (message.tool() < inputs_.size() && Decode(message, &input)) {
      inputs_[message.tool()] = input;
    }
  }
}

bool Player::Step(std::optional<std::uint64_t> expected) {
  const std::uint64_t index = result_.steps + 1;
  while (!pending_.empty() && pending_.front().index() <= index) {
    Apply(pending_.front());
    pending_.pop_front();
  }
  engine_->Step(inputs_);
  ++result_.steps;
  if (!options_.verify) return true;
  const std::uint64_t actual = Hash();
  if (actual == expected) {
    ++result_.verified;
    return true;
  }
  result_.difference = {index, engine_->state().step, engine_->state().time_s, actual, expected};
  return false;
}

bool Player::TakeHashes(const McapMessage& message) {
  v1::StateHashes hashes;
  if (!hashes.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    Damaged(message, "hashes that cannot be decoded");
    return true;
  }
  if (hashes.first_index() != result_.steps + 1) {
    // Hashes are missing: how many steps, and with which inputs, is not known any more.
    Damaged(message, absl::StrCat("hashes from step ", hashes.first_index(),
                                  " on, expected those from step ", result_.steps + 1, " on"));
    Step(std::nullopt);
    return false;
  }
  for (const std::uint64_t hash : hashes.hashes()) {
    result_.interrupted = stop_ != nullptr && stop_->load();
    if (result_.interrupted || !Step(hash)) return false;
  }
  return true;
}

// Feeds the player until the end of the recording or of the replay.
absl::Status Play(McapReader* reader, Player* player, ReplayResult* result) {
  McapMessage message;
  bool playing = true;
  while (true) {
    const absl::StatusOr<bool> more = reader->Next(&message);
    if (!more.ok()) return more.status();
    if (!*more) {
      if (!reader->truncated_at()) player->CheckAllWereHashed();
      return absl::OkStatus();
    }
    const auto channel = reader->channels().find(message.channel);
    if (channel == reader->channels().end()) continue;
    const std::string& topic = channel->second.topic;
    if (topic == kFramesTopic) ++result->frames;
    if (topic == kEventsTopic) player->TakeEvent(message);
    if (!playing) {
      if (result->interrupted) return absl::OkStatus();
      continue;  // to the end, for what else is wrong with the file
    }
    if (topic == kFramesTopic || topic == kForcesTopic) player->NoteStep(message);
    if (topic == kInputsTopic) player->TakeInputs(message);
    if (topic == kHashesTopic) playing = player->TakeHashes(message);
  }
}

// What the file says about itself is for people; the scene is what was stepped.
absl::Status CheckAbout(const RecordingAbout& about, const Model& model) {
  const double rate_hz = 1 / model.dt_s;
  if (about.seed != model.seed) {
    return absl::InvalidArgumentError(absl::StrCat("the metadata say that the seed is ", about.seed,
                                                   ", the scene says ", model.seed));
  }
  // Both are the same number written and read; a few roundings are permitted to other writers.
  if (!(std::abs(about.rate_hz - rate_hz) <= 1e-12 * rate_hz)) {
    return absl::InvalidArgumentError(absl::StrCat("the metadata say that rate_hz is ",
                                                   about.rate_hz, ", the scene says ", rate_hz));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ReplayResult> Replay(const std::string& path, const ReplayOptions& options) {
  absl::StatusOr<std::unique_ptr<McapReader>> reader = McapReader::Open(path);
  if (!reader.ok()) return reader.status();
  absl::StatusOr<RecordingBeginning> beginning = ReadBeginning(**reader, path);
  if (!beginning.ok()) return beginning.status();
  const absl::StatusOr<std::shared_ptr<const Model>> model = BuildRecordedModel(*beginning);
  if (!model.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", model.status().message()));
  }
  if (absl::Status status = CheckAbout(beginning->about, **model); !status.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", status.message()));
  }
  absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(*model, {.threads = options.threads});
  if (!engine.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", engine.status().message()));
  }
  ReplayResult result;
  result.about = beginning->about;
  result.dt_s = (*model)->dt_s;
  Player player(*std::move(engine), options, &result);
  if (absl::Status status = Play(reader->get(), &player, &result); !status.ok()) return status;
  result.final_hash = player.Hash();
  result.truncated_at = (*reader)->truncated_at();
  const std::vector<McapDamage>& damage = (*reader)->damage();
  result.damage.insert(result.damage.begin(), damage.begin(), damage.end());
  return result;
}

}  // namespace adhesim
