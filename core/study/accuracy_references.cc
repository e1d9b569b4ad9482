#include "core/study/accuracy_references.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "core/engine/engine.h"
#include "core/study/timing.h"

namespace adhesim {
namespace {

constexpr double kHighestRateHz = 20000;  // scene.proto's
// Of the time that is left: for the first reference, the second, and the finer mesh. The rest is
// for the settings. A reference there must be.
constexpr double kFirstPart = 0.25, kSecondPart = 0.2, kMeshPart = 0.2, kMustPart = 0.6;
constexpr double kMeshWork = 8;  // twice as fine in three directions
constexpr int kEarlySteps = 8;   // of the scene's own, by which costs are foretold

double SecondsSince(std::chrono::steady_clock::time_point start) {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  return elapsed.count();
}

// One run that others may be judged by.
struct Candidate {
  AccuracyReference about;
  double ratio = 1;  // of its rate and the scene's
  AccuracyTrace trace;
  bool done() const { return !trace.left_out && trace.failed.empty() && !trace.time_s.empty(); }
};

class Maker {
 public:
  explicit Maker(const ReferenceRequest& request)
      : request_(request), implicit_(IsImplicit(request.model)) {}

  AccuracyReferences Make() {
    if (const std::string why = WhyNotRungeKutta(request_.model); why.empty()) {
      MakeFirst(RungeKutta());
      MakeSecond(Fine(Ratios(), kSecondPart));
      made_.share = "the effects' forces and the mesh; no stepping code";
    } else if (implicit_) {
      MakeFirst(Explicit());
      MakeSecond(Fine(Ratios(), kSecondPart));
      made_.share =
          "contact, zones, tools and the effects' forces; how velocities follow from forces is "
          "apart";
      if (!made_.second) MakeHalf("there was no time for the explicit path");
    } else {
      MakeFirst(Fine(Ratios(), kFirstPart));
      MakeHalf(absl::StrCat("no second integrator can step this scene (", why, ")"));
    }
    MakeFinerMesh();
    return std::move(made_);
  }

 private:
  // Multiples of the scene's rate, the finest first.
  std::vector<double> Ratios() const {
    std::vector<double> ratios;
    for (const double ratio :
         request_.quick ? std::vector<double>{8, 4} : std::vector<double>{16, 8, 4, 2}) {
      if (ratio <= kHighestRateHz * request_.model.dt_s) ratios.push_back(ratio);
    }
    if (ratios.empty()) ratios.push_back(1);
    return ratios;
  }

  // The second reference by the code of the first, at half its rate.
  void MakeHalf(const std::string& why) {
    if (first_ratio_ <= 1) return;
    MakeSecond(Fine({0.5 * first_ratio_}, kSecondPart));
    made_.share = absl::StrCat("all code: ", why,
                               ", so that their difference shows the step's error and chaos, not "
                               "a mistake of both");
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

  absl::StatusOr<std::unique_ptr<Engine>> EngineWith(const std::vector<SceneEdit>& edits) const {
    const auto model = EditedModel(request_.scene, request_.directory, edits);
    if (!model.ok()) return model.status();
    return Engine::Create(*model, {.threads = request_.threads});
  }

  // CPU time of the first steps of an engine, which RunTrace() makes anew: however busy the machine
  // is, and however short they are.
  double EarlyMs(Engine* engine) const {
    const double until_s = kEarlySteps * request_.model.dt_s;
    engine->Step({});  // what is made once
    const double start_ms = ThreadCpuMs();
    while (engine->state().time_s < until_s && !engine->frozen()) engine->Step({});
    return ThreadCpuMs() - start_ms;
  }

  // What a run takes, from what the scene's own took and how the first steps compare.
  double Foretold(Engine* engine) {
    if (own_early_ms_ == 0) {
      const auto own = EngineWith({});
      own_early_ms_ = own.ok() ? EarlyMs(own->get()) : 0;
    }
    return own_early_ms_ > 0 ? request_.run_s * EarlyMs(engine) / own_early_ms_ : request_.run_s;
  }

  // The engine with edits at the first of the rates that there is time for. One there must be of
  // the first reference, if it has no other: the last rate is run then whatever it takes.
  Candidate Run(const std::string& name, const std::vector<SceneEdit>& edits,
                const std::vector<double>& ratios, double part, bool must) {
    Say(absl::StrCat("reference: ", name));
    Candidate made;
    made.about.name = name;
    made.trace.left_out = true;
    for (const double ratio : ratios) {
      std::vector<SceneEdit> all = edits;
      all.push_back({"rate_hz", absl::StrFormat("%.10g", ratio / request_.model.dt_s)});
      const auto engine = EngineWith(all);
      if (!engine.ok()) {
        made.trace.left_out = false;
        made.trace.failed = std::string(engine.status().message());
        return made;
      }
      const bool last = must && ratio == ratios.back();
      if (!last && Foretold(engine->get()) > part * request_.left_s) continue;
      const auto start = std::chrono::steady_clock::now();
      made.ratio = ratio;
      made.trace =
          RunTrace(engine->get(), request_.probes, Within(must ? kMustPart : part), nullptr);
      Finish(name, start, &made);
      return made;
    }
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
  Candidate Fine(const std::vector<double>& ratios, double part) {
    std::vector<SceneEdit> edits;
    if (implicit_) {
      edits.push_back({"integration.integrator", "newton"});
      edits.push_back({"integration.tolerance", "1e-6"});
      edits.push_back({"integration.max_iterations", "2000"});
    } else {
      edits.push_back({"integration.stability_fraction", "0.25"});
      edits.push_back({"integration.max_substeps", "500"});
    }
    return Run(implicit_ ? "newton" : "explicit", edits, ratios, part, made_.trace.time_s.empty());
  }

  // Its sub-steps are as long as they may be, whatever the rate.
  Candidate Explicit() {
    return Run("explicit",
               {{"integration.integrator", "explicit"},
                {"integration.stability_fraction", "0.8"},
                {"integration.max_substeps", "500"}},
               Ratios(), kFirstPart, false);
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
    first_ratio_ = made.ratio;
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
    // Not even built where that alone is beyond it.
    if (request_.run_s * kMeshWork > kMeshPart * request_.left_s) {
      made_.left_out.push_back("reference on " + name + ": no time for it");
      return;
    }
    Candidate made = Run(name, edits, {1}, kMeshPart, false);
    if (!Accept(made)) return;
    made_.finer_mesh = made.about;
    made_.finer_trace = std::move(made.trace);
  }

  void Say(const std::string& text) const {
    if (request_.progress) request_.progress(text);
  }

  const ReferenceRequest& request_;
  bool implicit_;
  double own_early_ms_ = 0;  // of the scene as it is
  double first_ratio_ = 1;   // Candidate::ratio
  AccuracyReferences made_;
};

}  // namespace

AccuracyReferences MakeAccuracyReferences(const ReferenceRequest& request) {
  return Maker(request).Make();
}

}  // namespace adhesim
