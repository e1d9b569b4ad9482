#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "adhesim/v1/session_service.pb.h"
#include "server/hub.h"
#include "server/limits.h"
#include "server/recording_source.h"
#include "server/scene_source.h"
#include "server/session.h"

namespace adhesim {

// A session with its hub, as the services know it.
struct LiveSession {
  std::string id;
  std::uint64_t seed = 1;
  PeerCounter::Share share;  // of its creator
  std::unique_ptr<Hub> hub;  // before `session`, which calls it until the end, and owns its model
  std::unique_ptr<Session> session;

  // What GetSession shows.
  v1::Session Describe() const;
};

// All sessions of a server. Thread-safe. Create(), Delete() and StopAll() may take seconds: not for
// gRPC's threads.
class Sessions {
 public:
  // `recordings` may be empty.
  Sessions(SceneSource source, const Limits& limits, bool realtime,
           RecordingSource recordings = {});
  ~Sessions();

  std::vector<OfferedScene> ListScenes() const { return source_.list(); }

  // Errors: Draining, TooManySessions, SceneNotFound, SceneInvalid (every mistake, as field
  // violations), SceneTooLarge, ArgumentInvalid. `warnings` are added to.
  absl::StatusOr<std::shared_ptr<LiveSession>> Create(const v1::CreateSessionRequest& request,
                                                      const std::string& peer,
                                                      std::vector<std::string>* warnings);
  // SessionNotFound.
  absl::StatusOr<std::shared_ptr<LiveSession>> Find(const std::string& id) const;
  std::vector<std::shared_ptr<LiveSession>> List() const;
  absl::Status Delete(const std::string& id);

  // From now on nothing is created, and heartbeats say so.
  void Drain();
  bool draining() const { return draining_.load(); }
  // Ends every session and its streams.
  void StopAll(const absl::Status& why);

  const Limits& limits() const { return limits_; }
  const RecordingSource& recordings() const { return recordings_; }

 private:
  absl::StatusOr<ReadScene> ReadRequested(const v1::CreateSessionRequest& request) const;
  absl::StatusOr<std::unique_ptr<Engine>> Build(const ReadScene& scene, bool from_client,
                                                std::vector<std::string>* warnings) const;

  const SceneSource source_;
  const Limits limits_;
  const bool realtime_;
  const RecordingSource recordings_;
  const std::string id_prefix_;
  std::atomic<bool> draining_{false};
  PeerCounter per_peer_;

  // Guards the rest. A standard mutex: thread sanitizers do not see through Abseil's as packaged.
  mutable std::mutex mutex_;
  std::uint64_t next_number_ = 1;
  std::map<std::uint64_t, std::shared_ptr<LiveSession>> by_number_;
  std::map<std::string, std::uint64_t> numbers_;
};

// How many particles a scene makes, as far as the message tells: known before anything is
// allocated.
std::uint64_t EstimateParticles(const v1::Scene& scene);

}  // namespace adhesim
