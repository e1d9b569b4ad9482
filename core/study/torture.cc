#include "core/study/torture.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <random>
#include <vector>

#include "core/scene/scene_file.h"

namespace adhesim {
namespace {

constexpr int kMostParticles = 500;

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed * 7919 + 13) {}
  double Between(double a, double b) {
    return a + (b - a) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  int Below(int n) { return static_cast<int>(engine_() % static_cast<unsigned>(n)); }
  bool Chance(double p) { return Between(0, 1) < p; }
  template <typename T>
  T Of(std::initializer_list<T> values) {
    return *std::next(values.begin(), Below(static_cast<int>(values.size())));
  }
  // Uniform in its exponent.
  double Decades(double from, double to) { return from * std::pow(to / from, Between(0, 1)); }
  Vec3 In(double half) {
    const double x = Between(-half, half), y = Between(-half, half);
    return {x, y, Between(-half, half)};
  }

 private:
  std::mt19937_64 engine_;
};

std::string Text(const Vec3& v) {
  return absl::StrFormat("[%.4f, %.4f, %.4f]", v.x(), v.y(), v.z());
}

class Writer {
 public:
  explicit Writer(std::uint64_t seed) : draw_(seed), seed_(seed) {
    tissue_ = draw_.Chance(0.6);
    rate_hz_ = tissue_ ? draw_.Of({60, 100, 200, 500, 1000}) : draw_.Of({500, 1000, 2000});
  }

  std::string Scene() {
    text_ = absl::StrCat("description: torture scene of seed ", seed_, ", to be run for ",
                         Seconds(), " s\nrate_hz: ", rate_hz_, "\nseed: ", seed_ + 1,
                         "\nintegration: {max_substeps: 500}\nbodies:\n");
    const int bodies = 1 + draw_.Below(5);
    const bool apart = draw_.Chance(0.8);
    for (int i = 0; i < bodies && particles_ < kMostParticles - 130; ++i) AddBody(i, apart);
    const int tools = draw_.Below(3);
    if (tools > 0) absl::StrAppend(&text_, "tools:\n");
    for (int i = 0; i < tools; ++i) AddTool(i);
    AddEffects();
    return std::move(text_);
  }

  // At most 600 steps.
  double Seconds() const { return std::max(0.3, std::min(2.0, 400.0 / rate_hz_)); }

 private:
  Vec3 Place(bool apart) {
    Vec3 at;
    const double spacing_m = apart ? 0.075 : 0.03;
    for (int attempt = 0; attempt < 200; ++attempt) {
      at = draw_.In(0.06 * (1 + 0.02 * attempt));
      const auto near = [&](const Vec3& other) { return (at - other).norm() < spacing_m; };
      if (std::none_of(placed_.begin(), placed_.end(), near)) break;
    }
    placed_.push_back(at);
    return at;
  }

  void AddBody(int index, bool apart) {
    const Vec3 at = Place(apart);
    absl::StrAppend(&text_, "  - {name: b", index, ", ");
    const int kind = draw_.Below(10);
    const bool sheet = kind >= 8, filled = tissue_ && !sheet && draw_.Chance(0.7);
    if (kind < 4) {
      const int subdivisions = draw_.Below(2);
      absl::StrAppendFormat(&text_, "icosphere: {radius_m: %.4f, subdivisions: %d}",
                            draw_.Between(0.012, 0.036), subdivisions);
      particles_ += subdivisions == 0 ? 12 : 42;
    } else if (!sheet) {
      const double x = draw_.Decades(0.003, 0.04), y = draw_.Decades(0.003, 0.04);
      absl::StrAppendFormat(&text_, "block: {size_m: [%.4f, %.4f, %.4f]", x, y,
                            draw_.Decades(0.003, 0.04));
      if (!filled) absl::StrAppend(&text_, ", cells: ", 1 + draw_.Below(3));
      absl::StrAppend(&text_, "}");
      particles_ += 56;
    } else {
      const int columns = 2 + draw_.Below(6), rows = 2 + draw_.Below(6);
      absl::StrAppendFormat(&text_, "sheet: {length_m: %.4f, width_m: %.4f, columns: %d, rows: %d}",
                            draw_.Between(0.02, 0.07), draw_.Between(0.02, 0.07), columns, rows);
      particles_ += columns * rows;
    }
    if (filled) {
      absl::StrAppend(&text_, ", tetrahedra: {cells: ", 1 + draw_.Below(3), "}");
      particles_ += 64;
      any_filled_ = true;
    }
    const int held = draw_.Below(8);
    const bool rigid = held == 2 && !filled;
    if (!rigid && !sheet) ++closed_;
    if (!rigid && !filled) {
      absl::StrAppend(&surfaces_, surfaces_.empty() ? "" : ", ", "b", index);
    }
    const double mass_kg = draw_.Decades(0.001, 1);
    absl::StrAppendFormat(&text_, ", mass_kg: %.4g, position_m: %s, rotation_deg: %s", mass_kg,
                          Text(at), Text(draw_.In(180)));
    if (held == 0) {
      absl::StrAppend(&text_, ", fixed: [all: true]");
    } else if (held == 1) {
      absl::StrAppendFormat(&text_, ", fixed: [half_space: {point_m: %s, normal: [0, 0, 1]}]",
                            Text(at));
    } else {
      if (rigid) absl::StrAppend(&text_, ", kind: rigid");
      const double speed = draw_.Of({0.0, 0.1, 1.0});
      absl::StrAppendFormat(&text_, ", velocity_m_s: %s, angular_velocity_rad_s: %s",
                            Text(draw_.In(speed)), Text(draw_.In(10 * speed)));
    }
    absl::StrAppend(&text_, "}\n");
  }

  // From above, its shaft clear of every body, then anywhere.
  void AddTool(int index) {
    const double angle = draw_.Between(-0.6, 0.6);
    const Vec3 start(draw_.Between(-0.05, 0.05), 0.1 * index - 0.05, 0.16);
    absl::StrAppend(&text_, "  - name: t", index, "\n");
    if (draw_.Chance(0.7)) {
      absl::StrAppendFormat(&text_, "    needle: {length_m: 0.12, radius_m: %.4g}\n",
                            draw_.Decades(0.0005, 0.01));
    } else {
      absl::StrAppend(&text_, "    lancet: {}\n");
    }
    absl::StrAppendFormat(&text_,
                          "    position_m: %s\n    orientation_wxyz: [%.6f, %.6f, 0, 0]\n"
                          "    coupling: {max_speed_m_s: %g, max_force_n: %g}\n",
                          Text(start), std::cos(0.5 * angle), std::sin(0.5 * angle),
                          draw_.Of({0.5, 2.0, 10.0}), draw_.Of({2.0, 10.0, 50.0}));
    if (draw_.Chance(0.6)) {
      absl::StrAppendFormat(&text_, "    adhesion: {normal_strength_pa: %.3g}\n",
                            draw_.Decades(10, 1e6));
    }
    absl::StrAppendFormat(&text_, "    trajectory:\n      - {t_s: 0, position_m: %s}\n",
                          Text(start));
    double t_s = 0;
    for (int i = 0, n = 2 + draw_.Below(5); i < n; ++i) {
      t_s += draw_.Decades(0.001, 0.5);
      absl::StrAppendFormat(&text_, "      - {t_s: %.4f, position_m: %s}\n", t_s,
                            Text(draw_.In(0.06)));
    }
  }

  void AddEffects() {
    absl::StrAppend(&text_, "effects:\n");
    if (any_filled_) {
      absl::StrAppendFormat(
          &text_,
          "  - elasticity: {young_modulus_pa: %.4g, poisson_ratio: %.3g, model: %s, "
          "stiffness_damping_s: %g}\n",
          draw_.Decades(100, 1e7), draw_.Of({0.0, 0.3, 0.45, 0.49}),
          draw_.Chance(0.7) ? "corotational" : "neo_hookean", draw_.Of({0.0, 0.001, 0.01}));
    }
    if (!surfaces_.empty()) {
      absl::StrAppendFormat(
          &text_, "  - shape_memory: {bodies: [%s], stiffness_n_m: %.4g, damping_n_s_m: %g}\n",
          surfaces_, draw_.Decades(1, 500), draw_.Of({0.0, 0.02, 0.1}));
    }
    // Tissue's nu says how incompressible it is; sheets have no volume.
    if (!any_filled_ && closed_ > 0 && draw_.Chance(0.5)) {
      absl::StrAppend(&text_, "  - volume_preservation: {}\n");
    }
    if (draw_.Chance(0.4)) absl::StrAppend(&text_, "  - uniform_gravity: {}\n");
    if (draw_.Chance(0.5)) {
      absl::StrAppendFormat(&text_,
                            "  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: %.3g}\n",
                            draw_.Decades(1, 30));
    }
    if (draw_.Chance(0.3)) {
      absl::StrAppendFormat(&text_, "  - drag: {rate_per_s: %.3g}\n", draw_.Decades(0.1, 20));
    }
    AddAdhesive();
  }

  void AddAdhesive() {
    absl::StrAppendFormat(&text_, "  - virtual_adhesive: {capture_distance_m: %g",
                          draw_.Of({0.0005, 0.001, 0.002}));
    const bool strength = draw_.Chance(0.8);
    if (strength) {
      absl::StrAppendFormat(&text_, ", normal_strength_pa: %.3g",
                            draw_.Chance(0.2) ? 0 : draw_.Decades(1, 1e5));
    }
    // Friction needs masses on the surface, which carried ones have not.
    if (strength && !any_filled_ && draw_.Chance(0.3)) {
      absl::StrAppend(&text_, ", friction_coefficient: ", draw_.Of({0.0, 0.3, 2.0}));
    }
    if (draw_.Chance(0.2)) {
      absl::StrAppendFormat(&text_, ", bell: {rate_per_s: %.3g, force_n: %.3g}",
                            draw_.Decades(0.1, 1e5), draw_.Decades(1e-5, 0.1));
    }
    if (draw_.Chance(0.2)) {
      absl::StrAppendFormat(&text_, ", patch_size_m: %.3g", draw_.Between(0.005, 0.03));
    }
    if (draw_.Chance(0.2)) absl::StrAppend(&text_, ", self_collision: true");
    absl::StrAppend(&text_, "}\n");
  }

  Draw draw_;
  std::uint64_t seed_;
  bool tissue_ = false, any_filled_ = false;
  int rate_hz_ = 1000, particles_ = 0, closed_ = 0;
  std::string surfaces_;  // names of bodies without tetrahedra
  std::vector<Vec3> placed_;
  std::string text_;
};

}  // namespace

std::string TortureScene(std::uint64_t seed) { return Writer(seed).Scene(); }
double TortureSeconds(std::uint64_t seed) { return Writer(seed).Seconds(); }

StressResult RunTorture(std::uint64_t seed, double cpu_limit_s, const std::function<bool()>& stop) {
  StressCase stress_case{};
  stress_case.duration_s = TortureSeconds(seed);
  StressResult result = RunStressScene(
      stress_case, ParseScene(TortureScene(seed), absl::StrCat("torture-", seed, ".yaml"), "."),
      cpu_limit_s, stop);
  if (result.outcome == StressOutcome::kFrozen) {
    result.outcome = StressOutcome::kFailed;
    result.cause = absl::StrCat("frozen: ", result.cause);
  }
  return result;
}

}  // namespace adhesim
