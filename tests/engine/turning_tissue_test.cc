// Energy of stiff tissue that turns, free or about what holds it: an unfinished solve adds none.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/engine/engine.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim {
namespace {

using test::EngineOf;
using test::ModelOf;

// A scene of the hard cases, and what its energies are measured against: 27 g that fall by up to 21
// mm, and what spins.
struct Turning {
  const char* scene;
  double reference_j;
};
constexpr Turning kHinge = {"swings_on_hinge", 0.0056};
constexpr Turning kPin = {"spins_about_pin", 0.00033};
constexpr Turning kCorner = {"turns_about_stuck_corner", 0.00039};
constexpr Turning kFree = {"spins_freely", 0.00042};

// Of the reference: the most by which kinetic and elastic energy exceed the start's and what
// gravity did.
double MostGained(const Turning& turning, v1::Integrator integrator, double tolerance,
                  double seconds, double rate_hz = 200) {
  SceneFile file =
      ReadSceneFile(std::string(ADHESIM_SOURCE_DIR "/scenes/stress/") + turning.scene + ".yaml");
  file.scene.set_rate_hz(rate_hz);
  file.scene.mutable_integration()->set_integrator(integrator);
  file.scene.mutable_integration()->set_tolerance(tolerance);
  auto engine = EngineOf(ModelOf(file));
  double most = -1;
  for (int k = 0; k < seconds * rate_hz * (kSanitized ? 0.1 : 1); ++k) {
    engine->Step({});
    const Ledger& ledger = engine->state().ledger;
    const double gained = engine->MechanicalEnergy() - ledger.initial_j - ledger.external_work_j;
    if (!(gained <= most * turning.reference_j)) most = gained / turning.reference_j;
  }
  return most;
}

// 1 % of the reference: a turn by a in a step may gain in order a^2, 0.4 % at 0.06 rad. Before
// decision 27 these ended at up to 1e33 times the reference.
TEST(TurningTissue, GainsNothingFromAnUnfinishedSolve) {
  for (const double tolerance : {0.001, 0.01, 0.1, 0.5}) {
    EXPECT_LT(MostGained(kHinge, v1::INTEGRATOR_IMPLICIT, tolerance, 3), 0.01) << tolerance;
    for (const Turning& turning : {kPin, kCorner, kFree}) {
      EXPECT_LT(MostGained(turning, v1::INTEGRATOR_IMPLICIT, tolerance, 1), 0.01)
          << turning.scene << " " << tolerance;
    }
  }
}

TEST(TurningTissue, GainsNothingFromAnUnfinishedNewtonStep) {
  for (const double tolerance : {0.001, 0.01, 0.1}) {
    for (const Turning& turning : {kHinge, kPin, kCorner, kFree}) {
      EXPECT_LT(MostGained(turning, v1::INTEGRATOR_NEWTON, tolerance, 0.5), 0.01)
          << turning.scene << " " << tolerance;
    }
  }
}

// 0.2 rad a step at 60 Hz and 0.6 at 20: up to six sub-steps each. In one, linear steps gained up
// to six times the reference. The hinge turns by 1.5 rad in 50 ms, and from rest by 0.8 of which
// its velocity tells nothing.
TEST(TurningTissue, GainsNothingWhereAStepTurnsItFar) {
  for (const double rate_hz : {60.0, 20.0}) {
    for (const v1::Integrator integrator : {v1::INTEGRATOR_IMPLICIT, v1::INTEGRATOR_NEWTON}) {
      for (const Turning& turning : {kPin, kFree}) {
        EXPECT_LT(MostGained(turning, integrator, 0.001, 1, rate_hz), 0.01)
            << turning.scene << " " << rate_hz;
      }
      EXPECT_LT(MostGained(kHinge, integrator, 0.001, 3, rate_hz), 0.02) << rate_hz;
    }
  }
}

}  // namespace
}  // namespace adhesim
