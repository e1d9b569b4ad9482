#include "core/scene/copies.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <tuple>

namespace adhesim {
namespace {

// Darts for one copy. Random packing of spheres jams at about 38 % of the space; long before, darts
// hit by chance only.
constexpr int kMostDarts = 20'000;

// Uniform in [-1, 1): the standard's distributions differ from library to library.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  double Throw() { return static_cast<double>(engine_() >> 11) * 0x1p-52 - 1; }
  Vec3 ThrowVector() {
    const double x = Throw(), y = Throw(), z = Throw();
    return {x, y, z};
  }

 private:
  std::mt19937_64 engine_;
};

// Points in cubes as wide as the spacing: whoever is too near is in one of 27.
class Neighbourhood {
 public:
  explicit Neighbourhood(double spacing_m) : spacing_m_(spacing_m) {}

  bool HasRoom(const Vec3& p) const {
    const auto [x, y, z] = CubeOf(p);
    for (std::int64_t i = x - 1; i <= x + 1; ++i) {
      for (std::int64_t j = y - 1; j <= y + 1; ++j) {
        for (std::int64_t k = z - 1; k <= z + 1; ++k) {
          const auto [begin, end] = points_.equal_range({i, j, k});
          for (auto it = begin; it != end; ++it) {
            if ((it->second - p).squaredNorm() < spacing_m_ * spacing_m_) return false;
          }
        }
      }
    }
    return true;
  }
  void Add(const Vec3& p) { points_.emplace(CubeOf(p), p); }

 private:
  using Cube = std::tuple<std::int64_t, std::int64_t, std::int64_t>;
  Cube CubeOf(const Vec3& p) const {
    const auto index = [&](double x) {
      return static_cast<std::int64_t>(std::floor(x / spacing_m_));
    };
    return {index(p.x()), index(p.y()), index(p.z())};
  }

  const double spacing_m_;
  std::multimap<Cube, Vec3> points_;
};

Vec3 AnyRotation(Dice* dice) { return 180 * dice->ThrowVector(); }

absl::StatusOr<std::vector<CopyPlace>> Scatter(const v1::Copies& copies, Dice* dice) {
  Neighbourhood taken(copies.spacing_m());
  std::vector<CopyPlace> places;
  while (places.size() < copies.count()) {
    Vec3 p;
    int darts = 0;
    do {
      if (++darts > kMostDarts) {
        return absl::InvalidArgumentError(
            absl::StrCat("only ", places.size(), " of ", copies.count(), " copies at a spacing of ",
                         copies.spacing_m(), " m find room in a ball of radius ", copies.radius_m(),
                         " m; permitted: at most a third of its volume taken"));
      }
      p = dice->ThrowVector();
    } while (p.squaredNorm() > 1 || !taken.HasRoom(copies.radius_m() * p));
    taken.Add(copies.radius_m() * p);
    places.push_back({copies.radius_m() * p, AnyRotation(dice)});
  }
  return places;
}

// The lattice is the points of even coordinate sum among all integer points, times spacing /
// sqrt 2.
std::vector<CopyPlace> Pack(const v1::Copies& copies, Dice* dice) {
  using Site = std::array<int, 4>;  // distance squared, then the coordinates: ties by these
  std::vector<Site> sites;
  for (int radius = 1; sites.size() < copies.count(); ++radius) {
    sites.clear();
    for (int x = -radius; x <= radius; ++x) {
      for (int y = -radius; y <= radius; ++y) {
        for (int z = -radius; z <= radius; ++z) {
          const int distance_sq = x * x + y * y + z * z;
          if ((x + y + z) % 2 == 0 && distance_sq <= radius * radius) {
            sites.push_back({distance_sq, x, y, z});
          }
        }
      }
    }
  }
  std::sort(sites.begin(), sites.end());
  std::vector<CopyPlace> places;
  for (std::size_t i = 0; i < copies.count(); ++i) {
    const auto [distance_sq, x, y, z] = sites[i];
    places.push_back({copies.spacing_m() / std::sqrt(2.0) * Vec3(x, y, z), AnyRotation(dice)});
  }
  return places;
}

}  // namespace

absl::StatusOr<std::vector<CopyPlace>> PlaceCopies(const v1::Copies& copies, std::uint64_t seed) {
  Dice dice(seed);
  if (copies.has_radius_m()) return Scatter(copies, &dice);
  return Pack(copies, &dice);
}

}  // namespace adhesim
