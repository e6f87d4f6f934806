// What a compiler made of the gate, for samples: on a Cortex-M, too. Prints some samples as bits,
// and a digest of many.

#include <cstdint>
#include <cstring>

#include "tests/runtime/gate_proof/gate_samples.h"
#if defined(__arm__)
#include "runtime/embedded/semihosting.h"
#else
#include <cstdio>
#endif

extern "C" void Gate(const void* limits, const void* planned, const void* previous, int ticks,
                     void* result);

namespace tumbler {
namespace {

void Say(const char* text) {
#if defined(__arm__)
  semihosting::Print(text);
#else
  std::fputs(text, stdout);
#endif
}

void Say(std::uint32_t word) {
  char text[10] = "00000000 ";
  for (int i = 7; i >= 0; --i, word >>= 4U) text[i] = "0123456789abcdef"[word & 15U];
  Say(text);
}

// There are many NaN. Processors differ in which they give.
std::uint32_t BitsOf(float x) {
  std::uint32_t bits = 0x7fc00000;
  if (x == x) std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

void Show(const GateInput& in, const std::uint32_t* out) {
  Say("sample ");
  for (const float x : in.limits) Say(BitsOf(x));
  for (const float x : in.planned) Say(BitsOf(x));
  for (const float x : in.previous) Say(BitsOf(x));
  Say(static_cast<std::uint32_t>(in.ticks));
  for (int i = 0; i < 4; ++i) Say(out[i]);
  Say("\n");
}

}  // namespace

void Compare() {
  constexpr int kSamples = 200000;
  constexpr int kShown = 60;
  GateSamples samples(7);
  std::uint32_t digest = 2166136261U;
  for (int i = 0; i < kSamples; ++i) {
    const GateInput in = samples.Next(i % 2 == 0);
    float result[4] = {};
    Gate(in.limits, in.planned, in.previous, in.ticks, result);
    std::uint32_t flags = 0;
    std::memcpy(&flags, &result[3], sizeof flags);
    const std::uint32_t out[4] = {BitsOf(result[0]), BitsOf(result[1]), BitsOf(result[2]),
                                  flags & 0xffffU};
    for (const std::uint32_t word : out) digest = (digest ^ word) * 16777619U;
    if (i < kShown) Show(in, out);
  }
  Say("digest ");
  Say(digest);
  Say("\n");
}

}  // namespace tumbler

int main() {
  tumbler::Compare();
#if defined(__arm__)
  tumbler::semihosting::Exit(true);
#else
  return 0;
#endif
}
