#include "common/core/ring_buffer.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <random>
#include <thread>

namespace tumbler {
namespace {

TEST(RingBuffer, ReturnsElementsInTheOrderTheyCame) {
  RingBuffer<int, 4> ring;
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(ring.Push(i));
  for (int i = 0; i < 4; ++i) {
    int element = -1;
    ASSERT_TRUE(ring.Pop(element));
    EXPECT_EQ(element, i);
  }
}

TEST(RingBuffer, RefusesWhenFullAndKeepsWhatItHolds) {
  RingBuffer<int, 2> ring;
  ASSERT_TRUE(ring.Push(1));
  ASSERT_TRUE(ring.Push(2));
  EXPECT_FALSE(ring.Push(3));
  EXPECT_EQ(ring.size(), 2U);
  int element = 0;
  ASSERT_TRUE(ring.Pop(element));
  EXPECT_EQ(element, 1);
  EXPECT_TRUE(ring.Push(3));
}

TEST(RingBuffer, LeavesTheArgumentAloneWhenEmpty) {
  RingBuffer<int, 2> ring;
  int element = 7;
  EXPECT_FALSE(ring.Pop(element));
  EXPECT_EQ(element, 7);
}

TEST(RingBuffer, AgreesWithADequeUnderRandomUse) {
  std::mt19937_64 random(3);
  RingBuffer<std::uint64_t, 16> ring;
  std::deque<std::uint64_t> model;
  for (int step = 0; step < 200'000; ++step) {
    if (random() % 2 == 0) {
      const std::uint64_t value = random();
      const bool room = model.size() < 16;
      ASSERT_EQ(ring.Push(value), room);
      if (room) model.push_back(value);
    } else {
      std::uint64_t value = 0;
      ASSERT_EQ(ring.Pop(value), !model.empty());
      if (!model.empty()) {
        ASSERT_EQ(value, model.front());
        model.pop_front();
      }
    }
    ASSERT_EQ(ring.size(), model.size());
  }
}

// An element so large that a torn or early read would show, since all its words are equal.
struct Wide {
  std::uint64_t words[9];
};

TEST(RingBuffer, HandsEveryElementWholeAndInOrderToAnotherThread) {
  constexpr std::uint64_t kCount = 300'000;
  RingBuffer<Wide, 64> ring;
  std::thread producer([&ring] {
    for (std::uint64_t i = 0; i < kCount;) {
      Wide element{};
      for (auto& word : element.words) word = i;
      if (ring.Push(element)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t mistakes = 0;
  std::uint64_t above_capacity = 0;
  for (std::uint64_t expected = 0; expected < kCount;) {
    if (ring.size() > ring.capacity()) ++above_capacity;
    Wide element{};
    if (!ring.Pop(element)) {
      std::this_thread::yield();
      continue;
    }
    for (const auto word : element.words) mistakes += word != expected ? 1 : 0;
    ++expected;
  }
  producer.join();
  EXPECT_EQ(mistakes, 0U);
  EXPECT_EQ(above_capacity, 0U);
  Wide element{};
  EXPECT_FALSE(ring.Pop(element));
}

}  // namespace
}  // namespace tumbler
