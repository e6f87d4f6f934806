#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <variant>

namespace tumbler {

/// A list of protocols, of drives or of sensors, with ways to get from a configuration to its
/// protocol. Each has a type `Config`, a type `Host` and a name `kName`.
template <typename... Protocols>
struct ProtocolList {
  /// One device, in any of the protocols.
  using Config = std::variant<typename Protocols::Config...>;
  /// The host side of one device, or nothing.
  using Host = std::variant<std::monostate, typename Protocols::Host...>;

  static constexpr std::size_t kCount = sizeof...(Protocols);
  /// The protocols' names in drives files.
  static constexpr std::array<std::string_view, kCount> kNames{Protocols::kName...};

  /// Calls `visit(Protocol{})` for every protocol in turn.
  template <typename Visit>
  static constexpr void ForEach(Visit&& visit) {
    (visit(Protocols{}), ...);
  }

  /// Calls `visit(Protocol{}, config)` with the protocol that a device speaks and its own
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

}  // namespace tumbler
