#include "tests/support/protocol_side.h"

namespace tumbler::testing {

const std::vector<TestedProtocol>& EveryProtocol() {
  static const std::vector<TestedProtocol> protocols = [] {
    std::vector<TestedProtocol> all;
    DriveProtocols::ForEach([&all](auto listed) {
      using Protocol = decltype(listed);
      all.push_back({std::string(Protocol::kId),
                     "primitives/robots/" + std::string(Protocol::kExample),
                     &SideOf(SideTag<Protocol>{})});
    });
    return all;
  }();
  return protocols;
}

void PrintTo(const TestedProtocol& protocol, std::ostream* out) { *out << protocol.name; }

const ProtocolSide& SideOf(const DriveConfig& drive) {
  return DriveProtocols::With(drive,
                              [](auto protocol, const auto& /*config*/) -> const ProtocolSide& {
                                return SideOf(SideTag<decltype(protocol)>{});
                              });
}

}  // namespace tumbler::testing
