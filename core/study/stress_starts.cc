#include "core/study/stress_starts.h"

#include <cmath>
#include <random>

#include "core/model/carried.h"
#include "core/tools/coupling.h"

namespace adhesim {
namespace {

constexpr double kJitterM = 0.005;
constexpr double kLost = 0.3;
constexpr int kLatenesses = 9;  // 0 to 40 ms
constexpr double kLatenessS = 0.005;

Aabb BoxOf(const std::vector<Vec3>& position_m) {
  Aabb box;
  for (const Vec3& x : position_m) box.Add(x);
  return box;
}

// Uniform in [-1, 1)^3; the library's distributions differ between platforms.
Vec3 Uniform(std::mt19937* random) {
  const auto one = [random] { return (*random)() * 0x1p-31 - 1; };
  const double x = one(), y = one();
  return {x, y, one()};
}

// Depends on its arguments only, so that a run that starts again sees the same.
unsigned Draw(std::uint64_t step, unsigned salt) {
  std::seed_seq seed{static_cast<unsigned>(step), salt};
  return std::mt19937(seed)();
}

}  // namespace

void Flatten(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  for (Vec3& x : *position_m) x.z() = 0.5 * (box.min.z() + box.max.z());
}

void Collapse(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  for (Vec3& x : *position_m) x = 0.5 * (box.min + box.max);
}

void TurnInsideOut(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  for (Vec3& x : *position_m) x.z() = box.min.z() + box.max.z() - x.z();
}

void Strew(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  std::mt19937 random(7);
  for (Vec3& x : *position_m) x += 0.125 * (box.max - box.min).cwiseProduct(Uniform(&random));
}

void Scramble(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  std::mt19937 random(7);
  for (Vec3& x : *position_m) {
    x = 0.5 * (box.min + box.max + (box.max - box.min).cwiseProduct(Uniform(&random)));
  }
}

void TwistFourTurns(const Model&, std::vector<Vec3>* position_m) {
  const Aabb box = BoxOf(*position_m);
  const Vec3 middle = 0.5 * (box.min + box.max);
  for (Vec3& x : *position_m) {
    const double angle = 8 * M_PI * (x.x() - box.min.x()) / (box.max.x() - box.min.x());
    x = middle + Eigen::AngleAxisd(angle, Vec3::UnitX()) * (x - middle);
  }
}

void StretchTenfold(const Model&, std::vector<Vec3>* position_m) {
  for (Vec3& x : *position_m) x.x() *= 10;
}

void StartFrom(Spoil spoil, Engine* engine) {
  State start = engine->state();
  spoil(engine->model(), &start.position_m);
  Carry(engine->model(), start.position_m);
  engine->Restore(start);
}

void Jitter(const Engine& engine, std::vector<ToolInput>* inputs) {
  const State& state = engine.state();
  for (std::size_t t = 0; t < inputs->size(); ++t) {
    ToolInput& input = (*inputs)[t];
    input.has_target = true;
    input.target = PoseAt(engine.model().tools[t].trajectory, state.time_s + engine.model().dt_s);
    if (state.step % 2 == 1) input.target.position_m += Vec3(kJitterM, 0, 0);
  }
}

void LosePoses(const Engine& engine, std::vector<ToolInput>* inputs) {
  const State& state = engine.state();
  for (std::size_t t = 0; t < inputs->size(); ++t) {
    ToolInput& input = (*inputs)[t];
    input.has_target = true;
    input.target = state.tools[t].target;  // what came last
    if (Draw(state.step, 2 * t) < kLost * 0x1p32) continue;
    const double late_s = kLatenessS * (Draw(state.step, 2 * t + 1) % kLatenesses);
    input.target = PoseAt(engine.model().tools[t].trajectory,
                          std::max(0.0, state.time_s + engine.model().dt_s - late_s));
  }
}

}  // namespace adhesim
