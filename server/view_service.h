#pragma once

#include <grpcpp/support/server_callback.h>

#include "adhesim/v1/view_service.grpc.pb.h"
#include "server/service_context.h"

namespace adhesim {

// Viewers' streams, on serialised messages: a frame is serialised once, whatever the number of
// viewers.
class ViewService final
    : public v1::ViewService::WithRawCallbackMethod_Watch<v1::ViewService::Service> {
 public:
  explicit ViewService(ServiceContext* context) : context_(context) {}

  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* Watch(
      grpc::CallbackServerContext* call) override;

 private:
  ServiceContext* const context_;
};

}  // namespace adhesim
