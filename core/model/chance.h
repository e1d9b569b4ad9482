#pragma once

#include <cstdint>

namespace adhesim {

// e^x by arithmetic alone, so that every machine and every build gives the same bits; relative
// error below 1e-15 for |x| <= 700, beyond which x is cut.
double Exp(double x);

// A number in [0, 1) that depends on the three alone: chance without a sequence, so that neither
// order nor threads matter (the finaliser of SplitMix64; Steele, Lea and Flood 2014).
double Chance(std::uint64_t seed, std::uint64_t draw, std::uint64_t who);

}  // namespace adhesim
