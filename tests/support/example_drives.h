#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "firmware_interface/devices/protocols.h"
#include "tests/support/files.h"

namespace tumbler::testing {

/// The commented drives file of the tumbler for a protocol.
struct ExampleDrives {
  std::string protocol;  ///< The name of the protocol's source files.
  std::string file;      ///< Relative to the project's folder.
};

/// The example of every protocol that is listed in devices/protocols.h.
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
inline std::string AtRate(std::string text, double rate_hz) {
  for (const auto& match : MatchesOf("(rate_hz|estimates_s|status_s) = [0-9.]+", text)) {
    const double value = match[1] == "rate_hz" ? rate_hz : 1 / rate_hz;
    text = ReplacedAll(text, match[0], match[1] + " = " + std::to_string(value));
  }
  return text;
}

inline void PrintTo(const ExampleDrives& example, std::ostream* out) { *out << example.protocol; }

}  // namespace tumbler::testing
