// Feeds a fuzzer's target with random steps of 16 bytes from fixed seeds, without libFuzzer, for
// the normal tests.
// usage: PROGRAM [ROUNDS [FIRST_SEED]]

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/drive_traffic.h"

// The target may be in the same unity source.
// NOLINTNEXTLINE(readability-redundant-declaration)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  const long rounds = argc > 1 ? std::atol(argv[1]) : 500;
  const long first = argc > 2 ? std::atol(argv[2]) : 1;
  // Identifiers of the drives there, and some beside them; anything else is ignored by nearly all.
  std::vector<tumbler::CanId> ids = {0x001, 0x011, 0x021, 0x022, 0x023, 0x027, 0x029, 0x02b,
                                     0x02c, 0x02d, 0x035, 0x038, 0x03c, 0x000, 0x080, 0x081,
                                     0x181, 0x201, 0x281, 0x301, 0x581, 0x601, 0x701, 0x77f,
                                     0x7ff, 0x03f, 0x040, 0x000, 0x080, 0x601};
  tumbler::DriveProtocols::ForEach([&ids](auto protocol) {
    using Protocol = decltype(protocol);
    const auto traffic = Protocol::TrafficOf({}, Protocol::Example(0), 1000);
    ids.insert(ids.end(), traffic.host_sends.begin(), traffic.host_sends.end());
    ids.insert(ids.end(), traffic.host_receives.begin(), traffic.host_receives.end());
  });
  std::size_t steps = 0;
  for (long seed = first; seed < first + rounds; ++seed) {
    std::mt19937 random(static_cast<std::mt19937::result_type>(seed));
    std::vector<std::uint8_t> input(16 * (1 + random() % 200));
    for (std::size_t i = 0; i < input.size(); ++i) {
      input[i] = static_cast<std::uint8_t>(random());
      if (i % 16 >= 4 && random() % 4 == 0) input[i] = random() % 2 == 0 ? 0x00 : 0xff;
    }
    for (std::size_t at = 0; at < input.size(); at += 16) {
      const tumbler::CanId id = ids[random() % ids.size()];
      input[at + 1] = static_cast<std::uint8_t>(id.value);
      input[at + 2] = static_cast<std::uint8_t>(id.value >> 8);
      if (random() % 4 != 0) {
        const unsigned size = random() % 2 == 0 ? 8 : 6;
        input[at + 3] = static_cast<std::uint8_t>(size | (id.extended ? 0x80U : 0U));
      }
    }
    steps += input.size() / 16;
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  std::printf("%ld inputs, %zu steps\n", rounds, steps);
}
