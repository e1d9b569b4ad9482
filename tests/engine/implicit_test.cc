// Implicit steps of whole engines: tissue that a tool presses.

#include <gtest/gtest.h>

#include "core/engine/engine.h"
#include "core/model/diagnostics.h"
#include "tests/support/engine_fixture.h"
#include "tests/support/pressed_block.h"

namespace adhesim {
namespace {

using test::EngineOf;
using test::PressedBlock;

TEST(ImplicitEngine, PressesAndLetsGo) {
  auto engine = EngineOf(ModelOf(PressedBlock{}));
  double peak = 0;
  for (int k = 0; k < 260; ++k) {
    engine->Step({});
    peak = std::max(peak, engine->state().tools[0].tissue.force_n.norm());
  }
  EXPECT_GT(peak, 0.1);
}

}  // namespace
}  // namespace adhesim
