#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

#include <string>

#include "server/errors.h"

namespace adhesim {

// The numbers of the codes are the same. The details go into the trailer `grpc-status-details-bin`.
inline grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()),
                      ErrorDetails(status));
}

}  // namespace adhesim
