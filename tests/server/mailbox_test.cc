#include "server/mailbox.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace adhesim {
namespace {

TEST(NewestWins, ShowsTheNewestAndSaysWhatWasOvertaken) {
  NewestWins<int> mailbox;
  EXPECT_FALSE(mailbox.Update());
  mailbox.back() = 1;
  EXPECT_FALSE(mailbox.Publish());
  mailbox.back() = 2;
  EXPECT_TRUE(mailbox.Publish());  // 1 was never seen
  EXPECT_TRUE(mailbox.Update());
  EXPECT_EQ(mailbox.front(), 2);
  EXPECT_FALSE(mailbox.Update());
  EXPECT_EQ(mailbox.front(), 2);
}

TEST(NewestWins, LetsTheWriterReadWhatItPublishedLast) {
  NewestWins<int> mailbox;
  for (int i = 1; i <= 5; ++i) {
    mailbox.back() = i;
    mailbox.Publish();
    EXPECT_EQ(mailbox.published(), i);
    if (i % 2 == 0) mailbox.Update();
  }
}

TEST(NewestWins, KeepsTheCapacityOfArrays) {
  NewestWins<std::vector<int>> mailbox([] {
    std::vector<int> values;
    values.reserve(100);
    return values;
  });
  for (int i = 0; i < 3; ++i) {
    EXPECT_GE(mailbox.back().capacity(), 100u);
    mailbox.Publish();
    mailbox.Update();
  }
}

TEST(NewestWins, NeverShowsATornOrAnOlderValue) {
  constexpr std::uint64_t kValues = 200'000;
  NewestWins<std::array<std::uint64_t, 16>> mailbox;
  std::uint64_t overtaken = 0;
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kValues; ++i) {
      mailbox.back().fill(i);
      overtaken += mailbox.Publish();
    }
  });
  std::uint64_t last = 0;
  std::uint64_t seen = 0;
  while (last < kValues) {
    if (!mailbox.Update()) continue;
    const auto& value = mailbox.front();
    for (const std::uint64_t part : value) ASSERT_EQ(part, value[0]);
    ASSERT_GT(value[0], last);
    last = value[0];
    ++seen;
  }
  writer.join();
  EXPECT_EQ(seen + overtaken, kValues);  // each value was seen or counted
}

TEST(BoundedQueue, KeepsOrderAndRefusesWhenFull) {
  BoundedQueue<int, 4> queue;
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.Push(i));
  EXPECT_FALSE(queue.Push(4));
  int value = -1;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(queue.Pop(&value));
    EXPECT_EQ(value, i);
  }
  EXPECT_FALSE(queue.Pop(&value));
}

TEST(BoundedQueue, LosesNothingBetweenThreads) {
  constexpr int kValues = 10'000;
  BoundedQueue<int, 8> queue;
  std::thread writer([&] {
    for (int i = 0; i < kValues; ++i) {
      while (!queue.Push(i)) std::this_thread::yield();
    }
  });
  for (int i = 0; i < kValues; ++i) {
    int value = -1;
    while (!queue.Pop(&value)) std::this_thread::yield();
    ASSERT_EQ(value, i);
  }
  writer.join();
}

}  // namespace
}  // namespace adhesim
