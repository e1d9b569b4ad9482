#pragma once

#include <grpcpp/support/server_callback.h>

#include "adhesim/v1/recording_service.grpc.pb.h"
#include "server/service_context.h"

namespace adhesim {

// Lists and reads the server's recordings, over gRPC.
class RecordingService final : public v1::RecordingService::CallbackService {
 public:
  explicit RecordingService(ServiceContext* context) : context_(context) {}

  grpc::ServerUnaryReactor* ListRecordings(grpc::CallbackServerContext* call,
                                           const v1::ListRecordingsRequest* request,
                                           v1::ListRecordingsResponse* response) override;
  grpc::ServerWriteReactor<v1::ReadRecordingResponse>* ReadRecording(
      grpc::CallbackServerContext* call, const v1::ReadRecordingRequest* request) override;

 private:
  ServiceContext* const context_;
};

}  // namespace adhesim
