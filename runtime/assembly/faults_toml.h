#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/key_table.h"
#include "runtime/core/executor_config.h"

namespace tumbler {

/// A joint as the file may name it, with the positions that every primitive allows it (in any
/// role).
struct FaultsJoint {
  std::string name;
  double position_min_rad = 0;
  double position_max_rad = 0;
};

/// Reads a faults file (`primitives/robots/tumbler_faults.toml` is a commented example) over the
/// defaults that `config` holds: its `reactions`, `collapse`, and the limits that `kFaultTable`
/// names. Checked: every value and its range, unknown keys, entries that `FaultTable` does not
/// take, and a pose for every joint where a reaction is collapse.
/// @param joints  in the order of the executor's.
/// @throws FileError with file, line, key and allowed range; `config` is then unchanged.
void LoadFaults(const std::string& path, std::span<const FaultsJoint> joints,
                ExecutorConfig& config);
void ParseFaults(std::string_view text, const std::string& name,
                 std::span<const FaultsJoint> joints, ExecutorConfig& config);

/// The key of a name of the tables: `over-temperature` is `over_temperature`.
[[nodiscard]] std::string FaultsKey(std::string_view name);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> FaultsKeyTables();

}  // namespace tumbler
