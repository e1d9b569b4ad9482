// effect_probe SCENE STEPS: what stepping a scene takes. Prints the effects of the build, what the
// heap gave, the contacts and the hash at the end, a line each. One thread and the plainest
// instruction set: valgrind, which counts its instructions, stops at AVX-512.

#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "core/effects/registry.h"
#include "core/engine/engine.h"
#include "core/scene/build_model.h"
#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "tests/support/count_allocations.h"

namespace adhesim::test {
namespace {

int Run(const SceneFile& file, int steps) {
  const BuiltModel built = BuildModel(WithDefaults(file.scene), file.directory);
  if (!built.model) {
    std::cerr << file.Format(file.Located(built.problems));
    return 2;
  }
  const long allocations_before = allocations, bytes_before = allocated_bytes;
  auto engine = Engine::Create(built.model, {.threads = 1, .simd = Simd::kBaseline});
  if (!engine.ok()) {
    std::cerr << engine.status() << "\n";
    return 2;
  }
  const long made = allocations - allocations_before, bytes = allocated_bytes - bytes_before;
  const long before_steps = allocations;
  for (int k = 0; k < steps; ++k) (*engine)->Step({});
  const long in_steps = allocations - before_steps;
  std::printf("effects");
  for (std::string_view name : AvailableEffects()) std::printf(" %s", std::string(name).c_str());
  std::printf("\nallocations %ld\nbytes %ld\nallocations_in_steps %ld\n", made, bytes, in_steps);
  std::printf("colliding %d\n", (*engine)->state().contacts.colliding_particles);
  std::printf("hash %016llx\n", static_cast<unsigned long long>((*engine)->StateHash()));
  return 0;
}

}  // namespace
}  // namespace adhesim::test

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: effect_probe SCENE STEPS\n";
    return 2;
  }
  const adhesim::SceneFile file = adhesim::ReadSceneFile(argv[1]);
  if (!file.ok()) {
    std::cerr << file.Format(file.problems);
    return 2;
  }
  // A thread has a heap of its own, empty and on a page. The first thread's begins where the
  // program's data end, and reading leaves holes in it that differ between builds; the library's
  // copies take other instructions for other alignments.
  int exit_code = 2;
  std::thread([&] { exit_code = adhesim::test::Run(file, std::atoi(argv[2])); }).join();
  return exit_code;
}
