#include "core/bounded_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace parallax {
namespace {

TEST(BoundedQueue, FirstInFirstOut) {
  BoundedQueue<int> queue(3);
  EXPECT_TRUE(queue.push(1));
  EXPECT_TRUE(queue.push(2));
  EXPECT_EQ(queue.size(), 2u);
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.try_pop(), 2);
  EXPECT_EQ(queue.try_pop(), std::nullopt);
}

TEST(BoundedQueue, TryPushRefusesWhenFullAndKeepsTheValue) {
  BoundedQueue<std::unique_ptr<int>> queue(1);
  auto one = std::make_unique<int>(1), two = std::make_unique<int>(2);
  EXPECT_TRUE(queue.try_push(one));
  EXPECT_EQ(one, nullptr);
  EXPECT_FALSE(queue.try_push(two));
  ASSERT_NE(two, nullptr);
  EXPECT_EQ(*two, 2);
}

TEST(BoundedQueue, DropOldestKeepsTheNewest) {
  BoundedQueue<int> queue(2);
  EXPECT_EQ(queue.push_drop_oldest(1), std::nullopt);
  EXPECT_EQ(queue.push_drop_oldest(2), std::nullopt);
  EXPECT_EQ(queue.push_drop_oldest(3), 1);
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_EQ(queue.pop(), 3);
  queue.close();
  EXPECT_EQ(queue.push_drop_oldest(4), 4);
}

TEST(BoundedQueue, CloseDeliversWhatIsThereAndThenEnds) {
  BoundedQueue<int> queue(2);
  queue.push(1);
  queue.close();
  EXPECT_FALSE(queue.push(2));
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, WaitersAreWokenByCloseAndByStop) {
  BoundedQueue<int> empty(1), full(1);
  full.push(1);
  bool popped = true, pushed = true, popped_after_close = true;
  {
    std::jthread popper([&](std::stop_token stop) { popped = empty.pop(stop).has_value(); });
    std::jthread pusher([&](std::stop_token stop) { pushed = full.push(2, stop); });
  }  // asked to stop and joined
  EXPECT_FALSE(popped);
  EXPECT_FALSE(pushed);
  EXPECT_EQ(full.size(), 1u);
  {
    std::jthread popper([&] { popped_after_close = empty.pop().has_value(); });
    empty.close();
  }
  EXPECT_FALSE(popped_after_close);
}

TEST(BoundedQueue, EverythingArrivesOnceFromManyThreads) {
  constexpr int kThreads = 3, kEach = 2000;
  BoundedQueue<int> queue(4);
  std::vector<int> seen(kThreads * kEach, 0);
  std::size_t most = 0;
  {
    std::vector<std::jthread> pushers;
    for (int t = 0; t < kThreads; ++t) {
      pushers.emplace_back([&queue, t] {
        for (int i = 0; i < kEach; ++i) queue.push(t * kEach + i);
      });
    }
    std::vector<int> last(kThreads, -1);
    for (int n = 0; n < kThreads * kEach; ++n) {
      most = std::max(most, queue.size());
      const int value = *queue.pop();
      ++seen[static_cast<std::size_t>(value)];
      int& before = last[static_cast<std::size_t>(value / kEach)];
      EXPECT_LT(before, value);  // each thread's values in their order
      before = value;
    }
  }
  EXPECT_LE(most, queue.capacity());
  for (const int count : seen) EXPECT_EQ(count, 1);
}

}  // namespace
}  // namespace parallax
