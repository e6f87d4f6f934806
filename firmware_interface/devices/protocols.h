#pragma once

#include "firmware_interface/devices/akv3.h"
#include "firmware_interface/devices/cansimple.h"
#include "firmware_interface/devices/cia402.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/mit.h"
#include "firmware_interface/devices/protocol_list.h"

namespace tumbler {

/// Checks the protocols one by one, so that the compiler names what is missing in which.
template <DriveProtocol... Protocols>
using DriveProtocolList = ProtocolList<Protocols...>;

/// All protocols. To add one, name it here and in the list of CMakeLists.txt; everything else about
/// it stands in files of its own.
using DriveProtocols =
    DriveProtocolList<MitProtocol, Cia402Protocol, CanSimpleProtocol, AkV3Protocol>;

/// One drive, in any of the protocols.
using DriveConfig = DriveProtocols::Config;

[[nodiscard]] Status Validate(const DriveConfig& config) noexcept;
[[nodiscard]] const JointMap& JointOf(const DriveConfig& config) noexcept;
/// The ranges of the drive's setpoints, at its shaft.
[[nodiscard]] ShaftRanges CommandRanges(const DriveConfig& config) noexcept;
/// Positions of the shaft that the drive can report without wrapping.
[[nodiscard]] DriveRange ReportedPositions(const DriveConfig& config) noexcept;
/// The time within which a drive that is switched on has replied, set-up included [ms].
[[nodiscard]] int FirstReply_ms(const DriveConfig& config) noexcept;
/// Whether the drive's setpoints carry gains.
[[nodiscard]] bool CarriesGains(const DriveConfig& config) noexcept;

}  // namespace tumbler
