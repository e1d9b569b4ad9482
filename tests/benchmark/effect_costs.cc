#include "tests/benchmark/effect_costs.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "core/effects/registry.h"
#include "core/engine/engine.h"
#include "core/engine/heap_meter.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "core/study/timing.h"
#include "tests/support/effect_samples.h"

namespace adhesim::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kChunk = 20;  // steps of one scene before the other has its turn

// A scene with and without one effect.
struct Case {
  std::string effect;  // what is added
  std::string to;      // what it is added to
  std::string with, without;
};

struct Figures {
  double us = 0;            // CPU time of a step
  std::size_t bytes = 0;    // of the heap
  double instructions = 0;  // of a step; 0: not counted
};

std::unique_ptr<Engine> EngineOfText(const std::string& text, Simd simd) {
  const SceneFile file = ParseScene(text, "benchmark", "");
  if (!file.ok()) {
    std::cerr << file.Format(file.problems);
    return nullptr;
  }
  const BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  if (!built.model) {
    std::cerr << file.Format(file.Located(built.problems));
    return nullptr;
  }
  auto engine = Engine::Create(built.model, {.threads = 1, .simd = simd});
  if (engine.ok()) return *std::move(engine);
  std::cerr << engine.status() << "\n";
  return nullptr;
}

// The bodies of a sample's scene with these effects, each a line of YAML.
std::string SceneWith(std::string_view on, const std::vector<std::string>& effects) {
  std::string scene = test::SceneOf({"", on, ""});
  scene.resize(scene.find("effects:"));
  if (on == "block") {
    scene =
        "bodies:\n  - name: block\n    block: {size_m: [0.5, 0.5, 0.5]}\n"
        "    tetrahedra: {cells: 5}\n    density_kg_m3: 10\n    velocity_m_s: [0.1, 0.2, 0.3]\n"
        "    angular_velocity_rad_s: [0.5, -1, 0.7]\n";
  }
  if (!effects.empty()) scene += "effects:\n";
  for (const std::string& effect : effects) absl::StrAppend(&scene, "  - ", effect, "\n");
  return scene;
}

std::vector<Case> Cases() {
  const std::string glue = "virtual_adhesive: {capture_distance_m: 0.1, normal_strength_pa: 20}";
  std::vector<Case> cases;
  for (const test::EffectSample& sample : test::EffectSamples()) {
    const std::string effect(sample.message), name(sample.name());
    const auto available = AvailableEffects();
    if (std::find(available.begin(), available.end(), name) == available.end()) continue;
    const std::vector<std::string> base =
        sample.on == "glued" ? std::vector{glue} : std::vector<std::string>();
    std::vector<std::string> more = base;
    more.push_back(effect);
    cases.push_back(
        {name, std::string(sample.on), SceneWith(sample.on, more), SceneWith(sample.on, base)});
  }
  cases.push_back({"virtual_adhesive", "two_balls", SceneWith("two_balls", {glue}),
                   SceneWith("two_balls", {})});
  // What is far apart and stays so costs next to nothing.
  std::string far[2] = {SceneWith("two_balls", {glue}), SceneWith("two_balls", {})};
  for (std::string& scene : far) {
    const std::string place = "[1.25, 0.04, 0.02]", velocity = "[-4, 0, 0]";
    scene.replace(scene.find(place), place.size(), "[100, 0, 0]");
    scene.replace(scene.find(velocity), velocity.size(), "[0, 0, 0]");
  }
  cases.push_back({"virtual_adhesive", "two_balls, 99 m apart", far[0], far[1]});
  return cases;
}

// Fills what both take of time and heap. False: one of them cannot be run.
bool Measure(const Case& of, const EffectCostOptions& options, Figures* with, Figures* without) {
  const std::string* texts[2] = {&of.without, &of.with};
  std::vector<double> us[2];
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    std::unique_ptr<Engine> engines[2];
    double sum[2] = {0, 0};
    for (int k = 0; k < 2; ++k) {
      engines[k] = EngineOfText(*texts[k], options.simd);
      if (!engines[k]) return false;
    }
    for (int step = 0; step < options.steps; step += kChunk) {
      for (int k = 0; k < 2; ++k) {
        const double before = ThreadCpuMs();
        for (int i = 0; i < std::min(kChunk, options.steps - step); ++i) engines[k]->Step({});
        sum[k] += 1e3 * (ThreadCpuMs() - before);
      }
    }
    for (int k = 0; k < 2; ++k) us[k].push_back(sum[k] / options.steps);
  }
  Figures* figures[2] = {without, with};
  for (int k = 0; k < 2; ++k) {
    figures[k]->us = Percentile(us[k], 0.5);
    const SceneFile file = ParseScene(*texts[k], "benchmark", "");
    const BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
    HeapMeter heap;
    const auto engine = Engine::Create(built.model, {.threads = 1, .simd = options.simd});
    figures[k]->bytes = heap.Take();
  }
  return true;
}

// Instructions of a step inside Pipeline::Step, by this program under valgrind with the plainest
// instruction set; nothing when that cannot be.
std::optional<double> CountInstructions(const std::string& text, int steps) {
  const std::string base =
      (std::filesystem::temp_directory_path() / absl::StrCat("adhesim_bench_", getpid())).string();
  const std::string scene = base + ".yaml", counts = base + ".callgrind";
  std::ofstream(scene) << text;
  std::error_code error;
  const std::string self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::string command = absl::StrCat(
      "valgrind --tool=callgrind --callgrind-out-file='", counts,
      "' --toggle-collect='adhesim::Pipeline::Step(std::span<adhesim::ToolInput const, "
      "18446744073709551615ul>)' '",
      self, "' --step-scene '", scene, "' --steps ", steps, " > /dev/null 2>&1");
  const int status = std::system(command.c_str());
  std::optional<double> instructions;
  std::ifstream file(counts);
  for (std::string word; status == 0 && file >> word;) {
    double total = 0;
    if (word == "totals:" && file >> total) instructions = total / steps;
  }
  std::remove(scene.c_str());
  std::remove(counts.c_str());
  return instructions;
}

Json ToJson(const Figures& figures) {
  Json json = {{"cpu_us_per_step", figures.us}, {"bytes", figures.bytes}};
  if (figures.instructions > 0) json["instructions_per_step"] = figures.instructions;
  return json;
}

void Print(const Case& of, const Figures& with, const Figures& without) {
  std::cout << absl::StrFormat(
      "%-22s %-22s %9.2f %9.2f %+9.2f %+10.1f", of.effect, of.to, without.us, with.us,
      with.us - without.us,
      (static_cast<double>(with.bytes) - static_cast<double>(without.bytes)) / 1024);
  if (with.instructions > 0) {
    std::cout << absl::StrFormat(" %12.0f %+12.0f", without.instructions,
                                 with.instructions - without.instructions);
  }
  std::cout << std::endl;
}

}  // namespace

int StepText(const std::string& file, int steps) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  const std::unique_ptr<Engine> engine = EngineOfText(text.str(), Simd::kBaseline);
  if (!engine) return 2;
  for (int step = 0; step < steps; ++step) engine->Step({});
  return 0;
}

int MeasureEffects(const EffectCostOptions& options) {
  const bool counts = options.count && std::system("valgrind --version > /dev/null 2>&1") == 0;
  if (options.count && !counts)
    std::cerr << "bench: without valgrind no instructions are counted\n";
  std::cout << absl::StrFormat("%-22s %-22s %9s %9s %9s %10s", "effect", "added to", "before us",
                               "with us", "adds us", "adds KiB");
  std::cout << (counts ? absl::StrFormat(" %12s %12s\n", "instructions", "adds") : "\n");
  std::map<std::string, double> counted;  // by scene: effects share what they are added to
  const auto count = [&](const std::string& text) {
    const auto [at, is_new] = counted.emplace(text, 0);
    if (is_new) at->second = CountInstructions(text, options.steps).value_or(0);
    return at->second;
  };
  Json report = {{"simd", SimdName(options.simd)}, {"steps", options.steps}};
  for (const Case& of : Cases()) {
    Figures with, without;
    if (!Measure(of, options, &with, &without)) return 1;
    if (counts) {
      with.instructions = count(of.with);
      without.instructions = count(of.without);
    }
    Print(of, with, without);
    report["effects"].push_back({{"effect", of.effect},
                                 {"added_to", of.to},
                                 {"without", ToJson(without)},
                                 {"with", ToJson(with)}});
  }
  if (options.json.empty()) return 0;
  std::ofstream file(options.json);
  file << report.dump(2) << "\n";
  file.close();
  if (file) return 0;
  std::cerr << "bench: cannot write " << options.json << "\n";
  return 1;
}

}  // namespace adhesim::bench
