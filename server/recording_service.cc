#include "server/recording_service.h"

#include <absl/strings/str_cat.h>

#include <fstream>
#include <string>

#include "server/errors.h"
#include "server/grpc_status.h"

namespace adhesim {
namespace {

constexpr std::size_t kPieceBytes = 256 << 10;

// Sends a file piece by piece; the next one is read when the one before has left. Deletes itself.
class FileReactor final : public grpc::ServerWriteReactor<v1::ReadRecordingResponse> {
 public:
  FileReactor(ServiceContext* context, const std::string& peer, const std::string& name) {
    const Limits& limits = context->sessions.limits();
    share_ = context->streams.Take(PeerHost(peer), limits.streams_per_peer);
    if (share_ == nullptr) {
      Finish(ToGrpcStatus(
          Error(Reason::kTooManyStreams, absl::StrCat("this peer has ", limits.streams_per_peer,
                                                      " streams, more are not permitted"))));
      return;
    }
    const auto& find = context->sessions.recordings().find;
    const absl::StatusOr<std::string> path =
        find ? find(name)
             : Error(Reason::kRecordingNotFound, "this server was started without recordings");
    if (!path.ok()) {
      Finish(ToGrpcStatus(path.status()));
      return;
    }
    file_.open(*path, std::ios::binary);
    SendNext();
  }

  void OnWriteDone(bool ok) override {
    if (ok) {
      SendNext();
    } else {
      Finish(grpc::Status::CANCELLED);
    }
  }
  void OnDone() override { delete this; }

 private:
  void SendNext() {
    std::string* piece = response_.mutable_data();
    piece->resize(kPieceBytes);
    file_.read(piece->data(), kPieceBytes);
    piece->resize(file_.gcount());
    if (file_.bad()) {
      Finish(ToGrpcStatus(Error(Reason::kInternal, "the recording cannot be read")));
    } else if (piece->empty()) {
      Finish(grpc::Status::OK);
    } else {
      StartWrite(&response_);
    }
  }

  PeerCounter::Share share_;
  std::ifstream file_;
  v1::ReadRecordingResponse response_;
};

}  // namespace

grpc::ServerUnaryReactor* RecordingService::ListRecordings(grpc::CallbackServerContext* call,
                                                           const v1::ListRecordingsRequest*,
                                                           v1::ListRecordingsResponse* response) {
  const auto& list = context_->sessions.recordings().list;
  if (list) *response = list();
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

grpc::ServerWriteReactor<v1::ReadRecordingResponse>* RecordingService::ReadRecording(
    grpc::CallbackServerContext* call, const v1::ReadRecordingRequest* request) {
  return new FileReactor(context_, call->peer(), request->name());
}

}  // namespace adhesim
