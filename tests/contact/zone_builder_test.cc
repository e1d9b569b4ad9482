#include "core/contact/zone_builder.h"

#include <gtest/gtest.h>

#include "tests/support/engine_fixture.h"

namespace adhesim::test {
namespace {

// Two sheets of 5 x 2 particles above each other and a rigid third: zones are made from bonds put
// in by hand.
class Zones : public testing::Test {
 protected:
  Zones()
      : model_(ModelOf(R"(
bodies:
  - {name: low, sheet: {length_m: 4, width_m: 1, columns: 5, rows: 2}, mass_kg: 1}
  - {name: high, sheet: {length_m: 4, width_m: 1, columns: 5, rows: 2}, mass_kg: 1, position_m: [0, 0, 0.1]}
  - {name: plate, kind: rigid, sheet: {length_m: 1, width_m: 1, columns: 2, rows: 2}, mass_kg: 1,
     position_m: [0, 0, 0.2]}
tools:
  - {name: left, needle: {}, position_m: [0, 0, 1]}
  - {name: right, needle: {}, position_m: [0, 0, 1]}
effects:
  - virtual_adhesive: {capture_distance_m: 0.15}
)")),
        builder_(*model_) {
    ZoneBuilder::Reserve(*model_, &contacts_);
  }
  // Particle `high` of the upper sheet sticks to particle `low` of the lower one.
  void Stick(int low, int high) {
    Bond bond;
    bond.particle = model_->bodies[1].first_particle + high;
    bond.triangle = 0;
    bond.vertices = {low, -1, -1};
    bond.weights = {1, 0, 0};
    contacts_.bonds.push_back(bond);
  }
  void HoldByTool(int tool, int particle) {
    Bond bond;
    bond.tool = tool;
    bond.vertices = {particle, -1, -1};
    contacts_.bonds.push_back(bond);
  }
  std::uint32_t Rebuild() {
    StepReport report;
    builder_.Rebuild(&contacts_, &report);
    return report.bits;
  }
  int ZoneOf(int particle) const { return contacts_.zone_of[particle]; }
  int IdOf(int particle) const { return contacts_.zones[ZoneOf(particle)].id; }

  std::shared_ptr<const Model> model_;
  ZoneBuilder builder_;
  Contacts contacts_;
};

// Which sheet particles are neighbours: a row of five along x, so 0 and 4 are far apart.
TEST_F(Zones, SeparateContactsAreSeparateZones) {
  Stick(0, 0);
  Stick(4, 4);
  EXPECT_EQ(Rebuild(), 0u);
  EXPECT_EQ(contacts_.zones.size(), 3u);  // and the rigid plate
  EXPECT_NE(ZoneOf(0), ZoneOf(4));
  EXPECT_EQ(ZoneOf(0), ZoneOf(model_->bodies[1].first_particle));
  EXPECT_EQ(ZoneOf(1), -1);
  EXPECT_EQ(contacts_.colliding_particles, 4);
  EXPECT_EQ(contacts_.zones[ZoneOf(0)].bodies, 2);
}

TEST_F(Zones, GrowMergeSplitShrinkAndVanishKeepTheLargestPartsNumber) {
  Stick(0, 0);
  Stick(4, 4);
  Rebuild();
  const int left = IdOf(0), right = IdOf(4);
  Stick(1, 1);  // grows the left one
  Rebuild();
  EXPECT_EQ(IdOf(0), left);
  EXPECT_EQ(IdOf(1), left);
  Stick(2, 2);
  Stick(3, 3);  // closes the gap: they merge
  Rebuild();
  EXPECT_EQ(IdOf(4), IdOf(0));
  EXPECT_EQ(IdOf(0), left);
  contacts_.bonds.erase(contacts_.bonds.begin() +
                        3);  // particle 2 leaves: a split that the paper's rule cannot make
  Rebuild();
  EXPECT_NE(IdOf(0), IdOf(4));
  EXPECT_EQ(IdOf(0), left);
  EXPECT_NE(IdOf(4), right);  // a number is never used again
  contacts_.bonds.clear();
  Rebuild();
  EXPECT_EQ(contacts_.zones.size(), 1u);
  EXPECT_EQ(contacts_.colliding_particles, 0);
}

TEST_F(Zones, TellWhetherAnyHasLostMembers) {
  StepReport report;
  const auto parts = [&] { return builder_.Rebuild(&contacts_, &report); };
  Stick(0, 0);
  Stick(4, 4);
  EXPECT_FALSE(parts());  // new
  for (int k : {1, 2, 3}) Stick(k, k);
  EXPECT_FALSE(parts());  // two have become one
  EXPECT_FALSE(parts());  // as it was
  contacts_.bonds.erase(contacts_.bonds.begin() + 3);
  EXPECT_TRUE(parts());  // one is two, and a pair is in none
  EXPECT_FALSE(parts());
  contacts_.bonds.clear();
  EXPECT_TRUE(parts());  // they are gone
}

TEST_F(Zones, DoNotDependOnTheOrderOfBonds) {
  for (int k : {3, 0, 2, 1}) Stick(k, k);
  Rebuild();
  const std::vector<std::int32_t> shuffled = contacts_.zone_of;
  contacts_.bonds.clear();
  for (int k : {0, 1, 2, 3}) Stick(k, k);
  Rebuild();
  EXPECT_EQ(contacts_.zone_of, shuffled);
}

TEST_F(Zones, ARigidBodyIsOneZoneWithWhatSticksToIt) {
  Rebuild();
  const int plate = model_->bodies[2].first_particle;
  ASSERT_GE(ZoneOf(plate), 0);
  EXPECT_EQ(contacts_.zones[ZoneOf(plate)].count, 4);
  EXPECT_EQ(contacts_.zones[ZoneOf(plate)].rigid_body, 2);
  Bond bond;
  bond.particle = plate + 1;
  bond.triangle = 0;
  bond.vertices = {7, -1, -1};
  contacts_.bonds.push_back(bond);
  Rebuild();
  EXPECT_EQ(ZoneOf(7), ZoneOf(plate));
  EXPECT_EQ(contacts_.zones[ZoneOf(plate)].count, 5);
}

TEST_F(Zones, ToolsThatDisagreeAreKeptApart) {
  HoldByTool(0, 1);
  HoldByTool(1, 2);  // neighbours in the mesh, held by different tools
  EXPECT_EQ(Rebuild(), 0u);
  EXPECT_NE(ZoneOf(1), ZoneOf(2));
  EXPECT_EQ(contacts_.zones[ZoneOf(1)].tool, 0);
  EXPECT_EQ(contacts_.zones[ZoneOf(2)].tool, 1);
  // One particle that both hold: the second loses it, and the report says so.
  HoldByTool(1, 1);
  EXPECT_EQ(Rebuild(), static_cast<std::uint32_t>(kStepZoneSplitForced));
  EXPECT_EQ(contacts_.zones[ZoneOf(1)].tool, 0);
  EXPECT_EQ(contacts_.bonds.size(), 2u);
}

}  // namespace
}  // namespace adhesim::test
