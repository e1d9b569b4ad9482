#include "clients/cli/explain.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <set>

#include "clients/cli/run_report.h"
#include "core/engine/engine.h"
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
    if (!used.contains(kind->name()))
      left_out.push_back({{"name", kind->name()}, {"does", comments.Of(kind)}});
  }
  (*explanation)["effects"] = effects;
  (*explanation)["left_out"] = left_out;
}

}  // namespace

absl::StatusOr<Json> ExplainScene(const LoadedScene& loaded) {
  absl::StatusOr<std::unique_ptr<Engine>> engine = Engine::Create(loaded.model, {});
  if (!engine.ok()) return engine.status();
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
                      {"measured_steps", kSteps}};
  AddEffects(loaded.file, &explanation);
  explanation["stages"] = StagesJson(**engine);
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
    absl::StrAppend(
        &text, absl::StrFormat("  %-24s %9.1f us %5.1f %%  %s\n", stage["name"].get<std::string>(),
                               stage["median_us"].get<double>(), 100 * stage["share"].get<double>(),
                               stage["reason"].get<std::string>()));
  }
  absl::StrAppend(&text, "\nLeft out\n");
  for (const Json& effect : explanation["left_out"]) {
    absl::StrAppend(&text, absl::StrFormat("  %-24s %s\n", effect["name"].get<std::string>(),
                                           effect["does"].get<std::string>()));
  }
  return text;
}

}  // namespace adhesim
