#include "tests/support/frame_checker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

namespace tumbler::testing {

namespace {

class Checker {
 public:
  Checker(const FrameRules& rules) : rules_(rules) {
    const std::size_t count = rules.drives.drives.size();
    if (count == 0 || rules.limits.size() != count) {
      throw std::invalid_argument("frame rules: one set of limits for each drive");
    }
    report_.joints.resize(count);
    joints_.resize(count);
  }

  FrameReport Check(const std::vector<LoggedFrame>& log) {
    for (const LoggedFrame& logged : log) {
      ++line_;
      Take(logged);
    }
    if (rate_time_s_ > 0) report_.rate_hz = rate_ticks_ / rate_time_s_;
    return report_;
  }

 private:
  struct Joint {
    bool commanded = false;  // ever
    bool started = false;
    bool passive_before = false;  // the last setpoint could not move the joint
    bool driven = false;          // since it was started
    bool measured = false;
    double measured_rad = 0;
    double last_s = 0;
    MitCommand last;
  };

  void Fail(const std::string& what) {
    report_.violations.push_back(fmt::format("line {}: {}", line_, what));
  }
  [[nodiscard]] const DriveEntry& Entry(std::size_t joint) const {
    return rules_.drives.drives[joint];
  }

  [[nodiscard]] const MitConfig& Mit(std::size_t joint) const {
    return std::get<MitConfig>(Entry(joint).config);
  }

  void Take(const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      const MitConfig& mit = Mit(i);
      if (frame.extended || frame.remote) break;
      if (frame.id == mit.reply_id) return TakeReply(i, frame);
      if (frame.id == mit.command_id) return TakeCommand(i, logged);
    }
    Fail(fmt::format("identifier {:X} is none of the drives'", frame.id));
  }

  void TakeReply(std::size_t i, const CanFrame& frame) {
    MitReply reply;
    if (DecodeMitReply(Mit(i), frame, reply) != Status::kOk) {
      return Fail(fmt::format("joint {}: not a reply", i));
    }
    ++report_.joints[i].replies;
    joints_[i].measured = true;
    joints_[i].measured_rad = Mit(i).joint.ToJointPosition(reply.position_rad);
  }

  void TakeCommand(std::size_t i, const LoggedFrame& logged) {
    Joint& joint = joints_[i];
    MitMagic magic{};
    MitCommand command;
    const bool is_magic = DecodeMitMagic(Mit(i), logged.frame, magic);
    if (!is_magic && DecodeMitCommand(Mit(i), logged.frame, command) != Status::kOk) {
      return Fail(fmt::format("joint {}: not a command", i));
    }
    CheckOrder(i, logged.time_s, is_magic && magic == MitMagic::kExit);
    if (joint.commanded && logged.time_s - joint.last_s > rules_.silence_s) joint.started = false;
    ++report_.joints[i].commands;
    if (is_magic) {
      TakeMagic(i, magic);
    } else {
      TakeSetpoint(i, command, logged.time_s);
    }
    joint.commanded = true;
    joint.last_s = logged.time_s;
  }

  void CheckOrder(std::size_t i, double time_s, bool torque_off) {
    const bool first = report_.first_command_s == 0 && report_.last_command_s == 0;
    const double gap_s = first ? 0 : time_s - report_.last_command_s;
    const bool silence = gap_s > rules_.silence_s;
    if (i != next_ && !first && !silence && !(torque_off && i == 0)) {
      Fail(fmt::format("joint {} is commanded where joint {} is due", i, next_));
    }
    if (i == 0) {
      if (last_tick_s_ > 0 && !silence && time_s > last_tick_s_) {
        rate_time_s_ += time_s - last_tick_s_;
        ++rate_ticks_;
      }
      last_tick_s_ = time_s;
    }
    next_ = (i + 1) % joints_.size();
    if (first) report_.first_command_s = time_s;
    report_.last_command_s = time_s;
    report_.longest_silence_s = std::max(report_.longest_silence_s, gap_s);
  }

  void TakeMagic(std::size_t i, MitMagic magic) {
    Joint& joint = joints_[i];
    if (magic == MitMagic::kZero) Fail(fmt::format("joint {}: its zero is set", i));
    if (magic == MitMagic::kExit) joint.started = joint.passive_before = false;
    if (magic == MitMagic::kEnter && !joint.started) {
      if (!joint.passive_before) {
        Fail(fmt::format("joint {}: motor mode without a neutral setpoint before", i));
      }
      joint.started = true;
      joint.driven = false;
      ++report_.joints[i].starts;
    }
  }

  void TakeSetpoint(std::size_t i, const MitCommand& command, double time_s) {
    Joint& joint = joints_[i];
    FrameReport::Joint& report = report_.joints[i];
    const DriveEntry& entry = Entry(i);
    const JointMap& map = std::get<MitConfig>(entry.config).joint;
    const JointLimits<double>& limits = rules_.limits[i];
    // A step of the wire's, at the joint.
    const auto step = [](const MitRange& range, int bits) {
      return static_cast<double>(range.max - range.min) / ((1 << bits) - 1);
    };
    const double gear = map.gear_ratio;
    const double position_step =
        step(std::get<MitConfig>(entry.config).command.position_rad, 16) / gear;
    const double velocity_step =
        step(std::get<MitConfig>(entry.config).command.velocity_rad_s, 12) / gear;
    const double torque_step = step(std::get<MitConfig>(entry.config).command.torque_nm, 12) * gear;
    const double position = map.ToJointPosition(command.position_rad);
    const double velocity = map.ToJointVelocity(command.velocity_rad_s);
    const double torque = map.ToJointTorque(command.torque_nm);
    const bool drives = command.kp_nm_per_rad > 0 || std::abs(torque) > torque_step;
    joint.passive_before = !drives;
    if (!drives) return;

    ++report.driving;
    report_.last_driving_s = time_s;
    if (!joint.started) Fail(fmt::format("joint {} is driven without having been started up", i));
    const auto within = [&](const char* what, double value, double min, double max, double slack) {
      if (!(value >= min - slack && value <= max + slack)) {
        Fail(fmt::format("joint {}: {} {:.4f} is outside {:.4f} ... {:.4f}", i, what, value, min,
                         max));
      }
    };
    within("position", position, limits.position_min_rad, limits.position_max_rad, position_step);
    within("velocity", velocity, -limits.velocity_max_rad_s, limits.velocity_max_rad_s,
           velocity_step);
    within("torque", torque, -limits.torque_max_nm, limits.torque_max_nm, torque_step);

    if (joint.driven) {
      const double period_s = 1 / rules_.drives.rate_hz;
      const double ticks = std::min<double>(rules_.ticks_made_up_max,
                                            std::ceil((time_s - joint.last_s) / period_s) + 1);
      const double moved = std::abs(position - map.ToJointPosition(joint.last.position_rad));
      const double allowed =
          1.002 * limits.velocity_max_rad_s * period_s * ticks + 2 * position_step;
      report.step_max_rad = std::max(report.step_max_rad, moved);
      if (moved > allowed) {
        Fail(fmt::format("joint {}: a step of {:.4f} rad, at most {:.4f}", i, moved, allowed));
      }
      const double pushed = std::abs(torque - map.ToJointTorque(joint.last.torque_nm));
      const double torque_allowed =
          limits.torque_max_nm * period_s / rules_.torque_rise_s * ticks + 2 * torque_step;
      if (pushed > torque_allowed) {
        Fail(fmt::format("joint {}: a torque step of {:.4f} N m, at most {:.4f}", i, pushed,
                         torque_allowed));
      }
    } else {
      if (!joint.measured) Fail(fmt::format("joint {} is driven unmeasured", i));
      const double jump = std::abs(position - joint.measured_rad);
      report.start_jump_rad = std::max(report.start_jump_rad, jump);
      if (jump > rules_.start_jump_max_rad) {
        Fail(fmt::format("joint {}: the first setpoint is {:.4f} rad from the measured position", i,
                         jump));
      }
    }
    joint.driven = true;
    joint.last = command;
    report.last_position_rad = position;
  }

  const FrameRules& rules_;
  FrameReport report_;
  std::vector<Joint> joints_;
  int line_ = 0;
  std::size_t next_ = 0;
  double last_tick_s_ = 0;
  double rate_time_s_ = 0;
  int rate_ticks_ = 0;
};

}  // namespace

std::vector<LoggedFrame> ParseCandumpLog(std::string_view text) {
  std::vector<LoggedFrame> log;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = text.find('\n');
    const std::string line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const auto require = [&](bool condition) {
      if (!condition) {
        throw std::runtime_error(
            fmt::format("line {} is not one of candump -L: '{}'", number, line));
      }
    };
    // (1795259017.651121) vcan0 123#DEADBEEF
    const std::size_t after_time = line.find(") ");
    const std::size_t hash = line.find('#');
    require(line.size() > 2 && line[0] == '(' && after_time != std::string::npos &&
            hash != std::string::npos);
    LoggedFrame logged;
    char* rest = nullptr;
    logged.time_s = std::strtod(line.c_str() + 1, &rest);
    require(rest == line.c_str() + after_time);
    const std::size_t space = line.rfind(' ', hash);
    require(space != std::string::npos && space > after_time);
    const std::string id = line.substr(space + 1, hash - space - 1);
    require(id.size() == 3 || id.size() == 8);
    logged.frame.extended = id.size() == 8;
    logged.frame.id = static_cast<std::uint32_t>(std::strtoul(id.c_str(), &rest, 16));
    require(*rest == '\0');
    std::string data = line.substr(hash + 1);
    if (!data.empty() && data[0] == 'R') {
      logged.frame.remote = true;
      data.clear();
    }
    require(data.size() % 2 == 0 && data.size() <= 16);
    logged.frame.size = static_cast<std::uint8_t>(data.size() / 2);
    for (std::size_t i = 0; i < logged.frame.size; ++i) {
      const std::string byte = data.substr(2 * i, 2);
      logged.frame.data[i] = static_cast<std::uint8_t>(std::strtoul(byte.c_str(), &rest, 16));
      require(*rest == '\0');
    }
    log.push_back(logged);
  }
  return log;
}

FrameReport CheckFrames(const std::vector<LoggedFrame>& log, const FrameRules& rules) {
  return Checker(rules).Check(log);
}

}  // namespace tumbler::testing
