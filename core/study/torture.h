#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/study/stress_cases.h"

namespace adhesim {

// A scene that nobody would make: bodies of any kind, size, mass and stiffness, tools that push and
// pull anywhere, effects with parameters from decades. At most 500 particles. The same text for a
// seed on every machine.
std::string TortureScene(std::uint64_t seed);
// How long it is run, simulated: 0.3 to 2 s, shorter at high rates.
double TortureSeconds(std::uint64_t seed);

// Runs the scene of a seed and judges it as a case of stress. Frozen counts as failed: nothing in
// such a scene is invalid. Explicit steps that need more than 500 sub-steps may be refused.
StressResult RunTorture(std::uint64_t seed, double cpu_limit_s,
                        const std::function<bool()>& stop = nullptr);

}  // namespace adhesim
