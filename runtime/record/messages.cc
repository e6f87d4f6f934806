#include "runtime/record/messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "runtime/executor/faults.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/tick_fields.h"
#include "runtime/record/sentences.h"

namespace tumbler {

void FillState(const TimedRecord& timed, state_t& message) {
  const auto set = [](auto& member, const auto& value) {
    member = static_cast<std::remove_cvref_t<decltype(member)>>(value);
  };
  ForEachRow(kTickFields, [&](const auto& row) {
    if constexpr (row.kFilled) set(row.in_message(message), row.of_tick(timed));
  });
  message.joints.resize(timed.record.joint_count);
  for (std::size_t i = 0; i < timed.record.joint_count; ++i) {
    ForEachJointField([&](const JointField& /*field*/, auto in_record, auto in_message) {
      set(in_message(message.joints[i]), in_record(timed.record.joints[i]));
    });
    ForEachDerivedJointField([&](const JointField& /*field*/, auto of_tick, auto in_message) {
      set(in_message(message.joints[i]), of_tick(timed, i));
    });
  }
}

EventWatch::EventWatch(const RunDescription& about)
    : joints_(about.joints), nodes_(about.nodes), error_codes_(about.error_codes) {}

std::optional<event_t> EventWatch::Next(const TimedRecord& timed) {
  const TickRecord& record = timed.record;
  std::string text;
  if (record.faults != last_faults_ && record.first_fault.fault != Fault::kNone &&
      last_faults_ == 0) {
    text = Describe(record.first_fault, joints_, error_codes_);
  } else if (record.faults != last_faults_) {
    text = record.faults == 0 ? "faults cleared" : "further fault";
    const std::uint32_t more = record.faults & ~last_faults_;
    const char* separator = ": ";
    for (std::size_t fault = 1; fault < kFaultCount; ++fault) {
      if ((more >> fault & 1U) == 0) continue;
      text += separator;
      text += ToString(static_cast<Fault>(fault));
      separator = ", ";
    }
  } else if (record.refusal.refusal != last_refusal_ && record.refusal.refusal != Refusal::kNone) {
    text = fmt::format("{} refused: {}", ToString(record.command),
                       Describe(record.refusal, joints_, error_codes_));
  } else if (timed.request.id != last_request_id_ && timed.request.refusal != Refusal::kNone) {
    text = fmt::format("{} refused: {}", ToString(timed.request.request),
                       ToString(timed.request.refusal));
  } else if (record.node != last_node_ && record.state == ExecutorState::kRunning) {
    const auto node = static_cast<std::size_t>(record.node);
    text = node < nodes_.size() ? nodes_[node] : fmt::format("node {}", record.node);
  }
  if (record.state == ExecutorState::kRunning) last_node_ = record.node;
  std::optional<event_t> event;
  if (record.state != last_state_ || !text.empty()) {
    event.emplace();
    event->tick = record.tick;
    event->time_ns = timed.time_ns;
    event->from_state = ToString(last_state_);
    event->to_state = ToString(record.state);
    event->text = text;
  }
  last_state_ = record.state;
  last_faults_ = record.faults;
  last_request_id_ = timed.request.id;
  last_refusal_ = record.refusal.refusal;
  return event;
}

RunMessage::RunMessage(const RunDescription& about) : bit_rate_(about.bit_rate) {
  message_.version = TUMBLER_VERSION;
  message_.run = about.number;
  message_.robot = about.robot;
  message_.motion = about.motion;
  message_.bus = about.bus;
  message_.mode = about.mode;
  message_.attended = about.attended ? 1 : 0;
  message_.keyed = about.keyed ? 1 : 0;
  message_.rate_hz = about.rate_hz;
  message_.speed = about.speed;
  message_.error_codes = about.error_codes;
  message_.error_codes.resize(about.joints.size());
  message_.joints = about.joints;
  message_.joint_count = static_cast<std::int32_t>(about.joints.size());
  message_.nodes = about.nodes;
  message_.node_count = static_cast<std::int32_t>(about.nodes.size());
  message_.branches = about.branches;
  message_.branch_count = static_cast<std::int32_t>(about.branches.size());
  message_.kernel = about.machine.kernel;
  message_.cpu = about.machine.cpu;
  message_.adapter = about.machine.adapter;
  message_.scheduling = about.scheduling;
  message_.reply_age_max_ticks = -1;
}

void RunMessage::Count(const TimedRecord& timed) {
  const auto period_ns = static_cast<float>(1e9 / std::max(message_.rate_hz, 1e-3));
  message_.ticks = timed.number + 1;
  message_.missed_ticks = timed.record.tick - timed.number;
  if (timed.wake_up_ns > period_ns / 2) ++message_.late_ticks;
  wake_up_.Add(static_cast<std::int64_t>(timed.wake_up_ns));
  tick_.Add(static_cast<std::int64_t>(timed.tick_ns));
  bits_ += timed.bus_bits;
  for (std::size_t i = 0; i < timed.record.joint_count; ++i) {
    message_.reply_age_max_ticks =
        std::max(message_.reply_age_max_ticks, timed.record.joints[i].reply_age_ticks);
  }
}

const run_t& RunMessage::At(std::int64_t time_ns, std::int64_t lost, std::int64_t unpublished) {
  const auto us = [](const DurationHistogram& durations, double share) {
    return static_cast<float>(durations.PercentileNs(share)) * 1e-3F;
  };
  const double elapsed_s = static_cast<double>(time_ns - message_.time_ns) * 1e-9;
  const double capacity = elapsed_s * bit_rate_;
  message_.bus_load = capacity > 0 ? static_cast<float>(static_cast<double>(bits_) / capacity) : 0;
  bits_ = 0;
  message_.time_ns = time_ns;
  message_.wake_up_p50_us = us(wake_up_, 0.5);
  message_.wake_up_p99_us = us(wake_up_, 0.99);
  message_.wake_up_p99_9_us = us(wake_up_, 0.999);
  message_.wake_up_p99_99_us = us(wake_up_, 0.9999);
  message_.wake_up_max_us = static_cast<float>(wake_up_.max_ns()) * 1e-3F;
  message_.tick_p50_us = us(tick_, 0.5);
  message_.tick_p99_us = us(tick_, 0.99);
  message_.tick_p99_9_us = us(tick_, 0.999);
  message_.tick_p99_99_us = us(tick_, 0.9999);
  message_.tick_max_us = static_cast<float>(tick_.max_ns()) * 1e-3F;
  message_.lost_records = lost;
  message_.unpublished = unpublished;
  return message_;
}

}  // namespace tumbler
