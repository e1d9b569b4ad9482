#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>

#include "core/scene/scene_file.h"
#include "core/scene/validate.h"
#include "tests/scene/sample_scene.h"

namespace adhesim {
namespace {

// std::mt19937_64 gives the same numbers everywhere; the distributions of the standard library do
// not.
std::size_t Below(std::mt19937_64* random, std::size_t limit) { return (*random)() % limit; }

// One to three edits: a byte replaced, removed, inserted, or a piece copied elsewhere.
std::string Mutated(std::string text, std::mt19937_64* random) {
  constexpr char kLikely[] = " \n\t:-[]{},&*!|>'\"#%@?0123456789.eEx_~<=a\\\xff\xc3\xa9";
  const int edits = 1 + static_cast<int>(Below(random, 3));
  for (int i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = Below(random, text.size());
    const char byte = kLikely[Below(random, sizeof(kLikely))];
    switch (Below(random, 4)) {
      case 0:
        text[at] = byte;
        break;
      case 1:
        text.erase(at, 1 + Below(random, 20));
        break;
      case 2:
        text.insert(at, 1, byte);
        break;
      default:
        text.insert(at, text.substr(Below(random, text.size()), 1 + Below(random, 40)));
    }
  }
  return text;
}

TEST(SceneFuzz, EveryMutationOfASceneIsReadOrRefusedWithAPlace) {
  std::mt19937_64 random(1);
  int accepted = 0, refused = 0;
  for (int i = 0; i < 4000; ++i) {
    const SceneFile file = ParseScene(Mutated(SampleScene(), &random), "fuzz.yaml", "");
    if (file.ok()) {
      ++accepted;
      ASSERT_TRUE(ValidateScene(WithDefaults(file.scene)).empty()) << file.text;
    } else {
      ++refused;
      for (const Problem& problem : file.problems) {
        ASSERT_GE(problem.line, 1);
        ASSERT_GE(problem.column, 1);
        ASSERT_FALSE(problem.message.empty());
      }
      ASSERT_FALSE(file.Format(file.problems).empty());
    }
  }
  // Both ways are walked often: some edits only touch comments, names or digits.
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace adhesim
