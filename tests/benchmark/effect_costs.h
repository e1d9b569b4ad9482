#pragma once

#include <string>

#include "core/model/simd.h"

namespace adhesim::bench {

struct EffectCostOptions {
  int steps = 200;
  int repeats = 5;
  bool count = true;  // instructions, if valgrind is installed
  Simd simd = BestSimd();
  std::string json;  // file to write, or empty
};

// What each effect of the build adds to a scene by itself: the samples of the effects' folders with
// and without it, in turn. CPU time of a step, heap, and instructions where valgrind is installed.
// Prints a table; returns an exit code.
int MeasureEffects(const EffectCostOptions& options);

// Steps a scene's text, for valgrind to watch. Returns an exit code.
int StepText(const std::string& file, int steps);

}  // namespace adhesim::bench
