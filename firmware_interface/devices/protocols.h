#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <variant>

#include "firmware_interface/devices/akv3.h"
#include "firmware_interface/devices/cansimple.h"
#include "firmware_interface/devices/cia402.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/mit.h"

namespace tumbler {

/// A list of protocols, with ways to get from a configuration to its protocol.
template <typename... Protocols>
struct ProtocolList {
  /// One drive, in any of the protocols.
  using Config = std::variant<typename Protocols::Config...>;
  /// The host side of one drive, or nothing.
  using Host = std::variant<std::monostate, typename Protocols::Host...>;

  static constexpr std::size_t kCount = sizeof...(Protocols);
  /// The protocols' names in drives files.
  static constexpr std::array<std::string_view, kCount> kNames{Protocols::kName...};

  /// Checks the protocols one by one, so that the compiler names what is missing in which.
  template <DriveProtocol Protocol>
  static constexpr bool kIsDescribed = true;
  static_assert((kIsDescribed<Protocols> && ...));

  /// Calls `visit(Protocol{})` for every protocol in turn.
  template <typename Visit>
  static constexpr void ForEach(Visit&& visit) {
    (visit(Protocols{}), ...);
  }

  /// Calls `visit(Protocol{}, config)` with the protocol that a drive speaks and its own
  /// configuration, and returns the result. (std::visit and std::get can throw; this cannot.)
  template <typename Visit>
  static constexpr decltype(auto) With(const Config& config, Visit&& visit) {
    return WithOneOf<Protocols...>(config, visit);
  }

 private:
  template <typename First, typename... Rest, typename Visit>
  static constexpr decltype(auto) WithOneOf(const Config& config, Visit& visit) {
    if constexpr (sizeof...(Rest) > 0) {
      if (!std::holds_alternative<typename First::Config>(config)) {
        return WithOneOf<Rest...>(config, visit);
      }
    }
    return visit(First{}, *std::get_if<typename First::Config>(&config));
  }
};

/// All protocols. To add one, name it here and in the list of CMakeLists.txt; everything else about
/// it stands in files of its own.
using DriveProtocols = ProtocolList<MitProtocol, Cia402Protocol, CanSimpleProtocol, AkV3Protocol>;

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
