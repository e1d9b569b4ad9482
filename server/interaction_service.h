#pragma once

#include <grpcpp/support/server_callback.h>

#include "adhesim/v1/interaction_service.grpc.pb.h"
#include "server/service_context.h"

namespace adhesim {

// Operators' streams.
class InteractionService final : public v1::InteractionService::CallbackService {
 public:
  explicit InteractionService(ServiceContext* context) : context_(context) {}

  grpc::ServerBidiReactor<v1::InteractRequest, v1::InteractResponse>* Interact(
      grpc::CallbackServerContext* call) override;

 private:
  ServiceContext* const context_;
};

}  // namespace adhesim
