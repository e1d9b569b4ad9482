#include "core/study/accuracy_references.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <utility>

#include "core/engine/engine.h"

namespace adhesim {
namespace {

constexpr double kHighestRateHz = 20000;  // scene.proto's
// Of the time that is left: for the first reference, the second, and the finer mesh.
constexpr double kFirstPart = 0.35, kSecondPart = 0.3, kMeshPart = 0.3;
constexpr double kNewtonWork = 2;  // of short steps, over a linear one
constexpr double kMeshWork = 8;    // twice as fine in three directions

double SecondsSince(std::chrono::steady_clock::time_point start) {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  return elapsed.count();
}

// One run that others may be judged by.
struct Candidate {
  AccuracyReference about;
  AccuracyTrace trace;
  bool done() const { return !trace.left_out && trace.failed.empty() && !trace.time_s.empty(); }
};

class Maker {
 public:
  explicit Maker(const ReferenceRequest& request)
      : request_(request), implicit_(IsImplicit(request.model)) {}

  AccuracyReferences Make() {
    if (WhyNotRungeKutta(request_.model).empty()) {
      MakeFirst(RungeKutta());
      MakeSecond(Fine(Ratio(kSecondPart, implicit_ ? kNewtonWork : 1), kSecondPart));
      made_.share = "the effects' forces and the mesh; no stepping code";
    } else if (implicit_) {
      const double ratio = Ratio(kSecondPart, kNewtonWork);
      MakeFirst(Explicit(ratio));
      MakeSecond(Fine(ratio, kSecondPart));
      made_.share =
          "contact, zones, tools and the effects' forces; how velocities follow from forces is "
          "apart";
    } else {
      const double ratio = Ratio(kFirstPart, 1);
      MakeFirst(Fine(ratio, kFirstPart));
      if (ratio > 1) MakeSecond(Fine(0.5 * ratio, kSecondPart));
      made_.share = absl::StrCat(
          "all code: no second integrator can step this scene (", WhyNotRungeKutta(request_.model),
          "), so that their difference shows the step's error and chaos, not a mistake of both");
    }
    MakeFinerMesh();
    return std::move(made_);
  }

 private:
  // The largest multiple of the scene's rate that is permitted and that there is time for.
  double Ratio(double part, double work) const {
    const double rate_hz = 1 / request_.model.dt_s;
    for (const double ratio :
         request_.quick ? std::vector<double>{8, 4} : std::vector<double>{16, 8, 4}) {
      if (ratio * rate_hz > kHighestRateHz) continue;
      if (request_.run_s * ratio * work <= part * request_.left_s) return ratio;
    }
    for (const double ratio : {4.0, 2.0}) {
      if (ratio * rate_hz <= kHighestRateHz) return ratio;
    }
    return 1;
  }

  TraceOptions Within(double part) const {
    TraceOptions options = request_.trace;
    const auto start = std::chrono::steady_clock::now();
    options.out_of_time = [this, start, limit_s = part * request_.left_s] {
      return (request_.stop && request_.stop()) || SecondsSince(start) > limit_s;
    };
    return options;
  }

  Candidate RungeKutta() const {
    Say("reference: Runge and Kutta's method");
    const auto start = std::chrono::steady_clock::now();
    Candidate made;
    made.trace = RunRungeKutta(request_.model, request_.probes, Within(kFirstPart));
    Finish("Runge and Kutta's method of order 4", start, &made);
    return made;
  }

  // The engine with edits.
  Candidate Run(const std::string& name, const std::vector<SceneEdit>& edits, double part) const {
    Say(absl::StrCat("reference: ", name));
    Candidate made;
    const auto model = EditedModel(request_.scene, request_.directory, edits);
    if (!model.ok()) {
      made.trace.failed = std::string(model.status().message());
      made.about.name = name;
      return made;
    }
    const auto engine = Engine::Create(*model, {.threads = request_.threads});
    if (!engine.ok()) {
      made.trace.failed = std::string(engine.status().message());
      made.about.name = name;
      return made;
    }
    const auto start = std::chrono::steady_clock::now();
    made.trace = RunTrace(engine->get(), request_.probes, Within(part), nullptr);
    Finish(name, start, &made);
    return made;
  }

  void Finish(const std::string& name, std::chrono::steady_clock::time_point start,
              Candidate* made) const {
    made->about = {name, made->trace.rate_hz, made->trace.substeps,
                   SecondsSince(start) / request_.trace.instants_s.back()};
    made->about.name = absl::StrFormat("%s, %.6g Hz", name, made->trace.rate_hz);
    if (made->trace.substeps > 1) {
      absl::StrAppend(&made->about.name, " of ", made->trace.substeps, " sub-steps");
    }
  }

  // The scene's own kind of step, much finer; implicit ones by Newton's method, solved to the end.
  Candidate Fine(double ratio, double part) const {
    std::vector<SceneEdit> edits = {RateEdit(ratio)};
    if (implicit_) {
      edits.push_back({"integration.integrator", "newton"});
      edits.push_back({"integration.tolerance", "1e-6"});
      edits.push_back({"integration.max_iterations", "2000"});
    } else {
      edits.push_back({"integration.stability_fraction", "0.25"});
      edits.push_back({"integration.max_substeps", "500"});
    }
    return Run(implicit_ ? "newton" : "explicit", edits, part);
  }

  Candidate Explicit(double ratio) const {
    return Run("explicit",
               {RateEdit(ratio),
                {"integration.integrator", "explicit"},
                {"integration.stability_fraction", "0.8"},
                {"integration.max_substeps", "500"}},
               kFirstPart);
  }

  SceneEdit RateEdit(double ratio) const {
    return {"rate_hz", absl::StrFormat("%.10g", ratio / request_.model.dt_s)};
  }

  // A candidate that came to no end is named, and the other one takes its place.
  bool Accept(const Candidate& made) {
    if (made.done()) return true;
    made_.left_out.push_back(absl::StrCat(
        "reference ", made.about.name, ": ",
        made.trace.failed.empty() ? std::string("no time for it") : made.trace.failed));
    return false;
  }
  void MakeFirst(Candidate made) {
    if (!Accept(made)) return;
    made_.reference = made.about;
    made_.trace = std::move(made.trace);
  }
  void MakeSecond(Candidate made) {
    if (!Accept(made)) return;
    if (made_.trace.time_s.empty()) return MakeFirst(std::move(made));
    made_.second = made.about;
    made_.second_trace = std::move(made.trace);
  }

  void MakeFinerMesh() {
    const std::vector<SceneEdit> edits = FinerMesh(request_.model.scene);
    if (edits.empty() || made_.trace.time_s.empty() || request_.quick) return;
    const std::string name = "a mesh twice as fine";
    if (request_.run_s * kMeshWork > kMeshPart * request_.left_s) {
      made_.left_out.push_back("reference on " + name + ": no time for it");
      return;
    }
    Candidate made = Run(name, edits, kMeshPart);
    if (!Accept(made)) return;
    made_.finer_mesh = made.about;
    made_.finer_trace = std::move(made.trace);
  }

  void Say(const std::string& text) const {
    if (request_.progress) request_.progress(text);
  }

  const ReferenceRequest& request_;
  bool implicit_;
  AccuracyReferences made_;
};

}  // namespace

AccuracyReferences MakeAccuracyReferences(const ReferenceRequest& request) {
  return Maker(request).Make();
}

}  // namespace adhesim
