#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/study/stress_cases.h"

namespace adhesim {

// A hard case in Bullet: the same start, the same conditions as far as they can be measured of it.
struct BulletCase {
  std::string not_expressible;  // why Bullet does not have the case; empty: it ran
  StressResult result;
};

// Bullet's deformable bodies by implicit steps, as its own demo of volumes. `dt_s`: absent: the
// scene's own. Judged are: finite; energy above what was put in, by our own law of the same moduli
// (not where bodies overlap at the start: what pushing them apart costs, Bullet does not tell);
// depth; shape; what the case shows. Books and forces of tools it does not have.
BulletCase RunBulletCase(const StressCase& stress_case, std::optional<double> dt_s,
                         const std::string& scenes_directory, double cpu_limit_s,
                         const std::function<bool()>& stop = nullptr);

}  // namespace adhesim
