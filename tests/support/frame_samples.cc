#include "tests/support/frame_samples.h"

#include <cstdio>
#include <cstdlib>

namespace tumbler::testing {

void FrameSamples::Add(const char* message, const CanFrame& frame, Signals signals) {
  std::printf("%s %s %u%s ", dbc_.c_str(), message, frame.id, frame.extended ? "x" : "");
  for (std::size_t i = 0; i < frame.size; ++i) std::printf("%02x", frame.data[i]);
  if (frame.size == 0) std::printf("-");
  for (const auto& [name, value] : signals) std::printf(" %s=%.17g", name, value);
  std::printf("\n");
}

void FrameSamples::Expect(Status status) {
  if (status != Status::kOk) std::abort();
}

}  // namespace tumbler::testing
