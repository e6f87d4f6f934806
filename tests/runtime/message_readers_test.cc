// Messages of telemetry that anybody may have sent or edited.

#include "runtime/record/message_readers.h"
#include "runtime/executor/faults.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/executor/faults.h"
#include "tests/support/telemetry_messages.h"

namespace tumbler {
namespace {

using testing::About;
using testing::State;
using testing::Truth;

template <typename Message>
std::vector<std::uint8_t> Bytes(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

template <typename Message>
void ExpectOnlyWholeMessages(const Message& message) {
  std::vector<std::uint8_t> bytes = Bytes(message);
  Message read{};
  EXPECT_TRUE(ReadMessage(bytes, read));
  EXPECT_EQ(Bytes(read), bytes);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(ReadMessage(std::span(bytes).first(size), read)) << size;
  }
  bytes.push_back(0);
  EXPECT_FALSE(ReadMessage(bytes, read)) << "a byte too many";
  EXPECT_FALSE(ReadMessage(std::vector<std::uint8_t>(70'000, 0), read));
}

TEST(MessageReaders, AreReadOnlyWhenTheyAreWhole) {
  ExpectOnlyWholeMessages(State(1));
  ExpectOnlyWholeMessages(About());
  ExpectOnlyWholeMessages(Truth());
  event_t event{};
  event.text = "<b>";
  ExpectOnlyWholeMessages(event);
}

/// A message of version 0.1: with the fingerprint of then, and without the last field of its
/// joints.
std::vector<std::uint8_t> Former(const state_t& state) {
  const std::vector<std::uint8_t> now = Bytes(state);
  std::vector<std::uint8_t> bytes = {0x55, 0x79, 0x99, 0x36, 0x3e, 0x7f, 0xbd, 0x65};
  const std::size_t joint = static_cast<std::size_t>(joint_state_t{}._getEncodedSizeNoHash());
  const std::size_t joints = now.size() - state.joints.size() * joint;
  bytes.insert(bytes.end(), now.begin() + 8, now.begin() + static_cast<std::ptrdiff_t>(joints));
  for (std::size_t at = joints; at < now.size(); at += joint) {
    const auto begin = now.begin() + static_cast<std::ptrdiff_t>(at);
    bytes.insert(bytes.end(), begin, begin + static_cast<std::ptrdiff_t>(joint) - 4);
  }
  return bytes;
}

TEST(MessageReaders,
     StatesOfVersion01AreReadOnlyWhenTheyAreWholeAndDoNotSayWhenRepliesWereSampled) {
  state_t state = State(7);
  state.fault_value = 3;
  state.joints[0].planned_position_rad = 1;
  state.joints[1].correction_rad = 2;
  state.joints[1].reply_sampled_us = 5;
  const std::vector<std::uint8_t> bytes = Former(state);
  state_t read{};
  ASSERT_TRUE(ReadMessage(bytes, read));
  EXPECT_EQ(read.tick, 7);
  EXPECT_EQ(read.fault_value, 3);
  ASSERT_EQ(read.joints.size(), 2U);
  EXPECT_EQ(read.joints[0].planned_position_rad, 1);
  EXPECT_EQ(read.joints[1].correction_rad, 2);
  EXPECT_TRUE(std::isnan(read.joints[0].reply_sampled_us));
  EXPECT_TRUE(std::isnan(read.joints[1].reply_sampled_us));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(ReadMessage(std::span(bytes).first(size), read)) << size;
  for (int more = 1; more < 100; ++more) {
    std::vector<std::uint8_t> longer = bytes;
    longer.resize(longer.size() + static_cast<std::size_t>(more));
    EXPECT_FALSE(ReadMessage(longer, read)) << more;
  }
  std::vector<std::uint8_t> long_one = bytes;
  long_one.resize(70'000);
  EXPECT_FALSE(ReadMessage(long_one, read));
}

space_truth_t TruthInSpace() {
  space_truth_t truth{};
  truth.truth = Truth();
  truth.root_y_m = 2;
  truth.root_quaternion[3] = 1;
  return truth;
}

TEST(MessageReaders, TrueStatesInSpaceAreReadOnlyWhenTheyAreWholeAndThoseInThePlaneAreTakenToo) {
  ExpectOnlyWholeMessages(TruthInSpace());
  space_truth_t read{};
  truth_t in_plane = Truth();
  in_plane.root_pitch_rad = 0.25;
  ASSERT_TRUE(ReadMessage(Bytes(in_plane), read));
  EXPECT_FALSE(IsInSpace(read));
  EXPECT_EQ(read.truth.root_pitch_rad, 0.25);
  EXPECT_EQ(read.root_y_m, 0);
  ASSERT_TRUE(ReadMessage(Bytes(TruthInSpace()), read));
  EXPECT_TRUE(IsInSpace(read));
  EXPECT_EQ(read.root_y_m, 2);
  EXPECT_FALSE(ReadMessage(Bytes(TruthInSpace()), in_plane)) << "of another fingerprint";
  EXPECT_FALSE(ReadMessage(Bytes(space_truth_t{}), read)) << "a rotation by nothing";
}

/// Every number of 32 bits in a message becomes one that lengths must not be.
template <typename Message>
void ExpectNoSurpriseAfterAnyLength(const Message& message) {
  const std::vector<std::uint8_t> good = Bytes(message);
  for (const std::uint32_t length : {0x7fffffffU, 0x80000000U, 0xffffffffU, 1'000'000U, 65U}) {
    for (std::size_t at = 8; at + 4 <= good.size(); ++at) {
      std::vector<std::uint8_t> bytes = good;
      for (std::size_t i = 0; i < 4; ++i) {
        bytes[at + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
      }
      Message read{};
      if (ReadMessage(bytes, read)) {
        EXPECT_EQ(Bytes(read).size(), bytes.size());
      }
    }
  }
}

TEST(MessageReaders, SurviveAnyLength) {
  ExpectNoSurpriseAfterAnyLength(State(1));
  ExpectNoSurpriseAfterAnyLength(About());
  ExpectNoSurpriseAfterAnyLength(Truth());
  ExpectNoSurpriseAfterAnyLength(TruthInSpace());
}

TEST(MessageReaders, HaveStatesAndFaultsThatThereAre) {
  state_t read{};
  for (const int wrong : {-1, 8, 127, -128}) {
    state_t state = State(1);
    state.state = static_cast<std::int8_t>(wrong);
    EXPECT_FALSE(ReadMessage(Bytes(state), read));
  }
  for (const int wrong : {-1, static_cast<int>(kFaultCount), 127}) {
    state_t state = State(1);
    state.faults = 1;
    state.fault = static_cast<std::int8_t>(wrong);
    EXPECT_FALSE(ReadMessage(Bytes(state), read));
  }
}

}  // namespace
}  // namespace tumbler
