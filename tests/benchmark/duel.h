#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>
#include <vector>

#include "core/model/model.h"
#include "core/model/simd.h"

namespace adhesim::bench {

// One run of a scene by our engine and by Bullet, side by side in this thread.
struct Repeat {
  double ours_ms = 0, bullet_ms = 0;  // median CPU time of a whole step in the measured half
  double ratio() const { return ours_ms / bullet_ms; }
};

struct StageCost {
  std::string name;
  double median_us = 0;  // wall time, of the last repeat
};

// What the repeats of a scene gave. Medians are over the repeats.
struct Result {
  std::vector<Repeat> repeats;
  bool has_bullet = false;
  double ours_ms = 0, ours_p99_ms = 0, bullet_ms = 0, bullet_p99_ms = 0;
  double ratio = 0, ratio_min = 0, ratio_max = 0;
  double colliding_share = 0;       // mean share of particles that collide, of ours
  double peak_colliding_share = 0;  // at most
  double bullet_contacts = 0;       // mean of vertex-face contacts
  bool bullet_finite = true;
  std::vector<StageCost> stages;
};

struct DuelOptions {
  int steps = 0;         // of each run
  int measure_from = 0;  // < steps
  int repeats = 1;
  Simd simd = BestSimd();  // of our engine
};

// Runs both: chunks of steps of one and of the other in turn, so that a slow moment of the machine
// falls on both. CPU time of this thread. Errors: the engine's; Internal when it froze.
absl::StatusOr<Result> Compare(std::shared_ptr<const Model> model, const DuelOptions& options);

}  // namespace adhesim::bench
