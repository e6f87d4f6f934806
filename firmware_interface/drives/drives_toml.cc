#include "firmware_interface/drives/drives_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <utility>

#include "common/primitive.h"
#include "common/toml_reader.h"
#include "firmware_interface/can/frame_length.h"

namespace tumbler {

namespace {

constexpr std::int64_t kDrivesFileVersion = 1;
constexpr double kLargest = static_cast<double>(kMitLargest);

float NumberAsFloat(TomlTable& table, std::string_view key, Range range) {
  return static_cast<float>(table.Number(key, range));
}

/// A range [min, max] around zero, or from zero on for gains.
MitRange ReadRange(TomlTable& table, std::string_view key, bool from_zero) {
  const std::vector<double> ends = table.Numbers(key, {-kLargest, kLargest, false}, 2);
  if (!(ends[0] < ends[1])) {
    table.Fail(key, fmt::format("is [{}, {}]; the first number must be below the second",
                                MessageNumber(ends[0]), MessageNumber(ends[1])));
  }
  if (from_zero ? ends[0] != 0 : !(ends[0] < 0 && ends[1] > 0)) {
    table.Fail(key, fmt::format(
                        "is [{}, {}]; {}", MessageNumber(ends[0]), MessageNumber(ends[1]),
                        from_zero ? "a gain's range must start at 0" : "the range must contain 0"));
  }
  return {static_cast<float>(ends[0]), static_cast<float>(ends[1])};
}

MitRanges ReadRanges(TomlTable& table) {
  MitRanges ranges;
  ranges.position_rad = ReadRange(table, "position_rad", false);
  ranges.velocity_rad_s = ReadRange(table, "velocity_rad_s", false);
  ranges.kp_nm_per_rad = ReadRange(table, "kp_nm_per_rad", true);
  ranges.kd_nm_s_per_rad = ReadRange(table, "kd_nm_s_per_rad", true);
  ranges.torque_nm = ReadRange(table, "torque_nm", false);
  return ranges;
}

/// Ranges of replies where the drive's differ from those of its commands.
MitRanges ReadReplyRanges(TomlTable& table, MitRanges ranges) {
  if (table.Has("position_rad")) ranges.position_rad = ReadRange(table, "position_rad", false);
  if (table.Has("velocity_rad_s")) {
    ranges.velocity_rad_s = ReadRange(table, "velocity_rad_s", false);
  }
  if (table.Has("torque_nm")) ranges.torque_nm = ReadRange(table, "torque_nm", false);
  return ranges;
}

/// A gain at the joint that the drive can carry at its shaft.
float ReadGain(TomlTable& table, std::string_view key, const MitRange& range,
               const JointMap& joint) {
  const float gain = NumberAsFloat(table, key, Range::NonNegative());
  if (joint.ToDriveGain(gain) > range.max) {
    table.Fail(key, fmt::format("is {}; the drive carries at most {} at the joint",
                                MessageNumber(static_cast<double>(gain)),
                                MessageNumber(static_cast<double>(joint.ToJointGain(range.max)))));
  }
  return gain;
}

JointMap ReadJoint(TomlTable& table) {
  JointMap joint;
  const std::int64_t direction = table.Integer("direction", -1, 1, 1);
  if (direction == 0) table.Fail("direction", "is 0; allowed: 1 or -1");
  joint.direction = static_cast<float>(direction);
  joint.gear_ratio = static_cast<float>(table.Number("gear_ratio", {0.001, 1000, false}, 1));
  joint.zero_offset_rad =
      static_cast<float>(table.Number("zero_offset_rad", {-1000, 1000, false}, 0));
  return joint;
}

void ReadMit(TomlTable& table, DriveEntry& drive) {
  static constexpr std::array<std::string_view, 2> kTemperatures = {"signed", "offset-40"};
  MitConfig mit;
  mit.command_id = static_cast<std::uint16_t>(table.Integer("command_id", 1, 0xff));
  mit.reply_id = static_cast<std::uint16_t>(table.Integer("reply_id", 0, 0x7ff));
  mit.joint = ReadJoint(table);
  TomlTable range = table.Table("range");
  mit.command = ReadRanges(range);
  mit.reply = mit.command;
  if (auto reply = table.OptionalTable("reply_range")) {
    mit.reply = ReadReplyRanges(*reply, mit.command);
  }
  mit.temperature = table.Choice("temperature_encoding", kTemperatures, "signed") == "signed"
                        ? MitTemperature::kSigned
                        : MitTemperature::kOffset40;
  drive.kp_nm_per_rad = ReadGain(table, "kp_nm_per_rad", mit.command.kp_nm_per_rad, mit.joint);
  drive.kd_nm_s_per_rad =
      ReadGain(table, "kd_nm_s_per_rad", mit.command.kd_nm_s_per_rad, mit.joint);
  if (mit.reply_id == mit.command_id) {
    table.Fail(
        "reply_id",
        fmt::format("is {}, as command_id; a drive's two identifiers must differ", mit.reply_id));
  }
  drive.config = mit;
}

/// Ranges at the shaft, none wider than the wire carries.
ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max) {
  TomlTable range = table.Table("range");
  const auto read = [&range](std::string_view key, double most) {
    const DriveRange ends = ReadRange(range, key, false);
    // Ends are floats: what rounds to the last one that fits is let pass.
    if (!ends.ContainsZeroWithin(static_cast<float>(most))) {
      range.Fail(key,
                 fmt::format("is [{}, {}]; the protocol carries at most +-{} at the shaft",
                             MessageNumber(static_cast<double>(ends.min)),
                             MessageNumber(static_cast<double>(ends.max)), MessageNumber(most)));
    }
    return ends;
  };
  return {read("position_rad", position_max), read("velocity_rad_s", velocity_max),
          read("torque_nm", torque_max)};
}

/// What the drive was tuned to, for protocols that do not carry gains.
void ReadOwnGains(TomlTable& table, DriveEntry& drive) {
  drive.kp_nm_per_rad = NumberAsFloat(table, "kp_nm_per_rad", {0, 1e6, true});
  drive.kd_nm_s_per_rad = NumberAsFloat(table, "kd_nm_s_per_rad", {0, 1e6, true});
}

void ReadCanSimple(TomlTable& table, const DrivesConfig& bus, DriveEntry& drive) {
  constexpr double kPositionMax_rad = 1e6;
  constexpr double kVelocityMax_rad_s = 205.88;  // 32.767 turns/s
  constexpr double kTorqueMax_nm = 32.767;
  CanSimpleConfig can;
  can.node_id = static_cast<std::uint8_t>(table.Integer("node_id", 0, kCanSimpleNodeMax));
  can.joint = ReadJoint(table);
  can.range = ReadShaftRanges(table, kPositionMax_rad, kVelocityMax_rad_s, kTorqueMax_nm);
  ReadOwnGains(table, drive);
  CanSimpleMessages& messages = drive.messages;
  messages.heartbeat_s = table.Number("heartbeat_s", {0.001, 1, false}, messages.heartbeat_s);
  messages.estimates_s = table.Number("estimates_s", {0.001, 0.1, false}, messages.estimates_s);
  for (const auto& [key, period] : {std::pair{"torques_s", &messages.torques_s},
                                    std::pair{"temperature_s", &messages.temperature_s}}) {
    *period = table.Number(key, {0, 60, false}, *period);
    if (*period > 0 && *period < 0.001) {
      table.Fail(key, fmt::format("is {}; allowed: 0 (not sent) or from 0.001 ... 60",
                                  MessageNumber(*period)));
    }
  }
  // A measurement that is older than a few ticks counts as a drive that is silent.
  const double estimate_ticks = messages.estimates_s * bus.rate_hz;
  if (estimate_ticks > 4) {
    table.Fail("estimates_s",
               fmt::format("is {}, {} ticks of the control loop; at most 4 are "
                           "allowed: raise encoder_msg_rate of the drive",
                           MessageNumber(messages.estimates_s), MessageNumber(estimate_ticks)));
  }
  can.heartbeat_ticks_max =
      static_cast<int>(std::ceil(2.5 * messages.heartbeat_s * bus.rate_hz)) + 1;
  can.estimates_per_tick_max = static_cast<int>(std::ceil(1 / estimate_ticks)) + 1;
  drive.config = can;
}

void ReadCia402(TomlTable& table, TomlTable& bus_table, const DrivesConfig& bus,
                DriveEntry& drive) {
  static constexpr std::array<std::string_view, 4> kReactions = {"none", "fault", "disable",
                                                                 "quick-stop"};
  constexpr double kTwoPi = 6.2831853071795864769;
  constexpr double kInt32 = 2147483520.0;  // the largest float below 2^31
  Cia402Config cia402;
  cia402.node_id = static_cast<std::uint8_t>(table.Integer("node_id", 1, 126));
  cia402.host_id =
      static_cast<std::uint8_t>(table.Integer("host_id", 1, kCanOpenNodeMax, kCanOpenNodeMax));
  cia402.joint = ReadJoint(table);
  const double units = table.Number("position_units_per_turn", {1, 1e9, false});
  const double velocity_units =
      table.Number("velocity_units_per_turn_s", {0.001, 1e9, false}, units);
  const double rated_nm = table.Number("rated_torque_nm", {0.001, 10'000, false});
  cia402.position_units_per_turn = static_cast<float>(units);
  cia402.velocity_units_per_turn_s = static_cast<float>(velocity_units);
  cia402.rated_torque_nm = static_cast<float>(rated_nm);
  constexpr double kRounded = 0.999999;  // The drive computes with floats.
  cia402.range = ReadShaftRanges(table, std::min(kInt32 / units * kTwoPi * kRounded, 1e6),
                                 std::min(kInt32 / velocity_units * kTwoPi * kRounded, 1e6),
                                 std::min(32.767 * rated_nm * kRounded, 1e6));
  ReadOwnGains(table, drive);
  cia402.heartbeat_ms = static_cast<std::uint16_t>(
      std::llround(1000 * table.Number("heartbeat_s", {0.001, 10, false}, 0.1)));
  const std::string reaction = table.Choice("watchdog_reaction", kReactions, "fault");
  cia402.watchdog_reaction = static_cast<std::int16_t>(
      std::find(kReactions.begin(), kReactions.end(), reaction) - kReactions.begin());
  cia402.quick_stop_option = static_cast<std::int16_t>(table.Integer("quick_stop_option", 1, 7, 6));
  cia402.feed_forward = table.Boolean("feed_forward", true);
  cia402.status_every = static_cast<std::uint8_t>(table.Integer("status_every", 1, 240, 4));
  cia402.following_window_rad = static_cast<float>(
      table.Number("following_window_rad", {0, kInt32 / units * kTwoPi * kRounded, false}, 0));
  if (cia402.host_id == cia402.node_id) {
    table.Fail("host_id",
               fmt::format("is {}, as node_id; the host has a number of its own", cia402.host_id));
  }
  const double period_us = 1e6 / bus.rate_hz;
  cia402.period_us = static_cast<std::uint32_t>(std::llround(period_us));
  Cia402Period period;
  if (std::abs(period_us - cia402.period_us) > 1e-6 || cia402.period_us < 100 ||
      ToInterpolationPeriod(cia402.period_us, period) != Status::kOk) {
    bus_table.Fail("rate_hz",
                   fmt::format("is {}, a period of {} us; CiA 402 drives take 1 to 255 times 1, "
                               "10, 100, ... us, e.g. 1000, 500, 400 or 250 Hz",
                               MessageNumber(bus.rate_hz), MessageNumber(period_us)));
  }
  const double watchdog_s = table.Number("watchdog_s", {0, 10, false});
  if (watchdog_s > 0 && watchdog_s * bus.rate_hz < 3) {
    table.Fail("watchdog_s",
               fmt::format("is {}; allowed: 0 (none) or at least 3 periods of the "
                           "control loop, {}",
                           MessageNumber(watchdog_s), MessageNumber(3 / bus.rate_hz)));
  }
  cia402.watchdog_ms = static_cast<std::uint16_t>(std::llround(watchdog_s * 1000));
  drive.config = cia402;
}

DriveEntry ReadDrive(TomlTable& table, TomlTable& bus_table, const DrivesConfig& bus) {
  static constexpr std::array<std::string_view, 3> kProtocols = {"mit", "canopen-csp", "cansimple"};
  DriveEntry drive;
  drive.joint = table.String("joint");
  if (drive.joint.empty() || !FixedString<32>::fits(drive.joint)) {
    table.Fail("joint", fmt::format("is '{}'; allowed: 1 to 32 bytes", drive.joint));
  }
  if (!table.Has("protocol")) table.Fail("protocol", "is missing and has no default");
  const std::string protocol = table.Choice("protocol", kProtocols, "");
  if (protocol == "mit") {
    ReadMit(table, drive);
  } else if (protocol == "cansimple") {
    ReadCanSimple(table, bus, drive);
  } else {
    ReadCia402(table, bus_table, bus, drive);
  }
  drive.temperature_max_c = NumberAsFloat(table, "temperature_max_c", {0, 200, true});
  drive.watchdog_s = table.Number("watchdog_s", {0, 10, false});
  if (Validate(drive.config) != Status::kOk) {
    table.Fail("", "does not describe a drive of this protocol");
  }
  return drive;
}

/// The identifiers on the bus that one key decides on.
struct Identifiers {
  std::string_view key;     ///< of the file
  std::uint32_t value = 0;  ///< of that key
  bool to_drive = false;    ///< sent by the host and obeyed by the drive
  bool common = false;      ///< to all drives of the protocol
  std::vector<std::uint32_t> ids;
};

std::vector<Identifiers> IdentifiersOf(const DriveEntry& drive) {
  if (const auto* mit = std::get_if<MitConfig>(&drive.config)) {
    return {{"command_id", mit->command_id, true, false, {mit->command_id}},
            {"reply_id", mit->reply_id, false, false, {mit->reply_id}}};
  }
  if (const auto* can = std::get_if<CanSimpleConfig>(&drive.config)) {
    Identifiers all{"node_id", can->node_id, true, false, {}};
    for (std::uint32_t command = 0; command < 32; ++command) {
      all.ids.push_back(std::uint32_t{can->node_id} << 5 | command);
    }
    return {all};
  }
  const auto& cia402 = std::get<Cia402Config>(drive.config);
  Identifiers own{"node_id", cia402.node_id, true, false, {}};
  for (std::uint32_t function = 0x080; function <= 0x700; function += 0x080) {
    own.ids.push_back(function + cia402.node_id);
  }
  return {own,
          {"host_id",
           cia402.host_id,
           true,
           true,
           {canopen_id::kNmt, canopen_id::kSync, canopen_id::kHeartbeat + cia402.host_id}}};
}

/// What goes wrong when two drives share an identifier.
const char* Consequence(bool ours_to_drive, bool theirs_to_drive) {
  if (ours_to_drive && theirs_to_drive) return "both drives would obey";
  if (!ours_to_drive && !theirs_to_drive) return "replies would collide on the bus";
  return ours_to_drive ? "the drive would obey replies" : "its drive would obey replies";
}

void RejectShared(const Identifiers& ours, const Identifiers& theirs, const std::string& joint,
                  const TomlTable& table) {
  if (ours.common && theirs.common) return;
  for (const std::uint32_t id : ours.ids) {
    if (std::find(theirs.ids.begin(), theirs.ids.end(), id) == theirs.ids.end()) continue;
    const bool whole = ours.ids.size() == 1 && theirs.ids.size() == 1;
    table.Fail(ours.key,
               whole ? fmt::format("is {}, which is the {} of joint '{}'; {}", ours.value,
                                   theirs.key, joint, Consequence(ours.to_drive, theirs.to_drive))
                     : fmt::format("is {}, so that the frames 0x{:03x} would be those of joint "
                                   "'{}' ({} = {}), too",
                                   ours.value, id, joint, theirs.key, theirs.value));
  }
}

void RejectDuplicates(const DriveEntry& drive, const DriveEntry& earlier, const TomlTable& table) {
  if (drive.joint == earlier.joint) {
    table.Fail("joint", fmt::format("is '{}', which another drive moves already", drive.joint));
  }
  for (const Identifiers& ours : IdentifiersOf(drive)) {
    for (const Identifiers& theirs : IdentifiersOf(earlier)) {
      RejectShared(ours, theirs, earlier.joint, table);
    }
  }
  const auto* ours = std::get_if<Cia402Config>(&drive.config);
  const auto* theirs = std::get_if<Cia402Config>(&earlier.config);
  if (ours == nullptr || theirs == nullptr) return;
  if (ours->host_id != theirs->host_id) {
    table.Fail("host_id", fmt::format("is {}, and that of joint '{}' is {}; there is one host",
                                      ours->host_id, earlier.joint, theirs->host_id));
  }
  if (ours->watchdog_ms != theirs->watchdog_ms) {
    table.Fail("watchdog_s", fmt::format("is not that of joint '{}', and one heartbeat serves both",
                                         earlier.joint));
  }
}

DrivesConfig Read(TomlTable root) {
  if (root.String("format") != "tumbler-drives") {
    root.Fail("format", "is not 'tumbler-drives': this is not a drive configuration");
  }
  root.Integer("version", kDrivesFileVersion, kDrivesFileVersion);
  DrivesConfig config;
  TomlTable bus = root.Table("bus");
  config.bit_rate = static_cast<int>(bus.Integer("bit_rate", 10'000, 1'000'000));
  config.rate_hz = bus.Number("rate_hz", {10, 10'000, false});
  std::vector<TomlTable> tables = root.Tables("drive");
  if (tables.empty() || tables.size() > kMaxJoints) {
    root.Fail("drive",
              fmt::format("has {} entries; allowed: from 1 ... {}", tables.size(), kMaxJoints));
  }
  for (TomlTable& table : tables) {
    const DriveEntry drive = ReadDrive(table, bus, config);
    for (const DriveEntry& earlier : config.drives) RejectDuplicates(drive, earlier, table);
    config.drives.push_back(drive);
  }
  if (config.WorstCaseLoad() > 1) {
    bus.Fail(
        "rate_hz",
        fmt::format(
            "is {}; the frames of one cycle take up to {} bits, so that {} bit/s allow at most "
            "{} Hz: lower the rate or raise bit_rate",
            MessageNumber(config.rate_hz), config.WorstCaseTickBits(), config.bit_rate,
            config.bit_rate / config.WorstCaseTickBits()));
  }
  root.RejectUnknownKeys();
  return config;
}

}  // namespace

std::vector<ScheduledFrames> DrivesConfig::Schedule() const {
  std::vector<ScheduledFrames> schedule;
  const auto add = [&schedule](const char* what, int size, double period_ticks) {
    for (ScheduledFrames& frames : schedule) {
      if (frames.what == what && frames.size == size && frames.period_ticks == period_ticks) {
        ++frames.count;
        return;
      }
    }
    schedule.push_back({what, 1, size, period_ticks});
  };
  const auto ticks = [this](double period_s) { return std::max(1.0, period_s * rate_hz); };
  bool led = false;
  for (const DriveEntry& drive : drives) {
    if (std::holds_alternative<CanSimpleConfig>(drive.config)) {
      add("setpoints", 8, 1);
      add("estimates", 8, drive.messages.estimates_s * rate_hz);
      add("heartbeats", 8, ticks(drive.messages.heartbeat_s));
      if (drive.messages.torques_s > 0) add("torques", 8, ticks(drive.messages.torques_s));
      if (drive.messages.temperature_s > 0) {
        add("temperatures", 8, ticks(drive.messages.temperature_s));
      }
    } else if (const auto* cia402 = std::get_if<Cia402Config>(&drive.config)) {
      if (!led) {
        add("SYNC", 0, 1);
        if (cia402->watchdog_ms > 0) {
          add("host heartbeat", 1, ticks(std::floor(drive.watchdog_s * rate_hz / 3) / rate_hz));
        }
        led = true;
      }
      add("RPDO1", 6, 1);
      if (cia402->feed_forward) add("RPDO2", 6, 1);
      add("TPDO1", 6, 1);
      add("TPDO2", 6, cia402->status_every);
      add("heartbeats", 1, ticks(cia402->heartbeat_ms * 1e-3));
    } else {
      add("setpoints", 8, 1);
      add("replies", 8, 1);
    }
  }
  return schedule;
}

int DrivesConfig::WorstCaseTickBits() const {
  double bits = 0;
  for (const ScheduledFrames& frames : Schedule()) {
    bits +=
        frames.count * WorstCaseFrameBits(CanIdKind::kStandard, frames.size) / frames.period_ticks;
  }
  return static_cast<int>(std::ceil(bits));
}

double DrivesConfig::WorstCaseLoad() const { return WorstCaseTickBits() * rate_hz / bit_rate; }

namespace {

using Ids = std::vector<std::uint16_t>;

/// Adds identifiers that are not in it yet.
void AddAll(Ids& ids, std::initializer_list<std::uint32_t> more) {
  for (const std::uint32_t id : more) {
    const auto value = static_cast<std::uint16_t>(id);
    if (std::find(ids.begin(), ids.end(), value) == ids.end()) ids.push_back(value);
  }
}

}  // namespace

std::vector<std::uint16_t> DrivesConfig::HostSends() const {
  Ids ids;
  for (const DriveEntry& drive : drives) {
    if (const auto* mit = std::get_if<MitConfig>(&drive.config)) {
      AddAll(ids, {mit->command_id});
    } else if (const auto* can = std::get_if<CanSimpleConfig>(&drive.config)) {
      const auto id = [can](CanSimpleCommand command) {
        return CanSimpleId(can->node_id, command);
      };
      AddAll(ids, {id(CanSimpleCommand::kSetAxisState), id(CanSimpleCommand::kSetControllerMode),
                   id(CanSimpleCommand::kSetInputPos), id(CanSimpleCommand::kSetInputVel),
                   id(CanSimpleCommand::kClearErrors)});
    } else {
      const auto& cia402 = std::get<Cia402Config>(drive.config);
      AddAll(ids, {canopen_id::kNmt, canopen_id::kSync, canopen_id::kHeartbeat + cia402.host_id,
                   canopen_id::kRpdo1 + cia402.node_id, canopen_id::kRpdo2 + cia402.node_id,
                   canopen_id::kSdoRequest + cia402.node_id});
    }
  }
  return ids;
}

std::vector<std::uint16_t> DrivesConfig::HostReceives() const {
  Ids ids;
  for (const DriveEntry& drive : drives) {
    if (const auto* mit = std::get_if<MitConfig>(&drive.config)) {
      AddAll(ids, {mit->reply_id});
    } else if (const auto* can = std::get_if<CanSimpleConfig>(&drive.config)) {
      const auto id = [can](CanSimpleCommand command) {
        return CanSimpleId(can->node_id, command);
      };
      AddAll(ids, {id(CanSimpleCommand::kHeartbeat), id(CanSimpleCommand::kGetError),
                   id(CanSimpleCommand::kGetEncoderEstimates),
                   id(CanSimpleCommand::kGetTemperature), id(CanSimpleCommand::kGetTorques)});
    } else {
      const std::uint32_t node = std::get<Cia402Config>(drive.config).node_id;
      AddAll(ids,
             {canopen_id::kEmergency + node, canopen_id::kTpdo1 + node, canopen_id::kTpdo2 + node,
              canopen_id::kSdoReply + node, canopen_id::kHeartbeat + node});
    }
  }
  return ids;
}

int DrivesConfig::HostFramesMax() const {
  int frames = 0;
  for (const DriveEntry& drive : drives) {
    if (std::holds_alternative<MitConfig>(drive.config)) {
      frames += 1;
    } else if (std::holds_alternative<CanSimpleConfig>(drive.config)) {
      frames += 3;
    } else {
      frames += 4;
    }
  }
  return frames;
}

std::string DrivesConfig::DescribeSchedule() const {
  std::string text;
  for (const ScheduledFrames& frames : Schedule()) {
    text += fmt::format("{}{} {} of {} {}", text.empty() ? "" : ", ", frames.count, frames.what,
                        frames.size, frames.size == 1 ? "byte" : "bytes");
    if (frames.period_ticks > 1)
      text += fmt::format(" every {} ticks", MessageNumber(frames.period_ticks));
  }
  return text;
}

DrivesConfig LoadDrives(const std::string& path) { return Read(TomlTable::ParseFile(path)); }

DrivesConfig ParseDrives(std::string_view text, const std::string& name) {
  return Read(TomlTable::Parse(text, name));
}

DrivesConfig DrivesOf(const DrivesConfig& given, const std::vector<std::string>& joints,
                      const std::string& name) {
  DrivesConfig chosen = given;
  chosen.drives.clear();
  for (const std::string& joint : joints) {
    const auto found =
        std::find_if(given.drives.begin(), given.drives.end(),
                     [&joint](const DriveEntry& entry) { return entry.joint == joint; });
    if (found == given.drives.end()) {
      throw std::runtime_error(fmt::format("{}: has no drive for joint '{}'", name, joint));
    }
    chosen.drives.push_back(*found);
  }
  return chosen;
}

DrivesConfig DefaultDrives(const std::vector<std::string>& joints) {
  DrivesConfig drives;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    DriveEntry entry;
    entry.joint = joints[i];
    MitConfig mit;
    mit.command_id = static_cast<std::uint16_t>(i + 1);
    mit.reply_id = static_cast<std::uint16_t>(i + 17);
    entry.config = mit;
    entry.kp_nm_per_rad = 200;
    entry.kd_nm_s_per_rad = 4;
    drives.drives.push_back(entry);
  }
  return drives;
}

}  // namespace tumbler
