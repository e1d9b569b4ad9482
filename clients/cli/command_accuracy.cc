#include <absl/status/statusor.h>
#include <absl/strings/str_format.h>

#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/cli/accuracy_page.h"
#include "clients/cli/accuracy_report.h"
#include "clients/cli/bullet_accuracy.h"
#include "clients/cli/commands.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/validators.h"
#include "core/study/accuracy_apply.h"

namespace adhesim {
namespace {

struct Arguments {
  std::string scene, html, json, svg;
  std::vector<std::string> settings;
  AccuracyOptions options;
  bool apply = false, apply_rungs = false;
};

ExitCode Fail(const absl::Status& status) {
  if (absl::IsCancelled(status)) return kExitInterrupted;
  std::cerr << "error: " << status.message() << "\n";
  return absl::IsInvalidArgument(status) ? kExitBadInput : kExitCheckFailed;
}

// Before a study of minutes, not after it.
absl::Status CheckAllWritable(const Arguments& arguments) {
  for (const std::string& path : {arguments.html, arguments.svg, arguments.json}) {
    if (path.empty() || path == "-") continue;
    if (absl::Status writable = CheckWritable(path); !writable.ok()) return writable;
  }
  return absl::OkStatus();
}

absl::Status Write(const Arguments& arguments, const AccuracyReport& report) {
  if (!arguments.html.empty()) {
    absl::Status written = WriteTextFile(arguments.html, AccuracyPage(report));
    if (!written.ok()) return written;
    std::cerr << "the page: " << arguments.html << "\n";
  }
  if (!arguments.svg.empty()) {
    const absl::StatusOr<std::string> picture = AccuracyPicture(report);
    if (!picture.ok()) return picture.status();
    if (absl::Status s = WriteTextFile(arguments.svg, *picture); !s.ok()) return s;
    std::cerr << "the picture: " << arguments.svg << "\n";
  }
  if (arguments.json == "-") {
    PrintJson(AccuracyJson(report));
    return absl::OkStatus();
  }
  if (!arguments.json.empty()) {
    const std::string text =
        AccuracyJson(report).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
    if (absl::Status s = WriteTextFile(arguments.json, text); !s.ok()) return s;
  }
  std::cout << AccuracyText(report) << std::flush;
  return absl::OkStatus();
}

// Writes the cheapest setting within the tolerance into the scene's file, or leaves its own, and
// what the rungs of that setting cost.
ExitCode Apply(const SceneFile& file, const AccuracyStudy& study, bool own_setting) {
  if (!own_setting && study.advice.cheapest < 0) {
    std::cerr << "error: --apply: no setting is within the tolerance; " << file.file
              << " is as it was\n";
    return kExitCheckFailed;
  }
  const AccuracySetting& setting = study.points[own_setting ? 0 : study.advice.cheapest].setting;
  const std::vector<AccuracyRung>& measured = own_setting ? study.rungs : study.advised_rungs;
  const absl::StatusOr<v1::Rungs> rungs = RungsMessage(measured, !file.scene.tools().empty());
  if (!rungs.ok()) {
    std::cerr << (own_setting ? "error: --apply-rungs: " : "without what rungs cost: ")
              << rungs.status().message() << "\n";
    if (own_setting) return kExitCheckFailed;
  }
  RungsEntry entry;
  if (rungs.ok()) {
    entry = {*rungs,
             absl::StrFormat("measured by adhesim accuracy --apply%s: %.4g s at %.10g Hz",
                             own_setting ? "-rungs" : "", study.duration_s, setting.rate_hz)};
  }
  const absl::StatusOr<std::string> text = TextWithEdits(file, setting.edits, entry);
  if (!text.ok()) {
    std::cerr << "error: --apply: " << text.status().message() << ": " << SetOptions(setting)
              << "\n";
    return kExitCheckFailed;
  }
  if (*text == file.text) {
    std::cerr << file.file
              << (own_setting ? " has what its rungs cost already\n"
                              : " has what is recommended already\n");
    return kExitOk;
  }
  if (const absl::Status written = WriteTextFile(file.file, *text); !written.ok())
    return Fail(written);
  std::cerr << "written into " << file.file << ": "
            << (setting.edits.empty() ? "no other setting" : SetOptions(setting))
            << (rungs.ok() ? ", and what its rungs cost" : "") << "\n";
  return kExitOk;
}

ExitCode Accuracy(const Arguments& arguments) {
  const SceneFile file = ReadSceneFile(arguments.scene);
  const std::optional<LoadedScene> loaded = LoadScene(arguments.scene, arguments.settings);
  if (!loaded) return kExitBadInput;
  if (const absl::Status writable = CheckAllWritable(arguments); !writable.ok())
    return Fail(writable);
  StopOnSignals();
  AccuracyReport report;
  report.machine = DescribeMachine();
  report.file = arguments.scene;
  report.description = loaded->file.scene.description();
  AccuracyOptions options = arguments.options;
  options.stop = StopRequested;
  options.rival = BulletRival;
  options.advised_rungs = arguments.apply;
  options.only_rungs = arguments.apply_rungs;
  options.progress = [](const std::string& what) { std::cerr << what << " ..." << std::endl; };
  absl::StatusOr<AccuracyStudy> study =
      StudyAccuracy(loaded->file.scene, loaded->file.directory, options);
  if (!study.ok()) return Fail(study.status());
  report.study = *std::move(study);
  if (arguments.apply_rungs) return Apply(file, report.study, true);
  if (const absl::Status written = Write(arguments, report); !written.ok()) return Fail(written);
  return arguments.apply ? Apply(file, report.study, false) : kExitOk;
}

void AddLimits(CLI::App* command, AccuracyOptions* options) {
  // CLI11 2.1 reads no std::optional beside a transformation of units.
  command
      ->add_option_function<double>(
          "--tolerance-mm", [options](const double& mm) { options->tolerance_m = 1e-3 * mm; },
          "Error of positions that is permitted (default: 1 % of the motion)")
      ->check(Between(1e-9, 1e6));
  command
      ->add_option_function<double>(
          "--tolerance-n", [options](const double& n) { options->tolerance_n = n; },
          "Error of tools' forces that is permitted (default: 2 % of the peak)")
      ->check(Between(1e-12, 1e6));
  command
      ->add_option_function<double>(
          "--rate", [options](const double& hz) { options->rate_hz = hz; },
          "Steps a second that are demanded (default: the scene's)")
      ->check(Between(1e-3, 20000));
  command
      ->add_option("--step-budget", options->step_share,
                   "Part of a step's time that stepping may take")
      ->check(Between(1e-3, 1e3))
      ->capture_default_str();
}

}  // namespace

void AddAccuracyCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "accuracy",
      "Measures what accuracy costs: runs a scene at many settings, compares them with "
      "a reference made here, and recommends one");
  auto arguments = std::make_shared<Arguments>();
  AccuracyOptions* options = &arguments->options;
  command->add_option("SCENE", arguments->scene, "Scene file (YAML or JSON)")->required();
  command->add_option("--html", arguments->html, "Writes the report, one page that stands alone")
      ->type_name("FILE")
      ->check(OutputFile());
  command
      ->add_option("--svg", arguments->svg, "Writes its first diagram, a picture that stands alone")
      ->type_name("FILE")
      ->check(OutputFile());
  command->add_option("--json", arguments->json, "Writes the numbers; - is the standard output")
      ->type_name("FILE")
      ->check(OutputFile());
  command
      ->add_option("--seconds", options->seconds,
                   "Simulated time (default: until the last trajectory ends, or 4 s)")
      ->check(Between(1e-3, 1e4));
  command->add_option("--repeats", options->repeats, "Runs of each setting, for its cost")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--budget-s", options->budget_s,
                   "Wall time of the whole study; what does not fit is left out, and named")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->check(Between(0.1, 1e6))
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads that step")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_flag("--quick", options->quick, "Fewer settings, and a coarser reference");
  AddLimits(command, options);
  CLI::Option* apply =
      command->add_flag("--apply", arguments->apply,
                        "Writes the cheapest setting within the tolerance into the scene's file, "
                        "and what the governor's rungs cost at it");
  CLI::Option* apply_rungs = command->add_flag(
      "--apply-rungs", arguments->apply_rungs,
      "Measures nothing but what the governor's rungs cost, and writes it into the scene's file");
  AddSettingsOption(command, &arguments->settings);
  // What is recommended for another scene is not written into this one.
  apply->excludes("--set");
  apply_rungs->excludes("--set");
  for (const char* other : {"--apply", "--html", "--svg", "--json"}) apply_rungs->excludes(other);
  command->callback([arguments, exit_code] { *exit_code = Accuracy(*arguments); });
}

}  // namespace adhesim
