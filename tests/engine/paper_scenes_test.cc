#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/contact/penetration.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/test_size.h"

namespace adhesim::test {
namespace {

// The paper's own counts (Carra et al. 2007, figures 2, 3 and 6).
TEST(PaperScenes, HaveThePapersCounts) {
  struct Counts {
    const char* scene;
    int particles, triangles;
  };
  for (const Counts& paper :
       {Counts{"six_spheres_on_plane", 693, 1280}, Counts{"two_cells_sticky", 84, 160},
        Counts{"two_cells_slippery", 84, 160}, Counts{"cell_aggregation", 1050, 2000}}) {
    const auto engine = SceneEngine(std::string("paper/") + paper.scene + ".yaml");
    EXPECT_EQ(engine->model().particle_count(), paper.particles) << paper.scene;
    EXPECT_EQ(static_cast<int>(engine->model().triangles.size()), paper.triangles) << paper.scene;
  }
}

double RadiusOfGyration(const Engine& engine) {
  const Model& model = engine.model();
  double sum = 0, mass = 0;
  for (int p = 0; p < model.particle_count(); ++p) {
    sum += model.mass_kg[p] * engine.state().position_m[p].squaredNorm();
    mass += model.mass_kg[p];
  }
  return std::sqrt(sum / mass);
}

// Fig. 6: cells stick to an aggregate, more and more of their particles in contact.
TEST(PaperScenes, CellsAggregate) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  const auto engine = SceneEngine("paper/cell_aggregation.yaml");
  const double before_m = RadiusOfGyration(*engine);
  int colliding = 0;
  for (int second = 0; second < 3; ++second) {
    EXPECT_EQ(StepMany(engine.get(), 1000), 0u);
    EXPECT_GE(engine->state().contacts.colliding_particles, colliding);
    colliding = engine->state().contacts.colliding_particles;
    const std::vector<Vec3>& x = engine->state().position_m;
    EXPECT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0);
    EXPECT_EQ(CountEdgesThrough(engine->model(), x), 0);
  }
  EXPECT_LT(RadiusOfGyration(*engine), 0.75 * before_m);
  EXPECT_GT(colliding, 250);  // of 1050
  EXPECT_LE(engine->state().contacts.zones.size(), 3u);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

// Fig. 2: no interpenetration. 6 s show the whole pile at rest.
TEST(PaperScenes, SpheresComeToRestOnThePlaneAndEachOther) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  const auto engine = SceneEngine("paper/six_spheres_on_plane.yaml");
  for (int k = 0; k < 12; ++k) {
    EXPECT_EQ(StepMany(engine.get(), 250), 0u);
    const Penetration now = MeasurePenetration(engine->model(), engine->state().position_m);
    EXPECT_LE(now.max_depth_m, engine->model().adhesive->capture_distance_m);
    EXPECT_EQ(now.vertices_inside, 0);
  }
  EXPECT_GT(engine->state().contacts.colliding_particles, 100);
}

}  // namespace
}  // namespace adhesim::test
