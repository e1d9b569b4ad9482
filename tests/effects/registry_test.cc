#include "core/effects/registry.h"

#include <gtest/gtest.h>

#include "tests/support/effect_samples.h"

namespace adhesim::test {
namespace {

TEST(Registry, EveryEffectOfTheBuildHasASample) {
  for (std::string_view name : AvailableEffects()) {
    bool found = false;
    for (const EffectSample& sample : EffectSamples()) found = found || name == sample.name();
    EXPECT_TRUE(found) << name << ": write core/effects/" << name << "/samples.txt";
  }
}

TEST(Registry, RefusesAnEffectThatIsNotInTheBuild) {
  v1::Effect message;
  message.mutable_virtual_adhesive();  // contact, never a line of effects.def
  const auto effect = MakeEffect(Model(), message);
  ASSERT_FALSE(effect.ok());
  EXPECT_EQ(effect.status().message(),
            "effect 'virtual_adhesive' is not part of this build (ADHESIM_EFFECTS)");
}

}  // namespace
}  // namespace adhesim::test
