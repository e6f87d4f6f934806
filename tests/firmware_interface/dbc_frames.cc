// Writes frames of every kind that the codecs make, from random values, and what the codecs read
// from them, for every protocol: see tests/support/frame_samples.h.
// tests/firmware_interface/dbc_check.py holds the .dbc files against it.

#include <string>
#include <string_view>

#include "tests/support/frame_samples.h"
#include "tests/support/protocol_side.h"

int main() {
  using namespace tumbler;
  testing::FrameSamples samples;
  for (int i = 0; i < 200; ++i) {
    DriveProtocols::ForEach([&samples](auto protocol) {
      using Protocol = decltype(protocol);
      samples.Describe(std::string(Protocol::kDbc.substr(0, Protocol::kDbc.rfind('.'))));
      SideOf(testing::SideTag<Protocol>{}).AddSamples(samples);
    });
  }
}
