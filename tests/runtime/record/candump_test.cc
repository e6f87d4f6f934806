#include "runtime/assembly/candump.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

namespace tumbler {
namespace {

using ::testing::HasSubstr;

TEST(Candump, ReadsWhatItWrites) {
  std::mt19937 random(1);
  std::string text;
  std::vector<CandumpFrame> written;
  for (int i = 0; i < 1000; ++i) {
    CandumpFrame frame;
    frame.interface = i % 2 == 0 ? "can0" : "vcan12";
    frame.received.time_ns = static_cast<std::int64_t>(random()) * 1'000'000;
    CanFrame& can = frame.received.frame;
    can.extended = random() % 2 == 0;
    can.remote = random() % 4 == 0;
    can.id = static_cast<std::uint32_t>(random()) & (can.extended ? 0x1fffffffU : 0x7ffU);
    can.size = static_cast<std::uint8_t>(random() % 9);
    for (std::size_t b = 0; b < can.size && !can.remote; ++b) {
      can.data[b] = static_cast<std::uint8_t>(random());
    }
    text += CandumpLine(frame.received.time_ns, frame.interface, can) + "\n";
    written.push_back(frame);
  }
  std::int64_t skipped = -1;
  const auto read = ParseCandump(text, "log", skipped);
  EXPECT_EQ(skipped, 0);
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].received.frame, written[i].received.frame) << i;
    EXPECT_EQ(read[i].received.time_ns, written[i].received.time_ns) << i;
    EXPECT_EQ(read[i].interface, written[i].interface) << i;
  }
}

TEST(Candump, SkipsFdAndErrorFramesAndReadsDirectionsAndAlignment) {
  std::int64_t skipped = 0;
  const auto frames = ParseCandump(
      "(1436509052.249713)  can0 044#2A366C2BBA R\r\n"
      "(1436509052.249714) vcan0 123##1AABBCC\n"
      "(1436509052.249715) vcan0 20000004#0000000000000000\n"
      "\n"
      "(1436509052.249716) vcan0 7FF#R8 T\n",
      "log", skipped);
  EXPECT_EQ(skipped, 2);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].interface, "can0");
  EXPECT_EQ(frames[0].received.frame.size, 5);
  EXPECT_EQ(frames[0].received.frame.data[4], 0xba);
  EXPECT_TRUE(frames[1].received.frame.remote);
  EXPECT_EQ(frames[1].received.frame.size, 8);
}

TEST(Candump, FramesAreThoseOfOneInterfaceAndNoOneIsGuessedAmongSeveral) {
  std::int64_t skipped = 0;
  const auto frames = ParseCandump(
      "(1.000000) can1 001#00\n(1.000001) can0 001#01\n(1.000002) can1 002#02\n", "log", skipped);
  const auto problem = [&](const std::vector<CandumpFrame>& of, const std::string& interface) {
    try {
      return fmt::format("{} frames", FramesOfInterface(of, "log", interface).size());
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
  };
  EXPECT_EQ(problem(frames, ""),
            "log: has frames of several interfaces: can0 (1), can1 (2); say with --interface on "
            "which the drives are");
  const auto of_can1 = FramesOfInterface(frames, "log", "can1");
  ASSERT_EQ(of_can1.size(), 2U);
  EXPECT_EQ(of_can1[1].received.frame.id, 2U);
  EXPECT_EQ(problem(of_can1, ""), "2 frames");
  EXPECT_EQ(problem(frames, "can2"),
            "log: --interface: has no frame of 'can2'; it has those of can0 (1), can1 (2)");
  EXPECT_EQ(problem({}, ""), "0 frames");
  EXPECT_EQ(problem({}, "can0"), "log: --interface: has no frame of 'can0'; it has those of none");
}

TEST(Candump, NamesTheLineThatIsWrong) {
  for (const char* line :
       {"hello", "(1.5) can0 123#00", "(1.000000) can0 1234#00", "(1.000000) can0 123#0",
        "(1.000000) can0 123#001122334455667788", "(1.000000) can0 123#0G", "(1.000000) 123#00",
        "(1.000000) can0 800#00", "(-1.000000) can0 123#00", "(1.00000x) can0 123#00",
        "(99999999999.000000) can0 123#00", "(1.000000) can0 123#R9", "(1.000000) can0 123"}) {
    std::int64_t skipped = 0;
    try {
      ParseCandump("(1.000000) can0 123#00\n" + std::string(line) + "\n", "log", skipped);
      ADD_FAILURE() << "accepted: " << line;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("log:2: is not a line of `candump -l`")) << line;
    }
  }
}

}  // namespace
}  // namespace tumbler
