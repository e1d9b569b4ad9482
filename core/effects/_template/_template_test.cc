#include "core/effects/_template/_template.h"

#include <gtest/gtest.h>

#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

TEST(TemplateEffect, PullsBackInProportionToStretch) {
  const auto model = ModelOf(
      "bodies:\n  - {name: ball, icosphere: {radius_m: 0.5}, mass_kg: 1}\n"
      "effects:\n  - shape_memory: {stiffness_n_m: 50}\n");
  const TemplateEffect effect(*model, model->scene.effects(0).shape_memory());
  std::vector<Vec3> x = model->rest_position_m, force(x.size(), Vec3::Zero());
  for (Vec3& p : x) p *= 1.1;
  Parallel parallel{1};
  const double energy_j = effect.AddForces(
      {x, std::vector<Vec3>(x.size(), Vec3::Zero()), 0, {}, &parallel}, {force, {}, {}, {}});
  double expected_j = 0;
  Vec3 expected_n = Vec3::Zero();  // on particle 0
  for (int p = 0; p < model->particle_count(); ++p) {
    for (int k = model->neighbour_start[p]; k < model->neighbour_start[p + 1]; ++k) {
      const Vec3 edge = model->rest_position_m[model->neighbours[k]] - model->rest_position_m[p];
      expected_j += 0.5 * 0.5 * 50 * 0.01 * edge.squaredNorm();  // each edge comes twice
      if (p == 0) expected_n += 50 * 0.1 * edge;
    }
  }
  // 10 % longer: 1/2 k (0.1 L)^2 and k 0.1 L an edge, but for round-off of some hundred terms.
  EXPECT_NEAR(energy_j, expected_j, 1e-13 * expected_j);
  EXPECT_LT((force[0] - expected_n).norm(), 1e-13 * expected_n.norm());
}

}  // namespace
}  // namespace adhesim::test
