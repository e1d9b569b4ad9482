#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "clients/cli/paper_page.h"
#include "clients/cli/paper_report.h"
#include "clients/cli/picture_source.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/take_pictures.h"
#include "clients/cli/validators.h"
#include "core/scene/body_file.h"
#include "core/scene/did_you_mean.h"
#include "core/scene/mesh/read_surface.h"
#include "server/recording/temporary_directory.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

constexpr double kQuickShare = 0.2;  // of a figure's duration
constexpr int kSamples = 200, kQuickSamples = 40;
constexpr int kRivalSamples = 1200;  // one a millisecond: a touch may last for some
// Two fit beside each other in the page; a picture takes some 50 kB.
constexpr int kPictureWidth = 480, kPictureHeight = 360;

struct Arguments {
  std::vector<std::string> figures;
  std::string scenes = "scenes/paper";
  std::string html, json;
  std::string browser;
  bool no_pictures = false;
  bool quick = false;
};

bool IsChosen(const Arguments& arguments, std::string_view name) {
  const std::vector<std::string>& chosen = arguments.figures;
  return chosen.empty() || std::find(chosen.begin(), chosen.end(), name) != chosen.end();
}

// The figures asked for, in the paper's order; nothing after a message when one of them is none.
std::optional<std::vector<const PaperFigure*>> Choose(const Arguments& arguments) {
  std::vector<std::string> known;
  for (const PaperFigure& figure : PaperFigures()) known.emplace_back(figure.scene);
  known.emplace_back(kRivals);
  for (const std::string& name : arguments.figures) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::cerr << "error: no figure '" << name << "'" << DidYouMean(name, known)
              << "; there are: " << absl::StrJoin(known, ", ") << "\n";
    return std::nullopt;
  }
  std::vector<const PaperFigure*> chosen;
  for (const PaperFigure& figure : PaperFigures()) {
    if (IsChosen(arguments, figure.scene)) chosen.push_back(&figure);
  }
  return chosen;
}

std::string SceneFileOf(const Arguments& arguments, std::string_view scene) {
  return (fs::path(arguments.scenes) / absl::StrCat(std::string(scene), ".yaml")).string();
}

// What scenes/fetch_assets.sh places, and the scene names, and is not here; empty: nothing.
std::string MissingAsset(const std::string& scene_file) {
  const SceneFile file = ReadSceneFile(scene_file);
  for (const v1::Body& body : file.scene.bodies()) {
    const std::string* name = FileOf(body);
    if (name == nullptr) continue;
    const absl::Status found = ResolveFile(*name, file.directory).status();
    if (absl::IsNotFound(found)) return std::string(found.message());
  }
  return "";
}

// Runs a figure from its start; `writer` may be null.
absl::Status Measure(const Arguments& arguments, Engine* engine, InstantWriter* writer,
                     FigureReport* report) {
  const PaperFigure& figure = *report->figure;
  report->description = engine->model().scene.description();
  report->whole = !arguments.quick;
  report->duration_s = figure.duration_s * (arguments.quick ? kQuickShare : 1);
  StudyOptions options;
  options.duration_s = report->duration_s;
  options.samples = arguments.quick ? kQuickSamples : kSamples;
  (figure.story == Story::kRolls ? options.rolling_body : options.followed_body) = figure.followed;
  options.instants.assign(figure.instants.begin(), figure.instants.end());
  options.at_instant = [&] {
    if (writer != nullptr) writer->Write();
  };
  options.stop = StopRequested;
  report->study = RunPaperStudy(engine, options);
  if (report->study.interrupted) return absl::CancelledError("interrupted");
  report->claims = JudgeFigure(figure, report->study, report->whole);
  return writer != nullptr ? writer->Finish() : absl::OkStatus();
}

absl::Status Photograph(const Arguments& arguments, const std::string& recording,
                        FigureReport* report) {
  std::vector<double> at_s;
  for (const StudyInstant& instant : report->study.instants) at_s.push_back(instant.time_s);
  const PictureOptions options{.browser = arguments.browser,
                               .width = kPictureWidth,
                               .height = kPictureHeight,
                               .colour_map = "zone",
                               .theme = "light",
                               .hide = {"forces", "contacts", "zones"},
                               .stop = StopRequested};
  return TakePictures(recording, at_s, options, [&](const Picture& picture) {
    report->pictures.push_back(picture);
    return absl::OkStatus();
  });
}

// Runs one figure and takes its pictures, unless `no_pictures` says why there are none. Errors:
// InvalidArgument for a scene that cannot be used (every mistake is on stderr); Cancelled.
absl::Status RunFigure(const Arguments& arguments, const std::string& directory,
                       FigureReport* report, std::string* no_pictures) {
  const PaperFigure& figure = *report->figure;
  if (arguments.quick && figure.large && arguments.figures.empty()) {
    report->not_run = "it is large, and this is a quick run";
    return absl::OkStatus();
  }
  const std::string scene_file = SceneFileOf(arguments, figure.scene);
  report->not_run = MissingAsset(scene_file);
  if (!report->not_run.empty()) return absl::OkStatus();
  const std::optional<LoadedScene> loaded = LoadScene(scene_file);
  if (!loaded) return absl::InvalidArgumentError(absl::StrCat(scene_file, " cannot be used"));
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(loaded->model, Engine::Options());
  if (!engine.ok()) return absl::InvalidArgumentError(engine.status().message());
  if (!no_pictures->empty()) return Measure(arguments, engine->get(), nullptr, report);

  const std::string recording = absl::StrCat(directory, "/", std::string(figure.scene), ".mcap");
  const absl::StatusOr<std::unique_ptr<InstantWriter>> writer =
      InstantWriter::Open(recording, **engine);
  if (!writer.ok()) return writer.status();
  if (absl::Status measured = Measure(arguments, engine->get(), writer->get(), report);
      !measured.ok()) {
    return measured;
  }
  absl::Status taken = Photograph(arguments, recording, report);
  if (taken.ok() || absl::IsCancelled(taken)) return taken;
  // The numbers stand without them.
  *no_pictures = absl::StrCat("none from ", std::string(figure.scene), " on; ", taken.message());
  return absl::OkStatus();
}

// Runs a method of contact at one rate. Errors: as RunFigure.
absl::Status RunRival(const Arguments& arguments, const Rival& rival, int rate_hz,
                      RivalResult* result) {
  std::vector<std::string> settings(rival.settings.begin(), rival.settings.end());
  settings.push_back(absl::StrCat("rate_hz=", rate_hz));
  const std::string scene_file = SceneFileOf(arguments, rival.scene);
  const std::optional<LoadedScene> loaded = LoadScene(scene_file, settings);
  if (!loaded) return absl::InvalidArgumentError(absl::StrCat(scene_file, " cannot be used"));
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(loaded->model, Engine::Options());
  if (!engine.ok()) return absl::InvalidArgumentError(engine.status().message());
  StudyOptions options;
  options.duration_s = kRivalsDurationS;
  options.samples = kRivalSamples;
  options.stop = StopRequested;
  RivalRun& run = result->runs.emplace_back();
  run.rate_hz = rate_hz;
  run.substeps = (*engine)->substeps();
  run.study = RunPaperStudy(engine->get(), options);
  return run.study.interrupted ? absl::CancelledError("interrupted") : absl::OkStatus();
}

absl::Status RunRivals(const Arguments& arguments, PaperReport* report) {
  for (const Rival& rival : PaperRivals()) {
    RivalResult& result = report->rivals.emplace_back();
    result.rival = &rival;
    for (const int rate_hz : RivalRatesHz()) {
      if (absl::Status s = RunRival(arguments, rival, rate_hz, &result); !s.ok()) return s;
    }
  }
  report->rival_claims = JudgeRivals(report->rivals);
  return absl::OkStatus();
}

absl::Status Write(const Arguments& arguments, const PaperReport& report) {
  if (!arguments.html.empty()) {
    if (absl::Status s = WriteTextFile(arguments.html, PaperPage(report)); !s.ok()) return s;
    std::cerr << "the page: " << arguments.html << "\n";
  }
  if (arguments.json == "-") {
    PrintJson(PaperJson(report));
    return absl::OkStatus();
  }
  if (!arguments.json.empty()) {
    const std::string text =
        PaperJson(report).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
    if (absl::Status s = WriteTextFile(arguments.json, text); !s.ok()) return s;
  }
  std::cout << PaperText(report) << std::flush;
  return absl::OkStatus();
}

ExitCode Fail(const absl::Status& status) {
  if (absl::IsCancelled(status)) return kExitInterrupted;
  std::cerr << "error: " << status.message() << "\n";
  return absl::IsInvalidArgument(status) ? kExitBadInput : kExitCheckFailed;
}

ExitCode Paper(const Arguments& arguments) {
  const std::optional<std::vector<const PaperFigure*>> figures = Choose(arguments);
  if (!figures) return kExitBadInput;
  std::error_code ignored;
  if (!fs::is_directory(arguments.scenes, ignored)) {
    return Fail(absl::InvalidArgumentError(
        absl::StrCat("--scenes ", arguments.scenes,
                     ": no such directory; run this at the root of the source tree, or name the "
                     "directory of the paper's scenes")));
  }
  StopOnSignals();
  PaperReport report;
  report.machine = DescribeMachine();
  if (arguments.no_pictures) {
    report.no_pictures = "left out with --no-pictures";
  } else if (const absl::Status can = CanTakePictures(arguments.browser); !can.ok()) {
    // A browser that was named is expected to be there.
    if (!arguments.browser.empty()) return Fail(absl::InvalidArgumentError(can.message()));
    report.no_pictures = std::string(can.message());
  }
  const absl::StatusOr<std::unique_ptr<TemporaryDirectory>> directory = TemporaryDirectory::Make();
  if (!directory.ok()) return Fail(directory.status());
  for (const PaperFigure* figure : *figures) {
    std::cerr << figure->scene << " ..." << std::endl;
    FigureReport& one = report.figures.emplace_back();
    one.figure = figure;
    const absl::Status status =
        RunFigure(arguments, (*directory)->path(), &one, &report.no_pictures);
    if (!status.ok()) return Fail(status);
  }
  if (IsChosen(arguments, kRivals)) {
    std::cerr << kRivals << " ..." << std::endl;
    if (const absl::Status status = RunRivals(arguments, &report); !status.ok()) {
      return Fail(status);
    }
  }
  if (const absl::Status written = Write(arguments, report); !written.ok()) return Fail(written);
  return AnyFails(report) ? kExitCheckFailed : kExitOk;
}

}  // namespace

void AddPaperCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "paper",
      "Runs the paper's experiments and judges its claims by numbers; ends with 1 when "
      "one does not hold");
  auto arguments = std::make_shared<Arguments>();
  command->add_option(
      "FIGURE", arguments->figures,
      "Scenes of the figures to run, or `rivals`, the comparison of methods (default: all)");
  command->add_option("--html", arguments->html, "Writes the report, one page that stands alone")
      ->type_name("FILE")
      ->check(OutputFile());
  command->add_option("--json", arguments->json, "Writes the numbers; - is the standard output")
      ->type_name("FILE")
      ->check(OutputFile());
  command->add_option("--scenes", arguments->scenes, "Directory of the paper's scenes")
      ->type_name("DIR")
      ->capture_default_str();
  command->add_flag("--no-pictures", arguments->no_pictures, "Needs no browser");
  command->add_flag("--quick", arguments->quick,
                    "A fifth of each run and no large scene: what needs the end is not judged");
  command->add_option("--browser", arguments->browser,
                      "Chromium's program (default: the one on PATH)");
  command->callback([arguments, exit_code] { *exit_code = Paper(*arguments); });
}

}  // namespace adhesim
