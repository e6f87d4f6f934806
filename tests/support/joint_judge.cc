#include "tests/support/joint_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace tumbler::testing {

std::uint32_t UnsignedField(const CanFrame& frame, std::size_t first, std::size_t bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = bytes; i-- > 0;) value = value << 8 | frame.data[first + i];
  return value;
}
double SignedField(const CanFrame& frame, std::size_t first, std::size_t bytes) {
  const auto value = static_cast<double>(UnsignedField(frame, first, bytes));
  const double range = bytes == 2 ? 65536.0 : 4294967296.0;
  return value >= range / 2 ? value - range : value;
}
double FloatField(const CanFrame& frame, std::size_t first) {
  return static_cast<double>(std::bit_cast<float>(UnsignedField(frame, first, 4)));
}

BusJudge::BusJudge(const FrameRules& rules) : rules_(rules) {
  const std::size_t count = rules.drives.drives.size();
  if (count == 0 || rules.limits.size() != count) {
    throw std::invalid_argument("frame rules: one set of limits for each drive");
  }
  report_.joints.resize(count);
  report_.violations.reserve(16);
}

const FrameReport& BusJudge::report() {
  if (rate_time_s_ > 0) report_.rate_hz = rate_ticks_ / rate_time_s_;
  return report_;
}

void BusJudge::Fail(const std::string& what) {
  if (report_.violations.size() < 100) {
    report_.violations.push_back(fmt::format("line {}: {}", line_, what));
  }
}

void BusJudge::OpenTick(const char* what, double time_s, bool off_before) {
  if (next_ != 0 && !off_before && time_s - report_.last_command_s < rules_.silence_s) {
    Fail(fmt::format("{} where joint {} is due", what, next_));
  }
  next_ = 0;
}

// Whether this is the joint's first command in a tick.
bool BusJudge::CheckOrder(std::size_t joint, double time_s, bool torque_off, bool several) {
  const bool first = report_.first_command_s == 0 && report_.last_command_s == 0;
  const double gap_s = first ? 0 : time_s - report_.last_command_s;
  const bool silence = gap_s > rules_.silence_s;
  report_.longest_silence_s = std::max(report_.longest_silence_s, gap_s);
  // Another frame of the joint that had the last one, in the same tick.
  const bool same_tick = several && !first && joint == current_ &&
                         time_s - tick_begin_s_ < rules_.same_tick_share / rules_.drives.rate_hz;
  if (!same_tick) {
    if (joint != next_ && !first && !silence && !(torque_off && joint == 0)) {
      Fail(fmt::format("joint {} is commanded where joint {} is due", joint, next_));
    }
    if (joint == 0) {
      if (last_tick_s_ > 0 && !silence && time_s > last_tick_s_) {
        rate_time_s_ += time_s - last_tick_s_;
        ++rate_ticks_;
      }
      last_tick_s_ = time_s;
    }
    current_ = joint;
    tick_begin_s_ = time_s;
    next_ = (joint + 1) % report_.joints.size();
  }
  if (first) report_.first_command_s = time_s;
  report_.last_command_s = time_s;
  return !same_tick;
}

JointJudge::JointJudge(BusJudge& bus, std::size_t joint, const JointMap& map,
                       const WireSteps& steps)
    : bus_(bus),
      joint_(joint),
      direction_(static_cast<double>(map.direction)),
      gear_(static_cast<double>(map.gear_ratio)),
      zero_rad_(static_cast<double>(map.zero_offset_rad)) {
  constexpr double kFloatStep_rad = 1e-5;
  steps_.position_rad = steps.position_rad > 0 ? steps.position_rad / gear_ : kFloatStep_rad;
  steps_.velocity_rad_s = steps.velocity_rad_s / gear_;
  steps_.torque_nm = steps.torque_nm * gear_;
}

bool JointJudge::Begin(double time_s, bool torque_off, bool several) {
  const bool first = bus_.CheckOrder(joint_, time_s, torque_off, several);
  if (first) ticks_ = TicksSince(time_s);
  if (commanded_ && time_s - last_s_ > bus_.rules_.silence_s) started_ = false;
  ++report().commands;
  return first;
}
void JointJudge::End(double time_s) {
  commanded_ = true;
  last_s_ = time_s;
}

void JointJudge::Off() {
  started_ = passive_before_ = false;
  last_torque_nm_ = 0;
  order_ = {};
  order_.kind = DriveOrder::Kind::kOff;
}
void JointJudge::Start() {
  if (started_) return;
  started_ = true;
  driven_ = false;
  last_torque_nm_ = 0;
  ++report().starts;
}
void JointJudge::Passive(const DriveOrder& order) {
  passive_before_ = true;
  last_torque_nm_ = 0;
  order_ = order;
  order_.kind = DriveOrder::Kind::kPassive;
}
void JointJudge::Reply(double position_rad) {
  ++report().replies;
  measured_ = true;
  measured_rad_ = position_rad;
}

void JointJudge::Fail(const std::string& what) {
  bus_.Fail(fmt::format("joint {}: {}", joint_, what));
}
void JointJudge::FailUnstarted() {
  bus_.Fail(fmt::format("joint {} is driven without having been started up", joint_));
}

double JointJudge::Position(double shaft_rad) const {
  return direction_ * shaft_rad / gear_ + zero_rad_;
}
double JointJudge::Velocity(double shaft_rad_s) const { return direction_ * shaft_rad_s / gear_; }
double JointJudge::Torque(double shaft_nm) const { return direction_ * shaft_nm * gear_; }
double JointJudge::Gain(double shaft_gain) const { return gear_ * gear_ * shaft_gain; }

void JointJudge::Within(const char* what, double value, double min, double max, double slack) {
  if (!(value >= min - slack && value <= max + slack)) {
    Fail(fmt::format("{} {:.4f} is outside {:.4f} ... {:.4f}", what, value, min, max));
  }
}

/// How many ticks' steps the joint's command in this tick may take at once.
double JointJudge::TicksSince(double time_s) const {
  const double ticks = (time_s - last_s_) * bus_.rules_.drives.rate_hz;
  const double most = bus_.rules_.ticks_made_up_max;
  if (bus_.rules_.exact_time) return std::clamp(std::round(ticks), 1.0, most);
  return std::min(most, std::ceil(ticks - 0.01) + 1);
}

void JointJudge::CheckJump(double position_rad) {
  if (!measured_) bus_.Fail(fmt::format("joint {} is driven unmeasured", joint_));
  const double jump = std::abs(position_rad - measured_rad_);
  report().start_jump_rad = std::max(report().start_jump_rad, jump);
  if (!(jump <= bus_.rules_.start_jump_max_rad)) {
    Fail(fmt::format("the first setpoint is {:.4f} rad from the measured position", jump));
  }
}

void JointJudge::CheckFeedForward(const DriveOrder& order) {
  const JointLimits<double>& limits = bus_.rules_.limits[joint_];
  Within("velocity", order.velocity_rad_s, -limits.velocity_max_rad_s, limits.velocity_max_rad_s,
         steps_.velocity_rad_s);
  Within("torque", order.torque_nm, -limits.torque_max_nm, limits.torque_max_nm, steps_.torque_nm);
  const double pushed = std::abs(order.torque_nm - last_torque_nm_);
  const double allowed =
      limits.torque_max_nm / bus_.rules_.drives.rate_hz / bus_.rules_.torque_rise_s * ticks_ +
      2 * steps_.torque_nm;
  if (driven_ && pushed > allowed) {
    Fail(fmt::format("a torque step of {:.4f} N m, at most {:.4f}", pushed, allowed));
  }
}

void JointJudge::FeedForward(double velocity_rad_s, double torque_nm) {
  DriveOrder order = order_;
  order.velocity_rad_s = velocity_rad_s;
  order.torque_nm = torque_nm;
  CheckFeedForward(order);
  order_ = order;
  last_torque_nm_ = torque_nm;
}

void JointJudge::Setpoint(DriveOrder order, double time_s) {
  const JointLimits<double>& limits = bus_.rules_.limits[joint_];
  passive_before_ = false;
  ++report().driving;
  bus_.report_.last_driving_s = time_s;
  if (!started_) FailUnstarted();
  Within("position", order.position_rad, limits.position_min_rad, limits.position_max_rad,
         steps_.position_rad);
  CheckFeedForward(order);
  if (driven_) {
    const double moved = std::abs(order.position_rad - last_position_rad_);
    const double allowed = 1.002 * limits.velocity_max_rad_s / bus_.rules_.drives.rate_hz * ticks_ +
                           2 * steps_.position_rad;
    report().step_max_rad = std::max(report().step_max_rad, moved);
    if (!(moved <= allowed)) {
      Fail(fmt::format("a step of {:.4f} rad, at most {:.4f}", moved, allowed));
    }
  } else {
    CheckJump(order.position_rad);
  }
  driven_ = true;
  last_position_rad_ = order.position_rad;
  last_torque_nm_ = order.torque_nm;
  report().last_position_rad = order.position_rad;
  order_ = order;
  order_.kind = DriveOrder::Kind::kSetpoint;
}

}  // namespace tumbler::testing
