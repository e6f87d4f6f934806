#pragma once

#include <cstdint>
#include <string>

#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/protocols.h"

namespace tumbler {

/// An error of a drive in words: its code in hexadecimal and, where the protocol or its firmware
/// gives it a name, the name. For messages; allocates.
[[nodiscard]] std::string DescribeDriveError(const DriveConfig& drive, std::uint32_t code);

/// What a drive has refused while it was set up, such as `object 6060:00: 0x06020000, the object
/// does not exist`; empty if it refused nothing.
[[nodiscard]] std::string DescribeSetUpRefusal(const SetUpRefusal& refusal);

}  // namespace tumbler
