#include "clients/cli/explain.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <set>

#include "clients/cli/run_report.h"
#include "core/effects/registry.h"
#include "core/engine/engine.h"
#include "core/engine/heap_meter.h"
#include "core/scene/field_options.h"
#include "core/scene/scene_comments.h"

namespace adhesim {
namespace {

constexpr int kSteps = 200;

const google::protobuf::OneofDescriptor* EffectKinds() {
  return v1::Effect::descriptor()->FindOneofByName("kind");
}

// Adds the effects of the scene with their lines, and those that it could name but does not.
void AddEffects(const SceneFile& file, Json* explanation) {
  const SceneComments comments;
  const std::vector<std::string_view> available = AvailableEffects();
  std::set<std::string> used;
  Json effects = Json::array(), left_out = Json::array();
  for (int i = 0; i < file.scene.effects_size(); ++i) {
    const v1::Effect& effect = file.scene.effects(i);
    const auto* kind = effect.GetReflection()->GetOneofFieldDescriptor(effect, EffectKinds());
    used.insert(kind->name());
    const std::string path = JoinPath(IndexPath("effects", i), kind->name());
    effects.push_back({{"name", kind->name()},
                       {"path", path},
                       {"line", file.LineOf(path)},
                       {"does", comments.Of(kind)}});
  }
  for (int i = 0; i < EffectKinds()->field_count(); ++i) {
    const auto* kind = EffectKinds()->field(i);
    if (used.contains(kind->name())) continue;
    left_out.push_back({{"name", kind->name()}, {"does", comments.Of(kind)}});
    // Contact by virtual adhesives is part of every build.
    if (kind->name() != "virtual_adhesive" &&
        std::find(available.begin(), available.end(), kind->name()) == available.end()) {
      left_out.back()["in_build"] = false;
    }
  }
  (*explanation)["effects"] = effects;
  (*explanation)["left_out"] = left_out;
}

// The stages with their costs, their memory and the lines that asked for them; and those that
// scenes can have and this one does not.
void AddStages(const SceneFile& file, const Engine& engine, Json* explanation) {
  Json stages = StagesJson(engine), absent = Json::array();
  std::set<std::string> present;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const Engine::Stage& stage = engine.stages()[i];
    present.insert(stage.name);
    stages[i]["bytes"] = stage.bytes;
    Json& asked_by = stages[i]["asked_by"] = Json::array();
    for (const std::string& path : stage.paths) {
      asked_by.push_back({{"path", path}, {"line", file.LineOf(path)}});
    }
  }
  static constexpr std::pair<const char*, const char*> kOptional[] = {
      {"detect", "Looks for what is near: no effect of the scene is one of contact."},
      {"zones", "Takes hold and lets go: the scene has no virtual_adhesive."},
      {"sleep", "Leaves out what rests: the scene has no sleep, or it is switched off."},
      {"tools", "Moves tools: the scene has none."},
      {"error", "Bounds tools' forces: no tool meets implicit forces."}};
  for (const auto& [name, why] : kOptional) {
    if (!present.contains(name)) absent.push_back({{"name", name}, {"why", why}});
  }
  (*explanation)["stages"] = stages;
  (*explanation)["absent_stages"] = absent;
}

std::string Memory(const Json& bytes) {
  return absl::StrFormat("%.1f KiB", bytes.get<double>() / 1024);
}

std::string StageText(const Json& stage, const std::string& file) {
  std::string text =
      absl::StrFormat("  %-20s %9.1f us %5.1f %% %12s  %s\n", stage["name"].get<std::string>(),
                      stage["median_us"].get<double>(), 100 * stage["share"].get<double>(),
                      Memory(stage["bytes"]), stage["reason"].get<std::string>());
  for (const Json& asked : stage["asked_by"]) {
    absl::StrAppend(&text, absl::StrFormat("  %54s%s:%d %s\n", "", file, asked["line"].get<int>(),
                                           asked["path"].get<std::string>()));
  }
  return text;
}

}  // namespace

absl::StatusOr<Json> ExplainScene(const LoadedScene& loaded) {
  HeapMeter heap;
  absl::StatusOr<std::unique_ptr<Engine>> engine = Engine::Create(loaded.model, {});
  if (!engine.ok()) return engine.status();
  const std::size_t engine_bytes = heap.Take();
  (*engine)->TimeStages(kSteps);
  for (int i = 0; i < kSteps; ++i) (*engine)->Step({});

  const Model& model = *loaded.model;
  Json explanation = {{"scene", model.name},
                      {"file", loaded.file.file},
                      {"bodies", model.bodies.size()},
                      {"particles", model.particle_count()},
                      {"triangles", model.triangles.size()},
                      {"tools", model.tools.size()},
                      {"dt_s", model.dt_s},
                      {"substeps", (*engine)->substeps()},
                      {"measured_steps", kSteps},
                      {"engine_bytes", engine_bytes}};
  AddEffects(loaded.file, &explanation);
  AddStages(loaded.file, **engine, &explanation);
  return explanation;
}

std::string ExplanationText(const Json& explanation) {
  std::string text = absl::StrFormat(
      "%s: %d bodies, %d particles, %d triangles, %d tools; steps of %g s in %d sub-steps\n\n",
      explanation["scene"].get<std::string>(), explanation["bodies"].get<int>(),
      explanation["particles"].get<int>(), explanation["triangles"].get<int>(),
      explanation["tools"].get<int>(), explanation["dt_s"].get<double>(),
      explanation["substeps"].get<int>());
  absl::StrAppend(&text, "Switched on\n");
  for (const Json& effect : explanation["effects"]) {
    absl::StrAppend(
        &text, absl::StrFormat("  %-24s %s:%d\n", effect["name"].get<std::string>(),
                               explanation["file"].get<std::string>(), effect["line"].get<int>()));
  }
  absl::StrAppend(&text, "\nStages of a step (median of ", explanation["measured_steps"].get<int>(),
                  " steps from the start)\n");
  for (const Json& stage : explanation["stages"]) {
    absl::StrAppend(&text, StageText(stage, explanation["file"].get<std::string>()));
  }
  absl::StrAppend(&text, "  all of it with the state: ", Memory(explanation["engine_bytes"]), "\n");
  absl::StrAppend(&text, "\nLeft out\n");
  for (const Json& stage : explanation["absent_stages"]) {
    absl::StrAppend(&text,
                    absl::StrFormat("  %-24s %s\n", stage["name"].get<std::string>() + " (stage)",
                                    stage["why"].get<std::string>()));
  }
  for (const Json& effect : explanation["left_out"]) {
    absl::StrAppend(&text,
                    absl::StrFormat("  %-24s %s%s\n", effect["name"].get<std::string>(),
                                    effect["does"].get<std::string>(),
                                    effect.contains("in_build") ? " Not in this build." : ""));
  }
  return text;
}

}  // namespace adhesim
