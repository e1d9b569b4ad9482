#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "adhesim/v1/interaction_service.grpc.pb.h"
#include "adhesim/v1/session_service.grpc.pb.h"
#include "clients/cli/commands.h"
#include "clients/cli/service_client.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/trajectory.h"
#include "clients/cli/validators.h"

namespace adhesim {
namespace {

using Json = nlohmann::ordered_json;
using InteractStream = grpc::ClientReaderWriter<v1::InteractRequest, v1::InteractResponse>;

struct OperateOptions {
  std::string address;
  std::string scene;
  std::string session;
  std::string tool;
  std::string trajectory;
  std::string forces;
  double rate_hz = 250;
  bool keep = false;
  bool json = false;
};

// What an operator felt.
struct Felt {
  std::uint64_t feedbacks = 0;
  std::vector<float> round_trip_ms;  // from when a pose was due to the first feedback that used it
  double peak_push_n = 0;            // along the shaft, against the tip
  double push_area_m2 = 0;           // area of contact at that instant
  double peak_pull_n = 0;            // the other way
  double recent_push_n = 0;          // the same since the last progress line
  double recent_pull_n = 0;
  double peak_force_n = 0;
  std::uint32_t most_particles = 0;
  std::uint64_t newest_sequence = 0;
  std::int64_t first_ns = 0, last_ns = 0;  // when the first and the last feedback came
  v1::InteractResponse first, last;
};

// The component of the tissue's force along the shaft (from tip to handle), N.
double AlongShaft(const v1::ToolState& tool) {
  const v1::Pose& q = tool.pose();
  // The third column of the rotation: where +z points.
  const double x = 2 * (q.qx() * q.qz() + q.qw() * q.qy());
  const double y = 2 * (q.qy() * q.qz() - q.qw() * q.qx());
  const double z = 1 - 2 * (q.qx() * q.qx() + q.qy() * q.qy());
  return x * tool.tissue().fx_n() + y * tool.tissue().fy_n() + z * tool.tissue().fz_n();
}

constexpr char kForcesHeader[] =
    "t_s,step,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,x_m,y_m,z_m,colliding_particles,qw,qx,qy,qz,"
    "target_x_m,target_y_m,target_z_m,coupling_fx_n,coupling_fy_n,coupling_fz_n,sequence,operator_"
    "lost,retracted,contact_area_m2\n";

void WriteForces(const v1::InteractResponse& response, std::ofstream* out) {
  const v1::ToolState& tool = response.feedback().tool();
  const v1::Wrench& f = tool.tissue();
  const v1::Pose& p = tool.pose();
  const v1::Pose& t = tool.target();
  const v1::Wrench& c = tool.coupling();
  std::array<char, 640> line;
  std::snprintf(line.data(), line.size(),
                "%.6f,%llu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%u,%.9g,%.9g,%.9g,%.9g,%."
                "9g,%.9g,%.9g,%.9g,"
                "%.9g,%.9g,%llu,%d,%d,%.9g\n",
                response.time_s(), static_cast<unsigned long long>(response.step()), f.fx_n(),
                f.fy_n(), f.fz_n(), f.tx_nm(), f.ty_nm(), f.tz_nm(), p.x_m(), p.y_m(), p.z_m(),
                tool.colliding_particles(), p.qw(), p.qx(), p.qy(), p.qz(), t.x_m(), t.y_m(),
                t.z_m(), c.fx_n(), c.fy_n(), c.fz_n(),
                static_cast<unsigned long long>(response.feedback().sequence()),
                tool.operator_lost(), tool.retracted(), tool.contact_area_m2());
  *out << line.data();
}

// Reads everything that comes down, on a thread of its own.
class Reader {
 public:
  Reader(InteractStream* stream, const std::string& forces) : stream_(stream) {
    if (forces.empty()) return;
    writes_ = true;
    forces_.open(forces);
    forces_ << kForcesHeader;
  }
  // Whether the forces could be written so far.
  bool ok() const { return !writes_ || forces_.good(); }

  void Start() {
    thread_ = std::thread([this] { Loop(); });
  }
  void Join() {
    if (thread_.joinable()) thread_.join();
    if (forces_.is_open()) forces_.flush();
  }

  Felt felt() {
    std::lock_guard lock(mutex_);
    return felt_;
  }
  // What was felt, and a new start for what is recent.
  Felt TakeRecent() {
    std::lock_guard lock(mutex_);
    const Felt felt = felt_;
    felt_.recent_push_n = felt_.recent_pull_n = 0;
    return felt;
  }
  std::uint64_t newest_sequence() const { return newest_sequence_.load(); }
  bool ended() const { return ended_.load(); }

 private:
  void Loop() {
    v1::InteractResponse response;
    while (stream_->Read(&response)) {
      if (response.has_feedback()) Take(response);
      if (response.has_pose_refused()) {
        std::cerr << "pose " << response.pose_refused().sequence()
                  << " refused: " << response.pose_refused().reason() << ": "
                  << response.pose_refused().message() << "\n";
      }
    }
    ended_.store(true);
  }

  void Take(const v1::InteractResponse& response) {
    const std::int64_t now_ns = ClockNs();
    const v1::ToolFeedback& feedback = response.feedback();
    {
      std::lock_guard lock(mutex_);
      if (felt_.feedbacks++ == 0) {
        felt_.first = response;
        felt_.first_ns = now_ns;
      }
      felt_.last = response;
      felt_.last_ns = now_ns;
      if (feedback.sequence() > felt_.newest_sequence) {
        felt_.newest_sequence = feedback.sequence();
        felt_.round_trip_ms.push_back((now_ns - feedback.client_time_ns()) * 1e-6);
      }
      const double along_n = AlongShaft(feedback.tool());
      const v1::Wrench& f = feedback.tool().tissue();
      if (along_n > felt_.peak_push_n) {
        felt_.peak_push_n = along_n;
        felt_.push_area_m2 = feedback.tool().contact_area_m2();
      }
      felt_.peak_pull_n = std::max(felt_.peak_pull_n, -along_n);
      felt_.recent_push_n = std::max(felt_.recent_push_n, along_n);
      felt_.recent_pull_n = std::max(felt_.recent_pull_n, -along_n);
      felt_.peak_force_n = std::max(felt_.peak_force_n, std::hypot(f.fx_n(), f.fy_n(), f.fz_n()));
      felt_.most_particles = std::max(felt_.most_particles, feedback.tool().colliding_particles());
    }
    newest_sequence_.store(feedback.sequence());
    if (forces_.is_open()) WriteForces(response, &forces_);
  }

  InteractStream* const stream_;
  std::ofstream forces_;
  bool writes_ = false;
  std::mutex mutex_;
  Felt felt_;
  std::atomic<std::uint64_t> newest_sequence_{0};
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

double RateHeldHz(const Felt& felt) {
  const double seconds = (felt.last_ns - felt.first_ns) * 1e-9;
  return seconds > 0 ? (felt.last.step() - felt.first.step()) / seconds : 0;
}

std::uint64_t MissesWhileOperating(const Felt& felt) {
  return felt.last.feedback().timing().deadline_misses() -
         felt.first.feedback().timing().deadline_misses();
}

void PrintProgress(double t_s, const Felt& felt) {
  const v1::ToolState& tool = felt.last.feedback().tool();
  const v1::Wrench& f = tool.tissue();
  std::printf(
      "%5.1f s  force x %7.3f y %7.3f z %7.3f N  most in this second: push %6.3f pull %6.3f N  "
      "particles %3u  rate %6.1f Hz  misses %llu\n",
      t_s, f.fx_n(), f.fy_n(), f.fz_n(), felt.recent_push_n, felt.recent_pull_n,
      tool.colliding_particles(), RateHeldHz(felt),
      static_cast<unsigned long long>(MissesWhileOperating(felt)));
  std::fflush(stdout);
}

void SleepUntilNs(std::int64_t time_ns) {
  const timespec until{static_cast<time_t>(time_ns / 1'000'000'000),
                       static_cast<long>(time_ns % 1'000'000'000)};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

// Sends poses when they are due, whatever comes back (open loop). The number sent.
std::uint64_t SendPoses(const Trajectory& trajectory, const OperateOptions& options,
                        InteractStream* stream, Reader* reader) {
  const std::int64_t start_ns = ClockNs();
  const double length_s = trajectory.end_s() - trajectory.begin_s();
  const auto poses = static_cast<std::uint64_t>(std::floor(length_s * options.rate_hz)) + 1;
  double next_line_s = 1;
  for (std::uint64_t i = 0; i < poses; ++i) {
    const double t_s = i / options.rate_hz;
    const std::int64_t due_ns = start_ns + std::llround(t_s * 1e9);
    SleepUntilNs(due_ns);
    v1::InteractRequest request;
    v1::ToolPose* pose = request.mutable_pose();
    pose->set_sequence(i + 1);
    // When it was due, not when it was sent: a late client must not look fast.
    pose->set_client_time_ns(due_ns);
    *pose->mutable_pose() = trajectory.At(trajectory.begin_s() + t_s);
    if (StopRequested() || reader->ended() || !stream->Write(request)) return i;
    if (!options.json && t_s >= next_line_s) {
      PrintProgress(t_s, reader->TakeRecent());
      next_line_s += 1;
    }
  }
  // The last pose's force is part of the answer.
  for (int i = 0; i < 200 && !reader->ended() && reader->newest_sequence() < poses; ++i) {
    SleepUntilNs(ClockNs() + 5'000'000);
  }
  return poses;
}

Json Summary(const OperateOptions& options, const v1::Session& session, const Felt& felt,
             std::uint64_t poses_sent, double wall_s) {
  const v1::ToolFeedback& last = felt.last.feedback();
  const v1::Wrench& f = last.tool().tissue();
  Json json;
  json["session"] = session.session();
  json["scene"] = session.scene();
  json["tool"] = options.tool;
  json["seconds"] = wall_s;
  json["pose_rate_hz"] = options.rate_hz;
  json["poses_sent"] = poses_sent;
  json["poses_refused"] = last.poses_refused();
  json["poses_superseded"] = last.poses_superseded();
  json["feedbacks"] = felt.feedbacks;
  json["feedback_superseded"] = last.feedback_superseded();
  json["round_trip_ms"] = {{"p50", Percentile(felt.round_trip_ms, 0.5)},
                           {"p99", Percentile(felt.round_trip_ms, 0.99)},
                           {"max", Percentile(felt.round_trip_ms, 1)}};
  json["session_rate_hz"] = session.rate_hz();
  json["rate_held_hz"] = RateHeldHz(felt);
  json["steps"] = felt.last.step() - felt.first.step();
  json["deadline_misses"] = MissesWhileOperating(felt);
  json["skipped_steps"] =
      last.timing().skipped_steps() - felt.first.feedback().timing().skipped_steps();
  json["peak_push_n"] = felt.peak_push_n;
  json["peak_push_contact_area_m2"] = felt.push_area_m2;
  json["peak_pull_n"] = felt.peak_pull_n;
  json["peak_force_n"] = felt.peak_force_n;
  json["final_force_n"] = {f.fx_n(), f.fy_n(), f.fz_n()};
  json["colliding_particles_max"] = felt.most_particles;
  json["target_jumps"] = last.tool().target_jumps();
  return json;
}

void PrintSummary(const Json& summary) {
  const auto number = [&summary](const char* key) { return summary[key].get<double>(); };
  const Json& trip = summary["round_trip_ms"];
  std::printf("rate held %.1f of %.1f Hz, %.0f deadline misses and %.0f skipped steps in %.0f\n",
              number("rate_held_hz"), number("session_rate_hz"), number("deadline_misses"),
              number("skipped_steps"), number("steps"));
  std::printf("pose to force %.2f ms (p50), %.2f ms (p99); %.0f poses sent, %.0f refused\n",
              trip["p50"].get<double>(), trip["p99"].get<double>(), number("poses_sent"),
              number("poses_refused"));
  std::printf("colliding particles at most %.0f, peak push %.4f N, peak pull-off %.4f N\n",
              number("colliding_particles_max"), number("peak_push_n"), number("peak_pull_n"));
}

// The session to operate in: a new one of the scene, or the one that was named.
grpc::Status OpenSession(const OperateOptions& options, v1::SessionService::Stub& sessions,
                         v1::Session* session) {
  if (!options.session.empty()) {
    v1::GetSessionRequest request;
    request.set_session(options.session);
    v1::GetSessionResponse response;
    const grpc::Status status =
        UnaryCall(sessions, &v1::SessionService::Stub::GetSession, request, &response, kShortCallS);
    *session = response.session();
    return status;
  }
  v1::CreateSessionRequest request;
  request.set_scene_name(options.scene);
  v1::CreateSessionResponse response;
  const grpc::Status status = UnaryCall(sessions, &v1::SessionService::Stub::CreateSession, request,
                                        &response, kCreateCallS);
  for (const std::string& warning : response.warnings())
    std::cerr << "warning: " << warning << "\n";
  *session = response.session();
  return status;
}

ExitCode OperateIn(const OperateOptions& options, const Trajectory& trajectory,
                   const v1::Session& session, v1::InteractionService::Stub& interaction) {
  grpc::ClientContext context;
  const auto stream = interaction.Interact(&context);
  Reader reader(stream.get(), options.forces);
  if (!reader.ok()) {
    context.TryCancel();
    stream->Finish();
    std::cerr << "error: --forces " << options.forces << ": cannot be written\n";
    return kExitBadInput;
  }
  v1::InteractRequest take;
  take.mutable_take_control()->set_session(session.session());
  take.mutable_take_control()->set_tool(options.tool);
  v1::InteractResponse response;
  if (!stream->Write(take) || !stream->Read(&response)) {
    return ReportError("taking control of " + options.tool, stream->Finish());
  }
  const std::int64_t start_ns = ClockNs();
  reader.Start();
  const std::uint64_t sent = SendPoses(trajectory, options, stream.get(), &reader);
  const double wall_s = (ClockNs() - start_ns) * 1e-9;
  stream->WritesDone();
  reader.Join();
  const grpc::Status status = stream->Finish();
  const Json summary = Summary(options, session, reader.felt(), sent, wall_s);
  if (options.json) {
    std::cout << summary.dump() << std::endl;
  } else {
    PrintSummary(summary);
  }
  if (!status.ok()) return ReportError("operating " + options.tool, status);
  if (!reader.ok()) {
    std::cerr << "error: --forces " << options.forces << ": writing failed\n";
    return kExitCheckFailed;
  }
  return StopRequested() ? kExitInterrupted : kExitOk;
}

ExitCode Operate(const OperateOptions& options) {
  if (options.scene.empty() == options.session.empty()) {
    std::cerr << "error: give either --scene, for a new session, or --session\n";
    return kExitBadInput;
  }
  const Trajectory trajectory = Trajectory::Read(options.trajectory);
  if (trajectory.empty()) return kExitBadInput;
  const std::shared_ptr<grpc::Channel> channel = Connect(options.address);
  if (channel == nullptr) return kExitCannotConnect;
  StopOnSignals();
  const auto sessions = v1::SessionService::NewStub(channel);
  v1::Session session;
  const grpc::Status opened = OpenSession(options, *sessions, &session);
  if (!opened.ok()) {
    return ReportError(options.session.empty() ? "creating a session" : "finding the session",
                       opened);
  }
  const auto interaction = v1::InteractionService::NewStub(channel);
  const ExitCode code = OperateIn(options, trajectory, session, *interaction);
  if (options.session.empty() && !options.keep) {
    v1::DeleteSessionRequest request;
    request.set_session(session.session());
    v1::DeleteSessionResponse response;
    const grpc::Status deleted = UnaryCall(*sessions, &v1::SessionService::Stub::DeleteSession,
                                           request, &response, kShortCallS);
    if (!deleted.ok() && code == kExitOk) return ReportError("deleting the session", deleted);
  }
  return code;
}

}  // namespace

void AddOperateCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "operate", "A client: drives a tool along a trajectory and reports what it felt");
  auto options = std::make_shared<OperateOptions>();
  command->add_option("ADDRESS", options->address, "HOST:PORT of the server")->required();
  command->add_option("--scene", options->scene,
                      "Create a session of this scene, and delete it at the end");
  command->add_option("--session", options->session, "Join this session instead");
  command->add_option("--tool", options->tool, "Name of the tool")->required();
  command->add_option("--trajectory", options->trajectory, "CSV of t_s,x_m,y_m,z_m,qw,qx,qy,qz")
      ->required();
  command->add_option("--forces", options->forces,
                      "Write what was felt, a row for each step that was heard of");
  command->add_option("--rate", options->rate_hz, "Poses a second")
      ->check(Between(0.1, 10'000.0))
      ->capture_default_str();
  command->add_flag("--keep", options->keep, "Leave the session running at the end");
  command->add_flag("--json", options->json, "Summary as one JSON object");
  command->callback([options, exit_code] { *exit_code = Operate(*options); });
}

}  // namespace adhesim
