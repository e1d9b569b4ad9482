#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/contact/penetration.h"
#include "core/model/bond_geometry.h"
#include "core/model/diagnostics.h"
#include "core/scene/mesh/read_surface.h"
#include "core/scene/scene_file.h"
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
        Counts{"two_cells_slippery", 84, 160}, Counts{"rolling_ball", 217, 368},
        Counts{"cell_aggregation", 1050, 2000}, Counts{"cell_aggregation_x10", 10500, 20000},
        Counts{"cell_aggregation_x100", 105000, 200000}}) {
    const auto engine = SceneEngine(std::string("paper/") + paper.scene + ".yaml");
    EXPECT_EQ(engine->model().particle_count(), paper.particles) << paper.scene;
    EXPECT_EQ(static_cast<int>(engine->model().triangles.size()), paper.triangles) << paper.scene;
  }
}

// Fig. 5, with the counts of the paper. The bunny is fetched at set-up, where there is a network.
TEST(PaperScenes, BunniesStickToEachOtherAndToTheSheet) {
  const std::string directory = ADHESIM_SOURCE_DIR "/scenes/paper";
  if (!ResolveFile("asset:bunny.obj", directory).ok()) {
    GTEST_SKIP() << "bunny.obj is not installed: run scenes/fetch_assets.sh";
  }
  const auto engine = SceneEngine("paper/four_bunnies.yaml");
  const Model& model = engine->model();
  EXPECT_EQ(model.particle_count(), 567);
  EXPECT_EQ(model.triangles.size(), 1040u);
  for (int b = 1; b < 5; ++b) EXPECT_EQ(model.bodies[b].particle_count, 42);
  int early = 0;
  for (int k = 0; k < 16; ++k) {
    const Penetration now = MeasurePenetration(model, engine->state().position_m);
    EXPECT_LE(now.max_depth_m, model.adhesive->capture_distance_m);
    EXPECT_EQ(now.vertices_inside, 0);
    EXPECT_EQ(StepMany(engine.get(), 250), 0u);
    if (k == 7) early = engine->state().contacts.colliding_particles;
  }
  EXPECT_GE(2 * early, engine->state().contacts.colliding_particles);
  EXPECT_GE(engine->state().contacts.colliding_particles, 60);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-12);
}

// Highest less lowest point of a body.
double HeightOf(const Engine& engine, const Body& body) {
  double low = engine.state().position_m[body.first_particle].z(), high = low;
  for (int p = body.first_particle; p < body.first_particle + body.particle_count; ++p) {
    low = std::min(low, engine.state().position_m[p].z());
    high = std::max(high, engine.state().position_m[p].z());
  }
  return high - low;
}

// All scenes have one kind of ball; how soft it is shows on a rigid floor under 1 g. Three
// directions, because an icosphere on a corner, an edge or a face gives way differently.
TEST(PaperScenes, BallsFlattenByAboutATenthOnARigidFloor) {
  std::string elasticity;
  for (const char* scene :
       {"six_spheres_on_plane", "two_cells_sticky", "two_cells_slippery", "cell_aggregation"}) {
    const SceneFile file =
        ReadSceneFile(std::string(ADHESIM_SOURCE_DIR "/scenes/paper/") + scene + ".yaml");
    for (const v1::Effect& effect : file.scene.effects()) {
      if (!effect.has_shape_memory()) continue;
      v1::ShapeMemory ball = effect.shape_memory();
      ball.clear_bodies();
      if (elasticity.empty()) elasticity = ball.ShortDebugString();
      EXPECT_EQ(ball.ShortDebugString(), elasticity) << scene;
      break;
    }
  }
  EXPECT_EQ(elasticity, "stiffness_n_m: 200 damping_n_s_m: 1");
  for (const char* rotation_deg : {"[0, 0, 0]", "[31.7, 0, 0]", "[40, 25, 10]"}) {
    const auto engine = EngineOf(
        std::string("bodies:\n"
                    "  - {name: ball, icosphere: {radius_m: 0.6}, mass_kg: 1, position_m: [0.1, "
                    "0.07, 0.612], rotation_deg: ") +
        rotation_deg +
        "}\n"
        "  - {name: floor, sheet: {length_m: 6, width_m: 6, columns: 21, rows: 21}, mass_kg: 4, "
        "fixed: [all: true]}\n"
        "effects:\n"
        "  - uniform_gravity: {}\n"
        "  - shape_memory: {stiffness_n_m: 200, damping_n_s_m: 1}\n"
        "  - volume_preservation: {}\n"
        "  - drag: {rate_per_s: 0.5}\n"
        "  - virtual_adhesive: {capture_distance_m: 0.012, normal_strength_pa: 200}\n");
    const Body& ball = engine->model().bodies[0];
    const double before_m = HeightOf(*engine, ball);
    EXPECT_EQ(StepMany(engine.get(), 4000), 0u);
    const double flattening = 1 - HeightOf(*engine, ball) / before_m;
    EXPECT_GE(flattening, 0.05) << rotation_deg;
    EXPECT_LE(flattening, 0.15) << rotation_deg;
  }
}

// Speeds are compared while the bodies touch: not long after the start, and for good.
TEST(PaperScenes, HalfOfTheContactIsThereWithinTwoSeconds) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  struct Run {
    const char* scene;
    double duration_s;    // as the scene's file says
    int least_colliding;  // that it is contact at all: two coarse balls meet by some edges
  };
  // A ball that rolls from face to face has between 7 and 20, 14 on the mean.
  for (const Run& run : {Run{"six_spheres_on_plane", 6, 12}, Run{"two_cells_sticky", 5, 8},
                         Run{"rolling_ball", 2, 7}, Run{"cell_aggregation", 4, 12}}) {
    const auto engine = SceneEngine(std::string("paper/") + run.scene + ".yaml");
    StepMany(engine.get(), 2000);
    const int early = engine->state().contacts.colliding_particles;
    StepMany(engine.get(), static_cast<int>(1000 * (run.duration_s - 2)));
    EXPECT_GE(2 * early, engine->state().contacts.colliding_particles) << run.scene;
    EXPECT_GE(early, run.least_colliding) << run.scene;
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
  for (int second = 0; second < 4; ++second) {
    EXPECT_EQ(StepMany(engine.get(), 1000), 0u);
    EXPECT_GE(engine->state().contacts.colliding_particles, colliding);
    colliding = engine->state().contacts.colliding_particles;
    const std::vector<Vec3>& x = engine->state().position_m;
    EXPECT_EQ(MeasurePenetration(engine->model(), x).vertices_inside, 0);
    EXPECT_EQ(CountEdgesThrough(engine->model(), x), 0);
    // No bond lives on by a corner far from a contact that is gone.
    for (const Bond& bond : engine->state().contacts.bonds) {
      EXPECT_LE(std::abs(GeometryOf(bond, engine->model(), x).gap_m),
                engine->model().adhesive->release_distance_m);
    }
    if (second >= 1) {
      EXPECT_GE(colliding, 0.3 * engine->model().particle_count());
    }
  }
  EXPECT_LT(RadiusOfGyration(*engine), 0.75 * before_m);
  EXPECT_LE(engine->state().contacts.zones.size(), 3u);
  EXPECT_LE(IdentityError(engine->state().ledger), 1e-9);
}

// Ten and a hundred times Fig. 6: the cells start touching, so that the second half of the run is
// contact.
TEST(PaperScenes, PackedCellsAreInContactFromTheStart) {
  if (kSanitized) GTEST_SKIP() << "a long run of what shorter tests do";
  const auto engine =
      SceneEngine("paper/cell_aggregation_x" + std::to_string(TestSize(10, 100)) + ".yaml");
  EXPECT_EQ(StepMany(engine.get(), 250), 0u);
  EXPECT_GE(engine->state().contacts.colliding_particles, 0.3 * engine->model().particle_count());
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
