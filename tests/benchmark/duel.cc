#include "tests/benchmark/duel.h"

#include <time.h>

#include <algorithm>

#include "core/engine/engine.h"
#include "core/study/timing.h"
#include "tests/benchmark/bullet_soft_world.h"

namespace adhesim::bench {
namespace {

constexpr int kChunkSteps = 20;

double Median(std::vector<double> values) { return Percentile(std::move(values), 0.5); }

// Step times of both, and what was seen on the way.
struct Run {
  std::vector<double> ours_ms, bullet_ms;
  double colliding_sum = 0;
  double contacts_sum = 0;
  int colliding_peak = 0;
};

void StepOurs(Engine* engine, int from, int to, int measure_from, Run* run) {
  for (int k = from; k < to; ++k) {
    const double before = ThreadCpuMs();
    engine->Step({});
    const double spent = ThreadCpuMs() - before;
    if (k < measure_from) continue;
    run->ours_ms.push_back(spent);
    const int colliding = engine->state().contacts.colliding_particles;
    run->colliding_sum += colliding;
    run->colliding_peak = std::max(run->colliding_peak, colliding);
  }
}

void StepBullet(BulletSoftWorld* bullet, int from, int to, int measure_from, Run* run) {
  for (int k = from; k < to; ++k) {
    const double before = ThreadCpuMs();
    bullet->Step();
    const double spent = ThreadCpuMs() - before;
    if (k < measure_from) continue;
    run->bullet_ms.push_back(spent);
    run->contacts_sum += bullet->contacts();
  }
}

absl::StatusOr<Run> RunBoth(const std::shared_ptr<const Model>& model, const DuelOptions& options,
                            Result* result) {
  absl::StatusOr<std::unique_ptr<Engine>> engine =
      Engine::Create(model, {.threads = 1, .simd = options.simd});
  if (!engine.ok()) return engine.status();
  const std::unique_ptr<BulletSoftWorld> bullet = BulletSoftWorld::Create(*model);
  (*engine)->TimeStages(options.steps - options.measure_from);
  Run run;
  for (int k = 0; k < options.steps; k += kChunkSteps) {
    const int to = std::min(k + kChunkSteps, options.steps);
    StepOurs(engine->get(), k, to, options.measure_from, &run);
    if (bullet) StepBullet(bullet.get(), k, to, options.measure_from, &run);
  }
  if ((*engine)->frozen()) return absl::InternalError("the state became non-finite");
  result->stages.clear();
  for (const Engine::Stage& stage : (*engine)->stages()) {
    result->stages.push_back({stage.name, Median({stage.us.begin(), stage.us.end()})});
  }
  result->has_bullet = bullet != nullptr;
  result->bullet_finite = result->bullet_finite && (!bullet || bullet->finite());
  return run;
}

}  // namespace

absl::StatusOr<Result> Compare(std::shared_ptr<const Model> model, const DuelOptions& options) {
  Result result;
  std::vector<double> ours, ours_p99, bullet, bullet_p99, ratios;
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    absl::StatusOr<Run> run = RunBoth(model, options, &result);
    if (!run.ok()) return run.status();
    const Repeat& got =
        result.repeats.emplace_back(Repeat{Median(run->ours_ms), Median(run->bullet_ms)});
    ours.push_back(got.ours_ms);
    ours_p99.push_back(Percentile(run->ours_ms, 0.99));
    if (result.has_bullet) {
      bullet.push_back(got.bullet_ms);
      bullet_p99.push_back(Percentile(run->bullet_ms, 0.99));
      ratios.push_back(got.ratio());
    }
    // The same in every repeat, both being deterministic.
    const double steps = static_cast<double>(run->ours_ms.size());
    const double particles = model->particle_count();
    result.colliding_share = run->colliding_sum / steps / particles;
    result.peak_colliding_share = run->colliding_peak / particles;
    result.bullet_contacts = run->contacts_sum / steps;
  }
  result.ours_ms = Median(ours);
  result.ours_p99_ms = Median(ours_p99);
  result.bullet_ms = Median(bullet);
  result.bullet_p99_ms = Median(bullet_p99);
  result.ratio = Median(ratios);
  if (!ratios.empty()) {
    const auto [least, most] = std::minmax_element(ratios.begin(), ratios.end());
    result.ratio_min = *least;
    result.ratio_max = *most;
  }
  return result;
}

}  // namespace adhesim::bench
