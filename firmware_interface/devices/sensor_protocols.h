#pragma once

#include <concepts>
#include <span>
#include <string_view>
#include <vector>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/inertial_sensor.h"
#include "firmware_interface/devices/protocol_list.h"
#include "firmware_interface/devices/xsens_mti.h"

namespace tumbler {

/// The description of an inertial sensor's protocol: a type without objects, from which everything
/// that works with every sensor is made. Its sources stand beside each other, as those of a drive's
/// protocol do: `NAME.h` and `NAME.cc` without heap and files, and `NAME_toml.cc`.
template <typename P>
concept SensorProtocol = requires(const typename P::Config& config, TomlTable& table,
                                  const SensorReport& report) {
  /// The configuration of one sensor: a value with `Validate()`.
  { config.Validate() }
  noexcept->std::same_as<Status>;
  /// The host side of one sensor.
  requires std::derived_from<typename P::Host, InertialSensor>;
  requires std::constructible_from<typename P::Host, const typename P::Config&>;
  /// The sensor's name in drives files: the value of `protocol`.
  { P::kName } -> std::convertible_to<std::string_view>;
  /// The messages that it sends, in the order of the keys that give their identifiers.
  {std::span<const SensorMessage>(P::Messages(config))};
  /// The sensor's side: the frames of a report, in the order of the messages.
  {std::span<const CanFrame>(P::Frames(config, report))};
  /// Reads the protocol's keys of a table `[sensor]`. @throws FileError.
  requires std::same_as<decltype(P::Read(table)), typename P::Config>;
  /// These keys.
  requires std::same_as<decltype(P::Rows()), std::vector<KeyRow>>;
};
template <SensorProtocol... Protocols>
using SensorProtocolList = ProtocolList<Protocols...>;

/// All inertial sensors. To add one, name it here and in the list of CMakeLists.txt; everything
/// else about it stands in files of its own.
using SensorProtocols = SensorProtocolList<XsensMtiProtocol>;

/// One sensor, of any kind.
using SensorConfig = SensorProtocols::Config;

}  // namespace tumbler
