#include "core/study/accuracy_settings.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/scene/build_model.h"
#include "core/scene/field_options.h"
#include "core/scene/scene_file.h"
#include "core/scene/scene_text.h"
#include "core/scene/validate.h"

namespace adhesim {
namespace {

constexpr double kHighestRateHz = 20000;  // scene.proto's
// Newton's method takes about so many times the work of one linear solve.
constexpr double kNewtonWork = 3;
// An explicit step of tissue takes a hundred sub-steps; one that the scene's limit lets through,
// less.
constexpr double kExplicitWork = 5;

std::string Number(double value) { return absl::StrFormat("%.10g", value); }

std::string RateName(double rate_hz) { return absl::StrCat(Number(rate_hz), " Hz"); }

std::string EffectPath(int effect, const std::string& field) {
  return absl::StrCat(IndexPath("effects", effect), ".", field);
}

// The field that sets how fine a body's mesh is, and the number of pieces along its length (of
// spheres: how often triangles are split).
struct MeshLevel {
  std::string path;
  int value = 0;
  bool splits = false;
};

std::optional<MeshLevel> LevelOf(const v1::Body& body, const std::string& path) {
  if (body.has_tetrahedra()) {
    return MeshLevel{path + ".tetrahedra.cells", static_cast<int>(body.tetrahedra().cells())};
  }
  if (body.has_block()) {
    return MeshLevel{path + ".block.cells", static_cast<int>(body.block().cells())};
  }
  if (body.has_icosphere()) {
    return MeshLevel{path + ".icosphere.subdivisions",
                     static_cast<int>(body.icosphere().subdivisions()), true};
  }
  // Pieces along the length: the root of the number of particles, which is set.
  if (body.has_organ()) {
    return MeshLevel{path + ".organ.particles", static_cast<int>(body.organ().particles())};
  }
  if (body.has_label_map()) {
    return MeshLevel{path + ".label_map.particles", static_cast<int>(body.label_map().particles())};
  }
  return std::nullopt;
}

bool CountsParticles(const MeshLevel& level) { return level.path.ends_with("particles"); }

// The level `factor` times as fine along a length; nothing where fields do not permit it.
std::optional<SceneEdit> Refined(const MeshLevel& level, double factor) {
  double value = level.value;
  if (level.splits) {
    value += std::log2(factor);
    if (value != std::round(value) || value < 0 || value > 6) return std::nullopt;
  } else if (CountsParticles(level)) {
    value = std::round(value * factor * factor);
    if (value < 50 || value > 200000) return std::nullopt;
  } else {
    value = std::round(value * factor);
    if (value < 1 || value > 200) return std::nullopt;
  }
  if (static_cast<int>(value) == level.value) return std::nullopt;
  return SceneEdit{level.path, absl::StrCat(static_cast<int>(value))};
}

// Every deformable body's level, `factor` times as fine; empty when one cannot be.
std::vector<SceneEdit> RefineAll(const v1::Scene& scene, double factor) {
  std::vector<SceneEdit> edits;
  for (int b = 0; b < scene.bodies_size(); ++b) {
    if (scene.bodies(b).kind() == v1::BODY_KIND_RIGID) continue;
    const std::optional<MeshLevel> level = LevelOf(scene.bodies(b), IndexPath("bodies", b));
    if (!level) continue;
    const std::optional<SceneEdit> edit = Refined(*level, factor);
    if (!edit) return {};
    edits.push_back(*edit);
  }
  return edits;
}

SceneEdit IntegratorEdit(Integrator integrator) {
  return {"integration.integrator", IntegratorName(integrator)};
}

// Of the scene's own rate, in the order of their interest. Powers of two, so that every run passes
// the same instants.
std::vector<double> RateRatios(bool quick) {
  if (quick) return {0.5, 0.25};
  return {0.5, 0.25, 2, 0.125, 4};
}

bool IsPermitted(double rate_hz) { return rate_hz >= 1 && rate_hz <= kHighestRateHz; }

// Deformable bodies, of which two may touch.
int DeformableBodies(const Model& model) {
  return static_cast<int>(
      std::count_if(model.bodies.begin(), model.bodies.end(),
                    [](const Body& body) { return !body.rigid && !body.all_fixed; }));
}

class Dials {
 public:
  Dials(const v1::Scene& scene, const Model& model, const DialOptions& options)
      : scene_(scene), model_(model), quick_(options.quick), implicit_(IsImplicit(model)) {
    own_.name = absl::StrCat("as it is: ", RateName(scene.rate_hz()));
    own_.integrator = implicit_ ? model.integrator : Integrator::kExplicit;
    own_.method = IntegratorName(own_.integrator);
    own_.rate_hz = scene.rate_hz();
  }

  std::vector<AccuracyDial> All() const {
    return {Rate(),      IntegratorDial(), Tolerance(), Iterations(),
            Stability(), Mesh(),           Law(),       Zones()};
  }

 private:
  AccuracySetting AtRate(double ratio) const {
    AccuracySetting setting = own_;
    setting.rate_hz = ratio * scene_.rate_hz();
    setting.name = RateName(setting.rate_hz);
    setting.work = ratio;
    if (ratio != 1) setting.edits.push_back({"rate_hz", Number(setting.rate_hz)});
    return setting;
  }

  AccuracyDial Rate() const {
    AccuracyDial dial{"rate", "", {own_}};
    for (const double ratio : RateRatios(quick_)) {
      if (IsPermitted(ratio * scene_.rate_hz())) dial.settings.push_back(AtRate(ratio));
    }
    return dial;
  }

  AccuracyDial IntegratorDial() const {
    AccuracyDial dial{"integrator", "", {}};
    if (!implicit_) {
      dial.not_offered = "no effect of this scene has a stiffness to step implicitly";
      return dial;
    }
    const auto add = [&](Integrator integrator, double ratio, double work) {
      if (integrator == own_.integrator || ratio * scene_.rate_hz() < 1) return;
      AccuracySetting setting = AtRate(ratio);
      setting.integrator = integrator;
      setting.method = IntegratorName(integrator);
      setting.name = absl::StrCat(IntegratorName(integrator), ", ", setting.name);
      setting.edits.push_back(IntegratorEdit(integrator));
      setting.work = ratio * work;
      dial.settings.push_back(setting);
    };
    const std::vector<double> ratios =
        quick_ ? std::vector<double>{1} : std::vector<double>{1, 0.5, 0.25};
    for (const Integrator integrator : {Integrator::kNewton, Integrator::kImplicit}) {
      for (const double ratio : ratios) add(integrator, ratio, kNewtonWork);
    }
    add(Integrator::kExplicit, 1, kExplicitWork);
    return dial;
  }

  // A setting of a field of `integration` at some rate.
  AccuracySetting With(double ratio, const std::string& field, const std::string& value,
                       const std::string& said) const {
    AccuracySetting setting = AtRate(ratio);
    setting.name = absl::StrCat(setting.name, ", ", said, " ", value);
    setting.method = absl::StrCat(setting.method, ", ", said, " ", value);
    setting.edits.push_back({"integration." + field, value});
    return setting;
  }

  AccuracyDial Tolerance() const {
    AccuracyDial dial{"tolerance", implicit_ ? "" : "explicit steps solve nothing", {}};
    if (!implicit_) return dial;
    const auto add = [&](double ratio, double tolerance) {
      if (tolerance == scene_.integration().tolerance() || ratio * scene_.rate_hz() < 1) return;
      dial.settings.push_back(With(ratio, "tolerance", Number(tolerance), "tolerance"));
    };
    add(1, 0.01);
    if (quick_) return dial;
    add(1, 0.1);
    // A long step is the poorer for what the solver leaves; a short one wants a better solver, or
    // nothing is gained.
    for (const double tolerance : {0.01, 1e-4, 0.1}) {
      for (const double ratio : {0.5, 0.25, 2.0}) add(ratio, tolerance);
    }
    add(1, 1e-4);
    return dial;
  }

  AccuracyDial Iterations() const {
    AccuracyDial dial{"iterations", implicit_ ? "" : "explicit steps solve nothing", {}};
    if (!implicit_ || quick_) return dial;
    for (const int most : {16, 4}) {
      dial.settings.push_back(With(1, "max_iterations", absl::StrCat(most), "iterations at most"));
    }
    return dial;
  }

  AccuracyDial Stability() const {
    AccuracyDial dial{"stability", implicit_ ? "implicit steps have no such bound" : "", {}};
    if (implicit_) return dial;
    const std::vector<double> fractions =
        quick_ ? std::vector<double>{0.25} : std::vector<double>{0.25, 0.9};
    for (const double fraction : fractions) {
      if (fraction == scene_.integration().stability_fraction()) continue;
      AccuracySetting setting =
          With(1, "stability_fraction", Number(fraction), "fraction of the stable sub-step");
      setting.work = scene_.integration().stability_fraction() / fraction;
      dial.settings.push_back(setting);
    }
    return dial;
  }

  AccuracyDial Mesh() const {
    AccuracyDial dial{"mesh", "", {}};
    for (const double factor : {0.5, 1.5}) {
      if (quick_ && factor > 1) continue;
      const std::vector<SceneEdit> edits = RefineAll(scene_, factor);
      if (edits.empty()) continue;
      AccuracySetting setting = own_;
      setting.kind = DialKind::kMesh;
      setting.edits = edits;
      setting.name = absl::StrCat("mesh with ", edits[0].path.substr(edits[0].path.rfind('.') + 1),
                                  " ", edits[0].value);
      setting.work = factor * factor * factor;
      dial.settings.push_back(setting);
    }
    if (dial.settings.empty()) dial.not_offered = "mesh level: not offered by this scene";
    return dial;
  }

  AccuracyDial Law() const {
    AccuracyDial dial{"law", "", {}};
    for (int e = 0; e < scene_.effects_size(); ++e) {
      if (!scene_.effects(e).has_elasticity()) continue;
      const bool neo = scene_.effects(e).elasticity().model() == v1::ELASTIC_MODEL_NEO_HOOKEAN;
      AccuracySetting setting = own_;
      setting.kind = DialKind::kModel;
      setting.name = neo ? "corotational" : "neo_hookean";
      setting.edits = {{EffectPath(e, "elasticity.model"), setting.name}};
      setting.work = 1.5;
      dial.settings.push_back(setting);
      break;
    }
    if (dial.settings.empty()) dial.not_offered = "no effect of this scene has laws to choose from";
    return dial;
  }

  AccuracyDial Zones() const {
    AccuracyDial dial{"zones", "", {}};
    for (int e = 0; e < scene_.effects_size(); ++e) {
      if (!scene_.effects(e).has_virtual_adhesive()) continue;
      const v1::VirtualAdhesive& adhesive = scene_.effects(e).virtual_adhesive();
      const auto add = [&](const std::string& name, const char* field, const std::string& value) {
        AccuracySetting setting = own_;
        setting.kind = DialKind::kModel;
        setting.name = name;
        setting.edits = {{EffectPath(e, absl::StrCat("virtual_adhesive.", field)), value}};
        dial.settings.push_back(setting);
      };
      if (adhesive.ties()) {
        add("zones, no ties", "ties", "false");
        continue;  // which patches exclude
      }
      double size_m = 0.5 * adhesive.patch_size_m();
      if (!adhesive.has_patch_size_m()) {
        size_m = model_.bodies[0].size_m;
        for (const Body& body : model_.bodies) size_m = std::min(size_m, body.size_m);
        size_m /= 8;
      }
      add(absl::StrFormat("zones in patches of %.3g mm", 1e3 * size_m), "patch_size_m",
          absl::StrFormat("%.3g", size_m));
      if (adhesive.has_patch_size_m()) {
        add("zones that are not cut", "patch_size_m", "");
      } else if (!implicit_ && !adhesive.has_friction_coefficient() &&
                 DeformableBodies(model_) > 1) {
        add("ties, no zones", "ties", "true");
      }
    }
    if (dial.settings.empty()) dial.not_offered = "this scene has no virtual adhesive";
    return dial;
  }

  const v1::Scene& scene_;
  const Model& model_;
  bool quick_, implicit_;
  AccuracySetting own_;  // the scene as it is
};

// Takes out the field at a path like "effects[0].drag.rate_per_s"; nothing where there is none.
void TakeOut(const std::string& path, google::protobuf::Message* message) {
  const std::vector<std::string> names = absl::StrSplit(path, '.');
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::vector<std::string> parts = absl::StrSplit(names[i], absl::ByAnyChar("[]"));
    const google::protobuf::Reflection& reflection = *message->GetReflection();
    const auto* field = message->GetDescriptor()->FindFieldByName(parts[0]);
    if (field == nullptr) return;
    if (i + 1 == names.size()) return reflection.ClearField(message, field);
    if (field->cpp_type() != field->CPPTYPE_MESSAGE) return;
    int index = 0;
    if (!field->is_repeated()) {
      message = reflection.MutableMessage(message, field);
    } else if (parts.size() > 1 && absl::SimpleAtoi(parts[1], &index) && index >= 0 &&
               index < reflection.FieldSize(*message, field)) {
      message = reflection.MutableRepeatedMessage(message, field, index);
    } else {
      return;
    }
  }
}

}  // namespace

const char* IntegratorName(Integrator integrator) {
  switch (integrator) {
    case Integrator::kExplicit:
      return "explicit";
    case Integrator::kImplicit:
      return "implicit";
    case Integrator::kNewton:
      return "newton";
  }
  return "";
}

bool IsImplicit(const Model& model) {
  const auto elastic = [](const v1::Effect& effect) { return effect.has_elasticity(); };
  return model.integrator != Integrator::kExplicit &&
         std::any_of(model.scene.effects().begin(), model.scene.effects().end(), elastic);
}

std::vector<AccuracyDial> DialsOf(const v1::Scene& scene, const Model& model,
                                  const DialOptions& options) {
  return Dials(scene, model, options).All();
}

std::vector<double> TriedRatesHz(const Model& model, const DialOptions& options) {
  std::vector<double> rates_hz = {1 / model.dt_s};
  for (const double ratio : RateRatios(options.quick)) {
    if (IsPermitted(ratio / model.dt_s)) rates_hz.push_back(ratio / model.dt_s);
  }
  return rates_hz;
}

double CoarsestRateHz(const Model& model, const DialOptions& options) {
  const std::vector<double> rates_hz = TriedRatesHz(model, options);
  return *std::min_element(rates_hz.begin(), rates_hz.end());
}

std::vector<SceneEdit> FinerMesh(const v1::Scene& scene) { return RefineAll(scene, 2); }

absl::StatusOr<v1::Scene> Edited(const v1::Scene& scene, const std::vector<SceneEdit>& edits) {
  v1::Scene edited = scene;
  // They were measured at the scene's own setting.
  if (!edits.empty()) edited.clear_rungs();
  for (const SceneEdit& edit : edits) {
    if (edit.value.empty()) {
      TakeOut(edit.path, &edited);
      continue;
    }
    if (const absl::Status set = SetField(&edited, edit.path, edit.value); !set.ok()) return set;
  }
  for (const Problem& problem : ValidateScene(edited)) {
    if (problem.warning) continue;
    return absl::InvalidArgumentError(absl::StrCat(problem.path, ": ", problem.message));
  }
  return edited;
}

absl::StatusOr<std::shared_ptr<const Model>> EditedModel(const v1::Scene& scene,
                                                         const std::string& directory,
                                                         const std::vector<SceneEdit>& edits) {
  const absl::StatusOr<v1::Scene> edited = Edited(scene, edits);
  if (!edited.ok()) return edited.status();
  BuiltModel built = BuildModel(WithDefaults(*edited), directory);
  if (built.model != nullptr && AllWarnings(built.problems)) return std::move(built.model);
  for (const Problem& problem : built.problems) {
    if (problem.warning) continue;
    return absl::InvalidArgumentError(absl::StrCat(problem.path, ": ", problem.message));
  }
  return absl::InvalidArgumentError("the scene cannot be built");
}

}  // namespace adhesim
