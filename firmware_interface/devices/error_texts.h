#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/devices/drive.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/protocols.h"

namespace tumbler {

/// Whose error codes a drive has: `ak`, `damiao`, `odrive`, `cia402`, or the `kId` of a protocol
/// that names its own.
[[nodiscard]] std::string_view ErrorCodesOf(const DriveConfig& drive);
/// The same of each drive of a file, in their order.
[[nodiscard]] std::vector<std::string> ErrorCodesOf(const DrivesConfig& drives);

/// An error of a drive in words: its code in hexadecimal and, where the protocol or its firmware
/// gives it a name, the name. For messages; allocates.
[[nodiscard]] std::string DescribeDriveError(const DriveConfig& drive, std::uint32_t code);
/// The same by the name of the codes, as `ErrorCodesOf` gives it; of others only the number.
[[nodiscard]] std::string DescribeDriveError(std::string_view codes, std::uint32_t code);

/// How a drive's last change of state ended, and why it took its torque off, such as `procedure
/// result 3, disarmed; disarm reason 0x01000000, watchdog timer expired`; empty where it has said
/// neither.
[[nodiscard]] std::string DescribeReport(std::string_view codes, const DriveReport& report);

/// What a drive has said besides its error: what it refused and its report, as the end of a
/// sentence, such as `; its procedure result 3, disarmed`; empty where it has said neither.
[[nodiscard]] std::string DescribeRemarks(const DriveConfig& config, const Drive& drive);

/// What a drive has refused while it was set up, such as `object 6060:00: 0x06020000, the object
/// does not exist`; empty if it refused nothing.
[[nodiscard]] std::string DescribeSetUpRefusal(const SetUpRefusal& refusal);

}  // namespace tumbler
