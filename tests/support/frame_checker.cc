#include "tests/support/frame_checker.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

namespace tumbler::testing {

namespace {

constexpr double kTwoPi = 6.2831853071795864769;

// Fields of a payload, low byte first.
std::uint32_t Unsigned(const CanFrame& frame, std::size_t first, std::size_t bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = bytes; i-- > 0;) value = value << 8 | frame.data[first + i];
  return value;
}
double Signed(const CanFrame& frame, std::size_t first, std::size_t bytes) {
  const auto value = static_cast<double>(Unsigned(frame, first, bytes));
  const double range = bytes == 2 ? 65536.0 : 4294967296.0;
  return value >= range / 2 ? value - range : value;
}
double Float(const CanFrame& frame, std::size_t first) {
  return static_cast<double>(std::bit_cast<float>(Unsigned(frame, first, 4)));
}

}  // namespace

class FrameJudge::Checker {
 public:
  explicit Checker(const FrameRules& rules) : rules_(rules) {
    const std::size_t count = rules.drives.drives.size();
    if (count == 0 || rules.limits.size() != count) {
      throw std::invalid_argument("frame rules: one set of limits for each drive");
    }
    report_.joints.resize(count);
    report_.violations.reserve(16);
    joints_.resize(count);
    for (std::size_t i = 0; i < count; ++i) joints_[i].steps = StepsOf(i);
  }

  void Take(const LoggedFrame& logged) {
    ++line_;
    const CanFrame& frame = logged.frame;
    if (!frame.extended && !frame.remote) {
      if (IsCommon(logged)) return;
      for (std::size_t i = 0; i < joints_.size(); ++i) {
        const DriveConfig& config = Entry(i).config;
        bool taken = false;
        if (const auto* mit = std::get_if<MitConfig>(&config)) {
          taken = TakeMit(i, *mit, logged);
        } else if (const auto* can = std::get_if<CanSimpleConfig>(&config)) {
          taken = TakeCanSimple(i, *can, logged);
        } else {
          taken = TakeCia402(i, std::get<Cia402Config>(config), logged);
        }
        if (taken) return;
      }
    }
    Fail(fmt::format("identifier {:X} is none of the drives'", frame.id));
  }

  const FrameReport& report() {
    if (rate_time_s_ > 0) report_.rate_hz = rate_ticks_ / rate_time_s_;
    return report_;
  }
  [[nodiscard]] const DriveOrder& order(std::size_t joint) const { return joints_[joint].order; }

 private:
  /// Steps of the wire, at the joint.
  struct Steps {
    double position = 0, velocity = 0, torque = 0;
  };
  struct Joint {
    Steps steps;
    bool commanded = false;  // ever
    bool started = false;
    bool passive_before = false;  // the last setpoint could not move the joint
    bool driven = false;          // since it was started
    bool measured = false;
    double measured_rad = 0;
    double last_s = 0;
    double ticks = 1;  // since the tick before
    double last_position_rad = 0;
    double last_torque_nm = 0;
    bool velocity_mode = false;  // CANSimple
    bool switched_on = false;    // CiA 402: the last controlword was the one before operation
    bool has_input = false;      // CANSimple: the input that it would begin with
    double input_rad = 0;
    DriveOrder order;
  };

  void Fail(const std::string& what) {
    if (report_.violations.size() < 100) {
      report_.violations.push_back(fmt::format("line {}: {}", line_, what));
    }
  }
  [[nodiscard]] const DriveEntry& Entry(std::size_t joint) const {
    return rules_.drives.drives[joint];
  }
  [[nodiscard]] static double Gear(const JointMap& map) {
    return static_cast<double>(map.gear_ratio);
  }
  // Of the shaft, at the joint.
  [[nodiscard]] static double Position(const JointMap& map, double shaft_rad) {
    return static_cast<double>(map.direction) * shaft_rad / Gear(map) +
           static_cast<double>(map.zero_offset_rad);
  }
  [[nodiscard]] static double Velocity(const JointMap& map, double shaft_rad_s) {
    return static_cast<double>(map.direction) * shaft_rad_s / Gear(map);
  }
  [[nodiscard]] static double Torque(const JointMap& map, double shaft_nm) {
    return static_cast<double>(map.direction) * shaft_nm * Gear(map);
  }
  [[nodiscard]] Steps StepsOf(std::size_t i) const {
    const DriveConfig& config = Entry(i).config;
    const double gear = Gear(JointOf(config));
    if (const auto* mit = std::get_if<MitConfig>(&config)) {
      const auto step = [](const MitRange& range, int bits) {
        return static_cast<double>(range.max - range.min) / ((1 << bits) - 1);
      };
      return {step(mit->command.position_rad, 16) / gear,
              step(mit->command.velocity_rad_s, 12) / gear,
              step(mit->command.torque_nm, 12) * gear};
    }
    if (std::holds_alternative<CanSimpleConfig>(config)) {
      return {1e-5, 0.001 * kTwoPi / gear, 0.001 * gear};
    }
    const auto& cia402 = std::get<Cia402Config>(config);
    return {kTwoPi / static_cast<double>(cia402.position_units_per_turn) / gear,
            kTwoPi / static_cast<double>(cia402.velocity_units_per_turn_s) / gear,
            0.001 * static_cast<double>(cia402.rated_torque_nm) * gear};
  }

  // SYNC and the host's heartbeat.
  bool IsCommon(const LoggedFrame& logged) {
    const auto* cia402 = std::get_if<Cia402Config>(&Entry(0).config);
    if (cia402 == nullptr) return false;
    if (logged.frame.id == 0x80) {
      if (next_ != 0 && !OffBefore() && logged.time_s - report_.last_command_s < rules_.silence_s) {
        Fail(fmt::format("SYNC where joint {} is due", next_));
      }
      next_ = 0;
      return true;
    }
    return logged.frame.id == 0x700U + cia402->host_id;
  }
  [[nodiscard]] bool OffBefore() const { return joints_[0].order.kind == DriveOrder::Kind::kOff; }

  void TakeReply(std::size_t i, double position_rad) {
    ++report_.joints[i].replies;
    joints_[i].measured = true;
    joints_[i].measured_rad = position_rad;
  }

  bool TakeMit(std::size_t i, const MitConfig& mit, const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    if (frame.id == mit.reply_id) {
      if (frame.size < 6 || frame.size > 8 || frame.data[0] != (mit.command_id & 0xff)) {
        if (!rules_.spoilt_replies) Fail(fmt::format("joint {}: not a reply", i));
        return true;
      }
      const double code = frame.data[1] << 8 | frame.data[2];
      const MitRange& range = mit.reply.position_rad;
      TakeReply(i,
                Position(mit.joint, static_cast<double>(range.min) +
                                        code * static_cast<double>(range.max - range.min) / 65535));
      return true;
    }
    if (frame.id != mit.command_id) return false;
    if (frame.size != 8) {
      Fail(fmt::format("joint {}: not a command", i));
      return true;
    }
    const auto d = [&frame](std::size_t k) { return unsigned{frame.data[k]}; };
    bool ones = true;
    for (std::size_t k = 0; k < 7; ++k) ones = ones && d(k) == 0xff;
    const bool off = ones && d(7) == 0xfd;
    Begin(i, logged.time_s, off, false);
    if (ones && d(7) == 0xfe) {
      Fail(fmt::format("joint {}: its zero is set", i));
    } else if (off) {
      Off(i);
    } else if (ones && d(7) == 0xfc) {
      if (!joints_[i].started && !joints_[i].passive_before) {
        Fail(fmt::format("joint {}: motor mode without a neutral setpoint before", i));
      }
      Start(i);
    } else {
      const auto value = [](unsigned code, const MitRange& range, double top) {
        return static_cast<double>(range.min) +
               code * static_cast<double>(range.max - range.min) / top;
      };
      const MitRanges& ranges = mit.command;
      DriveOrder order;
      order.position_rad = Position(mit.joint, value(d(0) << 8 | d(1), ranges.position_rad, 65535));
      order.velocity_rad_s =
          Velocity(mit.joint, value(d(2) << 4 | d(3) >> 4, ranges.velocity_rad_s, 4095));
      const double gear_2 = Gear(mit.joint) * Gear(mit.joint);
      order.kp_nm_per_rad = gear_2 * value((d(3) & 0xf) << 8 | d(4), ranges.kp_nm_per_rad, 4095);
      order.kd_nm_s_per_rad = gear_2 * value(d(5) << 4 | d(6) >> 4, ranges.kd_nm_s_per_rad, 4095);
      order.torque_nm = Torque(mit.joint, value((d(6) & 0xf) << 8 | d(7), ranges.torque_nm, 4095));
      const bool drives =
          order.kp_nm_per_rad > 0 || std::abs(order.torque_nm) > joints_[i].steps.torque ||
          (order.kd_nm_s_per_rad > 0 && std::abs(order.velocity_rad_s) > joints_[i].steps.velocity);
      if (drives) {
        Setpoint(i, order, logged.time_s);
      } else {
        Passive(i, order);
      }
    }
    End(i, logged.time_s);
    return true;
  }

  bool TakeCanSimple(std::size_t i, const CanSimpleConfig& can, const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    if (frame.id >> 5 != can.node_id) return false;
    Joint& joint = joints_[i];
    const unsigned command = frame.id & 0x1f;
    const auto position = [&can](double turns) { return Position(can.joint, turns * kTwoPi); };
    switch (command) {
      case 0x01:
      case 0x03:
      case 0x15:
      case 0x1c:
        return true;  // The drive's.
      case 0x09:
        TakeReply(i, position(Float(frame, 0)));
        return true;
      case 0x07: {
        const std::uint32_t state = Unsigned(frame, 0, 4);
        Begin(i, logged.time_s, state == 1, true);
        if (state == 1) {
          Off(i);
        } else if (state == 8) {
          if (!joint.has_input || joint.velocity_mode) {
            Fail(fmt::format("joint {}: closed loop without a position to begin with", i));
          } else {
            CheckJump(i, joint.input_rad);
          }
          Start(i);
        } else {
          Fail(fmt::format("joint {}: axis state {}", i, state));
        }
        break;
      }
      case 0x0b:
        Begin(i, logged.time_s, false, true);
        joint.velocity_mode = Unsigned(frame, 0, 4) == 2;
        if (!joint.velocity_mode && Unsigned(frame, 0, 4) != 3) {
          Fail(fmt::format("joint {}: control mode {}", i, Unsigned(frame, 0, 4)));
        }
        break;
      case 0x0c: {
        Begin(i, logged.time_s, false, true);
        DriveOrder order;
        order.position_rad = position(Float(frame, 0));
        order.velocity_rad_s = Velocity(can.joint, Signed(frame, 4, 2) * 0.001 * kTwoPi);
        order.torque_nm = Torque(can.joint, Signed(frame, 6, 2) * 0.001);
        joint.has_input = true;
        joint.input_rad = order.position_rad;
        if (joint.velocity_mode) Fail(fmt::format("joint {}: a position in velocity mode", i));
        // What an idle drive hears is kept for later: it is judged when closed loop is asked for.
        if (joint.started) Setpoint(i, order, logged.time_s);
        break;
      }
      case 0x0d: {
        Begin(i, logged.time_s, false, true);
        const bool still = std::abs(Float(frame, 0)) <= 1e-6 && std::abs(Float(frame, 4)) <= 1e-6;
        if (!joint.velocity_mode || !still) {
          Fail(fmt::format("joint {}: a velocity that is not for braking", i));
        }
        Passive(i, {});
        break;
      }
      case 0x18:
        Begin(i, logged.time_s, false, true);
        if (joint.started) Fail(fmt::format("joint {}: errors are cleared while it is driven", i));
        break;
      default:
        Fail(fmt::format("joint {}: command {:X}", i, command));
        return true;
    }
    End(i, logged.time_s);
    return true;
  }

  bool TakeCia402(std::size_t i, const Cia402Config& node, const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    const bool nmt = frame.id == 0 && frame.data[1] == node.node_id;
    if (!nmt && (frame.id & 0x7f) != node.node_id) return false;
    Joint& joint = joints_[i];
    const auto position = [&node](double units) {
      return Position(node.joint,
                      units * kTwoPi / static_cast<double>(node.position_units_per_turn));
    };
    switch (nmt ? 0 : frame.id & ~0x7fU) {
      case 0x080:
      case 0x280:
      case 0x580:
      case 0x700:
        return true;  // The drive's.
      case 0x180:
        TakeReply(i, position(Signed(frame, 2, 4)));
        return true;
      case 0x000:
      case 0x600:
        Begin(i, logged.time_s, false, true);
        if (joint.started) Fail(fmt::format("joint {}: set up while it is driven", i));
        break;
      case 0x200: {
        const std::uint32_t word = Unsigned(frame, 0, 2);
        const bool on = word == 0x0f, brakes = word == 0x02;
        Begin(i, logged.time_s, !on && !brakes, true);
        DriveOrder order;
        order.position_rad = position(Signed(frame, 2, 4));
        feed_forward_of_ = on ? static_cast<int>(i) : -1;
        if (on) {
          if (!joint.started) {
            if (!joint.switched_on) {
              Fail(fmt::format("joint {} is driven without having been started up", i));
            }
            Start(i);
          }
          // With the feed-forward of the tick before, unless the second frame says otherwise.
          order.velocity_rad_s = joint.order.velocity_rad_s;
          order.torque_nm = joint.last_torque_nm;
          Setpoint(i, order, logged.time_s);
        } else if (brakes) {
          Passive(i, order);
        } else if (word == 0x00 || word == 0x06 || word == 0x07 || word == 0x80) {
          Off(i);
          joint.switched_on = word == 0x07;
        } else {
          Fail(fmt::format("joint {}: controlword {:X}", i, word));
        }
        break;
      }
      case 0x300: {
        Begin(i, logged.time_s, false, true);
        DriveOrder order = joint.order;
        order.velocity_rad_s =
            Velocity(node.joint, Signed(frame, 0, 4) * kTwoPi /
                                     static_cast<double>(node.velocity_units_per_turn_s));
        order.torque_nm = Torque(
            node.joint, Signed(frame, 4, 2) * 0.001 * static_cast<double>(node.rated_torque_nm));
        if (feed_forward_of_ == static_cast<int>(i)) {
          CheckFeedForward(i, order);
          joint.order = order;
          joint.last_torque_nm = order.torque_nm;
        } else if (order.torque_nm != 0 || order.velocity_rad_s != 0) {
          Fail(fmt::format("joint {}: feed-forward without a setpoint", i));
        }
        break;
      }
      default:
        Fail(fmt::format("joint {}: identifier {:X}", i, frame.id));
        return true;
    }
    End(i, logged.time_s);
    return true;
  }

  /// A command to joint i. @param several  whether a tick may bring it more than one frame.
  void Begin(std::size_t i, double time_s, bool torque_off, bool several) {
    Joint& joint = joints_[i];
    if (CheckOrder(i, time_s, torque_off, several)) {
      joint.ticks = TicksSince(joint, time_s);
      if (joint.has_input && !joint.started) {  // It was not for starting up.
        Fail(fmt::format("joint {} is driven without having been started up", i));
      }
    }
    if (joint.commanded && time_s - joint.last_s > rules_.silence_s) joint.started = false;
    ++report_.joints[i].commands;
  }
  void End(std::size_t i, double time_s) {
    joints_[i].commanded = true;
    joints_[i].last_s = time_s;
  }

  // Whether it is the joint's first command in a tick.
  bool CheckOrder(std::size_t i, double time_s, bool torque_off, bool several) {
    const bool first = report_.first_command_s == 0 && report_.last_command_s == 0;
    const double gap_s = first ? 0 : time_s - report_.last_command_s;
    const bool silence = gap_s > rules_.silence_s;
    report_.longest_silence_s = std::max(report_.longest_silence_s, gap_s);
    // More frames of the joint that had the last one, in the same tick.
    const bool same_tick =
        several && !first && i == current_ && time_s - tick_begin_s_ < 0.5 / rules_.drives.rate_hz;
    if (!same_tick) {
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
      current_ = i;
      tick_begin_s_ = time_s;
      next_ = (i + 1) % joints_.size();
    }
    if (first) report_.first_command_s = time_s;
    report_.last_command_s = time_s;
    return !same_tick;
  }

  void Off(std::size_t i) {
    joints_[i].started = joints_[i].passive_before = joints_[i].has_input = false;
    joints_[i].switched_on = false;
    joints_[i].last_torque_nm = 0;
    joints_[i].order = {};
    joints_[i].order.kind = DriveOrder::Kind::kOff;
  }
  void Start(std::size_t i) {
    Joint& joint = joints_[i];
    if (joint.started) return;
    joint.started = true;
    joint.driven = false;
    joint.last_torque_nm = 0;
    ++report_.joints[i].starts;
  }
  void Passive(std::size_t i, const DriveOrder& order) {
    joints_[i].passive_before = true;
    joints_[i].last_torque_nm = 0;
    joints_[i].order = order;
    joints_[i].order.kind = DriveOrder::Kind::kPassive;
  }

  void Within(std::size_t i, const char* what, double value, double min, double max, double slack) {
    if (!(value >= min - slack && value <= max + slack)) {
      Fail(fmt::format("joint {}: {} {:.4f} is outside {:.4f} ... {:.4f}", i, what, value, min,
                       max));
    }
  }
  /// Ticks whose steps the joint's command in this tick may take at once.
  [[nodiscard]] double TicksSince(const Joint& joint, double time_s) const {
    const double ticks = (time_s - joint.last_s) * rules_.drives.rate_hz;
    const double most = rules_.ticks_made_up_max;
    if (rules_.exact_time) return std::clamp(std::round(ticks), 1.0, most);
    return std::min(most, std::ceil(ticks - 0.01) + 1);
  }
  void CheckJump(std::size_t i, double position_rad) {
    if (!joints_[i].measured) Fail(fmt::format("joint {} is driven unmeasured", i));
    const double jump = std::abs(position_rad - joints_[i].measured_rad);
    report_.joints[i].start_jump_rad = std::max(report_.joints[i].start_jump_rad, jump);
    if (!(jump <= rules_.start_jump_max_rad)) {
      Fail(fmt::format("joint {}: the first setpoint is {:.4f} rad from the measured position", i,
                       jump));
    }
  }
  void CheckFeedForward(std::size_t i, const DriveOrder& order) {
    const Joint& joint = joints_[i];
    const JointLimits<double>& limits = rules_.limits[i];
    Within(i, "velocity", order.velocity_rad_s, -limits.velocity_max_rad_s,
           limits.velocity_max_rad_s, joint.steps.velocity);
    Within(i, "torque", order.torque_nm, -limits.torque_max_nm, limits.torque_max_nm,
           joint.steps.torque);
    const double pushed = std::abs(order.torque_nm - joint.last_torque_nm);
    const double allowed =
        limits.torque_max_nm / rules_.drives.rate_hz / rules_.torque_rise_s * joint.ticks +
        2 * joint.steps.torque;
    if (joint.driven && pushed > allowed) {
      Fail(
          fmt::format("joint {}: a torque step of {:.4f} N m, at most {:.4f}", i, pushed, allowed));
    }
  }

  void Setpoint(std::size_t i, DriveOrder order, double time_s) {
    Joint& joint = joints_[i];
    FrameReport::Joint& report = report_.joints[i];
    const JointLimits<double>& limits = rules_.limits[i];
    joint.passive_before = false;
    ++report.driving;
    report_.last_driving_s = time_s;
    if (!joint.started) Fail(fmt::format("joint {} is driven without having been started up", i));
    Within(i, "position", order.position_rad, limits.position_min_rad, limits.position_max_rad,
           joint.steps.position);
    CheckFeedForward(i, order);
    if (joint.driven) {
      const double moved = std::abs(order.position_rad - joint.last_position_rad);
      const double allowed =
          1.002 * limits.velocity_max_rad_s / rules_.drives.rate_hz * joint.ticks +
          2 * joint.steps.position;
      report.step_max_rad = std::max(report.step_max_rad, moved);
      if (!(moved <= allowed)) {
        Fail(fmt::format("joint {}: a step of {:.4f} rad, at most {:.4f}", i, moved, allowed));
      }
    } else {
      CheckJump(i, order.position_rad);
    }
    joint.driven = true;
    joint.last_position_rad = order.position_rad;
    joint.last_torque_nm = order.torque_nm;
    report.last_position_rad = order.position_rad;
    joint.order = order;
    joint.order.kind = DriveOrder::Kind::kSetpoint;
  }

  FrameRules rules_;
  FrameReport report_;
  std::vector<Joint> joints_;
  int line_ = 0;
  std::size_t current_ = 0;  // joint that had the last command
  std::size_t next_ = 0;
  double tick_begin_s_ = 0;
  int feed_forward_of_ = -1;  // CiA 402: the joint whose setpoint came last
  double last_tick_s_ = 0;
  double rate_time_s_ = 0;
  int rate_ticks_ = 0;
};

FrameJudge::FrameJudge(const FrameRules& rules) : checker_(std::make_unique<Checker>(rules)) {}
FrameJudge::~FrameJudge() = default;
void FrameJudge::Take(const LoggedFrame& logged) { checker_->Take(logged); }
const FrameReport& FrameJudge::report() { return checker_->report(); }
const DriveOrder& FrameJudge::last_order(std::size_t joint) const { return checker_->order(joint); }

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
  FrameJudge judge(rules);
  for (const LoggedFrame& logged : log) judge.Take(logged);
  return judge.report();
}

}  // namespace tumbler::testing
