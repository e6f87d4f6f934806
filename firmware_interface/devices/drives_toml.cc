#include "firmware_interface/devices/drives_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "common/core/primitive.h"
#include "common/files/printable.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/can/frame_length.h"
#include "firmware_interface/devices/drive_keys.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "firmware_interface/devices/sensor_toml.h"

namespace tumbler {

namespace {

constexpr FileHeader kHeader{"tumbler-drives", 1,
                             "is not '{1}': this is not a drive configuration"};

void ReadUnfinished(TomlTable& table, std::string_view key, DrivesConfig& config) {
  config.unfinished = table.String(key);
  if (config.unfinished.empty()) table.Fail(key, "is empty; say what is missing, or remove it");
}

constexpr std::array kRootKeys = {
    KeyReadBy<DrivesConfig>("unfinished", ReadUnfinished,
                            "what commissioning has left to do; only `tumbler bench` reads such a "
                            "file")
        .Schema(R"({"type": "string", "minLength": 1})")
        .Default("none")
        .Allowed("any text"),
};

constexpr std::array kBusKeys = {
    KeyOf<&DrivesConfig::bit_rate>("bit_rate", {10'000, 1'000'000},
                                   "bit/s, as set on the interface")
        .Required(),
    KeyOf<&DrivesConfig::rate_hz>(
        "rate_hz", {10, 10'000},
        "of the control loop; the frames of a cycle have to fit in the worst case")
        .Required(),
};

/// The values that are read first from a drive's table.
struct DriveHead {
  std::string joint;
  std::string protocol;
};

void ReadJointName(TomlTable& table, std::string_view key, DriveHead& drive) {
  drive.joint = table.String(key);
  if (const char* mistake = MistakeInName(drive.joint)) table.Fail(key, mistake);
  if (drive.joint.empty() || !FixedString<32>::fits(drive.joint))
    table.Fail(key, fmt::format("is '{}'; allowed: 1 to 32 bytes", drive.joint));
}
void ReadProtocol(TomlTable& table, std::string_view key, DriveHead& drive) {
  if (!table.Has(key)) table.Fail(key, "is missing and has no default");
  drive.protocol = table.Choice(key, DriveProtocols::kNames, "");
}

constexpr std::array kHeadKeys = {
    KeyReadBy<DriveHead>("joint", ReadJointName, "name in the URDF")
        .Schema(R"({"type": "string", "minLength": 1, "maxLength": 32})")
        .Required()
        .Allowed("1 to 32 bytes, unique"),
    KeyReadBy<DriveHead>("protocol", ReadProtocol, "")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("that of a page in [protocols/](protocols/)"),
};

constexpr std::array kTemperatureKeys = {
    KeyOf<&DriveEntry::temperature_max_c>("temperature_max_c", {0, 200, true},
                                          "above it the run stops")
        .Required(),
};

constexpr std::array kLoopKeys = {
    KeyOf<&DriveEntry::loop_hz>(
        "loop_hz", {100, 1e6},
        "rate of the drive's own loop, which computes its torque: whether kd is stable "
        "[depends on it](driving.md#damping-and-the-drives-own-loop)")
        .Default("not known"),
};

constexpr std::array kMotorFactsKeys = {
    KeyOf<&MotorFacts::torque_factor>(
        "torque_factor", {0.1, 10},
        "what the motor exerts for each N m that the drive reckons with; this and the next two are "
        "[simulated, and fitted from there](identify.md#what-a-drives-file-says), and never sent"),
    KeyOf<&MotorFacts::torque_time_constant_s>("torque_time_constant_s", {0, 0.1},
                                               "of the current loop, first order"),
    KeyOf<&MotorFacts::velocity_filter_s>(
        "velocity_filter_s", {0, 0.1},
        "of the filter through which the drive sees its velocity, first order; 0: none"),
};

DriveTraffic TrafficOf(const DriveEntry& drive, double rate_hz) {
  return DriveProtocols::With(drive.config, [&](auto protocol, const auto& config) {
    return decltype(protocol)::TrafficOf(drive, config, rate_hz);
  });
}

DriveEntry ReadDrive(TomlTable& table, TomlTable& bus_table, const DrivesConfig& bus,
                     const FileReader& read) {
  DriveEntry drive;
  DriveHead head;
  ReadKeys(table, kHeadKeys, head);
  drive.joint = head.joint;
  DriveTable of_drive{table, bus_table, bus.rate_hz, drive, read};
  DriveProtocols::ForEach([&](auto protocol) {
    using Protocol = decltype(protocol);
    if (head.protocol == Protocol::kName) drive.config = Protocol::Read(of_drive);
  });
  ReadKeys(table, kTemperatureKeys, drive);
  ReadKeys(table, kLoopKeys, drive);
  ReadKeys(table, kMotorFactsKeys, drive.motor);
  ReadWatchdog(table, drive);
  if (Validate(drive.config) != Status::kOk) {
    table.Fail("", "does not describe a drive of this protocol");
  }
  return drive;
}

/// The consequence of two drives sharing an identifier, for messages.
const char* Consequence(bool ours_to_drive, bool theirs_to_drive) {
  if (ours_to_drive && theirs_to_drive) return "both drives would obey";
  if (!ours_to_drive && !theirs_to_drive) return "replies would collide on the bus";
  return ours_to_drive ? "the drive would obey replies" : "its drive would obey replies";
}

void RejectShared(const DriveIdentifiers& ours, const DriveIdentifiers& theirs,
                  const std::string& joint, const TomlTable& table) {
  if (ours.common && theirs.common) return;
  for (const CanId& id : ours.ids) {
    if (std::find(theirs.ids.begin(), theirs.ids.end(), id) == theirs.ids.end()) continue;
    const bool whole = ours.ids.size() == 1 && theirs.ids.size() == 1;
    table.Fail(ours.key,
               whole ? fmt::format("is {}, which is the {} of joint '{}'; {}", ours.value,
                                   theirs.key, joint, Consequence(ours.to_drive, theirs.to_drive))
                     : fmt::format("is {}, so that the frames 0x{:0{}x} would be those of joint "
                                   "'{}' ({} = {}), too",
                                   ours.value, id.value, id.extended ? 8 : 3, joint, theirs.key,
                                   theirs.value));
  }
}

void RejectDuplicates(const DriveEntry& drive, const DriveEntry& earlier, double rate_hz,
                      const TomlTable& table) {
  if (drive.joint == earlier.joint) {
    table.Fail("joint", fmt::format("is '{}', which another drive moves already", drive.joint));
  }
  const DriveTraffic traffic = TrafficOf(drive, rate_hz);
  const DriveTraffic before = TrafficOf(earlier, rate_hz);
  for (const DriveIdentifiers& ours : traffic.identifiers) {
    for (const DriveIdentifiers& theirs : before.identifiers) {
      RejectShared(ours, theirs, earlier.joint, table);
    }
  }
  DriveProtocols::With(drive.config, [&](auto protocol, const auto& /*config*/) {
    if constexpr (HasChecksBesideEachOther<decltype(protocol)>) {
      decltype(protocol)::CheckBeside(drive, earlier, table);
    }
  });
}

void RejectSharedWithSensor(const DriveEntry& drive, const DrivesConfig& config,
                            const TomlTable& table) {
  const DriveTraffic traffic = TrafficOf(drive, config.rate_hz);
  const auto reject = [&](std::string_view key, std::uint32_t id) {
    for (const std::vector<CanId>& taken : {traffic.host_sends, traffic.host_receives}) {
      if (std::find(taken.begin(), taken.end(), CanId(id)) == taken.end()) continue;
      table.Fail(key, fmt::format("is {}, which is an identifier of the drive of joint '{}'; "
                                  "allowed: one that nobody else sends",
                                  id, drive.joint));
    }
  };
  for (const SensorMessage& message : config.sensor->Messages()) reject(message.key, message.id);
}

DrivesConfig Read(TomlTable root, DrivesUse use, const FileReader& read) {
  ReadHeader(root, kHeader);
  DrivesConfig config;
  ReadKeys(root, kRootKeys, config);
  if (use == DrivesUse::kRun && !config.unfinished.empty()) {
    root.Fail("unfinished",
              fmt::format("says '{}', so the file does not describe the robot yet; finish it with "
                          "tumbler bench BUS commission, or remove this key when it is done",
                          config.unfinished));
  }
  TomlTable bus = root.Table("bus");
  ReadKeys(bus, kBusKeys, config);
  std::vector<TomlTable> tables = root.Tables("drive");
  if (tables.empty() || tables.size() > kMaxJoints) {
    root.Fail("drive",
              fmt::format("has {} entries; allowed: from 1 ... {}", tables.size(), kMaxJoints));
  }
  for (TomlTable& table : tables) {
    const DriveEntry drive = ReadDrive(table, bus, config, read);
    for (const DriveEntry& earlier : config.drives) {
      RejectDuplicates(drive, earlier, config.rate_hz, table);
    }
    config.drives.push_back(drive);
  }
  if (auto sensor = root.OptionalTable("sensor")) {
    config.sensor = ReadSensor(*sensor, config.rate_hz);
    for (const DriveEntry& drive : config.drives) RejectSharedWithSensor(drive, config, *sensor);
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

int ScheduledFrames::WorstCaseBits() const {
  return WorstCaseFrameBits(extended ? CanIdKind::kExtended : CanIdKind::kStandard, size);
}

std::vector<ScheduledFrames> DrivesConfig::Schedule() const {
  std::vector<ScheduledFrames> schedule;
  for (const DriveEntry& drive : drives) {
    for (const DriveFrames& frames : TrafficOf(drive, rate_hz).schedule) {
      const auto same = std::find_if(
          schedule.begin(), schedule.end(), [&frames](const ScheduledFrames& scheduled) {
            return scheduled.what == frames.what && scheduled.size == frames.size &&
                   scheduled.period_ticks == frames.period_ticks &&
                   scheduled.extended == frames.extended;
          });
      if (same == schedule.end()) {
        schedule.push_back(
            {std::string(frames.what), 1, frames.size, frames.period_ticks, frames.extended});
      } else if (!frames.common) {
        ++same->count;
      }
    }
  }
  if (sensor) {
    for (const SensorMessage& message : sensor->Messages())
      schedule.push_back({message.what, 1, message.size, rate_hz / sensor->RateOf(message)});
  }
  return schedule;
}

int DrivesConfig::WorstCaseTickBits() const {
  double bits = 0;
  for (const ScheduledFrames& frames : Schedule())
    bits += frames.count * frames.WorstCaseBits() / frames.period_ticks;
  return static_cast<int>(std::ceil(bits));
}

int DrivesConfig::LongestFrameBits() const {
  int longest = 0;
  for (const ScheduledFrames& frames : Schedule())
    longest = std::max(longest, frames.WorstCaseBits());
  return longest;
}

double DrivesConfig::WorstCaseLoad() const { return WorstCaseTickBits() * rate_hz / bit_rate; }

namespace {

/// Adds the identifiers that are not in the list yet.
void AddAll(std::vector<CanId>& ids, const std::vector<CanId>& more) {
  for (const CanId& id : more) {
    if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  }
}

}  // namespace

std::vector<CanId> DrivesConfig::HostSends() const {
  std::vector<CanId> ids;
  for (const DriveEntry& drive : drives) AddAll(ids, TrafficOf(drive, rate_hz).host_sends);
  return ids;
}

std::vector<CanId> DrivesConfig::HostReceives() const {
  std::vector<CanId> ids;
  for (const DriveEntry& drive : drives) AddAll(ids, TrafficOf(drive, rate_hz).host_receives);
  if (sensor) {
    for (const SensorMessage& message : sensor->Messages()) AddAll(ids, {message.id});
  }
  return ids;
}

int DrivesConfig::HostFramesMax() const {
  int frames = 0;
  for (const DriveEntry& drive : drives) frames += TrafficOf(drive, rate_hz).host_frames_max;
  return frames;
}

SimulatedPortConfig DrivesConfig::HostPort() const {
  SimulatedPortConfig port;
  port.transmit_capacity = std::max(port.transmit_capacity, HostFramesMax());
  return port;
}

std::string DrivesConfig::DescribeSchedule() const {
  std::string text;
  for (const ScheduledFrames& frames : Schedule()) {
    text += fmt::format("{}{} {} of {} {}", text.empty() ? "" : ", ", frames.count, frames.what,
                        frames.size, frames.size == 1 ? "byte" : "bytes");
    if (frames.extended) text += " with 29-bit identifiers";
    if (frames.period_ticks > 1)
      text += fmt::format(" every {} ticks", MessageNumber(frames.period_ticks));
  }
  return text;
}

KeyTable DrivesKeyTable() {
  const KeyRow drives{"", "`[[drive]]`", "required", fmt::format("1 to {}", kMaxJoints), "with:"};
  return {"firmware_interface/devices/drives_toml.cc", "drives",
          Joined({{RowOf(kHeader)},
                  RowsOf(kRootKeys),
                  RowsOf(kBusKeys, "`[bus]`"),
                  {drives},
                  RowsOf(kHeadKeys),
                  JointRows(),
                  GainRows(),
                  RowsOf(kTemperatureKeys),
                  RowsOf(kLoopKeys),
                  RowsOf(kMotorFactsKeys),
                  {WatchdogRow()},
                  ShaftRangeRows(),
                  SensorRows()})};
}

SampleTimes SampleTimesOf(const DrivesConfig& drives, std::int64_t period_ns) noexcept {
  const double slower = drives.rate_hz * static_cast<double>(period_ns) * 1e-9;
  SampleTimes times(static_cast<int>(std::lround(drives.bit_rate / slower)));
  for (const DriveEntry& entry : drives.drives) times.Add(entry.config);
  return times;
}

DrivesConfig LoadDrives(const std::string& path) {
  return Read(TomlTable::ParseFile(path), DrivesUse::kRun, ReadTextFile);
}

DrivesConfig ParseDrives(std::string_view text, const std::string& name, DrivesUse use,
                         const FileReader& read) {
  return Read(TomlTable::Parse(text, name), use, read);
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

DrivesConfig DefaultDrives(const std::vector<std::string>& joints, double kp_nm_per_rad,
                           double kd_nm_s_per_rad) {
  const ImpedanceRanges& ranges = MitProtocol::Example(0).command;
  const double kp_max = static_cast<double>(ranges.kp_nm_per_rad.max);
  const double kd_max = static_cast<double>(ranges.kd_nm_s_per_rad.max);
  if (!(kp_nm_per_rad >= 0 && kp_nm_per_rad <= kp_max && kd_nm_s_per_rad >= 0 &&
        kd_nm_s_per_rad <= kd_max)) {
    throw std::runtime_error(
        fmt::format("the default drives carry up to {} N m/rad and {} N m s/rad, not {} and {}: "
                    "name a drives file",
                    kp_max, kd_max, kp_nm_per_rad, kd_nm_s_per_rad));
  }
  DrivesConfig drives;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    DriveEntry entry;
    entry.joint = joints[i];
    entry.config = MitProtocol::Example(static_cast<int>(i));
    entry.kp_nm_per_rad = static_cast<float>(kp_nm_per_rad);
    entry.kd_nm_s_per_rad = static_cast<float>(kd_nm_s_per_rad);
    entry.loop_hz = kMitFirmwareLoop_hz;
    drives.drives.push_back(entry);
  }
  return drives;
}

}  // namespace tumbler
