// Writes random frames of every kind that the codecs of each protocol make, with the values that
// the codecs read from them (tests/support/frame_samples.h). tests/firmware_interface/dbc_check.py
// compares the .dbc files with them.

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
