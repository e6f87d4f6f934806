#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "common/core/primitive.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive.h"
#include "firmware_interface/devices/protocols.h"

namespace tumbler {

/// Finds when drives sampled the positions that they report, from what a host knows: when it handed
/// its frames to the bus, and when replies came.
///
/// A drive that answers (`DriveProtocol::SamplesAt`) samples its joint as the frame that asks it
/// ends. Its reply may then have to wait for the bus, behind further frames of the host and replies
/// of others. How long follows from the lengths of these frames, as far as they filled the bus
/// without a gap. A drive that reports by its own clock has sampled before its frame began: what is
/// found is that beginning, at the latest.
///
/// Where time stamps are late, so is what is found; and what a drive takes to answer on an idle bus
/// counts as part of it. Frames that are filtered away are not known, and leave a gap.
///
/// Call Receive and Send once in each tick, in this order. No heap, no exceptions.
class SampleTimes {
 public:
  /// Of no drives.
  SampleTimes() = default;
  /// @param bit_rate  of the bus [bit/s], > 0.
  explicit SampleTimes(int bit_rate) noexcept : bit_ns_(1'000'000'000 / bit_rate) {}

  /// Adds the drive of the next joint. Joints beyond kMaxJoints are left out.
  void Add(const DriveConfig& drive) noexcept;

  /// Takes the frames that came since the tick before, in their order. Time stamps are those of the
  /// last bit of each.
  void Receive(std::span<const ReceivedFrame> received) noexcept;
  /// Takes the frames of this tick that the bus took, in their order, and when they were handed to
  /// it. Without frames none is known.
  void Send(std::int64_t send_ns, std::span<const CanFrame> frames) noexcept;

  /// When the last position that the joint's drive reported was sampled [ns], on the clock of the
  /// time stamps; nothing if there was none.
  [[nodiscard]] std::optional<std::int64_t> sampled_ns(std::size_t joint) const noexcept {
    if (joint >= count_ || !joints_[joint].known) return std::nullopt;
    return joints_[joint].sampled_ns;
  }

 private:
  static constexpr std::size_t kSentMax = std::size_t{kMaxJoints} * FrameBatch::kCapacity;
  static constexpr std::size_t kReceivedMax = 128;

  struct Joint {
    DriveConfig drive;
    std::size_t asked_by = kSentMax;    ///< The frame at which it samples; kSentMax: none.
    std::size_t report = kReceivedMax;  ///< Its last report; kReceivedMax: none.
    std::int64_t sampled_ns = 0;
    bool known = false;
  };

  [[nodiscard]] bool AnswersLastFrames(std::size_t received) const noexcept {
    return end_ns_[received] > send_ns_;
  }
  [[nodiscard]] std::int64_t BeforeChain(std::size_t last) const noexcept;
  [[nodiscard]] std::int64_t BeforeReceived(std::int64_t end_ns) const noexcept;
  [[nodiscard]] std::int64_t BeforeUnanswered(std::size_t frame,
                                              std::int64_t end_ns) const noexcept;
  void FindAnswers() noexcept;

  std::int64_t bit_ns_ = 1000;
  std::size_t count_ = 0;
  std::array<Joint, kMaxJoints> joints_{};
  // Of the host's last frames: the time that each takes on the wire, intermission included.
  std::int64_t send_ns_ = 0;
  std::size_t sent_count_ = 0;
  std::array<std::int64_t, kSentMax> takes_ns_{};
  // Of the frames that came since: when they ended, and when one before them ended at the latest.
  std::size_t received_count_ = 0;
  std::array<std::int64_t, kReceivedMax> end_ns_{}, before_ns_{};
};

}  // namespace tumbler
