#include "server/viewer_stream.h"

#include <absl/strings/str_cat.h>

#include <utility>
#include <vector>

#include "server/errors.h"

namespace adhesim {
namespace {

constexpr double kDefaultRateHz = 60;
constexpr double kLowestRateHz = 0.01;
constexpr std::uint32_t kDefaultCredits = 2;
constexpr std::uint32_t kMaxCredits = 8;

absl::StatusOr<Hub::ViewerOptions> CheckStart(const v1::WatchStart& start) {
  Hub::ViewerOptions options;
  options.max_rate_hz = start.has_max_rate_hz() ? start.max_rate_hz() : kDefaultRateHz;
  options.credits = start.has_credits() ? start.credits() : kDefaultCredits;
  std::vector<FieldViolation> violations;
  if (!(options.max_rate_hz >= kLowestRateHz)) {
    violations.push_back({"start.max_rate_hz", absl::StrCat(options.max_rate_hz, ", permitted are ",
                                                            kLowestRateHz, " and more")});
  }
  if (options.credits < 1 || options.credits > kMaxCredits) {
    violations.push_back(
        {"start.credits", absl::StrCat(options.credits, ", permitted are 1 to ", kMaxCredits)});
  }
  if (!v1::PositionEncoding_IsValid(start.encoding())) {
    violations.push_back(
        {"start.encoding", absl::StrCat(static_cast<int>(start.encoding()), " is not known")});
  }
  if (start.encoding() == v1::POSITION_ENCODING_Q16)
    options.format.positions = v1::POSITION_ENCODING_Q16;
  for (int i = 0; i < start.fields_size(); ++i) {
    if (start.fields(i) == v1::FRAME_FIELD_STRAIN_ENERGY) {
      options.format.strain_energy = true;
    } else if (start.fields(i) == v1::FRAME_FIELD_CONTACTS) {
      options.format.contacts = true;
    } else if (start.fields(i) != v1::FRAME_FIELD_UNSPECIFIED) {
      violations.push_back({absl::StrCat("start.fields[", i, "]"),
                            absl::StrCat(static_cast<int>(start.fields(i)), " is not known")});
      break;  // one of them says it all
    }
  }
  if (violations.empty()) return options;
  return Error(Reason::kArgumentInvalid,
               absl::StrCat(violations[0].field, ": ", violations[0].description), violations);
}

}  // namespace

ViewerStream::ViewerStream(ServiceContext* context, std::function<void()> wake)
    : context_(context), wake_(std::move(wake)) {}

void ViewerStream::Deliver(const SharedBytes& message, std::uint64_t frames_dropped) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back({message, frames_dropped});
  }
  wake_();
}

void ViewerStream::DeliverHeartbeat(const SharedBytes& message, std::uint64_t frames_dropped) {
  {
    const std::lock_guard lock(mutex_);
    heartbeat_ = {message, frames_dropped};
  }
  wake_();
}

void ViewerStream::End(const absl::Status& why) {
  {
    const std::lock_guard lock(mutex_);
    if (!ended_) ended_ = why;
  }
  wake_();
}

std::optional<absl::Status> ViewerStream::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

absl::Status ViewerStream::Receive(const v1::WatchRequest& request) {
  if (live_ == nullptr) return StartWatching(request);
  if (request.has_start()) {
    return Error(Reason::kStreamStartedTwice, "only the first message may start");
  }
  if (live_->hub->Acknowledge(this, request.ack().frames())) live_->session->WakeObserver();
  return absl::OkStatus();
}

absl::Status ViewerStream::StartWatching(const v1::WatchRequest& request) {
  if (!request.has_start()) {
    return Error(Reason::kStreamNotStarted, "the first message must say what to watch");
  }
  const absl::StatusOr<Hub::ViewerOptions> options = CheckStart(request.start());
  if (!options.ok()) return options.status();
  absl::StatusOr<std::shared_ptr<LiveSession>> live =
      context_->sessions.Find(request.start().session());
  if (!live.ok()) return live.status();
  live_ = *std::move(live);
  if (absl::Status status = live_->hub->AddViewer(*options, this); !status.ok()) return status;
  live_->session->WakeObserver();
  return absl::OkStatus();
}

void ViewerStream::Leave() {
  if (live_ != nullptr) live_->hub->RemoveViewer(this);
}

bool ViewerStream::Next(Outgoing* response) {
  Waiting next;
  {
    const std::lock_guard lock(mutex_);
    if (!waiting_.empty()) {
      next = std::move(waiting_.front());
      waiting_.pop_front();
    } else if (heartbeat_.bytes != nullptr) {
      next = std::exchange(heartbeat_, {});
    } else {
      return false;
    }
  }
  v1::WatchResponse own;
  own.set_frames_dropped(next.frames_dropped);
  response->shared = std::move(next.bytes);
  own.SerializeToString(&response->own);
  return true;
}

}  // namespace adhesim
