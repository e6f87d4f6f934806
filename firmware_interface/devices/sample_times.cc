#include "firmware_interface/devices/sample_times.h"

#include <algorithm>
#include <limits>

#include "firmware_interface/can/frame_length.h"

namespace tumbler {
namespace {

/// Frames with a shorter gap between them have none: no other fits into it. Time stamps of kernels
/// are off by less, mostly.
constexpr int kShortestFrameBits = 44;

constexpr std::int64_t kNotKnown = std::numeric_limits<std::int64_t>::max();

bool Reports(const DriveConfig& drive, const CanFrame& frame) noexcept {
  return DriveProtocols::With(drive, [&frame](auto protocol, const auto& config) {
    double shaft_rad = 0;
    return decltype(protocol)::ReportedPosition(config, frame, shaft_rad);
  });
}

bool SamplesAt(const DriveConfig& drive, const CanFrame& frame) noexcept {
  return DriveProtocols::With(drive, [&frame](auto protocol, const auto& config) {
    return decltype(protocol)::SamplesAt(config, frame);
  });
}

}  // namespace

void SampleTimes::Add(const DriveConfig& drive) noexcept {
  if (count_ < joints_.size()) joints_[count_++].drive = drive;
}

void SampleTimes::Receive(std::span<const ReceivedFrame> received) noexcept {
  received_count_ = std::min(received.size(), kReceivedMax);
  for (std::size_t j = 0; j < count_; ++j) joints_[j].report = kReceivedMax;
  for (std::size_t i = 0; i < received_count_; ++i) {
    end_ns_[i] = received[i].time_ns;
    before_ns_[i] = end_ns_[i] - FrameBits(received[i].frame) * bit_ns_;
    for (std::size_t j = 0; j < count_; ++j) {
      if (Reports(joints_[j].drive, received[i].frame)) joints_[j].report = i;
    }
  }
  for (std::size_t j = 0; j < count_; ++j) {
    Joint& joint = joints_[j];
    if (joint.report == kReceivedMax) continue;
    joint.sampled_ns = before_ns_[joint.report];
    joint.known = true;
  }
  FindAnswers();
}

void SampleTimes::Send(std::int64_t send_ns, std::span<const CanFrame> frames) noexcept {
  send_ns_ = send_ns;
  sent_count_ = std::min(frames.size(), kSentMax);
  for (std::size_t j = 0; j < count_; ++j) joints_[j].asked_by = kSentMax;
  for (std::size_t i = 0; i < sent_count_; ++i) {
    takes_ns_[i] = FrameBits(frames[i]) * bit_ns_;
    for (std::size_t j = 0; j < count_; ++j) {
      if (SamplesAt(joints_[j].drive, frames[i])) joints_[j].asked_by = i;
    }
  }
}

/// When the frames ended, at the latest, that kept the bus until a received frame began: before
/// that and others that were received came one after the other.
std::int64_t SampleTimes::BeforeChain(std::size_t last) const noexcept {
  std::int64_t end_ns = before_ns_[last];
  for (std::size_t i = last; i-- > 0 && AnswersLastFrames(i);) {
    if (end_ns - end_ns_[i] > kShortestFrameBits * bit_ns_) break;
    end_ns = std::min(end_ns, end_ns_[i]) - (end_ns_[i] - before_ns_[i]);
  }
  return end_ns;
}

/// The same of the received frames, if any, that ended at this time.
std::int64_t SampleTimes::BeforeReceived(std::int64_t end_ns) const noexcept {
  for (std::size_t i = received_count_; i-- > 0 && AnswersLastFrames(i);) {
    if (end_ns_[i] - end_ns > kShortestFrameBits * bit_ns_) continue;
    if (end_ns - end_ns_[i] > kShortestFrameBits * bit_ns_) break;
    return std::min(end_ns, BeforeChain(i));
  }
  return end_ns;
}

/// When a frame of the host ended, at the latest, if the ones behind it, whose times nothing tells,
/// kept the bus until a reply could begin. They did so if they can have ended by then.
std::int64_t SampleTimes::BeforeUnanswered(std::size_t frame, std::int64_t end_ns) const noexcept {
  std::int64_t first_end_ns = send_ns_ - kIntermissionBits * bit_ns_, behind_ns = 0;
  for (std::size_t i = 0; i < sent_count_; ++i) {
    first_end_ns += takes_ns_[i];
    if (first_end_ns > end_ns) break;
    if (i > frame) behind_ns += takes_ns_[i];
  }
  return end_ns - behind_ns;
}

// From the host's last frame back to its first: each has ended before the next one began, and
// before the replies to it did.
void SampleTimes::FindAnswers() noexcept {
  std::int64_t next_end_ns = kNotKnown;
  for (std::size_t i = sent_count_; i-- > 0;) {
    std::int64_t end_ns = kNotKnown;
    if (next_end_ns != kNotKnown) end_ns = BeforeReceived(next_end_ns - takes_ns_[i + 1]);
    const auto answers = [&](const Joint& joint) {
      return joint.asked_by == i && joint.report != kReceivedMax && AnswersLastFrames(joint.report);
    };
    for (std::size_t j = 0; j < count_; ++j) {
      if (!answers(joints_[j])) continue;
      std::int64_t before_ns = BeforeChain(joints_[j].report);
      if (next_end_ns == kNotKnown) before_ns = BeforeUnanswered(i, before_ns);
      end_ns = std::min(end_ns, before_ns);
    }
    for (std::size_t j = 0; j < count_; ++j) {
      if (answers(joints_[j])) joints_[j].sampled_ns = end_ns;
    }
    next_end_ns = end_ns;
  }
}

}  // namespace tumbler
