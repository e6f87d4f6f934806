#include "runtime/record/timed_record.h"

#include "firmware_interface/can/frame_length.h"

namespace tumbler {
namespace {

/// The most bits that such a frame can take on the wire.
std::int32_t LongestBits(const CanFrame& frame) {
  return WorstCaseFrameBits(frame.extended ? CanIdKind::kExtended : CanIdKind::kStandard,
                            frame.remote ? 0 : frame.size);
}

}  // namespace

std::vector<CanFrame> SentFrames(const TickEntry& entry) {
  std::vector<CanFrame> frames;
  for (std::size_t i = 0; i < entry.record.joint_count; ++i) {
    for (const CanFrame& frame : entry.frames[i].frames()) {
      if (frames.size() < entry.notes.sent_count) frames.push_back(frame);
    }
  }
  return frames;
}

TimedRecord TimedRecords::Next(const TickEntry& entry) {
  TimedRecord timed;
  timed.time_ns = entry.notes.deadline_ns;
  timed.number = entry.index;
  timed.wake_up_ns = static_cast<float>(entry.notes.awake_ns - entry.notes.due_ns);
  timed.tick_ns = static_cast<float>(entry.notes.done_ns - entry.notes.awake_ns);
  for (const ReceivedFrame& received : entry.input().received) {
    timed.bus_bits += LongestBits(received.frame);
  }
  const std::vector<CanFrame> sent = SentFrames(entry);
  for (const CanFrame& frame : sent) timed.bus_bits += LongestBits(frame);
  timed.request = {entry.notes.request_id, static_cast<OperatorRequest>(entry.notes.request),
                   entry.notes.request_refusal};
  timed.record = entry.record;
  // What was sent in a tick that is not here is not known.
  if (entry.index != index_) replies_.Send(entry.notes.send_ns, {});
  index_ = entry.index + 1;
  replies_.Receive(entry.input().received);
  replies_.Send(entry.notes.send_ns, sent);
  for (std::size_t j = 0; j < timed.record.joint_count; ++j) {
    const auto sampled_ns = replies_.sampled_ns(j);
    timed.reply_sampled_us[j] = sampled_ns ? static_cast<float>(*sampled_ns - timed.time_ns) * 1e-3F
                                           : std::numeric_limits<float>::quiet_NaN();
  }
  return timed;
}

}  // namespace tumbler
