#include "core/study/accuracy_study.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "core/engine/engine.h"
#include "core/scene/validate.h"
#include "core/study/accuracy_references.h"
#include "core/study/accuracy_trace.h"
#include "core/study/timing.h"

namespace adhesim {
namespace {

constexpr double kDefaultSeconds = 4;
constexpr int kInstants = 100;
// Tolerances, unless others are asked for.
constexpr double kPartOfMotion = 0.01, kPartOfPeak = 0.02, kShareOfObservables = 0.05;

double ScriptedUntil(const v1::Scene& scene) {
  double end_s = 0;
  for (const v1::Tool& tool : scene.tools()) {
    for (const v1::Waypoint& waypoint : tool.trajectory()) end_s = std::max(end_s, waypoint.t_s());
  }
  for (const v1::Effect& effect : scene.effects()) {
    for (const v1::Activation& point : effect.muscle().schedule()) {
      end_s = std::max(end_s, point.t_s());
    }
  }
  return end_s;
}

CostFigures FiguresOf(const AccuracyCost& cost, double duration_s) {
  CostFigures figures;
  figures.repeats = static_cast<int>(cost.run_wall_s.size());
  if (figures.repeats == 0) return figures;
  figures.wall_min = *std::min_element(cost.run_wall_s.begin(), cost.run_wall_s.end()) / duration_s;
  figures.wall_p50 = Percentile(cost.run_wall_s, 0.5) / duration_s;
  figures.wall_p99 = Percentile(cost.run_wall_s, 0.99) / duration_s;
  figures.cpu_min = *std::min_element(cost.run_cpu_s.begin(), cost.run_cpu_s.end()) / duration_s;
  figures.step_p50_ms = Percentile(cost.step_wall_ms, 0.5);
  figures.step_p99_ms = Percentile(cost.step_wall_ms, 0.99);
  figures.step_max_ms = Percentile(cost.step_wall_ms, 1);
  return figures;
}

// A point's engine and what its runs left.
struct Subject {
  bool tried = false;
  std::unique_ptr<Engine> engine;  // of ours
  AccuracyTrace trace;
  AccuracyCost cost;
};

class Study {
 public:
  Study(const v1::Scene& scene, const std::string& directory, const AccuracyOptions& options)
      : scene_(scene), directory_(directory), options_(options) {}

  absl::StatusOr<AccuracyStudy> Run() {
    if (const absl::Status s = Load(); !s.ok()) return s;
    ChooseInstants();
    ListPoints();
    Measure(0);
    if (!study_.points[0].failed.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("as it is, the scene does not run: ", study_.points[0].failed));
    }
    if (study_.points[0].not_run) return NoTime();
    if (options_.only_rungs) {
      study_.rungs = RungsOfPoint(0);
      return Finished();
    }
    if (const absl::Status s = MakeReferences(); !s.ok()) return s;
    for (int round = 0; round < options_.repeats; ++round) {
      for (const std::size_t i : Order()) {
        if (round > 0 || i > 0) Measure(i);
      }
    }
    if (Stopped()) return Finished();
    Judge();
    MeasureAdvisedRungs();
    return Finished();
  }

 private:
  absl::StatusOr<AccuracyStudy> Finished() {
    if (Stopped()) return absl::CancelledError("interrupted");
    return std::move(study_);
  }

  absl::Status Load() {
    const auto model = EditedModel(scene_, directory_, {});
    if (!model.ok()) return model.status();
    model_ = *model;
    study_.scene = model_->name;
    study_.bodies = static_cast<int>(model_->bodies.size());
    study_.particles = model_->particle_count();
    study_.tetrahedra = static_cast<int>(model_->tetrahedra.size());
    study_.rate_hz = 1 / model_->dt_s;
    study_.formula = BeamOf(*model_);
    probes_.emplace(*model_);
    study_.probes = probes_->count();
    if (study_.probes == 0) {
      return absl::InvalidArgumentError("no surface of the scene can move: nothing to measure");
    }
    return absl::OkStatus();
  }

  // Multiples of the coarsest step, so that every run is there at each of them.
  void ChooseInstants() {
    double seconds = options_.seconds;
    if (seconds <= 0) seconds = ScriptedUntil(scene_);
    if (seconds <= 0) seconds = kDefaultSeconds;
    const double coarsest_hz = CoarsestRateHz(*model_, {options_.quick});
    trace_.common_step_s = 1 / coarsest_hz;
    const auto steps = std::max<std::int64_t>(1, std::llround(seconds * coarsest_hz));
    const std::int64_t instants = std::min<std::int64_t>(steps, kInstants);
    for (std::int64_t i = 1; i <= instants; ++i) {
      const std::int64_t step = i * steps / instants;
      trace_.instants_s.push_back(static_cast<double>(step) / coarsest_hz);
    }
    trace_.out_of_time = [this] { return Stopped() || ElapsedS() > options_.budget_s; };
    if (study_.formula) trace_.deflection = BeamEndDeflection;
    study_.duration_s = trace_.instants_s.back();
    study_.instants = trace_.instants_s.size();
  }

  void ListPoints() {
    study_.dials = DialsOf(model_->scene, *model_, {options_.quick});
    study_.dials.push_back(Governor());
    if (options_.rival) {
      rival_ = options_.rival(model_, {options_.quick});
      study_.dials.push_back(rival_.dial);
      study_.rival_about = rival_.about;
    }
    for (const AccuracyDial& dial : study_.dials) {
      for (const AccuracySetting& setting : dial.settings) {
        AccuracyPoint& point = study_.points.emplace_back();
        point.dial = dial.name;
        point.setting = setting;
        if (setting.rungs > 0) {
          study_.rungs[setting.rungs - 1].point = static_cast<int>(study_.points.size()) - 1;
        }
      }
    }
    subjects_.resize(study_.points.size());
  }

  // The first setting of each dial, then the second: a budget that ends early leaves none without.
  std::vector<std::size_t> Order() const {
    std::vector<std::size_t> order;
    std::size_t most = 0;
    for (const AccuracyDial& dial : study_.dials) most = std::max(most, dial.settings.size());
    for (std::size_t k = 0; k < most; ++k) {
      std::size_t first = 0;
      for (const AccuracyDial& dial : study_.dials) {
        if (k < dial.settings.size()) order.push_back(first + k);
        first += dial.settings.size();
      }
    }
    return order;
  }

  // What a session gives up under load, all along.
  AccuracyDial Governor() {
    AccuracyDial dial{"governor", "", {}};
    const auto engine = Engine::Create(model_, {});
    if (engine.ok()) {
      AccuracySetting setting = study_.dials[0].settings[0];
      setting.kind = DialKind::kModel;
      setting.name = "without";
      study_.rungs = RungsOf(**engine);
      for (const AccuracyRung& rung : study_.rungs) {
        absl::StrAppend(&setting.name, setting.rungs == 0 ? " " : " and ", rung.name);
        ++setting.rungs;
        dial.settings.push_back(setting);
      }
    }
    if (dial.settings.empty()) dial.not_offered = "nothing of this scene can be given up";
    return dial;
  }

  bool Stopped() const { return options_.stop && options_.stop(); }
  double ElapsedS() const {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    return elapsed.count();
  }
  absl::Status NoTime() const {
    if (Stopped()) return absl::CancelledError("interrupted");
    return absl::DeadlineExceededError(
        absl::StrFormat("the budget of %.4g s ended before there was a reference; shorten the run "
                        "(--seconds) or raise --budget-s",
                        options_.budget_s));
  }

  // Runs a point once more; the first time its trace is kept.
  void Measure(std::size_t i) {
    AccuracyPoint& point = study_.points[i];
    Subject& subject = subjects_[i];
    const bool first = !subject.tried;
    if (Stopped() || !point.failed.empty() || point.not_run) return;
    double guess_s = i == 0 ? 0 : run_s_ * point.setting.work;
    // Time for the rungs of the cheapest, most of which are no slower than the scene as it is.
    if (options_.advised_rungs) guess_s += run_s_ * static_cast<double>(study_.rungs.size());
    if (ElapsedS() + guess_s > options_.budget_s) {
      if (first) point.not_run = true;
      return;
    }
    if (options_.progress) options_.progress(point.setting.name);
    subject.tried = true;
    const bool ours = point.setting.kind != DialKind::kRival;
    if (ours && first && !Create(&point, &subject)) return;
    const double before_s = ElapsedS();
    AccuracyTrace trace = ours ? RunTrace(subject.engine.get(), *probes_, trace_, &subject.cost)
                               : rival_.run(point.setting, *probes_, trace_, &subject.cost);
    if (i == 0 && first) run_s_ = ElapsedS() - before_s;
    if (!first) return;
    point.failed = trace.failed;
    point.not_run = trace.left_out;
    point.bits = trace.bits;
    point.substeps = trace.substeps;
    if (!trace.deflection_m.empty()) point.deflection_m = trace.deflection_m.back();
    subject.trace = std::move(trace);
  }

  bool Create(AccuracyPoint* point, Subject* subject) const {
    const auto model = EditedModel(scene_, directory_, point->setting.edits);
    if (model.ok()) {
      auto engine = Engine::Create(*model, {.threads = options_.threads});
      if (engine.ok()) {
        subject->engine = *std::move(engine);
        subject->engine->SetFidelity(point->setting.rungs);
        return true;
      }
      point->failed = absl::StrCat("refused: ", engine.status().message());
      return false;
    }
    point->failed = absl::StrCat("refused: ", model.status().message());
    return false;
  }

  absl::Status MakeReferences() {
    ReferenceRequest request{scene_, directory_, *model_, *probes_, trace_};
    request.run_s = run_s_;
    request.left_s = options_.budget_s - ElapsedS();
    request.quick = options_.quick;
    request.threads = options_.threads;
    request.stop = options_.stop;
    request.progress = options_.progress;
    references_ = MakeAccuracyReferences(request);
    if (references_.trace.time_s.empty()) return NoTime();
    study_.reference = references_.reference;
    study_.second = references_.second;
    study_.references_share = references_.share;
    study_.finer_mesh = references_.finer_mesh;
    for (const std::string& text : references_.left_out) study_.left_out.push_back(text);
    return absl::OkStatus();
  }

  // Errors, orders and advice, from the traces.
  void Judge() {
    const AccuracyTrace& truth = references_.trace;
    study_.motion_m = MotionOf(truth, probes_->rest_m());
    study_.peak_force_n = PeakForce(truth);
    if (study_.formula) study_.reference_deflection_m = truth.deflection_m.back();
    if (study_.second) {
      study_.band = Compare(references_.second_trace, truth);
      study_.chaotic = study_.band->position_m.l2 > kChaoticShare * study_.motion_m;
    }
    if (study_.finer_mesh) {
      study_.own_mesh = Compare(subjects_[0].trace, references_.finer_trace);
    }
    for (std::size_t i = 0; i < study_.points.size(); ++i) JudgePoint(i);
    JudgeRungs();
    FitOrders();
    Recommend();
  }

  void JudgePoint(std::size_t i) {
    AccuracyPoint& point = study_.points[i];
    const Subject& subject = subjects_[i];
    if (point.not_run) study_.left_out.push_back(point.setting.name + " (no time left)");
    if (point.not_run || !point.failed.empty()) return;
    point.cost = FiguresOf(subject.cost, study_.duration_s);
    if (point.cost.repeats < options_.repeats) {
      study_.left_out.push_back(
          absl::StrCat(options_.repeats - point.cost.repeats, " repeats of: ", point.setting.name));
    }
    const AccuracyTrace* against = &references_.trace;
    if (point.setting.kind == DialKind::kModel) against = &subjects_[0].trace;
    if (point.setting.kind == DialKind::kMesh) {
      if (!study_.finer_mesh) return;
      against = &references_.finer_trace;
    }
    point.error = Compare(subject.trace, *against);
  }

  void JudgeRungs() {
    for (AccuracyRung& rung : study_.rungs) {
      if (!study_.points[rung.point].error) continue;
      JudgeRung(subjects_[rung.point].trace, subjects_[0].trace, *model_, &rung);
    }
  }

  // A setting that is written into the scene takes its rungs' errors with it.
  void MeasureAdvisedRungs() {
    const int cheapest = study_.advice.cheapest;
    if (!options_.advised_rungs || cheapest < 0) return;
    study_.advised_rungs = cheapest == 0 ? study_.rungs : RungsOfPoint(cheapest);
  }

  std::vector<AccuracyRung> RungsOfPoint(int i) {
    if (options_.progress) options_.progress("rungs of " + study_.points[i].setting.name);
    return MeasureRungs(subjects_[i].engine.get(), *probes_, trace_, subjects_[i].trace);
  }

  void FitOrders() {
    if (study_.chaotic) return;
    const double band_m = study_.band ? study_.band->position_m.l2 : 0;
    std::vector<std::string> methods;
    for (const AccuracyPoint& point : study_.points) {
      const std::string& method = point.setting.method;
      if (std::find(methods.begin(), methods.end(), method) == methods.end()) {
        methods.push_back(method);
      }
    }
    for (const std::string& method : methods) {
      std::vector<double> dt_s, error_m;
      for (const AccuracyPoint& point : study_.points) {
        if (!IsJudgedByReference(point.setting) || point.setting.method != method) continue;
        // Below the band the reference's own error is seen.
        if (!point.error || point.error->position_m.l2 <= band_m) continue;
        dt_s.push_back(1 / point.setting.rate_hz);
        error_m.push_back(point.error->position_m.l2);
      }
      const std::optional<FittedOrder> fit = FitOrder(dt_s, error_m);
      if (fit) study_.orders.push_back({method, *fit, static_cast<int>(dt_s.size())});
    }
  }

  // A reference for which there was little time may be one of the settings, and have no error.
  bool IsTheReference(const AccuracyPoint& point) const {
    return point.error->position_m.linf == 0 && study_.motion_m > 0 &&
           std::abs(point.setting.rate_hz / study_.reference.rate_hz - 1) < 1e-9;
  }

  void Recommend() {
    AdviceLimits& limits = study_.limits;
    // Who names a tolerance of positions or forces is answered in it.
    limits.by_observables = study_.chaotic && !options_.tolerance_m && !options_.tolerance_n;
    limits.tolerance_m = options_.tolerance_m.value_or(kPartOfMotion * study_.motion_m);
    limits.tolerance_n = options_.tolerance_n.value_or(kPartOfPeak * study_.peak_force_n);
    limits.tolerance_share = kShareOfObservables;
    limits.rate_hz = options_.rate_hz.value_or(study_.rate_hz);
    limits.step_share = options_.step_share;
    std::vector<AdviceCandidate> candidates;
    for (const AccuracyPoint& point : study_.points) {
      AdviceCandidate& one = candidates.emplace_back();
      one.usable = point.setting.kind == DialKind::kNumerical && point.error.has_value() &&
                   !IsTheReference(point);
      if (!one.usable) continue;
      one.rate_hz = point.setting.rate_hz;
      one.error_m = point.error->position_m.l2;
      if (point.error->force_n) one.force_n = point.error->force_n->l2;
      one.share = point.error->worst_share;
      one.cost = point.cost.wall_min;
      one.step_share = 1e-3 * point.cost.step_p99_ms * one.rate_hz;
    }
    study_.advice = Advise(candidates, limits);
  }

  const v1::Scene& scene_;  // as written
  const std::string& directory_;
  const AccuracyOptions& options_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::shared_ptr<const Model> model_;
  std::optional<AccuracyProbes> probes_;
  TraceOptions trace_;
  double run_s_ = 0;  // wall time of a run of the scene as it is
  AccuracyRival rival_;
  AccuracyReferences references_;
  std::vector<Subject> subjects_;  // [#points]
  AccuracyStudy study_;
};

}  // namespace

absl::StatusOr<AccuracyStudy> StudyAccuracy(const v1::Scene& scene, const std::string& directory,
                                            const AccuracyOptions& options) {
  return Study(scene, directory, options).Run();
}

}  // namespace adhesim
