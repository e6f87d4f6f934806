#include "offline/pages/run_data.h"

#include <algorithm>
#include <cmath>

namespace tumbler {
namespace {

/// Whether the setpoints of position take effect in this tick.
bool Controlled(const RunTick& tick) { return ControlsPosition(tick.state, tick.reaction); }

}  // namespace

const char* ToString(RunEvent::Kind kind) {
  switch (kind) {
    case RunEvent::Kind::kState:
      return "state";
    case RunEvent::Kind::kRequest:
      return "request";
    case RunEvent::Kind::kRefusal:
      return "refusal";
    case RunEvent::Kind::kFault:
      return "fault";
    case RunEvent::Kind::kTiming:
      return "timing";
    case RunEvent::Kind::kTruth:
      return "truth";
  }
  return "?";
}

RunTick TickOf(const TickEntry& entry, std::int64_t zero_ns) {
  const TickRecord& record = entry.record;
  RunTick tick;
  tick.time_s = static_cast<double>(entry.notes.deadline_ns - zero_ns) / 1e9;
  tick.tick = record.tick;
  tick.state = record.state;
  tick.reaction = record.reaction;
  tick.node = int{record.node};
  tick.primitive_time_s = double{record.primitive_time_s};
  return tick;
}

std::int64_t RunLatency::PercentileNs(double share) const {
  if (values_ns.empty()) return 0;
  const double at = std::ceil(share * static_cast<double>(values_ns.size())) - 1;
  return values_ns[static_cast<std::size_t>(std::max(at, 0.0))];
}

std::optional<double> RunData::FollowingError(std::size_t tick, std::size_t joint_index) const {
  const std::int32_t age = joint(tick, joint_index).reply_age_ticks;
  if (age < 0 || static_cast<std::size_t>(age) + 1 > tick || !Controlled(ticks[tick])) return {};
  const std::size_t asked = tick - 1 - static_cast<std::size_t>(age);
  if (!Controlled(ticks[asked])) return {};
  return double{joint(tick, joint_index).measured.position_rad} -
         double{joint(asked, joint_index).limited.position_rad};
}

}  // namespace tumbler
