#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/stress_report.h"
#include "clients/cli/validators.h"
#include "core/scene/did_you_mean.h"
#include "core/study/torture.h"

namespace adhesim {
namespace {

struct Arguments {
  std::vector<std::string> cases;
  std::string scenes = "scenes/stress";
  std::string html, json;
  std::string failures = ".";  // directory for scenes that torture found
  bool all = false, list = false;
  int torture = 0;
  std::uint64_t seed = 1;
  double cell_s = 60;
};

// Torture's by default where all is asked for.
constexpr int kAllTorture = 2000;

std::optional<std::vector<const StressCase*>> Choose(const Arguments& arguments) {
  std::vector<std::string> known;
  std::vector<const StressCase*> chosen;
  for (const StressCase& one : StressCases()) known.emplace_back(one.name);
  for (const std::string& name : arguments.cases) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::cerr << "error: no case '" << name << "'" << DidYouMean(name, known)
              << "; adhesim stress --list names them\n";
    return std::nullopt;
  }
  for (const StressCase& one : StressCases()) {
    const std::vector<std::string>& names = arguments.cases;
    if (names.empty() || std::find(names.begin(), names.end(), one.name) != names.end()) {
      chosen.push_back(&one);
    }
  }
  return chosen;
}

absl::Status Save(const Arguments& arguments, const StressReport& report) {
  if (arguments.json.empty() || arguments.json == "-") return absl::OkStatus();
  return WriteStressFile(
      arguments.json,
      StressJson(report).dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

// The cells of a case: its own setting, and the matrix where all is asked for.
std::vector<StressVariant> VariantsOf(const Arguments& arguments, const StressCase& one) {
  std::vector<StressVariant> variants = {StressVariant()};
  if (!arguments.all) return variants;
  const SceneFile file = ReadSceneFile(absl::StrCat(arguments.scenes, "/", one.scene, ".yaml"));
  const std::vector<StressVariant> matrix = StressMatrix(one, file.scene);
  variants.insert(variants.end(), matrix.begin(), matrix.end());
  return variants;
}

absl::Status RunCells(const Arguments& arguments, const std::vector<const StressCase*>& cases,
                      StressReport* report) {
  for (const StressCase* one : cases) {
    for (const StressVariant& variant : VariantsOf(arguments, *one)) {
      if (report->Find(one->name, VariantName(variant)) != nullptr) continue;
      const StressResult result =
          RunStressCase(*one, variant, arguments.scenes, arguments.cell_s, StopRequested);
      if (result.interrupted) return absl::CancelledError("interrupted");
      report->cells.push_back(CellOf(*one, variant, result, report->machine.commit));
      std::cerr << StressLine(report->cells.back()) << std::flush;
      if (absl::Status saved = Save(arguments, *report); !saved.ok()) return saved;
    }
  }
  return absl::OkStatus();
}

// The same cases in Bullet: at their own step, and where all is asked for at a short one too.
absl::Status RunBullet(const Arguments& arguments, const std::vector<const StressCase*>& cases,
                       StressReport* report) {
  for (const StressCase* one : cases) {
    for (const BulletVariant& variant : kBulletVariants) {
      if (variant.dt_s && !arguments.all) continue;
      if (report->Find(one->name, variant.name) != nullptr) continue;
      const BulletCase made =
          RunBulletCase(*one, variant.dt_s, arguments.scenes, arguments.cell_s, StopRequested);
      if (made.result.interrupted) return absl::CancelledError("interrupted");
      report->bullet.push_back(BulletCellOf(*one, variant, made, report->machine.commit));
      if (made.not_expressible.empty())
        std::cerr << StressLine(report->bullet.back()) << std::flush;
    }
  }
  return Save(arguments, *report);
}

absl::Status RunTortures(const Arguments& arguments, int scenes, StressReport* report) {
  TortureReport& torture = report->torture;
  torture.first_seed = arguments.seed;
  for (int i = 0; i < scenes; ++i) {
    const std::uint64_t seed = arguments.seed + static_cast<std::uint64_t>(i);
    const StressResult result = RunTorture(seed, arguments.cell_s, StopRequested);
    if (result.interrupted) return absl::CancelledError("interrupted");
    ++torture.scenes;
    torture.simulated_s += result.figures.simulated_s;
    torture.cpu_s += result.figures.cpu_s;
    if (result.outcome == StressOutcome::kSurvived) ++torture.survived;
    if (result.outcome == StressOutcome::kRefused) ++torture.refused;
    if (result.outcome != StressOutcome::kFailed) continue;
    const std::string file = absl::StrCat(arguments.failures, "/torture-", seed, ".yaml");
    if (absl::Status s = WriteStressFile(file, TortureScene(seed)); !s.ok()) return s;
    torture.failures.push_back({seed, result.cause, file});
    std::cerr << absl::StrFormat("failed    seed %d: %s (%s, %.3g s)\n", seed, result.cause, file,
                                 TortureSeconds(seed))
              << std::flush;
  }
  return absl::OkStatus();
}

// Nothing after a message: there is a file with other contents.
bool TakeUp(const Arguments& arguments, StressReport* report) {
  if (!arguments.all || arguments.json.empty() || arguments.json == "-") return true;
  absl::StatusOr<StressReport> cells = ReadStressCells(arguments.json);
  if (absl::IsNotFound(cells.status())) return true;
  if (!cells.ok()) {
    std::cerr << "error: " << cells.status().message() << "\n";
    return false;
  }
  report->cells = std::move(cells->cells);
  report->bullet = std::move(cells->bullet);
  std::cerr << report->cells.size() << " cells taken over from " << arguments.json << "\n";
  return true;
}

void List() {
  for (const StressCase& one : StressCases()) {
    std::cout << absl::StrFormat("%-24s %-9s %s\n", one.name, one.group, one.title);
  }
}

// Before minutes of cells, not after them. Files are replaced as a whole, by one beside them.
absl::Status CheckOutputs(const Arguments& arguments, bool tortures) {
  for (const std::string& path : {arguments.html, arguments.json}) {
    if (path.empty() || path == "-") continue;
    if (absl::Status s = CheckReplaceable(path); !s.ok()) return s;
  }
  return tortures ? CheckReplaceable(arguments.failures + "/torture.yaml") : absl::OkStatus();
}

std::string Closing(const StressReport& report) {
  std::string text;
  if (!report.cells.empty()) {
    absl::StrAppend(&text, report.cells.size(), " cells: ", report.Count("survived"), " survived, ",
                    report.Count("refused"), " refused when loaded, ", report.Count("frozen"),
                    " frozen with a cause, ", report.Count("failed"), " failed\n");
  }
  for (const BulletVariant& variant : kBulletVariants) {
    const int survived = report.CountBullet(variant.name, "survived");
    const int failed = report.CountBullet(variant.name, "failed");
    if (survived + failed == 0) continue;
    absl::StrAppend(&text, variant.name, " on the same cases: ", survived, " survived, ", failed,
                    " failed, ", report.CountBullet(variant.name, kNotExpressible),
                    " not expressible\n");
  }
  const TortureReport& torture = report.torture;
  if (torture.scenes > 0) {
    absl::StrAppendFormat(
        &text, "torture from seed %d: %d scenes, %d survived, %d refused, %d failed; %.0f s\n",
        torture.first_seed, torture.scenes, torture.survived, torture.refused,
        torture.failures.size(), torture.cpu_s);
  }
  return text;
}

ExitCode Stress(const Arguments& arguments) {
  if (arguments.list) {
    List();
    return kExitOk;
  }
  const std::optional<std::vector<const StressCase*>> cases = Choose(arguments);
  if (!cases) return kExitBadInput;
  std::error_code ignored;
  if (!std::filesystem::is_directory(arguments.scenes, ignored)) {
    std::cerr << "error: --scenes " << arguments.scenes
              << ": no such directory; run this at the root of the source tree, or name the "
                 "directory of the stress scenes\n";
    return kExitBadInput;
  }
  const bool everything = arguments.all && arguments.cases.empty();
  const int tortures = arguments.torture > 0 ? arguments.torture : everything ? kAllTorture : 0;
  if (const absl::Status s = CheckOutputs(arguments, tortures > 0); !s.ok()) {
    std::cerr << "error: " << s.message() << "\n";
    return kExitBadInput;
  }
  StopOnSignals();
  StressReport report;
  report.machine = DescribeMachine();
  if (!TakeUp(arguments, &report)) return kExitBadInput;
  absl::Status status;
  // Torture alone, unless cases are asked for too.
  if (arguments.torture == 0 || arguments.all || !arguments.cases.empty()) {
    status = RunCells(arguments, *cases, &report);
    if (status.ok()) status = RunBullet(arguments, *cases, &report);
  }
  if (status.ok() && tortures > 0) status = RunTortures(arguments, tortures, &report);
  if (status.ok()) status = Save(arguments, report);
  if (status.ok() && !arguments.html.empty()) {
    status = WriteStressFile(arguments.html, StressPage(report));
    if (status.ok()) std::cerr << "the page: " << arguments.html << "\n";
  }
  if (absl::IsCancelled(status)) return kExitInterrupted;
  if (!status.ok()) {
    std::cerr << "error: " << status.message() << "\n";
    return kExitBadInput;
  }
  if (arguments.json == "-") {
    PrintJson(StressJson(report));
  } else {
    std::cout << Closing(report) << std::flush;
  }
  const bool failed = report.Count("failed") > 0 || !report.torture.failures.empty();
  return failed ? kExitCheckFailed : kExitOk;
}

}  // namespace

void AddStressCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "stress", "Runs hard cases and judges whether each is survived; ends with 1 when one fails");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("CASE", arguments->cases, "Cases to run (default: all of them)");
  command->add_flag("--list", arguments->list, "Names the cases, and runs none");
  command->add_flag("--all", arguments->all,
                    "Every step, integrator and elastic law of each case, and 2,000 torture "
                    "scenes; goes on where --json left off");
  command->add_option("--torture", arguments->torture, "Runs this many random scenes instead")
      ->type_name("N")
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->seed, "Seed of the first random scene")
      ->type_name("S")
      ->capture_default_str();
  command
      ->add_option("--failures", arguments->failures, "Directory for the random scenes that failed")
      ->type_name("DIR")
      ->capture_default_str();
  command->add_option("--cell-seconds", arguments->cell_s, "CPU time that a cell may take")
      ->type_name("S")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--html", arguments->html, "Writes the matrix, one page that stands alone")
      ->type_name("FILE")
      ->check(OutputFile());
  command->add_option("--json", arguments->json, "Writes the cells; - is the standard output")
      ->type_name("FILE")
      ->check(OutputFile());
  command->add_option("--scenes", arguments->scenes, "Directory of the stress scenes")
      ->type_name("DIR")
      ->capture_default_str();
  command->callback([arguments, exit_code] { *exit_code = Stress(*arguments); });
}

}  // namespace adhesim
