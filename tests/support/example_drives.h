#pragma once

#include <ostream>
#include <regex>
#include <string>
#include <vector>

#include "firmware_interface/drives/protocols.h"

namespace tumbler::testing {

/// The commented drives file of the tumbler for a protocol.
struct ExampleDrives {
  std::string protocol;  ///< The name of the protocol's source files.
  std::string file;      ///< Relative to the project's folder.
};

/// The example of every protocol that is listed in drives/protocols.h.
inline std::vector<ExampleDrives> ExampleOfEveryProtocol() {
  std::vector<ExampleDrives> examples;
  DriveProtocols::ForEach([&examples](auto protocol) {
    using Protocol = decltype(protocol);
    examples.push_back(
        {std::string(Protocol::kId), "primitives/robots/" + std::string(Protocol::kExample)});
  });
  return examples;
}

/// The text of a drives file with another rate. What the drives report by their own clock comes
/// once a tick, too.
inline std::string AtRate(const std::string& text, double rate_hz) {
  const std::string at_rate = std::regex_replace(text, std::regex("rate_hz = [0-9.]+"),
                                                 "rate_hz = " + std::to_string(rate_hz));
  return std::regex_replace(at_rate, std::regex("(estimates_s|status_s) = [0-9.]+"),
                            "$1 = " + std::to_string(1 / rate_hz));
}

inline void PrintTo(const ExampleDrives& example, std::ostream* out) { *out << example.protocol; }

}  // namespace tumbler::testing
