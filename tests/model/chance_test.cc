#include "core/model/chance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace adhesim {
namespace {

TEST(Chance, ExpAgreesWithTheLibrarys) {
  for (double x = -699.5; x < 700; x += 0.37) {
    EXPECT_NEAR(Exp(x) / std::exp(x), 1, 1e-14)
        << x;  // the argument's own rounding at 700: 1e-13/7
  }
  EXPECT_EQ(Exp(0), 1);
  EXPECT_EQ(Exp(1e9), Exp(700));
}

// Uniform to the extent that 1e5 draws can tell (standard deviation of a tenth's share: 1e-3), and
// without relation between neighbours.
TEST(Chance, IsUniformAndIndependentOfItsNeighbours) {
  const int count = 100000;
  int tenth[10] = {};
  double correlation[3] = {};
  for (int i = 0; i < count; ++i) {
    const double u = Chance(1, i, 2);
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    ++tenth[static_cast<int>(10 * u)];
    const double other[3] = {Chance(2, i, 2), Chance(1, i + 1, 2), Chance(1, i, 3)};
    for (int k = 0; k < 3; ++k) correlation[k] += 12 * (u - 0.5) * (other[k] - 0.5) / count;
  }
  for (int n : tenth) EXPECT_NEAR(n / static_cast<double>(count), 0.1, 5e-3);
  for (double c : correlation) EXPECT_NEAR(c, 0, 0.02);
}

}  // namespace
}  // namespace adhesim
