// Firmware that plays the exported motion against a recording of the drives' frames, and writes
// what it sends, through semihosting:
//
//   playback PROTOCOL CYCLES BRANCH|- RECORDING OUTPUT [sensor]
//
// With the last word there is a sensor, and the drives have its drives file's gains.
//
// Prints how many counts of SysTick each tick took, by state, and how deep the stack became.
// SysTick counts processor cycles; under QEMU's -icount it counts instructions, and the first line
// printed gives the scale.

#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "motion.h"  // Written by tumbler export.
#include "runtime/embedded/playback.h"
#include "runtime/embedded/semihosting.h"
#include "runtime/embedded/startup.h"

namespace tumbler {
namespace {

using semihosting::Print;

/// SysTick as a 24-bit down-counter of processor cycles.
class Counter {
 public:
  Counter() noexcept {
    *Register(0x14) = kMask;
    *Register(0x18) = 0;
    *Register(0x10) = 5;  // On, processor clock, no interrupt.
    const std::uint32_t before = Now();
    overhead_ = (before - Now()) & kMask;
  }
  [[nodiscard]] std::uint32_t Now() const noexcept { return *Register(0x18); }
  /// Counts since a value of Now.
  [[nodiscard]] std::uint32_t Since(std::uint32_t before) const noexcept {
    return ((before - Now()) & kMask) - overhead_;
  }

 private:
  static constexpr std::uint32_t kMask = 0xffffff;
  static volatile std::uint32_t* Register(std::uint32_t offset) noexcept {
    return reinterpret_cast<volatile std::uint32_t*>(0xe000e000U + offset);
  }
  std::uint32_t overhead_ = 0;
};

struct Counts {
  std::uint32_t ticks = 0;
  std::uint64_t sum = 0;
  std::uint32_t most = 0;
  void Add(std::uint32_t counts) noexcept {
    ++ticks;
    sum += counts;
    if (counts > most) most = counts;
  }
};

[[noreturn]] void Fail(const char* problem) noexcept {
  Print("playback: ");
  Print(problem);
  Print("\n");
  semihosting::Exit(false);
}

struct Arguments {
  std::string_view drives;
  int cycles = 0;
  int branch = -1;
  const char* recording = nullptr;
  const char* output = nullptr;
  bool with_sensor = false;
};

Arguments ReadArguments(std::span<char> line) noexcept {
  if (!semihosting::CommandLine(line)) Fail("there is no command line");
  std::array<char*, 6> words{};
  char* next = line.data();
  for (char*& word : words) {
    word = next;
    if (word == nullptr || *word == '\0') Fail("too few arguments");
    next = std::strchr(word, ' ');
    if (next != nullptr) *next++ = '\0';
  }
  Arguments arguments;
  arguments.drives = words[1];
  if (!Playback::Knows(arguments.drives)) {
    Print("drives have to be one of");
    DriveProtocols::ForEach([](auto protocol) {
      Print(" ");
      Print(decltype(protocol)::kId.data());
    });
    Print("\n");
    Fail("there is no such protocol");
  }
  for (const char* c = words[2]; *c != '\0'; ++c) {
    if (*c < '0' || *c > '9' || arguments.cycles > 1000) Fail("cycles have to be 0 ... 9999");
    arguments.cycles = 10 * arguments.cycles + (*c - '0');
  }
  if (std::string_view(words[3]) != "-") {
    arguments.branch = motion::kGraph.FindBranch(words[3]);
    if (arguments.branch < 0) Fail("the motion has no such branch");
  }
  arguments.recording = words[4];
  arguments.output = words[5];
  if (next != nullptr) {
    if (std::string_view(next) != "sensor") Fail("the last word may be sensor, or be left out");
    arguments.with_sensor = true;
  }
  return arguments;
}

/// Measures a loop of 10 000 instructions, so that counts can be turned into instructions.
void Calibrate(const Counter& counter) noexcept {
  std::uint32_t n = 5000;
  const std::uint32_t before = counter.Now();
  asm volatile("1: subs %0, %0, #1\n bne 1b" : "+r"(n) : : "cc");
  Print("calibration: 10000 instructions took ");
  Print(counter.Since(before));
  Print(" counts\n");
}

int Play() noexcept {
  static std::array<char, 512> line;
  const Arguments arguments = ReadArguments(line);
  Print("motion ");
  Print(motion::kSource.data());
  Print(" ");
  Print(motion::kSourceHash.data());
  Print("\n");

  static Playback playback;
  if (playback.Configure(arguments.drives, arguments.cycles, arguments.branch, motion::kGraph,
                         motion::kPrimitives, arguments.with_sensor) != Status::kOk) {
    Fail("the executor does not take the motion");
  }
  const int in = semihosting::OpenForReading(arguments.recording);
  const int out = semihosting::OpenForWriting(arguments.output);
  if (in < 0) Fail("the recording cannot be read");
  if (out < 0) Fail("the output cannot be written");

  const Counter counter;
  Calibrate(counter);
  const std::uint32_t stack_of_set_up = StackUsed();
  const std::uint32_t stack_here = RepaintStack();
  static std::array<Counts, kExecutorStateCount> counts;
  static std::array<std::uint8_t, RecordedTick::kMaxBytes> bytes;
  static std::array<std::uint8_t, kPlaybackMaxBytes> packed;
  static RecordedTick tick;
  const std::span<std::uint8_t> header(bytes.data(), RecordedTick::kHeaderBytes);
  while (semihosting::Read(in, header) == header.size()) {
    const int more = UnpackHeader(header, tick);
    if (more < 0) Fail("a tick of the recording has too many frames");
    const std::span<std::uint8_t> frames(bytes.data(), static_cast<std::size_t>(more));
    if (semihosting::Read(in, frames) != frames.size()) Fail("the recording is cut off");
    UnpackFrames(frames, tick);
    const TickInput input = playback.NextInput(tick);
    const std::uint32_t before = counter.Now();
    playback.Tick(input);
    const std::uint32_t taken = counter.Since(before);
    counts[static_cast<std::size_t>(playback.output().record.state)].Add(taken);
    if (!semihosting::Write(out, {packed.data(), Pack(playback.output(), packed)}))
      Fail("the output cannot be written");
  }
  semihosting::Close(out);

  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i].ticks == 0) continue;
    Print("state ");
    Print(ToString(static_cast<ExecutorState>(i)));
    Print(": ");
    Print(counts[i].ticks);
    Print(" ticks, mean ");
    Print(static_cast<std::uint32_t>(counts[i].sum / counts[i].ticks));
    Print(", most ");
    Print(counts[i].most);
    Print(" counts\n");
  }
  Print("stack: of ");
  Print(StackSize());
  Print(" bytes, set-up used ");
  Print(stack_of_set_up);
  Print(" and ticks ");
  Print(StackUsed() - stack_here);
  Print("\n");
  return 0;
}

}  // namespace
}  // namespace tumbler

int main() { return tumbler::Play(); }
