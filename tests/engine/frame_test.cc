#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/engine_fixture.h"
#include "tests/support/sample_scenes.h"

namespace adhesim::test {
namespace {

Vec3 SumOf(const std::vector<ContactForce>& forces) {
  Vec3 sum = Vec3::Zero();
  for (const ContactForce& c : forces) sum += Vec3(c.force_n[0], c.force_n[1], c.force_n[2]);
  return sum;
}

double SizeOf(const std::vector<ContactForce>& forces) {
  double size = 0;
  for (const ContactForce& c : forces) {
    size += Vec3(c.force_n[0], c.force_n[1], c.force_n[2]).norm();
  }
  return size;
}

TEST(Frame, ContactForcesBetweenBodiesCancel) {
  auto engine = SceneEngine("paper/two_cells_sticky.yaml");
  Frame frame = engine->MakeFrame();
  int with_contact = 0;
  for (int step = 0; step < 2000; ++step) {
    engine->Step({});
    engine->WriteFrame(&frame);
    // Without a bond there is no force, and every force belongs to a bond.
    EXPECT_EQ(frame.contact_forces.empty(), frame.colliding_particles == 0) << step;
    if (frame.contact_forces.empty()) continue;
    ++with_contact;
    // Floats: 12 numbers, each good to 6e-8.
    EXPECT_LT(SumOf(frame.contact_forces).norm(), 1e-6 * SizeOf(frame.contact_forces)) << step;
    EXPECT_TRUE(
        std::is_sorted(frame.contact_forces.begin(), frame.contact_forces.end(),
                       [](const auto& a, const auto& b) { return a.particle < b.particle; }));
  }
  EXPECT_GT(with_contact, 500);
}

TEST(Frame, ContactForcesAtAToolAreWhatItFeels) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  Frame frame = engine->MakeFrame();
  // Pressed in and held: nothing is captured in these steps, whose impulse the sum would miss.
  StepMany(engine.get(), 400);
  ASSERT_EQ(engine->substeps(), 1);
  for (int step = 0; step < 50; ++step) {
    const StepReport report = engine->Step({});
    engine->WriteFrame(&frame);
    if (report.captures > 0) continue;
    const Vec3 felt = frame.tools[0].tissue.force_n;
    ASSERT_GT(felt.norm(), 0.01);
    EXPECT_LT((SumOf(frame.contact_forces) + felt).norm(), 1e-5 * felt.norm()) << step;
  }
}

TEST(Frame, ContactsOfAToolAddUpToWhatItFeels) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  Frame frame = engine->MakeFrame();
  StepMany(engine.get(), 400);  // as above
  for (int step = 0; step < 50; ++step) {
    const StepReport report = engine->Step({});
    engine->WriteFrame(&frame);
    if (report.captures > 0) continue;
    ASSERT_FALSE(frame.contacts.empty());
    Vec3 along = Vec3::Zero();
    double across = 0;
    for (const ContactFrame& contact : frame.contacts) {
      EXPECT_NEAR(contact.normal.norm(), 1, 1e-12);
      EXPECT_EQ(contact.tool, 0);
      EXPECT_EQ(contact.body, 0);
      EXPECT_GE(contact.margin, 0);
      EXPECT_LE(contact.margin, 1);
      EXPECT_TRUE(contact.normal_force_n < 0 || contact.margin == 1);
      ASSERT_FALSE(frame.zones.empty());
      EXPECT_EQ(contact.zone, frame.zones[0].id);
      along += contact.normal_force_n * contact.normal;
      across += contact.tangential_force_n;
    }
    // Only the size of the tangential parts is told: their sum is at most the sum of the sizes.
    const Vec3 on_tissue = -frame.tools[0].tissue.force_n;
    EXPECT_LE((along - on_tissue).norm(), across + 1e-9 * on_tissue.norm()) << step;
    EXPECT_GT(along.dot(on_tissue), 0.5 * on_tissue.squaredNorm());
  }
}

TEST(Frame, ContactsBetweenBodiesCarryTheirContactForces) {
  auto engine = SceneEngine("paper/two_cells_sticky.yaml");
  Frame frame = engine->MakeFrame();
  int with_contact = 0;
  for (int step = 0; step < 2000; ++step) {
    engine->Step({});
    engine->WriteFrame(&frame);
    if (frame.contacts.empty()) continue;
    ++with_contact;
    double carried = 0, of_particles = 0;
    for (const ContactFrame& contact : frame.contacts) {
      carried += std::hypot(contact.normal_force_n, contact.tangential_force_n);
      EXPECT_NE(contact.body, contact.other_body);
      EXPECT_EQ(contact.tool, -1);
    }
    for (const ContactForce& c : frame.contact_forces) {
      of_particles += Vec3(c.force_n[0], c.force_n[1], c.force_n[2]).norm();
    }
    // Each bond tells one of its sides, so that the sum is no more than that of all particles.
    EXPECT_LE(carried, (1 + 1e-6) * of_particles) << step;
    EXPECT_EQ(carried > 0, of_particles > 0) << step;
  }
  EXPECT_GT(with_contact, 500);
}

TEST(Frame, DepthOfAToolIsHowFarItHasPushedTheTissue) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  Frame frame = engine->MakeFrame();
  double touched_m = 0, deepest_m = 0, highest_m = 0;
  for (int step = 0; step < 1400; ++step) {
    engine->Step({});
    engine->WriteFrame(&frame);
    const ToolFrame& tool = frame.tools[0];
    if (tool.colliding_particles == 0) {
      EXPECT_EQ(tool.depth_m, 0);
      continue;
    }
    if (touched_m == 0) touched_m = tool.pose.position_m.z();
    // What it holds has moved with it; captures on the way in add a capture distance at most.
    EXPECT_NEAR(tool.depth_m, touched_m - tool.pose.position_m.z(), 1e-3) << step;
    deepest_m = std::max(deepest_m, tool.depth_m);
    highest_m = std::min(highest_m, tool.depth_m);
  }
  EXPECT_GT(deepest_m, 5e-3);
  EXPECT_LT(highest_m, -1e-3);  // pulled out before it lets go
}

TEST(Frame, StrainEnergyIsTheElasticEnergyWhereForcesWereEvaluated) {
  auto engine = EngineOf(NeedleScene(kPressAndPull));
  Frame frame = engine->MakeFrame();
  EXPECT_EQ(std::count(frame.strain_energy_j.begin(), frame.strain_energy_j.end(), 0.0f),
            engine->model().particle_count());
  StepMany(engine.get(), 300);
  engine->WriteFrame(&frame);
  double sum = 0;
  for (float e : frame.strain_energy_j) sum += e;
  EXPECT_GT(sum, 0);
  EXPECT_NEAR(sum, engine->state().ledger.elastic_j, 1e-5 * sum);  // floats
  // A restored state has no forces of its own yet: none are shown, rather than another state's.
  engine->Reset();
  engine->WriteFrame(&frame);
  EXPECT_TRUE(frame.contact_forces.empty());
  EXPECT_EQ(frame.strain_energy_j[0], 0.0f);
  EXPECT_EQ(*std::max_element(frame.strain_energy_j.begin(), frame.strain_energy_j.end()), 0.0f);
}

}  // namespace
}  // namespace adhesim::test
