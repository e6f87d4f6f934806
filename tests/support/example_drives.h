#pragma once

#include <ostream>
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

inline void PrintTo(const ExampleDrives& example, std::ostream* out) { *out << example.protocol; }

}  // namespace tumbler::testing
