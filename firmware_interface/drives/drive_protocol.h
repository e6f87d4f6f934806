#pragma once

#include <concepts>
#include <string_view>

#include "common/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"

namespace tumbler {

// Of drives files and simulations, which a microcontroller knows by name alone.
class TomlTable;
struct DriveEntry;            // drive_entry.h
struct DriveTable;            // drive_keys.h
struct DriveTraffic;          // drive_traffic.h
struct OwnedDrive;            // make_simulated.h
struct SimulatedMotorConfig;  // simulated_drive.h

/// The description of a drive protocol: a type without objects, of which everything that is there
/// for every protocol is made (protocols.h lists them). Everything in it stands beside the
/// protocol: what needs neither heap nor files in `NAME.h` and `NAME.cc`, the reading of a drives
/// file in `NAME_toml.cc`, the drive's side in `simulated_NAME.cc`.
template <typename P>
concept DriveProtocol = requires(const typename P::Config& config, const CanFrame& frame,
                                 double& shaft_rad, const DriveEntry& entry, DriveTable& table,
                                 const SimulatedMotorConfig& motor) {
  /// One drive: a value with `joint`, and with `Validate()`. Of several drives of a bus whose
  /// configurations have a member `leader`, the first gets true and the others false.
  requires std::same_as<decltype(P::Config::joint), JointMap>;
  { config.Validate() }
  noexcept->std::same_as<Status>;
  /// The host side of one.
  requires std::derived_from<typename P::Host, Drive>;
  requires std::constructible_from<typename P::Host, const typename P::Config&>;

  /// What a drives file calls it, as the value of `protocol`.
  { P::kName } -> std::convertible_to<std::string_view>;
  /// NAME of its source files; also its name in tests.
  { P::kId } -> std::convertible_to<std::string_view>;
  /// A commented drives file of the tumbler, in primitives/robots/.
  { P::kExample } -> std::convertible_to<std::string_view>;
  /// The file in dbc/ that describes it for bus analysers.
  { P::kDbc } -> std::convertible_to<std::string_view>;
  /// Time after which a drive that is switched on has been heard, set-up included [ms].
  { P::kFirstReply_ms } -> std::convertible_to<int>;

  /// The drive of joint 0, 1, ... in the example, as the core has it.
  { P::Example(int{}) }
  noexcept->std::same_as<typename P::Config>;
  /// What can be asked of the drive, and the positions that it can report without wrapping: at its
  /// shaft.
  { P::CommandRanges(config) }
  noexcept->std::same_as<ShaftRanges>;
  { P::ReportedPositions(config) }
  noexcept->std::same_as<DriveRange>;
  /// The position of the shaft that a frame tells the drive to go to, or that the drive reports in
  /// it [rad]. Each frame is taken by itself. False if it is no such frame of this drive; a frame
  /// that does not ask for position control is none.
  { P::CommandedPosition(config, frame, shaft_rad) }
  noexcept->std::same_as<bool>;
  { P::ReportedPosition(config, frame, shaft_rad) }
  noexcept->std::same_as<bool>;

  // (These return what is incomplete here, which only decltype lets pass.)
  /// Reads the protocol's keys of a drive, and its gains. @throws FileError.
  requires std::same_as<decltype(P::Read(table)), typename P::Config>;
  /// What the drive has on the bus of a control loop at this rate [Hz].
  requires std::same_as<decltype(P::TrafficOf(entry, config, double{})), DriveTraffic>;
  /// The drive's side, with this motor at its shaft. @throws std::invalid_argument.
  requires std::same_as<decltype(P::Simulate(entry, config, motor)), OwnedDrive>;
};

/// A protocol whose drives on one bus have to agree about something. `Check` throws FileError about
/// the table of `drive` where it does not go with one that the file has before it.
template <typename P>
concept HasChecksBesideEachOther = requires(const DriveEntry& drive, const DriveEntry& earlier,
                                            const TomlTable& table) {
  P::CheckBeside(drive, earlier, table);
};

}  // namespace tumbler
