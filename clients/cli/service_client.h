#pragma once

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace adhesim {

// What the commands that talk to a server share. They use gRPC's synchronous calls: in gRPC 1.51 a
// client of its callback calls sleeps 100 ms now and then when nothing happens for a second.

constexpr double kShortCallS = 10;
// Building a scene from an image takes a while.
constexpr double kCreateCallS = 120;

// CLOCK_MONOTONIC, ns.
inline std::int64_t ClockNs() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

// Connected to HOST:PORT, or null after a message.
inline std::shared_ptr<grpc::Channel> Connect(const std::string& address) {
  // Failures are told below, in words of our own; GRPC_VERBOSITY=ERROR brings gRPC's back.
  setenv("GRPC_VERBOSITY", "NONE", 0);
  grpc::ChannelArguments arguments;
  // A proxy of the environment is for the web; it would be asked for this machine's own loopback
  // too.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetMaxReceiveMessageSize(-1);  // a frame is as large as its scene
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
  // A connection of its own: small messages shall not wait behind large ones.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  auto channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  const auto until = std::chrono::system_clock::now() + std::chrono::seconds(5);
  if (channel->WaitForConnected(until)) return channel;
  std::cerr << "error: cannot connect to " << address << " within 5 s\n";
  return nullptr;
}

// Prints an error with its reason and the fields it is about; the exit code for it.
inline ExitCode ReportError(const std::string& what, const grpc::Status& status) {
  google::rpc::Status details;
  details.ParseFromString(status.error_details());
  google::rpc::ErrorInfo info;
  google::rpc::BadRequest bad;
  for (const auto& detail : details.details()) {
    detail.UnpackTo(&info);
    detail.UnpackTo(&bad);
  }
  std::cerr << "error: " << what << ": ";
  if (!info.reason().empty()) std::cerr << info.reason() << ": ";
  std::cerr << status.error_message() << "\n";
  for (const auto& field : bad.field_violations()) {
    std::cerr << "error: " << field.field() << ": " << field.description() << "\n";
  }
  switch (status.error_code()) {
    case grpc::StatusCode::UNAVAILABLE:
      return kExitCannotConnect;
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::FAILED_PRECONDITION:
      return kExitBadInput;
    default:
      return kExitCheckFailed;
  }
}

// One call with a deadline: UnaryCall(stub, &Stub::GetSession, request, &response, kShortCallS).
template <typename Stub, typename Method, typename Request, typename Response>
grpc::Status UnaryCall(Stub& stub, Method method, const Request& request, Response* response,
                       double deadline_s) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(std::llround(deadline_s * 1e3)));
  return (stub.*method)(&context, request, response);
}

// The p-th part of the values in order (nearest rank); 0 of none.
inline double Percentile(std::vector<float> values, double p) {
  if (values.empty()) return 0;
  const auto rank = static_cast<std::size_t>(std::ceil(p * values.size()));
  const auto nth = values.begin() + (rank > 0 ? rank - 1 : 0);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace adhesim
