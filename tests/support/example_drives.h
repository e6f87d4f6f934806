#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "firmware_interface/drives/protocols.h"

namespace tumbler::testing {

/// The commented drives file of the tumbler that a protocol comes with.
struct ExampleDrives {
  std::string protocol;  ///< by the name of its files
  std::string file;      ///< from the project's folder
};

/// That of every protocol which is listed in drives/protocols.h.
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
