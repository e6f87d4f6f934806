#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/sample_times.h"
#include "firmware_interface/devices/sensor_entry.h"

namespace tumbler {

/// Frames of one kind that the drives and the sensor of a file cause.
struct ScheduledFrames {
  std::string what;         ///< e.g. `setpoints`
  int count = 0;            ///< How many in each period, for all drives together.
  int size = 0;             ///< Bytes of payload.
  double period_ticks = 1;  ///< Ticks of the control loop in a period, >= 1.
  bool extended = false;    ///< Whether their identifiers have 29 bits.

  /// Bits of one of them on the wire if it were as long as such frames can be, intermission
  /// included.
  [[nodiscard]] int WorstCaseBits() const;
};

/// The drives of a robot and their bus.
struct DrivesConfig {
  int bit_rate = 1'000'000;  ///< Of the bus [bit/s].
  double rate_hz = 1000;     ///< Of the control loop, which is that of setpoints and replies.
  std::vector<DriveEntry> drives;
  std::string unfinished;             ///< What commissioning has left to do; empty: nothing.
  std::optional<SensorEntry> sensor;  ///< The robot's inertial sensor on the same bus.

  /// All frames of a running robot.
  [[nodiscard]] std::vector<ScheduledFrames> Schedule() const;
  /// Bits on the wire of one tick if every frame were as long as frames can be, intermissions
  /// included. Frames that do not come every tick count by their share, and the sum is rounded up.
  [[nodiscard]] int WorstCaseTickBits() const;
  /// Worst-case share of the bus that is in use, 0 ... 1.
  [[nodiscard]] double WorstCaseLoad() const;
  /// Bits of the longest of these frames.
  [[nodiscard]] int LongestFrameBits() const;
  /// The identifiers of all frames that only a host sends to these drives, with those that this
  /// one never sends, and the identifiers of all frames that it takes from drives and sensor. A
  /// socket has to let through both, so that commands of somebody else are seen.
  [[nodiscard]] std::vector<CanId> HostSends() const;
  [[nodiscard]] std::vector<CanId> HostReceives() const;
  /// The most frames that the host sends in one tick, starting up included.
  [[nodiscard]] int HostFramesMax() const;
  /// The host on a simulated bus, with the transmit queue of a Linux host: a tick's frames find
  /// room in it.
  [[nodiscard]] SimulatedPortConfig HostPort() const;
  /// The schedule in words: `2 setpoints of 8 bytes, 2 replies of 8 bytes`.
  [[nodiscard]] std::string DescribeSchedule() const;
};

/// Finds when these drives sampled what they report.
/// @param period_ns  of the control loop, by its clock. It is longer than rate_hz says where the
///                   robot is simulated at a slower pace, and so is a bit.
[[nodiscard]] SampleTimes SampleTimesOf(const DrivesConfig& drives,
                                        std::int64_t period_ns) noexcept;

/// What a drives file is read for.
enum class DrivesUse : std::uint8_t {
  kRun,        ///< To drive the robot, or to simulate its drives: a file half done is refused.
  kCommission  ///< To become right.
};

/// Reads a drives file (`primitives/robots/tumbler_drives*.toml` are commented examples). Checks
/// every value and its range, and refuses unknown keys, joints and identifiers that occur twice,
/// gains that the protocol cannot carry, and a rate whose frames do not fit on the bus in the worst
/// case.
/// @throws FileError  with file, line, key and allowed range.
DrivesConfig LoadDrives(const std::string& path);
/// The same of a text.
/// @param name  stands for the file in messages; what it names is found from its folder.
/// @param read  reads the files that it names.
DrivesConfig ParseDrives(std::string_view text, const std::string& name,
                         DrivesUse use = DrivesUse::kRun, const FileReader& read = ReadTextFile);

/// The keys that drives of all protocols have, for docs/formats.md.
KeyTable DrivesKeyTable();

/// The drives of these joints, in this order.
/// @param name  of the drives file, for messages.
/// @throws std::runtime_error  naming a joint that has no drive.
DrivesConfig DrivesOf(const DrivesConfig& given, const std::vector<std::string>& joints,
                      const std::string& name);

/// The drives of a simulation without a drives file: MIT drives with identifiers 1, 2, ... in the
/// order of the joints, replies on 17, 18, ..., 1000 Hz, 1 Mbit/s.
/// @param kp_nm_per_rad, kd_nm_s_per_rad  gains at the joint.
/// @throws std::runtime_error  when a frame of these drives cannot carry the gains.
DrivesConfig DefaultDrives(const std::vector<std::string>& joints, double kp_nm_per_rad = 200,
                           double kd_nm_s_per_rad = 4);

}  // namespace tumbler
