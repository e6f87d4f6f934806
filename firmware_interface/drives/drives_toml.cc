#include "firmware_interface/drives/drives_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

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

DriveEntry ReadDrive(TomlTable& table) {
  static constexpr std::array<std::string_view, 1> kProtocols = {"mit"};
  DriveEntry drive;
  drive.joint = table.String("joint");
  if (drive.joint.empty() || !FixedString<32>::fits(drive.joint)) {
    table.Fail("joint", fmt::format("is '{}'; allowed: 1 to 32 bytes", drive.joint));
  }
  if (!table.Has("protocol")) table.Fail("protocol", "is missing and has no default");
  table.Choice("protocol", kProtocols, "");
  ReadMit(table, drive);
  drive.temperature_max_c = NumberAsFloat(table, "temperature_max_c", {0, 200, true});
  drive.watchdog_s = table.Number("watchdog_s", {0, 10, false});
  if (Validate(drive.config) != Status::kOk) {
    table.Fail("", "does not describe a drive of this protocol");
  }
  return drive;
}

/// An identifier on the bus, or several that one key decides on.
struct Identifiers {
  std::string key;          ///< of the file
  std::uint32_t value = 0;  ///< of that key
  bool to_drive = false;    ///< sent by the host and obeyed by the drive
  std::vector<std::uint32_t> ids;
};

std::vector<Identifiers> IdentifiersOf(const DriveEntry& drive) {
  const MitConfig& mit = std::get<MitConfig>(drive.config);
  return {{"command_id", mit.command_id, true, {mit.command_id}},
          {"reply_id", mit.reply_id, false, {mit.reply_id}}};
}

/// What goes wrong when two drives share an identifier.
const char* Consequence(bool ours_to_drive, bool theirs_to_drive) {
  if (ours_to_drive && theirs_to_drive) return "both drives would obey";
  if (!ours_to_drive && !theirs_to_drive) return "replies would collide on the bus";
  return ours_to_drive ? "the drive would obey replies" : "its drive would obey replies";
}

void RejectDuplicates(const DriveEntry& drive, const DriveEntry& earlier, const TomlTable& table) {
  if (drive.joint == earlier.joint) {
    table.Fail("joint", fmt::format("is '{}', which another drive moves already", drive.joint));
  }
  for (const Identifiers& ours : IdentifiersOf(drive)) {
    for (const Identifiers& theirs : IdentifiersOf(earlier)) {
      const bool shared = std::any_of(ours.ids.begin(), ours.ids.end(), [&](std::uint32_t id) {
        return std::find(theirs.ids.begin(), theirs.ids.end(), id) != theirs.ids.end();
      });
      if (!shared) continue;
      table.Fail(ours.key,
                 fmt::format("is {}, which is the {} of joint '{}'; {}", ours.value, theirs.key,
                             earlier.joint, Consequence(ours.to_drive, theirs.to_drive)));
    }
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
    const DriveEntry drive = ReadDrive(table);
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
  for (std::size_t i = 0; i < drives.size(); ++i) {
    add("setpoints", 8, 1);
    add("replies", 8, 1);
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

}  // namespace tumbler
