#include <absl/strings/match.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/study/accuracy_advice.h"
#include "core/study/accuracy_error.h"
#include "core/study/accuracy_references.h"
#include "core/study/accuracy_study.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

using ::testing::HasSubstr;

AccuracyStudy StudyOf(const std::string& yaml, double seconds) {
  AccuracyOptions options;
  options.quick = true;
  options.repeats = 1;
  options.seconds = seconds;
  options.budget_s = 300;  // far more than it takes, also where the machine is busy
  const SceneFile file = SceneFileOf(yaml);
  absl::StatusOr<AccuracyStudy> study = StudyAccuracy(file.scene, file.directory, options);
  EXPECT_TRUE(study.ok()) << study.status();
  return study.ok() ? *std::move(study) : AccuracyStudy();
}

// Shared: it is the same study.
const AccuracyStudy& BeamStudy() {
  static const AccuracyStudy study = StudyOf(BeamScene(), 1);
  return study;
}

// Runge and Kutta's method is the truth; what is left over is backward Euler's, whose error falls
// with dt. At w dt = 0.04 to 0.17 of the first mode the next order is a tenth of it.
TEST(AccuracyStudy, FindsBackwardEulerToBeOfFirstOrder) {
  const AccuracyStudy& study = BeamStudy();
  EXPECT_THAT(study.reference.name, HasSubstr("Runge"));
  ASSERT_TRUE(study.second);
  EXPECT_FALSE(study.chaotic);
  ASSERT_FALSE(study.orders.empty());
  EXPECT_EQ(study.orders[0].method, "implicit");
  // Measured: 0.89.
  EXPECT_NEAR(study.orders[0].fit.order, 1, 0.15);
  // The engine at an eighth of the step has an eighth of the error.
  const double own = study.points[0].error->position_m.l2;
  EXPECT_NEAR(study.band->position_m.l2 / own, 0.125, 0.03);
}

// Every integrator rests where the mesh does; a single layer of tetrahedra bends by a third of what
// Timoshenko's beam does (two layers: two thirds, docs/tissue.md).
TEST(AccuracyStudy, KnowsWhereABeamComesToRest) {
  const AccuracyStudy& study = BeamStudy();
  ASSERT_TRUE(study.formula);
  EXPECT_NEAR(study.formula->deflection_m, 1.171e-3, 1e-6);  // by hand, four digits
  EXPECT_GT(study.reference_deflection_m, 0.2 * study.formula->deflection_m);
  EXPECT_LT(study.reference_deflection_m, 0.6 * study.formula->deflection_m);
  // After a second e^-6 of the swing is left.
  EXPECT_NEAR(*study.points[0].deflection_m, study.reference_deflection_m,
              0.02 * study.reference_deflection_m);
}

TEST(AccuracyStudy, ShowsARefusedSettingAsFailedWithItsReason) {
  const AccuracyStudy& study = BeamStudy();
  bool found = false;
  for (std::size_t i = 0; i < study.points.size(); ++i) {
    const AccuracyPoint& point = study.points[i];
    if (point.setting.integrator != Integrator::kExplicit) continue;
    found = true;
    EXPECT_THAT(point.failed, HasSubstr("sub-steps"));
    EXPECT_FALSE(point.error);
    EXPECT_NE(study.advice.cheapest, static_cast<int>(i));
    EXPECT_NE(study.advice.most_accurate, static_cast<int>(i));
  }
  EXPECT_TRUE(found);
}

TEST(AccuracyStudy, TellsWhichDialsASceneDoesNotHave) {
  const AccuracyStudy& study = BeamStudy();
  int offered = 0;
  for (const AccuracyDial& dial : study.dials) {
    EXPECT_EQ(dial.not_offered.empty(), dial.name != "stability" && dial.name != "zones")
        << dial.name << ": " << dial.not_offered;
    offered += dial.not_offered.empty();
  }
  EXPECT_EQ(offered, 7);
}

// A tool presses a small block.
constexpr char kPressed[] =
    "rate_hz: 100\n"
    "bodies:\n"
    "  - name: pad\n"
    "    block: {size_m: [0.04, 0.04, 0.02]}\n"
    "    tetrahedra: {cells: 2}\n"
    "    density_kg_m3: 1000\n"
    "    fixed: [half_space: {point_m: [0, 0, -0.0099], normal: [0, 0, 1]}]\n"
    "tools:\n"
    "  - name: probe\n"
    "    needle: {length_m: 0.1, radius_m: 0.005, tip_length_m: 0.004}\n"
    "    position_m: [0.002, 0.001, 0.012]\n"
    "    trajectory: [{t_s: 0.2, position_m: [0.002, 0.001, 0.006]}]\n"
    "effects:\n"
    "  - elasticity: {young_modulus_pa: 5000, stiffness_damping_s: 0.002}\n"
    "  - virtual_adhesive: {capture_distance_m: 0.001}\n";

// The first setting of each dial, then the second: a budget that ends early leaves none without.
TEST(AccuracyStudy, TriesEveryDialBeforeItTriesOneTwice) {
  const SceneFile file = SceneFileOf(kPressed);
  std::vector<std::string> said;
  AccuracyOptions options;
  options.quick = true;
  options.repeats = 1;
  options.seconds = 0.1;
  options.progress = [&](const std::string& what) { said.push_back(what); };
  ASSERT_TRUE(StudyAccuracy(file.scene, file.directory, options).ok());
  const auto place = [&](const std::string& what) {
    return std::find(said.begin(), said.end(), what) - said.begin();
  };
  EXPECT_LT(place("newton, 100 Hz"), place("50 Hz"));
  EXPECT_LT(place("neo_hookean"), place("50 Hz"));
  EXPECT_LT(place("50 Hz"), place("25 Hz"));
  EXPECT_LT(place("25 Hz"), static_cast<std::ptrdiff_t>(said.size()));
}

std::vector<std::string> ZoneSettingsOf(const std::string& adhesive) {
  const SceneFile file = SceneFileOf(
      "bodies:\n"
      "  - {name: a, icosphere: {radius_m: 0.1}, mass_kg: 1}\n"
      "  - {name: b, icosphere: {radius_m: 0.1}, mass_kg: 1, position_m: [0.21, 0, 0]}\n"
      "effects:\n"
      "  - shape_memory: {stiffness_n_m: 60}\n"
      "  - virtual_adhesive: {" +
      adhesive + "}\n");
  const auto model = EditedModel(file.scene, file.directory, {});
  EXPECT_TRUE(model.ok()) << model.status();
  std::vector<std::string> names;
  for (const AccuracyDial& dial : DialsOf((*model)->scene, **model, {})) {
    if (dial.name != "zones") continue;
    for (const AccuracySetting& setting : dial.settings) {
      names.push_back(setting.name);
      const auto edited = EditedModel(file.scene, file.directory, setting.edits);
      EXPECT_TRUE(edited.ok()) << setting.name << ": " << edited.status();
      if (!edited.ok()) continue;
      EXPECT_EQ((*edited)->adhesive->ties, setting.name == "ties, no zones") << setting.name;
      EXPECT_EQ((*edited)->adhesive->patch_size_m.has_value(),
                absl::StrContains(setting.name, "patches"))
          << setting.name;
    }
  }
  return names;
}

// Whole zones, zones in patches and ties: each scene is shown what it would be without its own.
TEST(AccuracyDials, OfZonesAreTheOtherWaysToStick) {
  using ::testing::ElementsAre;
  EXPECT_THAT(ZoneSettingsOf("capture_distance_m: 0.01"),
              ElementsAre(HasSubstr("in patches"), "ties, no zones"));
  EXPECT_THAT(ZoneSettingsOf("capture_distance_m: 0.01, patch_size_m: 0.1"),
              ElementsAre("zones in patches of 50 mm", "zones that are not cut"));
  EXPECT_THAT(ZoneSettingsOf("capture_distance_m: 0.01, ties: true"),
              ElementsAre("zones, no ties"));
  // Which ties exclude.
  EXPECT_THAT(ZoneSettingsOf("capture_distance_m: 0.01, normal_strength_pa: 10, "
                             "friction_coefficient: 0.3"),
              ElementsAre(HasSubstr("in patches")));
}

// The explicit path is foretold to take too long, and not begun; Newton's path is run because a
// reference there must be, and once more at half the rate, so that chaos is seen.
TEST(AccuracyReferences, AreOfOneCodeWhereThereIsNoTimeForTheOther) {
  const SceneFile file = SceneFileOf(kPressed);
  const auto model = EditedModel(file.scene, file.directory, {});
  ASSERT_TRUE(model.ok()) << model.status();
  const AccuracyProbes probes(**model);
  TraceOptions trace;
  trace.instants_s = {0.1, 0.2};
  const auto references = [&](double run_s) {
    ReferenceRequest request{file.scene, file.directory, **model, probes, trace};
    request.run_s = run_s;
    request.left_s = 300;
    return MakeAccuracyReferences(request);
  };
  const AccuracyReferences poor = references(1e6);
  EXPECT_EQ(poor.reference.rate_hz, 200);
  EXPECT_THAT(poor.reference.name, HasSubstr("newton"));
  EXPECT_THAT(poor.left_out, ::testing::Contains(HasSubstr("explicit")));
  // Half of it would take as long as nobody has.
  EXPECT_FALSE(poor.second);
  const AccuracyReferences rich = references(1e-3);
  ASSERT_TRUE(rich.second);
  EXPECT_THAT(rich.reference.name, HasSubstr("explicit"));
  EXPECT_THAT(rich.second->name, HasSubstr("newton"));
  EXPECT_EQ(rich.second->rate_hz, 1600);
}

// Frames of a governed session say what a rung is expected to cost; a study says what it does.
TEST(AccuracyStudy, MeasuresWhatTheGovernorGivesUp) {
  const AccuracyStudy& study = BeamStudy();
  ASSERT_FALSE(study.rungs.empty());
  EXPECT_EQ(study.rungs[0].name, "iterations");
  for (const AccuracyRung& rung : study.rungs) {
    ASSERT_GE(rung.point, 0);
    EXPECT_EQ(study.points[rung.point].setting.kind, DialKind::kModel);
    EXPECT_THAT(study.points[rung.point].setting.name, HasSubstr(rung.name));
    ASSERT_TRUE(rung.position);
    EXPECT_FALSE(rung.force);  // it has no tools
    EXPECT_LE(*rung.position, rung.declared_position);
  }
  // A tolerance five times as large is seen, however small both are.
  EXPECT_GT(*study.rungs.back().position, 0);
}

// What is written with a setting is of that setting: its rungs, by their difference from it.
TEST(AccuracyStudy, MeasuresTheRungsOfTheSettingThatItRecommends) {
  const SceneFile file = SceneFileOf(kPressed);
  AccuracyOptions options;
  options.quick = true;
  options.repeats = 1;
  options.seconds = 0.2;
  // Any error is permitted: the cheapest is one that steps more rarely, or a looser tolerance.
  options.tolerance_m = options.tolerance_n = 1e3;
  options.advised_rungs = true;
  auto study = StudyAccuracy(file.scene, file.directory, options);
  // What is cheapest is measured, and a busy machine may slow any run.
  for (int again = 0; again < 10 && study.ok() && study->advice.cheapest == 0; ++again) {
    study = StudyAccuracy(file.scene, file.directory, options);
  }
  ASSERT_TRUE(study.ok()) << study.status();
  ASSERT_GT(study->advice.cheapest, 0);
  const AccuracySetting& advised = study->points[study->advice.cheapest].setting;
  const auto model = EditedModel(file.scene, file.directory, advised.edits);
  ASSERT_TRUE(model.ok()) << model.status();
  const auto engine = EngineOf(*model);
  ASSERT_EQ(study->advised_rungs.size(), engine->rungs().size());
  TraceOptions trace;
  trace.common_step_s = 0.04;  // of 25 Hz, the coarsest
  for (int i = 1; i <= 5; ++i) trace.instants_s.push_back(0.04 * i);
  ASSERT_EQ(study->instants, trace.instants_s.size());
  const AccuracyProbes probes(**model);
  const auto run = [&](int rungs) {
    engine->SetFidelity(rungs);
    return RunTrace(engine.get(), probes, trace, nullptr);
  };
  const AccuracyTrace full = run(0);
  for (std::size_t r = 0; r < study->advised_rungs.size(); ++r) {
    const AccuracyError error = Compare(run(static_cast<int>(r) + 1), full);
    const AccuracyRung& rung = study->advised_rungs[r];
    EXPECT_EQ(rung.name, engine->rungs()[r].name);
    // The same bits, over 40 mm: the block's size.
    ASSERT_TRUE(rung.position && rung.force);
    EXPECT_EQ(*rung.position, error.position_m.linf / (*model)->bodies[0].size_m);
    EXPECT_EQ(*rung.force, error.force_n->linf / PeakForce(full));
  }
  EXPECT_NE(*study->advised_rungs[0].position, *study->rungs[0].position);
  // Nothing is recommended, so nothing is measured for it.
  options.tolerance_m = 1e-12;
  const auto none = StudyAccuracy(file.scene, file.directory, options);
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_TRUE(none->advised_rungs.empty());
}

// z = -(g / c) (t - (1 - e^{-ct}) / c) for every particle.
TEST(AccuracyRungeKutta, FallsThroughAFluidAsTheFormulaSays) {
  const std::shared_ptr<const Model> model = ModelOf(
      "bodies:\n  - {name: ball, icosphere: {radius_m: 0.1}, mass_kg: 1}\n"
      "effects:\n  - uniform_gravity: {acceleration_m_s2: [0, 0, -2]}\n  - drag: {rate_per_s: "
      "3}\n");
  TraceOptions options;
  options.instants_s = {0.5, 1};
  const AccuracyTrace trace = RunRungeKutta(*model, AccuracyProbes(*model), options);
  ASSERT_EQ(trace.failed, "");
  const double expected_m = -2.0 / 3 * (1 - (1 - std::exp(-3.0)) / 3);
  // Of fourth order: (c dt)^4 / 120 of the way with dt of a hundredth of a second.
  EXPECT_NEAR(trace.position_m[1][0].z() - AccuracyProbes(*model).rest_m()[0].z(), expected_m,
              1e-8);
}

TEST(AccuracyRungeKutta, IsNotForContactOrTools) {
  const auto why = [](const std::string& more) {
    return WhyNotRungeKutta(
        *ModelOf("bodies:\n  - {name: a, icosphere: {radius_m: 0.1}, mass_kg: 1}\n" + more));
  };
  EXPECT_EQ(why("effects:\n  - shape_memory: {stiffness_n_m: 1}\n"), "");
  EXPECT_THAT(why("effects:\n  - virtual_adhesive: {capture_distance_m: 0.01}\n"),
              HasSubstr("contact"));
  EXPECT_THAT(why("effects:\n  - volume_preservation: {}\n"), HasSubstr("constraints"));
}

// What sticks by chance lets go at another time in every run: positions part, and the scene is
// judged by what does not.
TEST(AccuracyStudy, JudgesWhatCannotBeForeseenByObservables) {
  const AccuracyStudy study = StudyOf(
      "rate_hz: 200\n"
      "bodies:\n"
      "  - {name: plate, sheet: {length_m: 1, width_m: 1, columns: 3, rows: 3}, mass_kg: 1, "
      "fixed: [all: true]}\n"
      "  - {name: drop, icosphere: {radius_m: 0.1, subdivisions: 0}, mass_kg: 1, "
      "position_m: [0.1, 0.1, -0.09], velocity_m_s: [0, 0, 0.3]}\n"
      "effects:\n"
      "  - shape_memory: {stiffness_n_m: 500}\n"
      "  - uniform_gravity: {acceleration_m_s2: [0, 0, -1]}\n"
      "  - virtual_adhesive: {capture_distance_m: 0.01, normal_strength_pa: 1e6, "
      "bell: {rate_per_s: 2, force_n: 1000}}\n",
      2);
  ASSERT_TRUE(study.band);
  EXPECT_TRUE(study.chaotic);
  EXPECT_TRUE(study.limits.by_observables);
  EXPECT_TRUE(study.orders.empty());
  EXPECT_THAT(study.references_share, HasSubstr("no second integrator"));
  std::vector<std::string> names;
  for (const Observable& one : study.points[0].error->observables) names.push_back(one.name);
  EXPECT_THAT(names, ::testing::Contains("radius of gyration at the end"));
  EXPECT_THAT(names, ::testing::Contains("last release"));
}

TEST(AccuracyError, FitsThePowerOfTheStep) {
  const std::array<double, 3> dt = {0.01, 0.02, 0.04}, error = {3e-4, 1.2e-3, 4.8e-3};
  const std::optional<FittedOrder> fit = FitOrder(dt, error);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->order, 2, 1e-12);
  EXPECT_NEAR(fit->factor, 3, 1e-10);
  EXPECT_FALSE(FitOrder(std::array{0.01, 0.02}, std::array{1.0, 2.0}));
  EXPECT_FALSE(FitOrder(dt, std::array{1.0, 0.0, 2.0}));
}

TEST(AccuracyError, TellsEventsThatOnlyOneRunHas) {
  AccuracyTrace truth, trace;
  truth.time_s = trace.time_s = {1};
  truth.position_m = {{Vec3(0, 0, 0), Vec3(1, 0, 0)}};
  trace.position_m = {{Vec3(0, 0, 3), Vec3(1, 4, 0)}};
  truth.events = {{"probe touches", 0.2}, {"probe lets go", 0.7}};
  trace.events = {{"probe touches", 0.21}, {"bodies touch", 0.4}};
  const AccuracyError error = Compare(trace, truth);
  EXPECT_NEAR(error.position_m.l2, std::sqrt(12.5), 1e-12);
  EXPECT_EQ(error.position_m.linf, 4);
  EXPECT_NEAR(error.worst_event_s, 0.01, 1e-12);
  EXPECT_EQ(error.lost_events, 2);
  EXPECT_FALSE(error.force_n);
}

AdviceCandidate Measured(double rate_hz, double error_m, double cost) {
  return {.usable = true,
          .rate_hz = rate_hz,
          .error_m = error_m,
          .force_n = std::nullopt,
          .share = 0,
          .cost = cost,
          .step_share = cost};
}

constexpr AdviceLimits kLimits = {.tolerance_m = 1e-3,
                                  .tolerance_n = 0.1,
                                  .tolerance_share = 0.05,
                                  .rate_hz = 100,
                                  .step_share = 0.5};

TEST(AccuracyAdvice, TakesTheCheapestWithinTheToleranceAndTheBestWithinTheRate) {
  std::vector<AdviceCandidate> table = {Measured(200, 5e-4, 0.4), Measured(50, 9e-4, 0.1),
                                        Measured(25, 4e-3, 0.05), Measured(400, 1e-4, 0.9)};
  Advice advice = Advise(table, kLimits);
  EXPECT_EQ(advice.cheapest, 1);
  EXPECT_EQ(advice.most_accurate, 0);  // 3 takes too long a step, 1 and 2 step too rarely
  table[1].force_n = 0.2;
  EXPECT_EQ(Advise(table, kLimits).cheapest, 0);
  table[0].usable = false;
  advice = Advise(table, kLimits);
  EXPECT_EQ(advice.cheapest, 3);
  EXPECT_EQ(advice.most_accurate, -1);
  EXPECT_EQ(Advise({}, kLimits).cheapest, -1);
}

TEST(AccuracyAdvice, OfAChaoticSceneGoesByObservables) {
  std::vector<AdviceCandidate> table = {Measured(200, 1e-6, 0.1), Measured(200, 1, 0.3)};
  table[0].share = 0.2;
  table[1].share = 0.01;
  AdviceLimits limits = kLimits;
  limits.by_observables = true;
  EXPECT_EQ(Advise(table, limits).cheapest, 1);
}

}  // namespace
}  // namespace adhesim::test
