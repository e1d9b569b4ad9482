#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>
#include <vector>

#include "adhesim/v1/scene.pb.h"
#include "core/model/model.h"

namespace adhesim {

// What turning a dial changes: how well the scene's equations are solved, the mesh that they are
// solved on, the equations themselves, or the engine. Only the first is error in time; the second
// is measured against a finer mesh; the third is no error at all, but a difference; the fourth
// solves the scene's equations on its mesh too, by other code, and is measured like the first.
enum class DialKind { kNumerical, kMesh, kModel, kRival };

// A field of the scene and its new value, as `--set` takes them.
struct SceneEdit {
  std::string path, value;
};

// One way to run a scene.
struct AccuracySetting {
  std::string name;  // "100 Hz, tolerance 0.01"
  DialKind kind = DialKind::kNumerical;
  Integrator integrator = Integrator::kImplicit;
  std::string method;  // what it has beside its rate: "implicit, tolerance 0.01"
  double rate_hz = 0;
  double work = 1;               // a guess of its cost over that of the scene as it is
  std::vector<SceneEdit> edits;  // of the scene as it is; none: that
  int substeps = 1;              // that a rival makes of a step
};

// Whether its error is one in time, and falls with the step.
inline bool IsJudgedByReference(const AccuracySetting& setting) {
  return setting.kind == DialKind::kNumerical || setting.kind == DialKind::kRival;
}

// What a scene lets choose, and the choices that are tried.
struct AccuracyDial {
  std::string name;
  std::string not_offered;  // why the scene has no such choice; empty: it has
  std::vector<AccuracySetting> settings;
};

struct DialOptions {
  bool quick = false;  // fewer choices, none of them expensive
};

// The dials of a scene whose defaults are filled in and whose model is at hand. The first setting
// of the first dial is the scene as it is.
std::vector<AccuracyDial> DialsOf(const v1::Scene& scene, const Model& model,
                                  const DialOptions& options);

// The rates that are tried, multiples of the scene's own [Hz], in the order of their interest; the
// own one first.
std::vector<double> TriedRatesHz(const Model& model, const DialOptions& options);

// Rates are multiples of this, so that every run passes the same instants.
double CoarsestRateHz(const Model& model, const DialOptions& options);

// Whether steps are implicit somewhere in the scene.
bool IsImplicit(const Model& model);

// The mesh on which levels of the mesh are judged: twice as fine as the scene's; empty when no body
// has a level.
std::vector<SceneEdit> FinerMesh(const v1::Scene& scene);

// The scene with the edits. Errors (InvalidArgument): the first that is refused, or what they
// contradict.
absl::StatusOr<v1::Scene> Edited(const v1::Scene& scene, const std::vector<SceneEdit>& edits);

// The same, as a model. `directory` is that of the scene's files.
absl::StatusOr<std::shared_ptr<const Model>> EditedModel(const v1::Scene& scene,
                                                         const std::string& directory,
                                                         const std::vector<SceneEdit>& edits);

// "explicit", "implicit" or "newton", as scenes write it.
const char* IntegratorName(Integrator integrator);

}  // namespace adhesim
