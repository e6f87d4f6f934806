// The keys of an Xsens MTi in drives files.

#include <array>

#include "common/files/file_keys.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/devices/xsens_mti.h"

namespace tumbler {
namespace {

constexpr std::array kXsensKeys = {
    KeyOf<&XsensMtiConfig::quaternion_id>("quaternion_id", {0, 0x7ff}, "of the attitude"),
    KeyOf<&XsensMtiConfig::rate_id>("rate_id", {0, 0x7ff}, "of the rate of turn"),
    KeyOf<&XsensMtiConfig::time_id>("time_id", {0, 0x7ff}, "of the sample time"),
};

}  // namespace

XsensMtiConfig XsensMtiProtocol::Read(TomlTable& table) {
  XsensMtiConfig config;
  ReadKeys(table, kXsensKeys, config);
  if (config.Validate() != Status::kOk) {
    table.Fail("quaternion_id",
               "is that of another message of the sensor; allowed: three different "
               "identifiers");
  }
  return config;
}

std::vector<KeyRow> XsensMtiProtocol::Rows() { return RowsOf(kXsensKeys, "`[sensor]`"); }

}  // namespace tumbler
