#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/devices/cia402.h"
#include "firmware_interface/devices/drive_keys.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "firmware_interface/devices/eds.h"

namespace tumbler {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kInt32 = 2147483520.0;  // the largest float below 2^31
constexpr double kRounded = 0.999999;    // The drive computes with floats.

/// The keys of a drive as the file has them.
struct Cia402Entry : Cia402Config {
  double position_units = 0;  ///< Per turn.
  double velocity_units = 0;  ///< Per turn and second.
  double rated_nm = 0;
  double heartbeat_s = 1e-3 * heartbeat_ms;
  std::string eds;  ///< Path of its electronic data sheet; empty: none.
};

constexpr std::array kNumberKeys = {
    KeyOf<&Cia402Entry::node_id, Cia402Entry>("node_id", {1, 126}, "").Required(),
    KeyOf<&Cia402Entry::host_id, Cia402Entry>("host_id", {1, kCanOpenNodeMax},
                                              "number of the host's heartbeat")
        .Allowed("1 to 127, the same in all drives"),
};

constexpr std::array kUnitKeys = {
    KeyOf<&Cia402Entry::position_units>("position_units_per_turn", {1, 1e9},
                                        "of 607Ah, 6064h, at the shaft")
        .Required(),
    KeyOf<&Cia402Entry::velocity_units>("velocity_units_per_turn_s", {0.001, 1e9},
                                        "of 606Ch, 60B1h; 60 where they count rpm")
        .Default("as position",
                 [](Cia402Entry& drive) { drive.velocity_units = drive.position_units; }),
    KeyOf<&Cia402Entry::rated_nm>("rated_torque_nm", {0.001, 10'000},
                                  "6076h; ranges reach at most 32.767 times as far")
        .Required(),
};

/// Reads the objects that the drive may lack, e.g. `60C2h`.
void ReadMayLack(TomlTable& table, std::string_view key, Cia402Entry& drive) {
  for (const std::string& name : table.Strings(key)) {
    const auto found = std::ranges::find_if(
        kCia402MayLack, [&](std::uint16_t index) { return fmt::format("{:04X}h", index) == name; });
    if (found == kCia402MayLack.end()) {
      table.Fail(key, fmt::format("'{}' is no object that a drive may lack; allowed: 1006h, 60C2h, "
                                  "605Ah, 6065h, 6007h",
                                  name));
    }
    drive.may_lack |=
        static_cast<std::uint8_t>(1U << static_cast<unsigned>(found - kCia402MayLack.begin()));
  }
}

constexpr std::array<std::string_view, 4> kReactions = {"none", "fault", "disable", "quick-stop"};
constexpr std::array kSetUpKeys = {
    KeyOf<&Cia402Entry::heartbeat_s>("heartbeat_s", {0.001, 10}, "of the drive: 1017h"),
    KeyOf<&Cia402Entry::watchdog_reaction, Cia402Entry>("watchdog_reaction", kReactions, "6007h"),
    KeyOf<&Cia402Entry::quick_stop_option, Cia402Entry>("quick_stop_option", {1, 7}, "605Ah"),
    KeyOf<&Cia402Entry::feed_forward, Cia402Entry>("feed_forward",
                                                   "velocity and torque offsets, in a second PDO"),
    KeyOf<&Cia402Entry::status_every, Cia402Entry>("status_every", {1, 240},
                                                   "SYNCs to a report of velocity and torque"),
    KeyOf<&Cia402Entry::following_window_rad, Cia402Entry>("following_window_rad",
                                                           "6065h, at the shaft")
        .Allowed("0 (the drive's own) or above",
                 [](const Cia402Entry& drive) {
                   return Range{0, kInt32 / drive.position_units * kTwoPi * kRounded};
                 }),
    KeyReadBy<Cia402Entry>("may_lack", ReadMayLack,
                           "objects that the drive may not have, e.g. `[\"60C2h\"]`; 6007h only "
                           "without a watchdog")
        .Schema(
            R"({"type": "array", "items": {"enum": ["1006h", "60C2h", "605Ah", "6065h", "6007h"]}})")
        .Default("none")
        .Allowed("1006h, 60C2h, 605Ah, 6065h, 6007h"),
    KeyOf<&Cia402Entry::eds>("eds",
                             "the drive's EDS or DCF file; says what it lacks, and what of the "
                             "set-up it would refuse")
        .Default("none")
        .Allowed("path, from the folder of this file"),
};

/// Reads the units, and the ranges, which with these units have to fit 32 and 16 bits.
void ReadUnits(TomlTable& keys, Cia402Entry& drive) {
  ReadKeys(keys, kUnitKeys, drive);
  drive.position_units_per_turn = static_cast<float>(drive.position_units);
  drive.velocity_units_per_turn_s = static_cast<float>(drive.velocity_units);
  drive.rated_torque_nm = static_cast<float>(drive.rated_nm);
  drive.range =
      ReadShaftRanges(keys, std::min(kInt32 / drive.position_units * kTwoPi * kRounded, 1e6),
                      std::min(kInt32 / drive.velocity_units * kTwoPi * kRounded, 1e6),
                      std::min(32.767 * drive.rated_nm * kRounded, 1e6));
}

/// Reads the control loop's period, and the time-out for the host's heartbeat, which the drive
/// watches.
void ReadTimes(DriveTable& table, Cia402Config& cia402) {
  const double period_us = 1e6 / table.rate_hz;
  cia402.period_us = static_cast<std::uint32_t>(std::llround(period_us));
  Cia402Period period;
  if (std::abs(period_us - cia402.period_us) > 1e-6 || cia402.period_us < 100 ||
      ToInterpolationPeriod(cia402.period_us, period) != Status::kOk) {
    table.bus.Fail("rate_hz",
                   fmt::format("is {}, a period of {} us; CiA 402 drives take 1 to 255 times 1, "
                               "10, 100, ... us, e.g. 1000, 500, 400 or 250 Hz",
                               MessageNumber(table.rate_hz), MessageNumber(period_us)));
  }
  ReadWatchdog(table.keys, table.entry);
  const double watchdog_s = table.entry.watchdog_s;
  if (watchdog_s > 0 && watchdog_s * table.rate_hz < 3) {
    table.keys.Fail("watchdog_s",
                    fmt::format("is {}; allowed: 0 (none) or at least 3 periods of the "
                                "control loop, {}",
                                MessageNumber(watchdog_s), MessageNumber(3 / table.rate_hz)));
  }
  cia402.watchdog_ms = static_cast<std::uint16_t>(std::llround(watchdog_s * 1000));
}

/// What one frame of the set-up or of a PDO needs of an object.
struct Cia402Need {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  int bits = 0;
  bool written = false;
  bool mapped = false;
  std::optional<std::uint32_t> value;  ///< That is written.
};

/// The objects of the set-up, those of the PDOs that it makes, and the mode that is read back.
std::vector<Cia402Need> NeedsOf(const Cia402Config& config) {
  std::vector<Cia402Need> needs;
  SdoRequest request;
  for (int step = 0; Cia402SetUp(config, step, request); ++step) {
    needs.push_back({request.index, request.sub, 8 * request.size, true, false, request.value});
    // The entries of a mapping name the objects in the PDO, with their lengths.
    const bool mapping = (request.index >= 0x1600 && request.index < 0x1800) ||
                         (request.index >= 0x1a00 && request.index < 0x1c00);
    if (!mapping || request.sub == 0) continue;
    needs.push_back({static_cast<std::uint16_t>(request.value >> 16),
                     static_cast<std::uint8_t>(request.value >> 8),
                     static_cast<int>(request.value & 0xff), request.index < 0x1800, true,
                     std::nullopt});
  }
  needs.push_back({0x6061, 0, 8, false, false, std::nullopt});
  return needs;
}

/// What is wrong with an object for a need, or an empty text.
std::string Problem(const EdsObject& object, const Cia402Need& need) {
  if (object.bits != need.bits) {
    return fmt::format("has DataType 0x{:04X}{}, and {} bits are {}", object.type,
                       object.bits == 0 ? "" : fmt::format(" of {} bits", object.bits), need.bits,
                       need.written ? "written" : "expected");
  }
  if (need.written ? !object.writable() : !object.readable()) {
    return fmt::format("has AccessType {}, and it is {}", object.access,
                       need.written ? "written" : "read");
  }
  if (need.mapped && !object.mappable) return "has PDOMapping=0, and it is in a PDO";
  if (!need.value) return "";
  std::int64_t value = *need.value;
  if (object.is_signed && value >= std::int64_t{1} << (need.bits - 1))
    value -= std::int64_t{1} << need.bits;
  if (value < object.low.value_or(value) || value > object.high.value_or(value)) {
    return fmt::format("is to be {}, and its limits are {} ... {}", value,
                       object.low ? fmt::format("{}", *object.low) : "",
                       object.high ? fmt::format("{}", *object.high) : "");
  }
  return "";
}

/// Compares what is to be written with what the drive has. What it may lack and lacks is noted.
void ApplyDataSheet(const ElectronicDataSheet& eds, Cia402Entry& cia402, const TomlTable& keys) {
  const auto fail = [&](const Cia402Need& need, const std::string& what) {
    keys.Fail("eds", fmt::format("object {:04X}h:{:02X} {}", need.index, need.sub, what));
  };
  if (eds.node_id() && *eds.node_id() != cia402.node_id) {
    keys.Fail("eds", fmt::format("{} is of node {}, and node_id is {}", eds.name(), *eds.node_id(),
                                 cia402.node_id));
  }
  for (const Cia402Need& need : NeedsOf(cia402)) {
    const std::optional<EdsObject> object = eds.Find(need.index, need.sub);
    if (object) {
      const std::string problem = Problem(*object, need);
      if (!problem.empty())
        fail(need, fmt::format("{} ({}:{})", problem, eds.name(), object->line));
      continue;
    }
    const auto* const lacked = std::ranges::find(kCia402MayLack, need.index);
    if (lacked == kCia402MayLack.end())
      fail(need, fmt::format("is not in {}, and the set-up needs it", eds.name()));
    if (need.index == 0x6007 && cia402.watchdog_ms != 0) {
      fail(need, fmt::format("is not in {}, so the drive does not react to the host's silence: say "
                             "watchdog_s = 0",
                             eds.name()));
    }
    cia402.may_lack |=
        static_cast<std::uint8_t>(1U << static_cast<unsigned>(lacked - kCia402MayLack.begin()));
  }
}

}  // namespace

Cia402Config Cia402Protocol::Read(DriveTable& table) {
  TomlTable& keys = table.keys;
  Cia402Entry cia402;
  ReadKeys(keys, kNumberKeys, cia402);
  cia402.joint = ReadJoint(keys);
  ReadUnits(keys, cia402);
  ReadOwnGains(table);
  ReadKeys(keys, kSetUpKeys, cia402);
  cia402.heartbeat_ms = static_cast<std::uint16_t>(std::llround(1000 * cia402.heartbeat_s));
  if (cia402.host_id == cia402.node_id) {
    keys.Fail("host_id",
              fmt::format("is {}, as node_id; the host has a number of its own", cia402.host_id));
  }
  ReadTimes(table, cia402);
  if (cia402.watchdog_ms != 0 && (cia402.may_lack >> 4 & 1U) != 0) {
    keys.Fail("may_lack",
              "has 6007h, without which the drive does not react to the host's silence: say "
              "watchdog_s = 0, or leave it out");
  }
  if (!cia402.eds.empty()) {
    const std::filesystem::path folder = std::filesystem::path(keys.file()).parent_path();
    const std::string path = (folder / cia402.eds).string();
    ApplyDataSheet(ElectronicDataSheet::Parse(table.read(path), path, cia402.node_id), cia402,
                   keys);
  }
  return cia402;
}

KeyTable Cia402Protocol::Keys() {
  KeyRow watchdog = WatchdogRow();
  watchdog.allowed = "0, or from 3 ticks on; the same in all drives";
  watchdog.meaning = "of the host's heartbeat: 1016h";
  return {"firmware_interface/devices/cia402_toml.cc", "cia402",
          Joined({RowsOf(kNumberKeys), RowsOf(kUnitKeys), RowsOf(kSetUpKeys), {watchdog}})};
}

void Cia402Protocol::CheckBeside(const DriveEntry& drive, const DriveEntry& earlier,
                                 const TomlTable& table) {
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

std::uint32_t Cia402Protocol::DbcId(std::uint32_t of_example, const Cia402Config& config) {
  constexpr std::uint32_t kNode = 0x7f, kHeartbeat = 0x700, kSync = 0x80;
  if (of_example == 0 || of_example == kSync) return of_example;
  if (of_example == (kHeartbeat | Config{}.host_id)) return kHeartbeat | config.host_id;
  return (of_example & ~kNode) | config.node_id;
}

DriveTraffic Cia402Protocol::TrafficOf(const DriveEntry& entry, const Cia402Config& config,
                                       double rate_hz) {
  const std::uint32_t node = config.node_id;
  DriveTraffic traffic;
  traffic.schedule = {{"SYNC", 0, 1, true}};
  if (config.watchdog_ms > 0) {
    const double heartbeat_s = std::floor(entry.watchdog_s * rate_hz / 3) / rate_hz;
    traffic.schedule.push_back({"host heartbeat", 1, PeriodTicks(heartbeat_s, rate_hz), true});
  }
  traffic.schedule.push_back({"RPDO1", 6});
  if (config.feed_forward) traffic.schedule.push_back({"RPDO2", 6});
  traffic.schedule.push_back({"TPDO1", 6});
  traffic.schedule.push_back({"TPDO2", 6, static_cast<double>(config.status_every)});
  traffic.schedule.push_back({"heartbeats", 1, PeriodTicks(config.heartbeat_ms * 1e-3, rate_hz)});

  DriveIdentifiers own{"node_id", node, true, false, {}};
  for (std::uint32_t function = 0x080; function <= 0x700; function += 0x080) {
    own.ids.push_back(function + node);
  }
  const std::uint32_t host_heartbeat = canopen_id::kHeartbeat + config.host_id;
  traffic.identifiers = {
      own,
      {"host_id",
       config.host_id,
       true,
       true,
       {canopen_id::kNmt, canopen_id::kSync, canopen_id::kLssRequest, host_heartbeat}}};
  for (const HostFrame& frame : HostFrames(config))
    traffic.host_sends.emplace_back(frame.to_all ? frame.id : frame.id + node);
  traffic.host_sends.emplace_back(host_heartbeat);
  traffic.host_receives = {canopen_id::kEmergency + node, canopen_id::kTpdo1 + node,
                           canopen_id::kTpdo2 + node, canopen_id::kSdoReply + node,
                           canopen_id::kHeartbeat + node};
  traffic.host_frames_max = 4;
  return traffic;
}

}  // namespace tumbler
