#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "firmware_interface/can/bus_faults.h"

namespace tumbler {

/// Reads a script of bus faults (`tests/data/bus_faults.toml` is a commented example).
/// @param nodes  names of the ports in the order of SimulatedBus::Attach, e.g. `host`, `leg1`.
/// @throws FileError with file, line, key and allowed range.
BusFaultPlan LoadBusFaults(const std::string& path, std::span<const std::string> nodes);
/// The same of a text. @param name  stands for the file in messages.
BusFaultPlan ParseBusFaults(std::string_view text, const std::string& name,
                            std::span<const std::string> nodes);

/// The keys of the file and the kinds of faults, for docs/formats.md.
std::vector<KeyTable> BusFaultsKeyTables();

}  // namespace tumbler
