// Queries allocate nothing: operator new and Bullet's own allocator count here.
#include <LinearMath/btAlignedAllocator.h>
#include <gtest/gtest.h>

#include "core/tools/coupling.h"
#include "tests/support/count_allocations.h"
#include "tests/tools/tools_for_test.h"

namespace {

void* BulletAlloc(std::size_t size, int alignment) {
  return adhesim::test::CountedAlloc(size, alignment);
}

}  // namespace

namespace adhesim {
namespace {

TEST(ToolQueries, AllocateNothing) {
  btAlignedAllocSetCustomAligned(BulletAlloc, [](void* p) { std::free(p); });
  {
    const TriangleMesh plate = BoxMesh(Vec3(0, 0, -0.0005), Vec3(0.1, 0.1, 0.001), 10);
    const auto tools = MakeTools({Needle(), Lancet()}, {plate});
    const std::vector<Pose> poses = {{Vec3(0, 0, 0.01), Quat::Identity()},
                                     {Vec3(0, 0.001, 0.01), Quat::Identity()}};
    ASSERT_GT(test::allocations, 0) << "the counters do not work";
    const long before = test::allocations;
    Numbers numbers;
    double sum = 0;
    for (int round = 0; round < 100; ++round) {
      const Vec3 a = numbers.InBox(0.01);
      ToolSet::Nearest nearest{};
      tools->NearestOnTriangle(round % 2, poses[0], a, a + numbers.InBox(0.01),
                               a + numbers.InBox(0.01), 0.01, &nearest);
      Vec3 normal;
      // The two tools overlap, so that Bullet's way out of an overlap runs as well.
      sum += tools->Sweep(round % 2, poses[round % 2], {Vec3(0, 0, -0.01) + a, Quat::Identity()},
                          poses, &normal);
      sum += tools->Bounds(round % 2, poses[0]).min.x();
      const auto result =
          FollowTarget({}, poses[0], {}, poses[1], ToolInertia(Needle(), {}), {}, 1e-3);
      sum += Advance(poses[0], result.twist, 1e-3).position_m.x();
    }
    EXPECT_EQ(test::allocations - before, 100 * 0) << sum;
  }
  btAlignedAllocSetCustomAligned(nullptr, nullptr);
}

}  // namespace
}  // namespace adhesim
