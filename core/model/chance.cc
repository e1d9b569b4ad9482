#include "core/model/chance.h"

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

std::uint64_t Scramble(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

}  // namespace

double Exp(double x) {
  x = std::clamp(x, -700.0, 700.0);
  // x = k ln 2 + r with |r| <= ln 2 / 2; ln 2 in two parts, so that k times the first is exact.
  const double k = std::floor(x * 1.4426950408889634 + 0.5);
  const double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
  // Taylor's series: the first term left out is below 2e-17.
  double sum = 1;
  for (int n = 13; n >= 1; --n) sum = 1 + sum * r / n;
  return std::ldexp(sum, static_cast<int>(k));
}

double Chance(std::uint64_t seed, std::uint64_t draw, std::uint64_t who) {
  const std::uint64_t bits = Scramble(Scramble(Scramble(seed) ^ draw) ^ who);
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

}  // namespace adhesim
