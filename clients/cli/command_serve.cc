#include <absl/strings/str_cat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/record_run.h"
#include "clients/cli/validators.h"
#include "core/engine/engine.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "server/recording/recording_directory.h"
#include "server/scene_source.h"
#include "server/server.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

// If shutting down takes longer than its grace by this much, something hangs: the process ends all
// the same.
constexpr double kWatchdogS = 10;

struct ServeOptions {
  std::vector<std::string> scenes;
  std::string directory;
  Server::Options server;
  std::string record;
  double frames_hz = 60;
  double grace_s = 5;
  bool json = false;
};

// Scene files by the names under which they are offered.
using OfferedFiles = std::map<std::string, fs::path>;

// Where scenes are when nobody says so: below the current directory, or beside the program and the
// two directories above it (a build tree).
std::string DefaultDirectory() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const fs::path& candidate :
       {fs::path("scenes"), program / "scenes", program / "../scenes", program / "../../scenes"}) {
    if (fs::is_directory(candidate, error)) return candidate.lexically_normal().string();
  }
  return "";
}

// Adds a file under its name without extension, or with its folders when that is taken.
void Offer(const fs::path& file, const fs::path& root, OfferedFiles* offered) {
  if (offered->emplace(file.stem().string(), file).second) return;
  offered->emplace(file.lexically_relative(root).replace_extension().string(), file);
}

void OfferDirectory(const std::string& directory, OfferedFiles* offered) {
  std::error_code error;
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator it(directory, error), end; !error && it != end;
       it.increment(error)) {
    const fs::path extension = it->path().extension();
    if (extension == ".yaml" || extension == ".yml") files.push_back(it->path());
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) Offer(file, directory, offered);
}

// False, with every mistake on stderr, when a scene that was asked for by name is wrong.
bool OfferScenes(const ServeOptions& options, OfferedFiles* offered) {
  bool ok = true;
  for (const std::string& scene : options.scenes) {
    const SceneFile file = ReadSceneFile(scene);
    std::cerr << file.Format(file.problems);
    ok = ok && file.ok();
    Offer(scene, fs::path(scene).parent_path(), offered);
  }
  if (!options.directory.empty()) OfferDirectory(options.directory, offered);
  return ok;
}

std::vector<OfferedScene> ListScenes(const OfferedFiles& offered) {
  std::vector<OfferedScene> scenes;
  for (const auto& [name, path] : offered) {
    scenes.push_back({name, ReadSceneFile(path.string()).scene.description()});
  }
  return scenes;
}

absl::StatusOr<ReadScene> Read(const OfferedFiles& offered, const std::string& name) {
  const auto found = offered.find(name);
  if (found == offered.end()) {
    return absl::NotFoundError(
        absl::StrCat("no scene \"", name, "\"; ListScenes names ", offered.size()));
  }
  // Read each time: a scene may have been edited since.
  const SceneFile file = ReadSceneFile(found->second.string());
  if (!file.ok()) return absl::InvalidArgumentError(file.Format(file.problems));
  return ReadScene{file.scene, file.directory};
}

std::unique_ptr<Engine> Build(const ReadScene& scene, Problems* problems) {
  *problems = ValidateScene(scene.scene);
  if (!AllWarnings(*problems)) return nullptr;
  BuiltModel built = BuildModel(WithDefaults(scene.scene), scene.directory);
  problems->insert(problems->end(), built.problems.begin(), built.problems.end());
  if (built.model == nullptr || !AllWarnings(*problems)) return nullptr;
  absl::StatusOr<std::unique_ptr<Engine>> engine = Engine::Create(built.model, Engine::Options());
  if (engine.ok()) return *std::move(engine);
  problems->push_back({"", std::string(engine.status().message())});
  return nullptr;
}

SceneSource MakeSource(const OfferedFiles& offered, const std::string& directory) {
  SceneSource source;
  source.list = [offered] { return ListScenes(offered); };
  source.read = [offered](const std::string& name) { return Read(offered, name); };
  source.build = [](const ReadScene& scene, Problems* problems) { return Build(scene, problems); };
  source.inline_directory = directory.empty() ? "." : directory;
  return source;
}

void PrintWhere(const ServeOptions& options, const Server& server, const OfferedFiles& offered) {
  if (options.json) {
    nlohmann::ordered_json where;
    where["grpc"] = server.address();
    if (!server.http_address().empty()) where["http"] = server.http_address();
    where["realtime_class"] = server.realtime_class();
    where["memory_locked"] = server.memory_locked();
    where["scenes"] = offered.size();
    std::cout << where.dump() << std::endl;
  } else {
    std::cout << "serving gRPC on " << server.address() << " ("
              << Counted(offered.size(), "scene", "scenes")
              << ", real-time class: " << server.realtime_class() << ", memory "
              << (server.memory_locked() ? "locked" : "not locked") << ")" << std::endl;
    if (!server.http_address().empty()) {
      std::cout << "open http://" << server.http_address() << "/ in a browser" << std::endl;
    }
  }
  for (const std::string& address : {server.address(), server.http_address()}) {
    if (address.empty() || IsLoopback(address)) continue;
    std::cerr << "warning: " << address
              << " can be reached from other machines, without encryption or authentication: "
                 "anyone there can create "
                 "sessions, drive tools and watch. Use it in a network you trust only.\n";
  }
}

// Ends the process when the work that it is given time for does not end.
class Watchdog {
 public:
  explicit Watchdog(double seconds) : thread_([this, seconds] { Watch(seconds); }) {}
  ~Watchdog() {
    done_.store(true);
    thread_.join();
  }

 private:
  void Watch(double seconds) {
    for (int i = 0; i < seconds * 20; ++i) {
      if (done_.load()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    if (done_.load()) return;
    std::cerr << "error: the server did not shut down in time\n";
    std::_Exit(kExitCheckFailed);
  }
  std::atomic<bool> done_{false};
  std::thread thread_;
};

// Waits for a signal, then shuts down; a second signal ends the grace. The signals are blocked in
// every thread.
ExitCode RunUntilSignal(Server* server, const sigset_t& signals, double grace_s) {
  int signal = 0;
  sigwait(&signals, &signal);
  std::cerr << "shutting down: streams have " << grace_s << " s to end\n";
  const Watchdog watchdog(grace_s + kWatchdogS);
  std::atomic<bool> hurry{false};
  std::atomic<bool> done{false};
  std::thread second([&] {
    const timespec pause{0, 50'000'000};
    while (!done.load()) {
      if (sigtimedwait(&signals, nullptr, &pause) > 0) hurry.store(true);
    }
  });
  server->Shutdown(grace_s, &hurry);
  done.store(true);
  second.join();
  return signal == SIGINT ? kExitInterrupted : kExitOk;
}

ExitCode Serve(ServeOptions options) {
  // Told below, in words of our own; GRPC_VERBOSITY=ERROR brings gRPC's back.
  setenv("GRPC_VERBOSITY", "NONE", 0);
  // Blocked before the first thread starts, so that none of them is interrupted.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);

  if (options.scenes.empty() && options.directory.empty()) options.directory = DefaultDirectory();
  if (!options.directory.empty() && !fs::is_directory(options.directory)) {
    std::cerr << "error: --scenes " << options.directory << ": no such directory\n";
    return kExitBadInput;
  }
  OfferedFiles offered;
  if (!OfferScenes(options, &offered)) return kExitBadInput;
  if (!options.record.empty()) {
    Recorder::Options recorder;
    recorder.frames_hz = options.frames_hz;
    absl::StatusOr<std::shared_ptr<RecordingDirectory>> recordings =
        RecordingDirectory::Open(options.record, recorder, options.server.version, BuildText());
    if (!recordings.ok()) {
      std::cerr << "error: --record " << recordings.status().message() << "\n";
      return kExitBadInput;
    }
    options.server.recordings = SourceOf(*recordings);
  }
  const std::string directory = options.directory.empty() && !options.scenes.empty()
                                    ? fs::path(options.scenes[0]).parent_path().string()
                                    : options.directory;
  absl::StatusOr<std::unique_ptr<Server>> server =
      Server::Start(options.server, MakeSource(offered, directory));
  if (!server.ok()) {
    std::cerr << "error: " << server.status().message() << "\n";
    return absl::IsInvalidArgument(server.status()) ? kExitBadInput : kExitCannotConnect;
  }
  PrintWhere(options, **server, offered);
  return RunUntilSignal(server->get(), signals, options.grace_s);
}

}  // namespace

void AddServeCommand(CLI::App& app, int* exit_code) {
  CLI::App* command =
      app.add_subcommand("serve", "The service: sessions of scenes, over gRPC and to browsers");
  auto options = std::make_shared<ServeOptions>();
  options->server.version = ADHESIM_VERSION;
  command->add_option("SCENE", options->scenes,
                      "Scene files to offer, by their names without .yaml");
  command->add_option(
      "--scenes", options->directory,
      "Offer every scene file below this directory (default, without SCENE: scenes/ here or by the "
      "program)");
  command
      ->add_option("--listen", options->server.listen,
                   "HOST:PORT for gRPC; port 0 picks a free one")
      ->capture_default_str();
  command->add_option(
      "--http", options->server.http,
      "HOST:PORT for browsers: the viewer's page and WebSockets; port 0 picks a free "
      "one (default: none)");
  command->add_flag(
      "--insecure-listen", options->server.insecure_listen,
      "Permit an address that other machines can reach, without encryption or authentication");
  command->add_option("--grace", options->grace_s, "Seconds that streams have to end after SIGTERM")
      ->check(Between(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--max-sessions", options->server.limits.sessions, "Sessions in all")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  command
      ->add_option("--max-sessions-per-peer", options->server.limits.sessions_per_peer,
                   "Sessions created from one host")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  command
      ->add_option("--max-streams-per-peer", options->server.limits.streams_per_peer,
                   "Open streams from one host")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  CLI::Option* record =
      command
          ->add_option("--record", options->record,
                       "Directory that gets a recording (SCENE-SESSION.mcap) of every session")
          ->type_name("DIR");
  command
      ->add_option("--record-frames", options->frames_hz,
                   "Frames per simulated second in the recordings")
      ->check(Between(1e-3, 1e5))
      ->needs(record)
      ->capture_default_str();
  command->add_flag("--json", options->json, "First line as JSON");
  command->callback([options, exit_code] { *exit_code = Serve(*options); });
}

}  // namespace adhesim
