#include "server/interaction_service.h"

#include "server/operator_stream.h"
#include "server/ordered_stream.h"

namespace adhesim {
namespace {

// Carries an operator's stream over gRPC.
class OperatorReactor final : public OrderedStream<v1::InteractRequest, v1::InteractResponse> {
 public:
  OperatorReactor(ServiceContext* context, const std::string& peer)
      : share_(context->TakeStream(peer)), stream_(context, [this] { Wake(); }) {
    share_.ok() ? Start() : Close(share_.status());
  }

 protected:
  absl::Status Receive(const v1::InteractRequest& request) override {
    return stream_.Receive(request);
  }
  void Leave() override { stream_.Leave(); }
  bool Next(v1::InteractResponse* response) override { return stream_.Next(response); }
  std::optional<absl::Status> Ended() const override { return stream_.ended(); }

 private:
  const absl::StatusOr<PeerCounter::Share> share_;
  OperatorStream stream_;
};

}  // namespace

grpc::ServerBidiReactor<v1::InteractRequest, v1::InteractResponse>* InteractionService::Interact(
    grpc::CallbackServerContext* call) {
  return new OperatorReactor(context_, call->peer());
}

}  // namespace adhesim
