// Feeds the fuzzer's target with records that were damaged at random from fixed seeds, without
// libFuzzer, for the normal tests.
// usage: PROGRAM [ROUNDS [FIRST_SEED]]
//        PROGRAM --seed FILE             writes an undamaged record, for libFuzzer to begin with

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include "tests/support/recorded_run.h"

// The target may be in the same unity source.
// NOLINTNEXTLINE(readability-redundant-declaration)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  const std::string whole =
      tumbler::testing::RecordedBytes(tumbler::testing::SmallConfiguration(), 12);
  const long rounds = argc > 1 ? std::atol(argv[1]) : 500;
  const long first = argc > 2 ? std::atol(argv[2]) : 1;
  for (long seed = first; seed < first + rounds; ++seed) {
    std::mt19937 random(static_cast<std::mt19937::result_type>(seed));
    std::string bytes = whole;
    const auto place = [&random, &bytes] { return random() % bytes.size(); };
    // Changes are made behind the texts more often than in them, although most bytes are in the
    // texts.
    constexpr std::size_t kTicks = 12 * std::size_t{400};
    const std::size_t texts = whole.size() - kTicks;
    for (std::size_t i = 1 + random() % 4; i > 0; --i) {
      const std::size_t at = random() % 2 == 0 ? place() : texts + random() % kTicks;
      switch (random() % 5) {
        case 0:
          bytes[at % bytes.size()] =
              static_cast<char>(bytes[at % bytes.size()] ^ (1 << (random() % 8)));
          break;
        case 1:
          bytes[at % bytes.size()] = static_cast<char>(random());
          break;
        case 2:
          bytes.resize(1 + place());
          break;
        case 3:
          bytes.erase(at % bytes.size(), 1 + random() % 300);
          break;
        default:
          bytes.insert(at % bytes.size(), bytes.substr(place(), random() % 300));
      }
      if (bytes.empty()) bytes.push_back('T');
    }
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  std::printf("%ld inputs\n", rounds);
}
