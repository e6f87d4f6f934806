// Feeds command_fuzzer's target with requests of any length, and damaged ones, from fixed seeds,
// without libFuzzer, for the normal tests.
// usage: PROGRAM [INPUTS]

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

// The target may be in the same unity source.
// NOLINTNEXTLINE(readability-redundant-declaration)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  const long inputs = argc > 1 ? std::atol(argv[1]) : 1000;
  std::mt19937 random(1);
  for (long n = 0; n < inputs; ++n) {
    // id, run, seen, command, length of the text, text
    std::vector<std::uint8_t> input(25 + 4 + random() % 300);
    for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(random());
    const std::size_t length = input.size() - 29 + (random() % 4 == 0 ? random() % 3 - 1 : 0);
    for (std::size_t i = 0; i < 4 && random() % 16 != 0; ++i) {
      input[25 + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
    }
    if (random() % 8 != 0) input.back() = 0;
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  for (std::size_t size = 0; size < 60; ++size) {
    const std::vector<std::uint8_t> zeros(size);
    LLVMFuzzerTestOneInput(zeros.data(), size);
  }
  std::printf("%ld inputs\n", inputs);
}
