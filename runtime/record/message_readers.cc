#include "runtime/record/message_readers.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <exception>
#include <utility>
#include <vector>

#include "runtime/executor/faults.h"

namespace tumbler {
namespace {

constexpr std::size_t kBytesMax = 65536;
constexpr std::size_t kElementsMax = 64;
constexpr std::size_t kJointsMax = 32;
constexpr std::size_t kFingerprint = 8;
constexpr std::size_t kWide = 8;  // bytes of a number of 64 bits

/// The fingerprint of state_t up to version 0.1: its joints ended before reply_sampled_us.
constexpr std::array<std::uint8_t, kFingerprint> kFormerState = {0x55, 0x79, 0x99, 0x36,
                                                                 0x3e, 0x7f, 0xbd, 0x65};

/// Goes through the bytes of a message without reading its values.
class Walk {
 public:
  explicit Walk(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
    good_ = bytes.size() <= kBytesMax;
    Skip(kFingerprint);
  }

  void Skip(std::size_t size) {
    if (!good_ || size > bytes_.size() - at_) {
      good_ = false;
      return;
    }
    at_ += size;
  }
  /// A whole number of 32 bits, as lengths are.
  std::size_t Length() {
    const std::size_t from = at_;
    Skip(4);
    std::size_t length = 0;
    for (std::size_t i = from; good_ && i < from + 4; ++i) length = length << 8U | bytes_[i];
    return good_ ? length : 0;
  }
  /// How many elements lists have.
  std::size_t Count() {
    const std::size_t count = Length();
    if (count > kElementsMax) good_ = false;
    return good_ ? count : 0;
  }
  /// Texts, whose lengths count their closing zeros.
  void Texts(std::size_t count) {
    for (std::size_t i = 0; i < count && good_; ++i) {
      const std::size_t length = Length();
      if (length == 0) good_ = false;
      Skip(length);
      if (good_ && bytes_[at_ - 1] != 0) good_ = false;
    }
  }
  [[nodiscard]] bool AtEnd() const { return good_ && at_ == bytes_.size(); }
  [[nodiscard]] bool good() const { return good_; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

template <typename Message>
bool Decode(std::span<const std::uint8_t> bytes, Message& message) {
  Message read;
  try {
    const auto size = static_cast<int>(bytes.size());
    if (read.decode(bytes.data(), 0, size) != size) return false;
  } catch (const std::exception&) {
    return false;
  }
  message = std::move(read);
  return true;
}

template <typename Enum>
bool IsOneOf(std::int8_t value, Enum last) {
  return value >= 0 && value <= static_cast<int>(last);
}

/// The bytes of a state_t up to version 0.1 as those of one of today, in which it is not known when
/// replies were sampled. Joints are at the end of the message, and that field at the end of each.
std::vector<std::uint8_t> FromFormerState(std::span<const std::uint8_t> bytes,
                                          std::size_t without_joints, std::size_t joint) {
  constexpr std::array<std::uint8_t, 4> kNaN = {0x7f, 0xc0, 0, 0};
  const std::int64_t fingerprint = state_t::getHash();
  std::vector<std::uint8_t> now;
  for (int shift = 56; shift >= 0; shift -= 8)
    now.push_back(static_cast<std::uint8_t>(fingerprint >> shift));
  const std::size_t former_joint = joint - kNaN.size();
  for (std::size_t i = kFingerprint; i < bytes.size(); ++i) {
    now.push_back(bytes[i]);
    if (i >= without_joints && (i + 1 - without_joints) % former_joint == 0)
      now.insert(now.end(), kNaN.begin(), kNaN.end());
  }
  return now;
}

}  // namespace

bool ReadMessage(std::span<const std::uint8_t> bytes, state_t& message) {
  const auto without_joints = static_cast<std::size_t>(state_t{}.getEncodedSize());
  const auto joint = static_cast<std::size_t>(joint_state_t{}._getEncodedSizeNoHash());
  std::vector<std::uint8_t> now;
  if (bytes.size() <= kBytesMax && bytes.size() >= kFingerprint &&
      std::ranges::equal(bytes.first(kFingerprint), kFormerState)) {
    now = FromFormerState(bytes, without_joints, joint);
    bytes = now;
  }
  Walk walk(bytes);
  walk.Skip(without_joints - kFingerprint - 4);
  const std::size_t count = walk.Count();
  if (count > kJointsMax) return false;
  walk.Skip(count * joint);
  state_t read;
  if (!walk.AtEnd() || !Decode(bytes, read)) return false;
  if (!IsOneOf(read.state, ExecutorState::kFault) || !IsOneOf(read.reaction, Reaction::kAbort) ||
      !IsOneOf(read.fault_state, ExecutorState::kFault) || read.fault < 0 ||
      static_cast<std::size_t>(read.fault) >= kFaultCount) {
    return false;
  }
  message = std::move(read);
  return true;
}

bool ReadMessage(std::span<const std::uint8_t> bytes, event_t& message) {
  Walk walk(bytes);
  walk.Skip(3 * kWide);
  walk.Texts(3);
  return walk.AtEnd() && Decode(bytes, message);
}

bool ReadMessage(std::span<const std::uint8_t> bytes, run_t& message) {
  Walk walk(bytes);
  walk.Skip(2 * kWide);
  walk.Texts(5);
  walk.Skip(3 + 3 * kWide);
  walk.Texts(2 * walk.Count());
  walk.Texts(walk.Count());
  walk.Texts(walk.Count());
  walk.Texts(4);
  return walk.good() && Decode(bytes, message);
}

namespace {

/// The fields of a truth_t.
void Truth(Walk& walk) {
  walk.Skip(7 * kWide + 2 + 4);
  walk.Texts(1);
  walk.Skip(3 * kWide);
  const std::size_t joints = walk.Count();
  for (std::size_t i = 0; i < joints; ++i) {
    walk.Texts(1);
    walk.Skip(4 * kWide + 2);
  }
  const std::size_t contacts = walk.Count();
  for (std::size_t i = 0; i < contacts; ++i) {
    walk.Texts(2);
    walk.Skip(kWide);
  }
}

}  // namespace

bool ReadMessage(std::span<const std::uint8_t> bytes, truth_t& message) {
  Walk walk(bytes);
  Truth(walk);
  return walk.AtEnd() && Decode(bytes, message);
}

bool ReadMessage(std::span<const std::uint8_t> bytes, space_truth_t& message) {
  truth_t in_plane;
  if (ReadMessage(bytes, in_plane)) {
    message = space_truth_t{};
    message.truth = std::move(in_plane);
    return true;
  }
  Walk walk(bytes);
  Truth(walk);
  walk.Skip(10 * kWide);
  space_truth_t read;
  if (!walk.AtEnd() || !Decode(bytes, read) || !IsInSpace(read)) return false;
  message = std::move(read);
  return true;
}

}  // namespace tumbler
