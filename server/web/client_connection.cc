#include "server/web/client_connection.h"

#include <absl/strings/str_cat.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "server/errors.h"

namespace adhesim {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedOutputStream;

std::string EndOf(std::uint32_t number, const absl::Status& why) {
  v1::ServerMessage message;
  message.set_stream(number);
  message.mutable_ended()->ParseFromString(ErrorDetails(why));  // empty when OK
  return message.SerializeAsString();
}

absl::Status InUse(std::uint32_t number) {
  return Error(Reason::kStreamInUse,
               absl::StrCat("stream ", number, " is another call that has not ended"));
}

// Everything of a ServerMessage that comes before the bytes of its WatchResponse.
std::string HeadOfWatch(std::uint32_t number, std::size_t bytes) {
  v1::ServerMessage message;
  message.set_stream(number);
  std::string head = message.SerializeAsString();
  std::uint8_t field[2 * 10];
  std::uint8_t* end = CodedOutputStream::WriteTagToArray(
      WireFormatLite::MakeTag(v1::ServerMessage::kWatchFieldNumber,
                              WireFormatLite::WIRETYPE_LENGTH_DELIMITED),
      field);
  end = CodedOutputStream::WriteVarint64ToArray(bytes, end);
  head.append(reinterpret_cast<const char*>(field), end - field);
  return head;
}

}  // namespace

ClientConnection::ClientConnection(ServiceContext* context, SessionCalls* calls, std::string peer,
                                   std::function<void()> wake)
    : context_(context), calls_(calls), peer_(std::move(peer)), wake_(std::move(wake)) {}

std::string ClientConnection::Farewell(const absl::Status& why) { return EndOf(0, why); }

absl::Status ClientConnection::Receive(std::string_view bytes, std::shared_ptr<void> held) {
  {
    // Refusals are answers, too: a client that never reads them is not answered for ever.
    const std::lock_guard lock(mutex_);
    if (answers_.size() >= 2 * kMaxCalls) {
      return Error(Reason::kTooManyRequests,
                   absl::StrCat(answers_.size(), " answers are waiting to be read"));
    }
  }
  if (!received_.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return Error(Reason::kArgumentInvalid, "the message is not a ClientMessage");
  }
  const std::uint32_t number = received_.stream();
  if (number == 0) {
    return Error(Reason::kArgumentInvalid, "stream is 0, permitted are 1 and more");
  }
  const std::uint32_t limit = context_->sessions.limits().stream_message_bytes;
  if (bytes.size() > limit && !received_.has_create_session()) {
    EndNumber(number, Error(Reason::kMessageTooLarge,
                            absl::StrCat("a message of ", bytes.size(), " bytes, permitted are ",
                                         limit, " unless it creates a session")));
    return absl::OkStatus();
  }
  switch (received_.request_case()) {
    case v1::ClientMessage::kWatch:
      ToStream<ViewerStream>(number, received_.watch(), received_.watch().has_start());
      break;
    case v1::ClientMessage::kInteract:
      ToStream<OperatorStream>(number, received_.interact(),
                               received_.interact().has_take_control());
      break;
    case v1::ClientMessage::kEnd:
      // Of a call: its answer ends it anyway. Of anything else: it has ended already.
      if (streams_.contains(number)) EndNumber(number, absl::OkStatus());
      break;
    case v1::ClientMessage::REQUEST_NOT_SET:
      EndNumber(number, Error(Reason::kArgumentInvalid, "no request that this server knows"));
      break;
    default:
      StartCall(std::move(held));
  }
  if (bytes.size() > limit) v1::ClientMessage().Swap(&received_);  // gives its memory back
  return absl::OkStatus();
}

absl::StatusOr<PeerCounter::Share> ClientConnection::TakeStream() const {
  if (streams_.size() < kMaxStreams) return context_->TakeStream(peer_);
  return Error(Reason::kTooManyStreams, absl::StrCat("this connection has ", kMaxStreams,
                                                     " streams, more are not permitted"));
}

template <typename End, typename Request>
void ClientConnection::ToStream(std::uint32_t number, const Request& request, bool opens) {
  if (!IsOpen(number)) {
    // It was sent before the client could know that the stream has ended.
    if (!opens && number <= highest_number_) return;
    absl::StatusOr<PeerCounter::Share> share = TakeStream();
    if (!share.ok()) {
      EndNumber(number, share.status());
      return;
    }
    Stream& stream = streams_[number];
    stream.share = *std::move(share);
    stream.end.emplace<End>(context_, wake_);
    highest_number_ = std::max(highest_number_, number);
  }
  const auto found = streams_.find(number);
  End* const end = found == streams_.end() ? nullptr : std::get_if<End>(&found->second.end);
  const absl::Status status = end == nullptr ? InUse(number) : end->Receive(request);
  if (!status.ok()) EndNumber(number, status);
}

bool ClientConnection::IsOpen(std::uint32_t number) const {
  if (streams_.contains(number)) return true;
  const std::lock_guard lock(mutex_);
  return pending_.contains(number);
}

void ClientConnection::EndNumber(std::uint32_t number, const absl::Status& why) {
  streams_.erase(number);
  {
    const std::lock_guard lock(mutex_);
    pending_.erase(number);  // its answer will be dropped
    answers_.push_back(EndOf(number, why));
  }
  wake_();
}

void ClientConnection::StartCall(std::shared_ptr<void> held) {
  const std::uint32_t number = received_.stream();
  absl::Status refusal;
  auto call = std::make_shared<Call>();
  if (IsOpen(number)) {
    refusal = InUse(number);
  } else {
    const std::lock_guard lock(mutex_);
    if (pending_.size() + answers_.size() >= kMaxCalls) {
      refusal = Error(Reason::kTooManyRequests,
                      absl::StrCat(kMaxCalls, " requests of this connection are waiting already"));
    } else {
      pending_[number] = call;
    }
  }
  if (!refusal.ok()) {
    EndNumber(number, refusal);
    return;
  }
  call->request.Swap(&received_);
  call->held = std::move(held);
  const v1::ClientMessage& request = call->request;
  v1::ServerMessage& response = call->response;
  switch (request.request_case()) {
    case v1::ClientMessage::kListScenes:
      return Dispatch(call, request.list_scenes(), response.mutable_list_scenes());
    case v1::ClientMessage::kCreateSession:
      return Dispatch(call, request.create_session(), response.mutable_create_session());
    case v1::ClientMessage::kGetSession:
      return Dispatch(call, request.get_session(), response.mutable_get_session());
    case v1::ClientMessage::kListSessions:
      return Dispatch(call, request.list_sessions(), response.mutable_list_sessions());
    case v1::ClientMessage::kDeleteSession:
      return Dispatch(call, request.delete_session(), response.mutable_delete_session());
    case v1::ClientMessage::kPauseSession:
      return Dispatch(call, request.pause_session(), response.mutable_pause_session());
    case v1::ClientMessage::kResumeSession:
      return Dispatch(call, request.resume_session(), response.mutable_resume_session());
    case v1::ClientMessage::kStepSession:
      return Dispatch(call, request.step_session(), response.mutable_step_session());
    case v1::ClientMessage::kResetSession:
      return Dispatch(call, request.reset_session(), response.mutable_reset_session());
    case v1::ClientMessage::kGetServerInfo:
      return Dispatch(call, request.get_server_info(), response.mutable_get_server_info());
    case v1::ClientMessage::kListRecordings:
      return Dispatch(call, request.list_recordings(), response.mutable_list_recordings());
    default:
      FinishCall(call, Error(Reason::kInternal, "a request that nobody answers"));
  }
}

template <typename Request, typename Response>
void ClientConnection::Dispatch(const std::shared_ptr<Call>& call, const Request& request,
                                Response* response) {
  const std::weak_ptr<ClientConnection> weak = weak_from_this();
  const auto gone = [weak] {
    const std::shared_ptr<ClientConnection> self = weak.lock();
    if (self == nullptr) return true;
    const std::lock_guard lock(self->mutex_);
    return self->left_;
  };
  calls_->Handle({peer_, gone}, request, response, [weak, call](const absl::Status& status) {
    if (const std::shared_ptr<ClientConnection> self = weak.lock()) self->FinishCall(call, status);
  });
}

// On any thread.
void ClientConnection::FinishCall(const std::shared_ptr<Call>& call, const absl::Status& status) {
  const std::uint32_t number = call->request.stream();
  call->response.set_stream(number);
  std::string answer = status.ok() ? call->response.SerializeAsString() : EndOf(number, status);
  const std::lock_guard lock(mutex_);
  const auto found = pending_.find(number);
  if (left_ || found == pending_.end() || found->second != call) return;
  pending_.erase(found);
  answers_.push_back(std::move(answer));
  wake_();
}

// Answers first, then the streams in turn.
bool ClientConnection::Next(Outgoing* message) {
  EndStreamsThatEnded();
  {
    const std::lock_guard lock(mutex_);
    if (!answers_.empty()) {
      *message = Outgoing{std::move(answers_.front()), nullptr, ""};
      answers_.pop_front();
      return true;
    }
  }
  auto it = streams_.upper_bound(last_served_);
  for (std::size_t i = 0; i < streams_.size(); ++i, ++it) {
    if (it == streams_.end()) it = streams_.begin();
    if (!NextOfStream(it->first, &it->second, message)) continue;
    last_served_ = it->first;
    return true;
  }
  return false;
}

void ClientConnection::EndStreamsThatEnded() {
  for (auto it = streams_.begin(); it != streams_.end();) {
    const auto& [number, stream] = *it++;
    std::optional<absl::Status> why;
    if (const auto* viewer = std::get_if<ViewerStream>(&stream.end)) why = viewer->ended();
    if (const auto* op = std::get_if<OperatorStream>(&stream.end)) why = op->ended();
    if (why) EndNumber(number, *why);
  }
}

bool ClientConnection::NextOfStream(std::uint32_t number, Stream* stream, Outgoing* message) {
  if (auto* viewer = std::get_if<ViewerStream>(&stream->end)) {
    ViewerStream::Outgoing response;
    if (!viewer->Next(&response)) return false;
    *message = Outgoing{HeadOfWatch(number, response.shared->size() + response.own.size()),
                        std::move(response.shared), std::move(response.own)};
    return true;
  }
  if (!std::get<OperatorStream>(stream->end).Next(sent_.mutable_interact())) return false;
  sent_.set_stream(number);
  *message = Outgoing{sent_.SerializeAsString(), nullptr, ""};
  return true;
}

void ClientConnection::Leave() {
  streams_.clear();
  const std::lock_guard lock(mutex_);
  left_ = true;
  pending_.clear();
}

}  // namespace adhesim
