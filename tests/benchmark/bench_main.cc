// adhesim_bench: step times of the paper's scenes, ours and those of Bullet's soft bodies, in one
// run.

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/model/simd.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "tests/benchmark/duel.h"
#include "tests/benchmark/effect_costs.h"

namespace adhesim::bench {
namespace {

using Json = nlohmann::ordered_json;

// A scene of the benchmark: simulated time (what the paper's scenes say that a run takes) and
// repeats, which keep all of them within some minutes. The second half of the time is measured.
struct Entry {
  const char* path;  // below the folder of scenes
  double seconds;
  int repeats;
  double target_ms;  // a step of ours at most, on the machine of the project; 0: none
};

constexpr Entry kEntries[] = {
    {"paper/two_cells_sticky.yaml", 5, 5, 0.021},
    {"paper/two_cells_slippery.yaml", 4, 5, 0},
    {"paper/rolling_ball.yaml", 2, 5, 0.07},
    {"paper/four_bunnies.yaml", 4, 5, 0.2},
    {"paper/six_spheres_on_plane.yaml", 6, 5, 0.25},
    {"paper/cell_aggregation.yaml", 4, 5, 0.40},
    {"paper/cell_aggregation_x10.yaml", 1, 3, 5},
    {"paper/cell_aggregation_x100.yaml", 0.5, 2, 60},
    {"training/liver_surface.yaml", 3, 3, 0},
    {"training/needle_organ.yaml", 3, 3, 0},
};
constexpr const char* kSmallest = "paper/cell_aggregation.yaml";
constexpr const char* kLargest = "paper/cell_aggregation_x100.yaml";

struct Arguments {
  std::vector<std::string> names;
  std::string folder = "scenes";
  std::string json;
  double seconds = 0;  // instead of each scene's, when positive
  int repeats = 0;     // likewise
  Simd simd = BestSimd();
};

struct Row {
  Entry entry;
  std::shared_ptr<const Model> model;
  int steps = 0;
  Result result;
};

// The scene's model; nothing, after a message, when it cannot be had here.
std::shared_ptr<const Model> Load(const std::string& path) {
  const SceneFile file = ReadSceneFile(path);
  if (!file.ok()) {
    std::cerr << file.Format(file.problems);
    return nullptr;
  }
  BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  if (!built.model) std::cerr << file.Format(file.Located(built.problems));
  return built.model;
}

bool Wanted(const Entry& entry, const std::vector<std::string>& names) {
  const std::string stem = std::filesystem::path(entry.path).stem();
  return names.empty() || std::find(names.begin(), names.end(), stem) != names.end();
}

double Load1() {
  double load[1] = {0};
  return getloadavg(load, 1) == 1 ? load[0] : 0;
}

Json ToJson(const Row& row) {
  const Result& result = row.result;
  Json json = {{"scene", row.entry.path},
               {"particles", row.model->particle_count()},
               {"triangles", row.model->triangles.size()},
               {"dt_s", row.model->dt_s},
               {"steps", row.steps},
               {"repeats", result.repeats.size()},
               {"cpu_ms_per_step", {{"median", result.ours_ms}, {"p99", result.ours_p99_ms}}},
               {"colliding_share",
                {{"mean", result.colliding_share}, {"max", result.peak_colliding_share}}}};
  if (row.entry.target_ms > 0) {
    json["target_ms"] = row.entry.target_ms;
    json["meets_target"] = result.ours_ms <= row.entry.target_ms;
  }
  if (result.has_bullet) {
    json["bullet"] = {
        {"cpu_ms_per_step", {{"median", result.bullet_ms}, {"p99", result.bullet_p99_ms}}},
        {"contacts_mean", result.bullet_contacts},
        {"finite", result.bullet_finite}};
    json["ratio"] = {
        {"median", result.ratio}, {"min", result.ratio_min}, {"max", result.ratio_max}};
  }
  Json stages = Json::array();
  for (const StageCost& stage : result.stages) {
    stages.push_back({{"name", stage.name}, {"median_us", stage.median_us}});
  }
  json["stages"] = stages;
  return json;
}

void PrintHeader() {
  std::cout << absl::StrFormat("%-36s %9s %9s %9s %6s %15s %6s %8s\n", "scene", "particles",
                               "ours ms", "Bullet ms", "ratio", "min..max", "CP", "limit ms");
}

void Print(const Row& row) {
  const Result& result = row.result;
  const std::string target =
      row.entry.target_ms > 0
          ? absl::StrFormat("%.3g %s", row.entry.target_ms,
                            result.ours_ms <= row.entry.target_ms ? "met" : "MISSED")
          : "-";
  std::cout << absl::StrFormat("%-36s %9d %9.4f ", row.entry.path, row.model->particle_count(),
                               result.ours_ms);
  if (result.has_bullet) {
    std::cout << absl::StrFormat("%9.4f %6.2f %15s ", result.bullet_ms, result.ratio,
                                 absl::StrFormat("%.2f..%.2f", result.ratio_min, result.ratio_max));
  } else {
    std::cout << absl::StrFormat("%9s %6s %15s ", "-", "-", "-");
  }
  std::cout << absl::StrFormat("%5.0f%% %8s\n", 100 * result.colliding_share, target);
  std::cout << "   ";
  for (const StageCost& stage : result.stages) {
    std::cout << absl::StrFormat(" %s %.1f us,", stage.name, stage.median_us);
  }
  std::cout << (result.bullet_finite ? "\n" : " BULLET NOT FINITE\n") << std::flush;
}

// Exponent of the growth of the step's time with the number of particles, 25 to 2,500 cells.
std::optional<double> Growth(const std::vector<Row>& rows) {
  const Row *small = nullptr, *large = nullptr;
  for (const Row& row : rows) {
    if (row.entry.path == std::string(kSmallest)) small = &row;
    if (row.entry.path == std::string(kLargest)) large = &row;
  }
  if (!small || !large) return std::nullopt;
  return std::log(large->result.ours_ms / small->result.ours_ms) /
         std::log(static_cast<double>(large->model->particle_count()) /
                  small->model->particle_count());
}

int Main(const Arguments& arguments) {
  const double load_before = Load1();
  std::vector<Row> rows;
  PrintHeader();
  for (const Entry& entry : kEntries) {
    if (!Wanted(entry, arguments.names)) continue;
    Row row{entry, Load(arguments.folder + "/" + entry.path), 0, {}};
    if (!row.model) {
      std::cerr << "bench: left out: " << entry.path << "\n";
      continue;
    }
    const double seconds = arguments.seconds > 0 ? arguments.seconds : entry.seconds;
    row.steps = std::max(2, static_cast<int>(std::lround(seconds / row.model->dt_s)));
    absl::StatusOr<Result> result = Compare(
        row.model, {row.steps, row.steps / 2,
                    arguments.repeats > 0 ? arguments.repeats : entry.repeats, arguments.simd});
    if (!result.ok()) {
      std::cerr << "bench: " << entry.path << ": " << result.status() << "\n";
      return 1;
    }
    row.result = *std::move(result);
    Print(row);
    rows.push_back(std::move(row));
  }
  if (rows.empty()) {
    std::cerr << "bench: no scene to run\n";
    return 2;
  }
  Json report = {{"simd", SimdName(arguments.simd)},
                 {"load_before", load_before},
                 {"load_after", Load1()},
                 {"scenes", Json::array()}};
  for (const Row& row : rows) report["scenes"].push_back(ToJson(row));
  std::cout << absl::StrFormat("load average %.2f before, %.2f after; %s\n", load_before,
                               report["load_after"].get<double>(), SimdName(arguments.simd));
  if (const std::optional<double> exponent = Growth(rows)) {
    report["growth_exponent"] = *exponent;
    std::cout << absl::StrFormat("growth from 25 to 2,500 cells: exponent %.3f\n", *exponent);
  }
  if (arguments.json.empty()) return 0;
  std::ofstream file(arguments.json);
  file << report.dump(2) << "\n";
  file.close();
  if (file) return 0;
  std::cerr << "bench: cannot write " << arguments.json << "\n";
  return 1;
}

}  // namespace
}  // namespace adhesim::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Step times (CPU time of one thread, second half of each run) of the paper's scenes: ours, "
      "and "
      "Bullet's soft bodies on the same meshes, masses and fields, interleaved");
  adhesim::bench::Arguments arguments;
  app.add_option("NAME", arguments.names,
                 "Scenes by name (two_cells_sticky); without it all. \"effects\" alone: what each "
                 "effect adds to a scene");
  app.add_option("--scenes", arguments.folder, "The folder of scenes")->capture_default_str();
  app.add_option("--seconds", arguments.seconds, "Simulated time instead of each scene's own")
      ->check(CLI::Range(1e-3, 1e4));
  app.add_option("--repeats", arguments.repeats, "Repeats instead of each scene's own")
      ->check(CLI::Range(1, 1000));
  std::map<std::string, adhesim::Simd> targets;
  for (adhesim::Simd simd : adhesim::AvailableSimd()) targets[adhesim::SimdName(simd)] = simd;
  app.add_option("--simd", arguments.simd, "Instruction set of our engine instead of the best")
      ->transform(CLI::CheckedTransformer(targets));
  app.add_option("--json", arguments.json, "Writes the figures to this file")->type_name("FILE");
  adhesim::bench::EffectCostOptions effects;
  app.add_option("--steps", effects.steps, "Steps of \"effects\"")->check(CLI::Range(1, 1000000));
  app.add_flag("!--no-instructions", effects.count, "\"effects\": do not count instructions");
  std::string step_scene;  // what counting instructions calls
  app.add_option("--step-scene", step_scene)->group("");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (!step_scene.empty()) return adhesim::bench::StepText(step_scene, effects.steps);
  if (arguments.names == std::vector<std::string>{"effects"}) {
    if (arguments.repeats > 0) effects.repeats = arguments.repeats;
    effects.simd = arguments.simd;
    effects.json = arguments.json;
    return adhesim::bench::MeasureEffects(effects);
  }
  return adhesim::bench::Main(arguments);
}
