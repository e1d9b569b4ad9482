#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/model/bond_geometry.h"

namespace adhesim {
namespace {

// A particle of one body over a triangle of another, each with an area and a compliance of its own.
struct Sides {
  static constexpr double kWork_j_m2 = 0.3, kUpper_per_pa = 2e-4, kLower_per_pa = 5e-5;
  Model model;
  Bond bond;

  Sides() {
    model.triangles = {{1, 2, 3}};
    model.area_m2 = {4e-6, 9e-6, 9e-6, 9e-6};
    model.mass_kg = {1e-3, 1e-3, 1e-3, 1e-3};
    model.compliance_per_pa = {kUpper_per_pa, kLower_per_pa, kLower_per_pa, kLower_per_pa};
    model.adhesive.emplace();
    model.adhesive->work_of_adhesion_j_m2 = kWork_j_m2;
    bond.particle = 0;
    bond.triangle = 0;
    bond.vertices = {1, 2, 3};
  }
};

// sqrt(4 E* w / (pi h)) with 1 / E* the sum over the sides. Tolerance: a few roundings.
double ClosedForm(double compliance_per_pa, double work_j_m2, double size_m) {
  return std::sqrt(4 * work_j_m2 / (compliance_per_pa * std::numbers::pi * size_m));
}

TEST(CrackTraction, IsThatOfBothSidesComplianceAndOfItsMembersSize) {
  const Sides sides;
  const double both = Sides::kUpper_per_pa + Sides::kLower_per_pa;
  EXPECT_NEAR(CrackTraction(sides.bond, 0, sides.model, sides.model.area_m2[0]) /
                  ClosedForm(both, Sides::kWork_j_m2, 2e-3),
              1, 1e-14);
  EXPECT_NEAR(CrackTraction(sides.bond, 2, sides.model, sides.model.area_m2[2]) /
                  ClosedForm(both, Sides::kWork_j_m2, 3e-3),
              1, 1e-14);
}

TEST(CrackTraction, TakesARigidSideAsWithoutCompliance) {
  Sides sides;
  sides.model.compliance_per_pa[0] = 0;
  for (const int member : {0, 1}) {
    EXPECT_NEAR(CrackTraction(sides.bond, member, sides.model, sides.model.area_m2[member]) /
                    ClosedForm(Sides::kLower_per_pa, Sides::kWork_j_m2, member == 0 ? 2e-3 : 3e-3),
                1, 1e-14);
  }
}

TEST(CrackTraction, OfAToolsBondIsTheToolsOwnAndTheTissuesAlone) {
  Sides sides;
  sides.model.tools.emplace_back();
  sides.bond.particle = -1;
  sides.bond.tool = 0;
  EXPECT_EQ(CrackTraction(sides.bond, 1, sides.model, sides.model.area_m2[1]),
            std::numeric_limits<double>::infinity());
  sides.model.tools[0].work_of_adhesion_j_m2 = 7;
  EXPECT_NEAR(CrackTraction(sides.bond, 1, sides.model, sides.model.area_m2[1]) /
                  ClosedForm(Sides::kLower_per_pa, 7, 3e-3),
              1, 1e-14);
}

TEST(CrackTraction, IsInfiniteWithoutAWorkOfAdhesion) {
  Sides sides;
  sides.model.adhesive->work_of_adhesion_j_m2.reset();
  EXPECT_EQ(CrackTraction(sides.bond, 0, sides.model, sides.model.area_m2[0]),
            std::numeric_limits<double>::infinity());
}

TEST(LimitOf, TakesTheLesserOfStrengthAndTraction) {
  Model model;
  model.adhesive.emplace();
  model.adhesive->strength = {100, 300};
  const BondLimit limit = LimitOf(-1, true, 2, 1, model, 200);
  EXPECT_EQ(limit.normal_n, 200);  // its strength
  EXPECT_EQ(limit.shear_n, 400);   // the crack's
}

TEST(LimitOf, IsAToolsOwnAndNothingWhereItDoesNotStick) {
  Sides sides;
  sides.model.adhesive->strength = {1, 1};
  sides.model.tools.emplace_back();
  sides.model.tools[0].strength = {100, 300};
  sides.bond.tool = 0;
  const BondLimit limit = LimitOf(sides.bond, 1, sides.model);
  EXPECT_EQ(limit.normal_n, 100 * 9e-6);
  EXPECT_EQ(limit.shear_n, 300 * 9e-6);
  sides.bond.sticky = false;
  EXPECT_EQ(LimitOf(sides.bond, 1, sides.model).normal_n, 0);
}

}  // namespace
}  // namespace adhesim
