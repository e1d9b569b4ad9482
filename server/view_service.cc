#include "server/view_service.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/impl/codegen/proto_utils.h>

#include "server/errors.h"
#include "server/ordered_stream.h"
#include "server/viewer_stream.h"

namespace adhesim {
namespace {

// The shared bytes themselves (kept alive by the slice, not copied), and the viewer's own.
grpc::ByteBuffer Join(const ViewerStream::Outgoing& message) {
  auto* keeper = new SharedBytes(message.shared);
  const grpc::Slice slices[] = {
      grpc::Slice(
          const_cast<char*>(message.shared->data()), message.shared->size(),
          [](void* kept) { delete static_cast<SharedBytes*>(kept); }, keeper),
      grpc::Slice(message.own)};
  return grpc::ByteBuffer(slices, 2);
}

// Carries a viewer's stream over gRPC.
class ViewerReactor final : public OrderedStream<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  ViewerReactor(ServiceContext* context, const std::string& peer)
      : message_limit_(context->sessions.limits().stream_message_bytes),
        share_(context->TakeStream(peer)),
        stream_(context, [this] { Wake(); }) {
    share_.ok() ? Start() : Close(share_.status());
  }

 protected:
  absl::Status Receive(const grpc::ByteBuffer& bytes) override {
    if (bytes.Length() > message_limit_) {
      return Error(
          Reason::kMessageTooLarge,
          absl::StrCat("a message of ", bytes.Length(), " bytes, permitted are ", message_limit_));
    }
    grpc::ByteBuffer copy(bytes);  // of references; deserialising clears its argument
    v1::WatchRequest request;
    if (!grpc::SerializationTraits<v1::WatchRequest>::Deserialize(&copy, &request).ok()) {
      return Error(Reason::kArgumentInvalid, "the message is not a WatchRequest");
    }
    return stream_.Receive(request);
  }

  void Leave() override { stream_.Leave(); }

  bool Next(grpc::ByteBuffer* response) override {
    ViewerStream::Outgoing next;
    if (!stream_.Next(&next)) return false;
    *response = Join(next);
    return true;
  }

  std::optional<absl::Status> Ended() const override { return stream_.ended(); }

 private:
  const std::uint32_t message_limit_;
  const absl::StatusOr<PeerCounter::Share> share_;
  ViewerStream stream_;
};

}  // namespace

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* ViewService::Watch(
    grpc::CallbackServerContext* call) {
  return new ViewerReactor(context_, call->peer());
}

}  // namespace adhesim
