#include "core/scene/quantity.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace adhesim {
namespace {

double Parse(const std::string& text, const std::string& field) {
  const absl::StatusOr<double> value = ParseQuantity(text, DimensionOf(field));
  return value.ok() ? *value : std::numeric_limits<double>::quiet_NaN();
}

std::string Error(const std::string& text, const std::string& field) {
  return std::string(ParseQuantity(text, DimensionOf(field)).status().message());
}

TEST(Quantity, GivesTheSameBitsInEveryDecimalUnit) {
  EXPECT_EQ(Parse("18 mm", "radius_m"), 0.018);
  EXPECT_EQ(Parse("9mm", "radius_m"), 0.009);  // 9 * 0.001 would be 0.009000000000000001
  EXPECT_EQ(Parse("1.8e1 mm", "radius_m"), 0.018);
  EXPECT_EQ(Parse("+1.8 cm", "radius_m"), 0.018);
  EXPECT_EQ(Parse("0.018", "radius_m"), 0.018);
  EXPECT_EQ(Parse("3 kPa", "normal_strength_pa"), 3000);
  EXPECT_EQ(Parse("7 g", "mass_kg"), 0.007);
  EXPECT_EQ(Parse("2 N/mm", "stiffness_n_m"), 2000);
  EXPECT_EQ(Parse("2 N*s/m", "damping_n_s_m"), 2);
  EXPECT_EQ(Parse("30 deg", "rotation_deg"), 30);
  EXPECT_EQ(Parse("1 kHz", "rate_hz"), 1000);
  EXPECT_EQ(Parse("5 N m/rad", "angular_stiffness_nm_rad"), 5);
  EXPECT_EQ(Parse("-9.81 m/s^2", "acceleration_m_s2"), -9.81);
}

TEST(Quantity, ReadsAngles) {
  // One multiplication by 180/pi: two roundings.
  EXPECT_NEAR(Parse("1 rad", "rotation_deg"), 57.29577951308232, 1e-13);
  EXPECT_NEAR(Parse("180 deg/s", "angular_velocity_rad_s"), 3.141592653589793, 1e-14);
}

TEST(Quantity, TakesTheDimensionFromTheLongestSuffix) {
  EXPECT_EQ(DimensionOf("stiffness_n_m")->name, "a stiffness");
  EXPECT_EQ(DimensionOf("damping_n_s_m")->name, "a damping");
  EXPECT_EQ(DimensionOf("velocity_m_s")->name, "a velocity");
  EXPECT_EQ(DimensionOf("max_torque_nm")->name, "a torque");
  EXPECT_EQ(DimensionOf("t_s")->name, "a time");
  EXPECT_EQ(DimensionOf("stability_fraction"), nullptr);
}

TEST(Quantity, NamesThePermittedUnitsOfAWrongOne) {
  EXPECT_EQ(Error("18 kg", "radius_m"),
            "'kg' is not a unit of a length here; permitted: m, mm, cm, um, \u00b5m");
  EXPECT_NE(Error("3 mm", "stability_fraction").find("without a unit"), std::string::npos);
}

TEST(Quantity, RefusesEverythingButFiniteDecimals) {
  for (const char* text :
       {".nan", ".inf",  "-.inf", "nan",           "inf",  "Infinity", "0x10", "0o17",
        "010",  "1_000", "1,5",   "1.2.3",         "true", "",         "-",    ".",
        "e5",   "1e999", "--1",   "1e99999999999", "soft", "1 2"}) {
    EXPECT_FALSE(ParseQuantity(text, nullptr).ok()) << text;
    EXPECT_FALSE(ParseQuantity(text, DimensionOf("radius_m")).ok()) << text;
  }
  for (const char* text : {"0", "-0", "1.", ".5", "1e3", "1E-3", "0.5", "+2"}) {
    EXPECT_TRUE(ParseQuantity(text, nullptr).ok()) << text;
  }
}

TEST(Quantity, RefusesWholeNumbersThatDoNotFit) {
  EXPECT_EQ(*ParseUnsigned("18446744073709551615", ~std::uint64_t{0}), ~std::uint64_t{0});
  for (const char* text : {"18446744073709551616", "-1", "1.0", "1e3", "010", "", "+", "0x1"}) {
    EXPECT_FALSE(ParseUnsigned(text, ~std::uint64_t{0}).ok()) << text;
  }
}

TEST(Quantity, WritesTheShortestNumberThatReadsBack) {
  EXPECT_EQ(NumberText(0.1), "0.1");
  EXPECT_EQ(NumberText(1000), "1000");
  EXPECT_EQ(NumberText(6e-4), "0.0006");
  EXPECT_EQ(NumberText(1e-9), "1.0e-09");
  EXPECT_EQ(NumberText(-1.5e300), "-1.5e+300");
}

}  // namespace
}  // namespace adhesim
