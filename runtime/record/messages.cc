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

namespace {

/// Sets a member of a message.
template <typename Member, typename Value>
void Set(Member& member, const Value& value) {
  if constexpr (std::is_same_v<Member, Value>) {
    member = value;
  } else {
    member = static_cast<Member>(value);
  }
}

}  // namespace

void FillState(const TimedRecord& timed, state_t& message) {
  ForEachRow(kTickFields, [&]<typename Row>(const Row& row) {
    if constexpr (Row::kFilled) Set(row.in_message(message), row.of_tick(timed));
  });
  message.joints.resize(timed.record.joint_count);
  for (std::size_t i = 0; i < timed.record.joint_count; ++i) {
    ForEachJointField([&](const JointField& /*field*/, auto in_record, auto in_message) {
      Set(in_message(message.joints[i]), in_record(timed.record.joints[i]));
    });
    ForEachDerivedJointField([&](const JointField& /*field*/, auto of_tick, auto in_message) {
      Set(in_message(message.joints[i]), of_tick(timed, i));
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

RunMessage::RunMessage(const RunDescription& about) {
  run_.about = about;
  run_.about.error_codes.resize(about.joints.size());
  run_.version = TUMBLER_VERSION;
}

const run_t& RunMessage::At(std::int64_t time_ns, std::int64_t lost, std::int64_t unpublished) {
  const double elapsed_s = static_cast<double>(time_ns - run_.time_ns) * 1e-9;
  const double capacity = elapsed_s * run_.about.bit_rate;
  run_.bus_load = capacity > 0 ? static_cast<float>(static_cast<double>(run_.bits) / capacity) : 0;
  run_.bits = 0;
  run_.time_ns = time_ns;
  run_.lost = lost;
  run_.unpublished = unpublished;
  ForEachRow(kRunFields,
             [this](const auto& row) { Set(row.in_message(message_), row.value(run_)); });
  return message_;
}

}  // namespace tumbler
