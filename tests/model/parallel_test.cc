#include "core/model/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace adhesim {
namespace {

TEST(Parallel, CoversEveryIndexExactlyOnceForAnyNumberOfThreads) {
  for (int threads : {1, 2, 3, 7}) {
    Parallel parallel(threads);
    EXPECT_EQ(parallel.threads(), threads);
    for (int count : {0, 1, 2, 5, 64, 1000}) {
      std::vector<int> visits(count, 0);
      parallel.For(count, 1, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) ++visits[i];
      });
      EXPECT_EQ(std::count(visits.begin(), visits.end(), 1), count) << threads << " " << count;
    }
  }
}

// Plain ints: the thread sanitizer sees whether a loop's writes are visible to the caller and to
// the next loop.
TEST(Parallel, WritesOfALoopAreSeenByTheNext) {
  Parallel parallel(3);
  std::vector<int> a(300, 0), b(300, 0);
  for (int round = 0; round < 2000; ++round) {
    parallel.For(300, 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) a[i] = b[299 - i] + 1;
    });
    parallel.For(300, 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) b[i] = a[299 - i];
    });
  }
  EXPECT_EQ(std::accumulate(a.begin(), a.end(), 0), 300 * 2000);
}

TEST(Parallel, DoesNotSplitLessThanAGrain) {
  Parallel parallel(4);
  int calls = 0;
  parallel.For(100, 100, [&](int, int) { ++calls; });
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace adhesim
