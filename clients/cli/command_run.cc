#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/headless_run.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "clients/cli/record_run.h"
#include "clients/cli/run_report.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/validators.h"

namespace adhesim {
namespace {

// Stage times are kept of at most so many of the last steps.
constexpr std::uint64_t kMostTimedSteps = 4096;
constexpr double kMostSteps = 1e9;

struct Arguments {
  std::string scene;
  double seconds = 1;
  std::uint64_t steps = 0;
  double measure_from_s = 0;
  double rate_hz = 0;
  int threads = 1;
  int fidelity = 0;
  double step_budget_s = 0;
  bool realtime = false;
  bool strict_realtime = false;
  std::string record;
  double frames_hz = 60;
  std::vector<std::string> settings;
  bool json = false;
};

// The number of steps that makes so many seconds, at least as long.
double StepCount(double seconds, double dt_s) { return std::ceil(seconds / dt_s - 1e-6); }

int Run(Arguments arguments, bool has_steps, bool has_rate) {
  if (has_rate) arguments.settings.push_back(absl::StrCat("rate_hz=", arguments.rate_hz));
  const std::optional<LoadedScene> loaded = LoadScene(arguments.scene, arguments.settings);
  if (!loaded) return kExitBadInput;

  const double dt_s = loaded->model->dt_s;
  const double steps =
      has_steps ? static_cast<double>(arguments.steps) : StepCount(arguments.seconds, dt_s);
  const double measure_from = StepCount(arguments.measure_from_s, dt_s);
  if (steps < 1 || steps > kMostSteps) {
    std::cerr << "error: a run of " << steps << " steps; permitted: 1 to " << kMostSteps << "\n";
    return kExitBadInput;
  }
  if (measure_from >= steps) {
    std::cerr << "error: --measure-from " << arguments.measure_from_s
              << " is not before the end of the run at " << steps * dt_s << " s\n";
    return kExitBadInput;
  }
  absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(loaded->model, {.threads = arguments.threads});
  if (!engine.ok()) {
    PrintRefusal(loaded->file, engine.status());
    return kExitBadInput;
  }

  const int rungs = static_cast<int>((*engine)->rungs().size());
  if (arguments.fidelity > rungs) {
    std::cerr << "error: --fidelity " << arguments.fidelity << "; permitted for this scene: 0 to "
              << rungs << "\n";
    return kExitBadInput;
  }
  (*engine)->SetFidelity(arguments.fidelity);
  if (arguments.step_budget_s > 0 && !arguments.realtime && !arguments.strict_realtime) {
    std::cerr << "error: --step-budget without --realtime or --strict-realtime\n";
    return kExitBadInput;
  }
  RunOptions options;
  options.steps = static_cast<std::uint64_t>(steps);
  options.measure_from = static_cast<std::uint64_t>(measure_from);
  options.realtime = arguments.realtime || arguments.strict_realtime;
  options.step_budget_s = arguments.step_budget_s;
  options.one_thread = arguments.threads == 1;
  (*engine)->TimeStages(std::min(options.steps - options.measure_from, kMostTimedSteps));
  std::unique_ptr<Recorder> recorder;
  if (!arguments.record.empty()) {
    absl::StatusOr<std::unique_ptr<Recorder>> begun =
        RecordRun(arguments.record, arguments.frames_hz, *loaded, **engine);
    if (!begun.ok()) {
      std::cerr << "error: --record " << begun.status().message() << "\n";
      return kExitBadInput;
    }
    recorder = *std::move(begun);
    options.observer = recorder.get();
  }
  const RunStatistics statistics = RunHeadless(engine->get(), options, StopOnSignals());
  Json report = RunReportJson(**engine, options, statistics, arguments.threads);
  if (recorder != nullptr) {
    recorder->OnEnd();
    report["recording"] = {{"file", arguments.record}, {"bytes", recorder->bytes_written()}};
  }
  if (arguments.json) {
    PrintJson(report);
  } else {
    std::cout << RunReportText(report);
  }
  if (statistics.interrupted) return kExitInterrupted;
  // What is wrong was said when it happened.
  if (recorder != nullptr && !recorder->status().ok()) return kExitCheckFailed;
  if ((*engine)->frozen()) {
    std::cerr << "error: frozen: " << (*engine)->FrozenBecause() << "\n";
    return kExitCheckFailed;
  }
  return arguments.strict_realtime && statistics.deadline_misses > 0 ? kExitDeadlineMissed
                                                                     : kExitOk;
}

}  // namespace

void AddRunCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "run", "Runs a scene headless, in this process, and prints what it measured");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("SCENE", arguments->scene, "Scene file (YAML or JSON)")->required();
  CLI::Option* seconds =
      command->add_option("--seconds", arguments->seconds, "Simulated time; without it 1 s");
  CLI::Option* steps =
      command->add_option("--steps", arguments->steps, "Number of steps, instead of --seconds");
  seconds->check(Between(1e-6, 1e6))->excludes(steps);
  command
      ->add_option("--measure-from", arguments->measure_from_s,
                   "Figures start at this simulated time, in s")
      ->check(Between(0.0, 1e6));
  CLI::Option* rate = command->add_option("--rate", arguments->rate_hz,
                                          "Steps per simulated second, instead of the scene's");
  command
      ->add_option("--threads", arguments->threads,
                   "Threads that step; the result is the same for any number")
      ->check(CLI::Range(1, 64));
  CLI::Option* fidelity = command->add_option(
      "--fidelity", arguments->fidelity,
      "How many rungs of fidelity are given up to save time (docs/governor.md)");
  fidelity->check(CLI::Range(0, 100));
  command
      ->add_option("--step-budget", arguments->step_budget_s,
                   "In real time: fidelity is given up when steps take longer, in s; a session "
                   "has 0.8 of the period (default: never)")
      ->check(Between(0.0, 1e3))
      ->excludes(fidelity);
  command->add_flag("--realtime", arguments->realtime,
                    "Each step waits for its time; counts missed deadlines");
  command->add_flag("--strict-realtime", arguments->strict_realtime,
                    "As --realtime; ends with 4 if one was missed");
  CLI::Option* record =
      command->add_option("--record", arguments->record, "Writes a recording (.mcap) to this file")
          ->type_name("FILE");
  command
      ->add_option("--record-frames", arguments->frames_hz,
                   "Frames per simulated second in the recording")
      ->check(Between(1e-3, 1e5))
      ->needs(record)
      ->capture_default_str();
  AddSettingsOption(command, &arguments->settings);
  command->add_flag("--json", arguments->json, "Prints one JSON object");
  command->callback([=] { *exit_code = Run(*arguments, steps->count() > 0, rate->count() > 0); });
}

}  // namespace adhesim
