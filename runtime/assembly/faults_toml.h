#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "runtime/executor/executor_config.h"

namespace tumbler {

/// A joint that the file may name, with the positions that every primitive allows it (in any role).
struct FaultsJoint {
  std::string name;
  double position_min_rad = 0;
  double position_max_rad = 0;
};

/// Reads a faults file (`primitives/robots/tumbler_faults.toml` is a commented example) into
/// `config`, in place of the defaults there: `reactions`, `collapse`, and the limits that
/// `kFaultTable` names. Checks every value and its range, and refuses unknown keys, entries that
/// `FaultTable` does not take, and a collapse without a position for every joint.
/// @param joints  in the order of the executor.
/// @throws FileError  with file, line, key and allowed range; `config` is then unchanged.
void LoadFaults(const std::string& path, std::span<const FaultsJoint> joints,
                ExecutorConfig& config);
/// The same of a text. @param name  stands for the file in messages.
void ParseFaults(std::string_view text, const std::string& name,
                 std::span<const FaultsJoint> joints, ExecutorConfig& config);

/// The key for a name of the tables: `over_temperature` for `over-temperature`.
[[nodiscard]] std::string FaultsKey(std::string_view name);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> FaultsKeyTables();

}  // namespace tumbler
