#include "server/view_service.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/impl/codegen/proto_utils.h>

#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "server/errors.h"
#include "server/ordered_stream.h"

namespace adhesim {
namespace {

constexpr double kDefaultRateHz = 60;
constexpr double kLowestRateHz = 0.01;
constexpr std::uint32_t kDefaultCredits = 2;
constexpr std::uint32_t kMaxCredits = 8;

// A message as it waits to be sent.
struct Outgoing {
  SharedBytes bytes;
  std::uint64_t frames_dropped = 0;
};

// The shared bytes themselves (kept alive by the slice, not copied), and the viewer's own field
// appended: in the wire format, fields of a message can be concatenated.
grpc::ByteBuffer Join(const Outgoing& message) {
  v1::WatchResponse own;
  own.set_frames_dropped(message.frames_dropped);
  auto* keeper = new SharedBytes(message.bytes);
  const grpc::Slice slices[] = {
      grpc::Slice(
          const_cast<char*>(message.bytes->data()), message.bytes->size(),
          [](void* kept) { delete static_cast<SharedBytes*>(kept); }, keeper),
      grpc::Slice(own.SerializeAsString())};
  return grpc::ByteBuffer(slices, 2);
}

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
  for (const int field : start.fields()) {
    if (field == v1::FRAME_FIELD_STRAIN_ENERGY) {
      options.format.strain_energy = true;
    } else {
      violations.push_back({"start.fields", absl::StrCat(field, " is not known")});
    }
  }
  if (start.encoding() == v1::POSITION_ENCODING_Q16) {
    options.format.positions = v1::POSITION_ENCODING_Q16;
  }
  if (violations.empty()) return options;
  return Error(Reason::kArgumentInvalid,
               absl::StrCat(violations[0].field, ": ", violations[0].description), violations);
}

// One viewer's stream. Frames wait for as long as credits allow; a heartbeat waits alone.
class ViewerStream final : public OrderedStream<grpc::ByteBuffer, grpc::ByteBuffer>,
                           public ViewerSink {
 public:
  ViewerStream(ServiceContext* context, const std::string& peer) : context_(context) {
    const Limits& limits = context_->sessions.limits();
    share_ = context_->streams.Take(PeerHost(peer), limits.streams_per_peer);
    if (share_ == nullptr) {
      Close(Error(Reason::kTooManyStreams, absl::StrCat("this peer has ", limits.streams_per_peer,
                                                        " streams, more are not permitted")));
      return;
    }
    Start();
  }

  void Deliver(const SharedBytes& message, std::uint64_t frames_dropped) override {
    absl::MutexLock lock(&mutex_);
    waiting_.push_back({message, frames_dropped});
    Continue();
  }

  void DeliverHeartbeat(const SharedBytes& message, std::uint64_t frames_dropped) override {
    absl::MutexLock lock(&mutex_);
    heartbeat_ = {message, frames_dropped};
    Continue();
  }

  void End(const absl::Status& why) override { Close(why); }

 protected:
  absl::Status Receive(const grpc::ByteBuffer& bytes) override {
    const std::uint32_t limit = context_->sessions.limits().stream_message_bytes;
    if (bytes.Length() > limit) {
      return Error(Reason::kMessageTooLarge,
                   absl::StrCat("a message of ", bytes.Length(), " bytes, permitted are ", limit));
    }
    grpc::ByteBuffer copy(bytes);  // of references; deserialising clears its argument
    v1::WatchRequest request;
    if (!grpc::SerializationTraits<v1::WatchRequest>::Deserialize(&copy, &request).ok()) {
      return Error(Reason::kArgumentInvalid, "the message is not a WatchRequest");
    }
    if (live_ == nullptr) return StartWatching(request);
    if (request.has_start()) {
      return Error(Reason::kStreamStartedTwice, "only the first message may start");
    }
    live_->hub->Acknowledge(this, request.ack().frames());
    live_->session->WakeObserver();
    return absl::OkStatus();
  }

  void Leave() override {
    if (live_ != nullptr) live_->hub->RemoveViewer(this);
  }

  bool Next(grpc::ByteBuffer* response) override {
    if (!waiting_.empty()) {
      *response = Join(waiting_.front());
      waiting_.pop_front();
      return true;
    }
    if (heartbeat_.bytes == nullptr) return false;
    *response = Join(heartbeat_);
    heartbeat_ = {};
    return true;
  }

 private:
  absl::Status StartWatching(const v1::WatchRequest& request) {
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

  ServiceContext* const context_;
  PeerCounter::Share share_;
  // Written by the first Receive() only.
  std::shared_ptr<LiveSession> live_;

  std::deque<Outgoing> waiting_ ABSL_GUARDED_BY(mutex_);
  Outgoing heartbeat_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* ViewService::Watch(
    grpc::CallbackServerContext* call) {
  return new ViewerStream(context_, call->peer());
}

}  // namespace adhesim
