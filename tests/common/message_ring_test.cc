#include "common/core/message_ring.h"

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <random>
#include <thread>
#include <vector>

namespace tumbler {
namespace {

using Message = std::vector<std::uint8_t>;

Message RandomMessage(std::mt19937& random, std::size_t size_max) {
  Message message(random() % (size_max + 1));
  for (std::uint8_t& byte : message) byte = static_cast<std::uint8_t>(random());
  return message;
}

TEST(MessageRing, IsAQueueOfMessagesOfAnyLength) {
  std::vector<std::uint8_t> storage(256);
  MessageRing ring(storage);
  std::deque<Message> expected;  // an independent queue with the same content
  std::mt19937 random(1);
  std::array<std::uint8_t, 256> out;
  std::size_t used = 0, refused = 0, taken = 0;
  for (int i = 0; i < 20000; ++i) {
    if (random() % 2 == 0) {
      const Message message = RandomMessage(random, 60);
      const bool fits = used + 4 + message.size() <= 256;
      ASSERT_EQ(ring.Push(message), fits);
      if (fits) expected.push_back(message);
      if (fits) used += 4 + message.size();
      refused += fits ? 0 : 1;
      continue;
    }
    std::size_t size = 999;
    ASSERT_EQ(ring.Pop(out, size), !expected.empty());
    if (expected.empty()) continue;
    ASSERT_EQ(Message(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size)),
              expected.front());
    used -= 4 + expected.front().size();
    expected.pop_front();
    ++taken;
  }
  EXPECT_GT(refused, 100U);
  EXPECT_GT(taken, 5000U);
}

TEST(MessageRing, TakesAMessageThatFillsItAndNoneThatIsLonger) {
  std::vector<std::uint8_t> storage(64);
  MessageRing ring(storage);
  EXPECT_FALSE(ring.Push(Message(61)));
  EXPECT_TRUE(ring.Push(Message(60, 7)));
  EXPECT_FALSE(ring.Push(Message()));
  std::array<std::uint8_t, 64> out{};
  std::size_t size = 0;
  EXPECT_TRUE(ring.Pop(out, size));
  EXPECT_EQ(size, 60U);
  EXPECT_EQ(out[59], 7);
  EXPECT_TRUE(ring.Push(Message()));
  EXPECT_TRUE(ring.Pop(out, size));
  EXPECT_EQ(size, 0U);
}

TEST(MessageRing, UsesAPowerOfTwoOfItsStorage) {
  std::vector<std::uint8_t> storage(100);
  MessageRing ring(storage);
  EXPECT_FALSE(ring.Push(Message(61)));
  EXPECT_TRUE(ring.Push(Message(60)));
}

TEST(MessageRing, KeepsOrderAndBytesBetweenTwoThreads) {
  constexpr int kMessages = 100'000;
  std::vector<std::uint8_t> storage(1024);
  MessageRing ring(storage);
  std::thread producer([&ring] {
    std::mt19937 random(2);
    for (int i = 0; i < kMessages; ++i) {
      const Message message = RandomMessage(random, 50);
      while (!ring.Push(message)) std::this_thread::yield();
    }
  });
  std::mt19937 random(2);
  int wrong = 0;
  std::array<std::uint8_t, 64> out;
  for (int i = 0; i < kMessages; ++i) {
    const Message expected = RandomMessage(random, 50);
    std::size_t size = 0;
    while (!ring.Pop(out, size)) std::this_thread::yield();
    if (Message(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size)) != expected) ++wrong;
  }
  producer.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace tumbler
