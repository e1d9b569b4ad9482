#include <cstdint>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "adhesim/v1/session_service.grpc.pb.h"
#include "adhesim/v1/view_service.grpc.pb.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/service_client.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/validators.h"

namespace adhesim {
namespace {

struct WatchOptions {
  std::string address;
  std::string session;
  double seconds = 0;  // 0: until interrupted
  double rate_hz = 60;
  std::string encoding = "float32";
  std::uint32_t credits = 2;
  bool json = false;
};

// Frames within a span of time.
struct Tally {
  std::int64_t start_ns = ClockNs();
  std::uint64_t frames = 0;
  std::uint64_t bytes = 0;
  std::vector<float> age_ms;
};

// Counts frames and their ages. The server's clock is ours on the same machine; elsewhere ages
// count from the freshest frame, since the clocks' difference is unknown.
class FrameCounter {
 public:
  explicit FrameCounter(bool same_clock) : same_clock_(same_clock) {}

  void Count(const v1::WatchResponse& response) {
    const std::int64_t age_ns = ClockNs() - response.frame().published_ns();
    if (total_.frames == 0 || age_ns < freshest_ns_) freshest_ns_ = age_ns;
    const auto age_ms = static_cast<float>((age_ns - (same_clock_ ? 0 : freshest_ns_)) * 1e-6);
    for (Tally* tally : {&total_, &second_}) {
      ++tally->frames;
      tally->bytes += response.ByteSizeLong();
      tally->age_ms.push_back(age_ms);
    }
    went_back_ += response.step() < step_;
    step_ = response.step();
    time_s_ = response.time_s();
    misses_ = response.frame().deadline_misses();
  }
  void SetDropped(std::uint64_t dropped) { dropped_ = dropped; }

  bool second_is_over() const { return ClockNs() - second_.start_ns >= 1'000'000'000; }
  // What happened since the last call.
  Json TakeSecond() {
    const Json json = Describe(second_);
    second_ = Tally();
    return json;
  }
  Json Total() const { return Describe(total_); }

 private:
  Json Describe(const Tally& tally) const {
    const double seconds = (ClockNs() - tally.start_ns) * 1e-9;
    Json json;
    json["step"] = step_;
    json["time_s"] = time_s_;
    json["seconds"] = seconds;
    json["frames"] = tally.frames;
    json["rate_hz"] = tally.frames / seconds;
    json["bytes_per_s"] = tally.bytes / seconds;
    if (tally.frames > 0) {
      json["age_ms"] = {{"p50", Percentile(tally.age_ms, 0.5)},
                        {"p99", Percentile(tally.age_ms, 0.99)},
                        {"max", Percentile(tally.age_ms, 1)}};
    }
    json["frames_dropped"] = dropped_;
    json["frames_older"] = went_back_;
    json["deadline_misses"] = misses_;
    return json;
  }

  const bool same_clock_;
  Tally total_, second_;
  std::int64_t freshest_ns_ = 0;
  std::uint64_t step_ = 0, misses_ = 0, dropped_ = 0, went_back_ = 0;
  double time_s_ = 0;
};

void Print(const char* title, const Json& json, bool as_json) {
  if (as_json) {
    std::cout << json.dump() << std::endl;
    return;
  }
  std::printf("%s: %llu frames, %.1f Hz, %.2f MB/s", title,
              json["frames"].get<unsigned long long>(), json["rate_hz"].get<double>(),
              json["bytes_per_s"].get<double>() * 1e-6);
  if (json.contains("age_ms")) {
    std::printf(", age %.2f ms (p50) %.2f ms (p99)", json["age_ms"]["p50"].get<double>(),
                json["age_ms"]["p99"].get<double>());
  }
  std::printf(
      ", dropped %llu, step %llu, misses %llu\n", json["frames_dropped"].get<unsigned long long>(),
      json["step"].get<unsigned long long>(), json["deadline_misses"].get<unsigned long long>());
  std::fflush(stdout);
}

// The session that was named, or the only one there is.
ExitCode FindSession(WatchOptions* options, v1::SessionService::Stub& sessions) {
  if (!options->session.empty()) return kExitOk;
  v1::ListSessionsResponse response;
  const grpc::Status status = UnaryCall(sessions, &v1::SessionService::Stub::ListSessions,
                                        v1::ListSessionsRequest(), &response, kShortCallS);
  if (!status.ok()) return ReportError("listing sessions", status);
  if (response.sessions_size() == 1) {
    options->session = response.sessions(0).session();
    return kExitOk;
  }
  std::cerr << "error: the server has " << response.sessions_size()
            << " sessions, say which with --session";
  for (const v1::Session& session : response.sessions()) {
    std::cerr << "\n  " << session.session() << "  " << session.scene();
  }
  std::cerr << "\n";
  return kExitBadInput;
}

void PrintTopology(const v1::WatchResponse& response) {
  const v1::Topology& topology = response.topology();
  std::printf("session %s: scene %s, %u particles, %zu triangles, %s, %s, %g Hz\n",
              response.session().c_str(), topology.scene().c_str(), topology.particles(),
              topology.triangles().size() / 12,
              Counted(topology.bodies_size(), "body", "bodies").c_str(),
              Counted(topology.tools_size(), "tool", "tools").c_str(), topology.rate_hz());
}

ExitCode Stream(const WatchOptions& options, v1::ViewService::Stub& view) {
  grpc::ClientContext context;
  const auto stream = view.Watch(&context);
  v1::WatchRequest request;
  request.mutable_start()->set_session(options.session);
  request.mutable_start()->set_max_rate_hz(options.rate_hz);
  request.mutable_start()->set_credits(options.credits);
  request.mutable_start()->set_encoding(options.encoding == "q16" ? v1::POSITION_ENCODING_Q16
                                                                  : v1::POSITION_ENCODING_FLOAT32);
  stream->Write(request);
  FrameCounter counter(options.address.starts_with("127.") ||
                       options.address.starts_with("localhost") ||
                       options.address.starts_with("unix:"));
  const std::int64_t start_ns = ClockNs();
  std::uint64_t frames = 0;
  bool ended = true;  // by the server
  v1::WatchResponse response;
  // Heartbeats come four times a second, so that the checks below are never far away.
  while (stream->Read(&response)) {
    counter.SetDropped(response.frames_dropped());
    if (response.has_topology() && !options.json) PrintTopology(response);
    if (response.has_frame()) {
      counter.Count(response);
      request.mutable_ack()->set_frames(++frames);
      stream->Write(request);
    }
    if (counter.second_is_over()) Print("second", counter.TakeSecond(), options.json);
    const bool over = options.seconds > 0 && ClockNs() - start_ns >= options.seconds * 1e9;
    if (over || StopRequested()) {
      ended = false;
      break;
    }
  }
  if (!ended) context.TryCancel();
  const grpc::Status status = stream->Finish();
  if (frames > 0) Print("total", counter.Total(), options.json);
  if (ended) return ReportError("watching " + options.session, status);
  return StopRequested() ? kExitInterrupted : kExitOk;
}

ExitCode Watch(WatchOptions options) {
  const std::shared_ptr<grpc::Channel> channel = Connect(options.address);
  if (channel == nullptr) return kExitCannotConnect;
  StopOnSignals();
  const auto sessions = v1::SessionService::NewStub(channel);
  if (const ExitCode code = FindSession(&options, *sessions); code != kExitOk) return code;
  const auto view = v1::ViewService::NewStub(channel);
  return Stream(options, *view);
}

}  // namespace

void AddWatchCommand(CLI::App& app, int* exit_code) {
  CLI::App* command =
      app.add_subcommand("watch", "A client: receives frames and reports rates, ages and drops");
  auto options = std::make_shared<WatchOptions>();
  command->add_option("ADDRESS", options->address, "HOST:PORT of the server")->required();
  command->add_option("--session", options->session, "Id of the session (default: the only one)");
  command
      ->add_option("--seconds", options->seconds,
                   "Stop after this long (default: when interrupted)")
      ->check(Between(0.1, 1e6));
  command->add_option("--rate", options->rate_hz, "Frames a second at most")
      ->check(Between(0.01, 1e5))
      ->capture_default_str();
  command->add_option("--encoding", options->encoding, "Positions as float32 or q16")
      ->check(CLI::IsMember({"float32", "q16"}))
      ->capture_default_str();
  command->add_option("--credits", options->credits, "Frames under way without acknowledgement")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  command->add_flag("--json", options->json, "A JSON object a second, and one for the total");
  command->callback([options, exit_code] { *exit_code = Watch(*options); });
}

}  // namespace adhesim
