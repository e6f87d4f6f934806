#pragma once

#include <concepts>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive.h"
#include "firmware_interface/devices/drive_range.h"
#include "firmware_interface/devices/host_frames.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

// Types of drives files and simulations. A microcontroller knows only their names.
class TomlTable;
struct DbcLine;               // drives_dbc.h
struct DriveEntry;            // drive_entry.h
struct DriveTable;            // drive_keys.h
struct DriveTraffic;          // drive_traffic.h
struct KeyTable;              // common/files/key_table.h
struct OwnedDrive;            // make_simulated.h
struct SimulatedMotorConfig;  // simulated_drive.h

/// A configuration of a protocol whose drives have a number, with this one.
template <typename Config>
constexpr Config OfNode(int node) noexcept {
  Config config;
  config.node_id = static_cast<std::uint8_t>(node);
  return config;
}

/// The description of a drive protocol: a type without objects. Everything that works with every
/// protocol is made from these descriptions; protocols.h lists them.
///
/// The sources of a protocol stand beside each other: the parts that need neither heap nor files in
/// `NAME.h` and `NAME.cc`, the reader of drives files in `NAME_toml.cc`, and the drive's side in
/// `simulated_NAME.cc`.
template <typename P>
concept DriveProtocol = requires(const typename P::Config& config, const CanFrame& frame,
                                 double& shaft_rad, const DriveEntry& entry, DriveTable& table,
                                 const SimulatedMotorConfig& motor) {
  /// The configuration of one drive: a value with `joint`, `Validate()`, and the drive's number on
  /// the bus, `node_id` (`OfNode` makes one; MIT's is `command_id`). It may have a member `leader`:
  /// the first such drive of a bus gets true, and the others get false.
  requires std::same_as<decltype(P::Config::joint), JointMap>;
  { config.Validate() }
  noexcept->std::same_as<Status>;
  /// The host side of one drive.
  requires std::derived_from<typename P::Host, Drive>;
  requires std::constructible_from<typename P::Host, const typename P::Config&>;

  /// The protocol's name in drives files: the value of `protocol`.
  { P::kName } -> std::convertible_to<std::string_view>;
  /// NAME of its source files, which is also its name in tests.
  { P::kId } -> std::convertible_to<std::string_view>;
  /// A commented drives file of the tumbler, in primitives/robots/.
  { P::kExample } -> std::convertible_to<std::string_view>;
  /// The file in dbc/ that describes its frames for bus analysers.
  { P::kDbc } -> std::convertible_to<std::string_view>;
  /// The time within which a drive that is switched on has replied, set-up included [ms].
  { P::kFirstReply_ms } -> std::convertible_to<int>;
  /// Whether setpoints carry the gains of the drive's law, so that it can be made softer.
  { P::kCarriesGains } -> std::convertible_to<bool>;

  /// The configuration of the drive of joint 0, 1, ... in the example.
  { P::Example(int{}) }
  noexcept->std::same_as<typename P::Config>;
  /// At the drive's shaft: the ranges of its setpoints, and the positions that it can report
  /// without wrapping.
  { P::CommandRanges(config) }
  noexcept->std::same_as<ShaftRanges>;
  { P::ReportedPositions(config) }
  noexcept->std::same_as<DriveRange>;
  /// The position of the shaft [rad] to which a frame sends the drive, or which the drive reports
  /// in a frame. Each frame is read by itself. Return false if the frame is no such frame of this
  /// drive; a command that does not ask for position control is none.
  { P::CommandedPosition(config, frame, shaft_rad) }
  noexcept->std::same_as<bool>;
  { P::ReportedPosition(config, frame, shaft_rad) }
  noexcept->std::same_as<bool>;
  /// Whether the drive samples its joint as the end of this frame of the host has come, and reports
  /// that. False for every frame: it reports by its own clock.
  { P::SamplesAt(config, frame) }
  noexcept->std::same_as<bool>;

  /// The frames that only a host sends to such a drive.
  { P::HostFrames(config) }
  noexcept->std::same_as<std::span<const HostFrame>>;

  // (The types that these return are incomplete here, which only decltype allows.)
  /// Reads the protocol's keys of a drive, and its gains. @throws FileError.
  requires std::same_as<decltype(P::Read(table)), typename P::Config>;
  /// These keys, for the protocol's page in docs/protocols/.
  requires std::same_as<decltype(P::Keys()), KeyTable>;
  /// The identifier that a message of `kDbc` has with this drive, by that in the file; 29-bit ones
  /// with bit 31 set.
  requires std::same_as<decltype(P::DbcId(std::uint32_t{}, config)), std::uint32_t>;
  /// The drive's frames on the bus of a control loop at this rate [Hz].
  requires std::same_as<decltype(P::TrafficOf(entry, config, double{})), DriveTraffic>;
  /// The drive's side, with this motor at its shaft. @throws std::invalid_argument.
  requires std::same_as<decltype(P::Simulate(entry, config, motor)), OwnedDrive>;
};

/// A protocol may have `DbcSignal(message, signal, line, config)`: a line of `kDbc` about a signal
/// as it is with this drive, or the lines of others in its place.
///
/// A protocol may have `ErrorName(code)`: the name of an error that its drives report, or null.

/// A protocol whose drives on one bus have to agree about something. `CheckBeside` throws FileError
/// about the table of `drive` if the drive does not go with an earlier one of the file.
template <typename P>
concept HasChecksBesideEachOther = requires(const DriveEntry& drive, const DriveEntry& earlier,
                                            const TomlTable& table) {
  P::CheckBeside(drive, earlier, table);
};

}  // namespace tumbler
