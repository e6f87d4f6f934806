#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "common/files/file_keys.h"
#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/drive_range.h"
#include "firmware_interface/devices/impedance.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// The table of a drive in a file, for the reader of its protocol.
struct DriveTable {
  TomlTable& keys;    ///< The drive's table.
  TomlTable& bus;     ///< The bus's table, for messages about values that the protocol excludes.
  double rate_hz;     ///< Rate of the control loop.
  DriveEntry& entry;  ///< Gets the gains, and the time-out where the protocol reads it.
  const FileReader& read;  ///< Reads the files that the table names.
};

// Keys that protocols have in common: their readers, which throw FileError, and their rows in
// docs/formats.md.

/// `direction`, `gear_ratio`, `zero_offset_rad`.
JointMap ReadJoint(TomlTable& table);
std::vector<KeyRow> JointRows();

/// A range [min, max] around zero, or from zero on for gains.
DriveRange ReadRange(TomlTable& table, std::string_view key, bool from_zero);

/// The key of such a range.
/// @tparam kFromZero  whether it is that of a gain.
template <auto kMember, bool kFromZero = false>
constexpr auto RangeOf(std::string_view name, const char* meaning) {
  using Ranges = file_keys_detail::ClassOf<kMember>;
  return KeyReadBy<Ranges>(
             name,
             [](TomlTable& table, std::string_view key, Ranges& ranges) {
               ranges.*kMember = ReadRange(table, key, kFromZero);
             },
             meaning)
      .Schema(R"({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})")
      .Allowed(kFromZero ? "[0, max]" : "[min, max] around 0");
}

/// `range`: the ranges of setpoints at the drive's shaft, none wider than the wire carries.
ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max);
std::vector<KeyRow> ShaftRangeRows();

/// `[range]`: the ranges of a protocol that carries gains. Each of its keys is required, unless
/// `of_model`, which then stays where a key is missing.
void ReadImpedanceRanges(TomlTable& drive, bool of_model, ImpedanceRanges& ranges);
std::vector<KeyRow> ImpedanceRangeRows();

/// The names of models, for the key that chooses one.
template <typename Model, std::size_t kCount>
constexpr std::array<std::string_view, kCount> NamesOf(const std::array<Model, kCount>& models) {
  std::array<std::string_view, kCount> names;
  for (std::size_t i = 0; i < kCount; ++i) names[i] = models[i].name;
  return names;
}

/// Takes the ranges with which drives of a model are delivered, where they differ between models.
void TakeModelRanges(float velocity_rad_s, float torque_nm, ImpedanceRanges& ranges);

/// `kp_nm_per_rad`, `kd_nm_s_per_rad`: gains at the joint that the drive can carry at its shaft.
/// @param kp, kd  what it can carry.
void ReadCarriedGains(DriveTable& table, const JointMap& joint, const DriveRange& kp,
                      const DriveRange& kd);
/// The same keys for protocols that do not carry gains: those to which the drive was tuned.
void ReadOwnGains(DriveTable& table);
std::vector<KeyRow> GainRows();

/// `watchdog_s`. All drives have it; a protocol that checks it reads it first.
void ReadWatchdog(TomlTable& table, DriveEntry& drive);
KeyRow WatchdogRow();

}  // namespace tumbler
