#include "server/sessions.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <exception>
#include <random>
#include <utility>

#include "core/scene/body_file.h"
#include "server/encode.h"
#include "server/errors.h"

namespace adhesim {
namespace {

constexpr double kMaxRateHz = 20'000;
constexpr double kMaxStepBudgetS = 10;

// Ids of an earlier run of the server must not mean a session of this one.
std::string RandomPrefix() {
  std::random_device random;
  return absl::StrFormat("%06x", random() & 0xffffffu);
}

// A client may name files of the server's own scenes only.
std::vector<FieldViolation> FileViolations(const v1::Scene& scene) {
  std::vector<FieldViolation> violations;
  for (int i = 0; i < scene.bodies_size(); ++i) {
    const v1::Body& body = scene.bodies(i);
    const std::string* file = FileOf(body);
    if (file == nullptr) continue;
    bool escapes = file->starts_with("/");
    for (const absl::string_view part : absl::StrSplit(*file, absl::ByAnyChar("/:"))) {
      escapes = escapes || part == "..";
    }
    if (!escapes) continue;
    violations.push_back(
        {ShapePath(body, absl::StrCat("bodies[", i, "]")),
         absl::StrCat("\"", *file,
                      "\" leaves the server's scenes; permitted are paths below them")});
  }
  return violations;
}

std::uint64_t EstimateParticles(const v1::Body& body) {
  if (body.has_icosphere()) {
    const std::uint32_t n =
        body.icosphere().has_subdivisions() ? body.icosphere().subdivisions() : 1;
    return n > 16 ? UINT32_MAX : 10 * (1ull << (2 * n)) + 2;
  }
  if (body.has_sheet()) return std::uint64_t{body.sheet().columns()} * body.sheet().rows();
  if (body.has_block()) return 6 * std::uint64_t{body.block().cells()} * body.block().cells();
  if (body.has_label_map()) return body.label_map().particles();
  if (body.has_organ()) return body.organ().particles();
  return 0;
}

absl::Status TooLarge(std::uint64_t particles, std::uint64_t limit) {
  return Error(Reason::kSceneTooLarge,
               absl::StrCat("the scene has ", particles, " particles, permitted are ", limit));
}

}  // namespace

std::uint64_t EstimateParticles(const v1::Scene& scene) {
  std::uint64_t sum = 0;
  for (const v1::Body& body : scene.bodies()) {
    sum += EstimateParticles(body) * (body.has_copies() ? body.copies().count() : 1);
  }
  return sum;
}

v1::Session LiveSession::Describe() const {
  const Model& model = session->model();
  const Session::Snapshot now = session->snapshot();
  v1::Session message;
  message.set_session(id);
  message.set_scene(model.name);
  message.set_state(now.state);
  message.set_rate_hz(1.0 / model.dt_s);
  message.set_seed(seed);
  message.set_step(now.step);
  message.set_time_s(now.time_s);
  EncodeTiming(now.timing, message.mutable_timing());
  message.set_realtime_class(EncodeRealtimeClass(session->realtime_class()));
  message.set_particles(model.particle_count());
  message.set_triangles(model.triangles.size());
  for (const Body& body : model.bodies) message.add_bodies(body.name);
  for (const ToolModel& tool : model.tools) message.add_tools(tool.name);
  message.set_viewers(hub->viewers());
  for (const std::string& tool : hub->operated_tools()) message.add_operated_tools(tool);
  return message;
}

Sessions::Sessions(SceneSource source, const Limits& limits, bool realtime,
                   RecordingSource recordings)
    : source_(std::move(source)),
      limits_(limits),
      realtime_(realtime),
      recordings_(std::move(recordings)),
      id_prefix_(RandomPrefix()) {}

Sessions::~Sessions() { StopAll(Error(Reason::kDraining, "the server has stopped")); }

absl::StatusOr<ReadScene> Sessions::ReadRequested(const v1::CreateSessionRequest& request) const {
  absl::StatusOr<ReadScene> read;
  if (request.has_scene()) {
    read = ReadScene{request.scene(), source_.inline_directory};
    const std::vector<FieldViolation> violations = FileViolations(request.scene());
    if (!violations.empty()) {
      return Error(Reason::kSceneInvalid, "the scene names files outside the server's scenes",
                   violations);
    }
  } else if (request.has_scene_name()) {
    read = source_.read(request.scene_name());
    if (absl::IsNotFound(read.status())) {
      return Error(Reason::kSceneNotFound, std::string(read.status().message()));
    }
    if (!read.ok()) return Error(Reason::kSceneInvalid, std::string(read.status().message()));
  } else {
    const std::string what = "neither scene_name nor scene is given, one is required";
    return Error(Reason::kArgumentInvalid, what, {{"source", what}});
  }
  if (request.has_rate_hz()) {
    const double rate_hz = request.rate_hz();
    if (!(rate_hz >= 1 && rate_hz <= kMaxRateHz)) {
      const std::string what =
          absl::StrCat("rate_hz is ", rate_hz, ", permitted are 1 to ", kMaxRateHz);
      return Error(Reason::kArgumentInvalid, what, {{"rate_hz", what}});
    }
    // Errors of rungs were measured at the scene's own.
    if (rate_hz != read->scene.rate_hz()) read->scene.clear_rungs();
    read->scene.set_rate_hz(rate_hz);
  }
  if (request.has_seed()) read->scene.set_seed(request.seed());
  if (request.has_step_budget_s()) {
    const double budget_s = request.step_budget_s();
    if (!(budget_s >= 0 && budget_s <= kMaxStepBudgetS)) {
      const std::string what =
          absl::StrCat("step_budget_s is ", budget_s, ", permitted are 0 to ", kMaxStepBudgetS);
      return Error(Reason::kArgumentInvalid, what, {{"step_budget_s", what}});
    }
  }
  return read;
}

absl::StatusOr<std::unique_ptr<Engine>> Sessions::Build(const ReadScene& scene, bool from_client,
                                                        std::vector<std::string>* warnings) const {
  const std::uint64_t estimate = EstimateParticles(scene.scene);
  if (estimate > limits_.particles) return TooLarge(estimate, limits_.particles);
  Problems problems;
  std::unique_ptr<Engine> engine;
  try {
    engine = source_.build(scene, &problems);
  } catch (const std::exception& error) {
    // Out of memory, or a library that throws: this scene fails, the server goes on.
    return Error(Reason::kInternal, absl::StrCat("the scene cannot be built: ", error.what()));
  }
  std::vector<FieldViolation> violations;
  for (const Problem& problem : problems) {
    std::string field = problem.path;
    if (from_client) field = field.empty() ? "scene" : absl::StrCat("scene.", field);
    if (problem.warning) {
      warnings->push_back(absl::StrCat(field, field.empty() ? "" : ": ", problem.message));
    } else {
      violations.push_back({field, problem.message});
    }
  }
  if (!violations.empty() || engine == nullptr) {
    const std::string first =
        violations.empty() ? "no reason is known"
                           : absl::StrCat(violations[0].field, ": ", violations[0].description);
    return Error(Reason::kSceneInvalid,
                 absl::StrCat("the scene has ", violations.size(), " mistakes; first ", first),
                 violations);
  }
  const std::uint64_t particles = engine->model().particle_count();
  if (particles > limits_.particles) return TooLarge(particles, limits_.particles);
  return engine;
}

absl::StatusOr<std::shared_ptr<LiveSession>> Sessions::Create(
    const v1::CreateSessionRequest& request, const std::string& peer,
    std::vector<std::string>* warnings) {
  if (draining()) return Error(Reason::kDraining, "the server is going away; try another");
  // Taken before the scene is built, so that requests under way count.
  PeerCounter::Share share = per_peer_.Take(PeerHost(peer), limits_.sessions_per_peer);
  if (share == nullptr || per_peer_.total() > limits_.sessions) {
    return Error(
        Reason::kTooManySessions,
        absl::StrCat("there are ", per_peer_.total(), " sessions; permitted are ", limits_.sessions,
                     " in all and ", limits_.sessions_per_peer, " for one peer; delete one first"));
  }
  const absl::StatusOr<ReadScene> scene = ReadRequested(request);
  if (!scene.ok()) return scene.status();
  absl::StatusOr<std::unique_ptr<Engine>> engine = Build(*scene, request.has_scene(), warnings);
  if (!engine.ok()) return engine.status();

  auto live = std::make_shared<LiveSession>();
  live->share = std::move(share);
  live->seed = (*engine)->model().seed;
  std::uint64_t number;
  {
    const std::lock_guard lock(mutex_);
    number = next_number_++;
  }
  live->id = absl::StrCat("s", number, "-", id_prefix_);
  live->hub = std::make_unique<Hub>(live->id, (*engine)->model());
  Session::Options options;
  options.realtime = realtime_;
  options.paused = request.paused();
  if (request.has_step_budget_s()) options.step_budget_s = request.step_budget_s();
  if (recordings_.record) {
    absl::StatusOr<std::shared_ptr<StepObserver>> recorder =
        recordings_.record(live->id, *scene, **engine);
    if (recorder.ok()) {
      options.step_observer = *std::move(recorder);
    } else {
      warnings->push_back(absl::StrCat("not recorded: ", recorder.status().message()));
    }
  }
  try {
    live->session = std::make_unique<Session>(*std::move(engine), options, live->hub.get());
  } catch (const std::exception& error) {
    return Error(Reason::kTooManySessions,
                 absl::StrCat("the system refuses another session: ", error.what()));
  }
  {
    const std::lock_guard lock(mutex_);
    // Checked again: StopAll() must find every session there is.
    if (!draining()) {
      by_number_[number] = live;
      numbers_[live->id] = number;
      return live;
    }
  }
  return Error(Reason::kDraining, "the server is going away; try another");
}

absl::StatusOr<std::shared_ptr<LiveSession>> Sessions::Find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto number = numbers_.find(id);
  if (number == numbers_.end()) {
    return Error(Reason::kSessionNotFound, absl::StrCat("no session \"", id, "\""));
  }
  return by_number_.at(number->second);
}

std::vector<std::shared_ptr<LiveSession>> Sessions::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<LiveSession>> all;
  for (const auto& [number, live] : by_number_) all.push_back(live);
  return all;
}

absl::Status Sessions::Delete(const std::string& id) {
  std::shared_ptr<LiveSession> live;
  {
    const std::lock_guard lock(mutex_);
    const auto number = numbers_.find(id);
    if (number == numbers_.end()) {
      return Error(Reason::kSessionNotFound, absl::StrCat("no session \"", id, "\""));
    }
    live = by_number_.at(number->second);
    by_number_.erase(number->second);
    numbers_.erase(number);
  }
  live->session->Stop(Error(Reason::kSessionDeleted, absl::StrCat("session ", id, " was deleted")));
  // Streams that are still ending hold the session a little longer, but not the peer's share.
  live->share.reset();
  return absl::OkStatus();
}

void Sessions::Drain() {
  draining_.store(true);
  for (const std::shared_ptr<LiveSession>& live : List()) live->hub->AnnounceDraining();
}

void Sessions::StopAll(const absl::Status& why) {
  draining_.store(true);
  std::map<std::uint64_t, std::shared_ptr<LiveSession>> all;
  {
    const std::lock_guard lock(mutex_);
    all.swap(by_number_);
    numbers_.clear();
  }
  for (auto& [number, live] : all) live->session->Stop(why);
}

}  // namespace adhesim
