#include "firmware_interface/drives/drives_toml.h"

#include <fmt/format.h>

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

DriveEntry ReadDrive(TomlTable& table) {
  static constexpr std::array<std::string_view, 1> kProtocols = {"mit"};
  static constexpr std::array<std::string_view, 2> kTemperatures = {"signed", "offset-40"};
  DriveEntry drive;
  drive.joint = table.String("joint");
  if (drive.joint.empty() || !FixedString<32>::fits(drive.joint)) {
    table.Fail("joint", fmt::format("is '{}'; allowed: 1 to 32 bytes", drive.joint));
  }
  if (!table.Has("protocol")) table.Fail("protocol", "is missing and has no default");
  table.Choice("protocol", kProtocols, "");
  MitConfig& mit = drive.mit;
  mit.command_id = static_cast<std::uint16_t>(table.Integer("command_id", 1, 0xff));
  mit.reply_id = static_cast<std::uint16_t>(table.Integer("reply_id", 0, 0x7ff));
  const std::int64_t direction = table.Integer("direction", -1, 1, 1);
  if (direction == 0) table.Fail("direction", "is 0; allowed: 1 or -1");
  mit.joint.direction = static_cast<float>(direction);
  mit.joint.gear_ratio = static_cast<float>(table.Number("gear_ratio", {0.001, 1000, false}, 1));
  mit.joint.zero_offset_rad =
      static_cast<float>(table.Number("zero_offset_rad", {-1000, 1000, false}, 0));
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
  drive.temperature_max_c = NumberAsFloat(table, "temperature_max_c", {0, 200, true});
  drive.watchdog_s = table.Number("watchdog_s", {0, 10, false});
  if (mit.reply_id == mit.command_id) {
    table.Fail(
        "reply_id",
        fmt::format("is {}, as command_id; a drive's two identifiers must differ", mit.reply_id));
  }
  if (mit.Validate() != Status::kOk) table.Fail("", "does not describe a drive of this protocol");
  return drive;
}

void RejectDuplicates(const DriveEntry& drive, const DriveEntry& earlier, const TomlTable& table) {
  if (drive.joint == earlier.joint) {
    table.Fail("joint", fmt::format("is '{}', which another drive moves already", drive.joint));
  }
  if (drive.mit.command_id == earlier.mit.command_id) {
    table.Fail("command_id",
               fmt::format("is {}, which is the command_id of joint '{}'; both drives would obey",
                           drive.mit.command_id, earlier.joint));
  }
  if (drive.mit.reply_id == earlier.mit.reply_id) {
    table.Fail(
        "reply_id",
        fmt::format("is {}, which is the reply_id of joint '{}'; replies would collide on the bus",
                    drive.mit.reply_id, earlier.joint));
  }
  if (drive.mit.reply_id == earlier.mit.command_id) {
    table.Fail(
        "reply_id",
        fmt::format("is {}, which is the command_id of joint '{}'; its drive would obey replies",
                    drive.mit.reply_id, earlier.joint));
  }
  if (drive.mit.command_id == earlier.mit.reply_id) {
    table.Fail(
        "command_id",
        fmt::format("is {}, which is the reply_id of joint '{}'; the drive would obey replies",
                    drive.mit.command_id, earlier.joint));
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

int DrivesConfig::WorstCaseTickBits() const {
  // Command and reply of each drive, 8 bytes with an 11-bit identifier.
  return static_cast<int>(drives.size()) * 2 * WorstCaseFrameBits(CanIdKind::kStandard, 8);
}

double DrivesConfig::WorstCaseLoad() const { return WorstCaseTickBits() * rate_hz / bit_rate; }

DrivesConfig LoadDrives(const std::string& path) { return Read(TomlTable::ParseFile(path)); }

DrivesConfig ParseDrives(std::string_view text, const std::string& name) {
  return Read(TomlTable::Parse(text, name));
}

}  // namespace tumbler
