// Compares the core on Cortex-M4F and M7 under QEMU with the same source on this machine: every
// byte that leaves the executor, in every tick of the whole shipped gait (two cycles and the roll).
//
// This machine plays the motion that the loader gives, with simulated drives, and records the
// frames that they send. The firmware plays the motion that `tumbler export` wrote, against that
// recording. `ctest -R CortexM -V` prints sizes, stack and instructions.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "runtime/assembly/dry_run_bus.h"
#include "runtime/embedded/playback.h"
#include "runtime/record/flight_record.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::ExampleDrives;
using testing::ExampleOfEveryProtocol;
using testing::MatchesOf;
using testing::Program;
using testing::ReadFile;
using testing::WriteFile;

constexpr int kCycles = 2;
constexpr const char* kBranch = "roll";

/// The most instructions that a tick of two joints may take.
constexpr double kInstructionsMax = 4000;

/// The same with feedback and an inertial sensor.
constexpr double kFeedbackInstructionsMax = 5000;

/// The most bytes of stack that a tick may use; and Configure, with its callers.
constexpr int kTickStackMax = 1024;
constexpr int kSetUpStackMax = 2048;

struct Machine {
  const char* name;  // of its preset
  const char* qemu;  // for QEMU's option -machine
};
/// Else a test's name had the bytes of its pointers, others in each build.
void PrintTo(const Machine& machine, std::ostream* out) { *out << machine.name; }
constexpr std::array kMachines{
    Machine{"m4f", "mps2-an386"},
#ifndef TUMBLER_ONE_CORTEX_M
    Machine{"m7", "mps2-an500"},
#endif
};

std::string Firmware(const Machine& machine, const std::string& name = "tumbler-playback") {
  return testing::BuildPath(fmt::format("cortex-{}/bin/{}.elf", machine.name, name));
}

const Sequence<float>& Gait() {
  static const auto gait = std::make_unique<const Sequence<float>>(
      ToRuntime(LoadMotion(testing::SourcePath("primitives/cartwheel.toml"))));
  return *gait;
}

/// The inputs and outputs of one run on this machine.
struct Played {
  std::string recording;
  std::string output;
  std::vector<std::size_t> tick_ends;  ///< The end of each tick in `output`.
  std::set<std::string> nodes;         ///< The nodes that were played.
  std::set<ExecutorState> states;
  std::set<Reaction> reactions;
  std::uint32_t faults = 0;
  int corrected = 0;  ///< Ticks in which the feedback moved a setpoint.
  int cycles = kCycles;
};

/// Changes a tick's input, in place of the world between drives and executor. It sees the record of
/// the tick before.
using Trouble = std::function<void(RecordedTick&, const TickRecord& last)>;

Played PlayHere(const ExampleDrives& drives, const Trouble& trouble = {}, int cycles = kCycles) {
  const Sequence<float>& gait = Gait();
  const DrivesConfig config = LoadDrives(testing::SourcePath(drives.file));
  std::vector<DryRunBus::Node> nodes;
  for (std::size_t i = 0; i < config.drives.size(); ++i) {
    // The joint is not at the start, so that it has to move there.
    const float start = gait.primitives[0].joints[i].position.control_points()[0];
    nodes.push_back({MakeSimulatedDrive(config.drives[i]),
                     static_cast<double>(start) + (i == 0 ? 0.4 : -0.25)});
  }
  DryRunBus bus("none", config.bit_rate, std::move(nodes), nullptr);
  Playback playback;
  if (playback.Configure(drives.protocol, cycles, gait.graph.FindBranch(kBranch), gait.graph,
                         {gait.primitives.data(),
                          static_cast<std::size_t>(gait.primitive_count)}) != Status::kOk) {
    throw std::logic_error("the executor does not take the gait");
  }
  Played run;
  run.cycles = cycles;
  RecordedTick tick;
  std::array<std::uint8_t, std::max(RecordedTick::kMaxBytes, kPlaybackMaxBytes)> bytes{};
  const auto append = [&bytes](std::string& to, std::size_t count) {
    to.append(reinterpret_cast<const char*>(bytes.data()), count);
  };
  for (int n = 0; n < 60'000 && !playback.done(); ++n) {
    bus.AdvanceTo(std::int64_t{n} * 1'000'000);
    tick = {};
    ReceivedFrame received;
    while (tick.frame_count < RecordedTick::kMaxFrames && bus.Receive(received) == Status::kOk)
      tick.frames[tick.frame_count++] = received;
    if (trouble) trouble(tick, playback.output().record);
    append(run.recording, Pack(tick, bytes));
    playback.Tick(playback.NextInput(tick));
    const TickOutput& output = playback.output();
    append(run.output, Pack(output, bytes));
    run.tick_ends.push_back(run.output.size());
    run.states.insert(output.record.state);
    run.reactions.insert(output.record.reaction);
    run.faults |= output.record.faults;
    if (output.record.state == ExecutorState::kRunning)
      run.nodes.insert(std::string(gait.graph.node(output.record.node).name.view()));
    for (std::size_t j = 0; j < output.record.joint_count; ++j) {
      for (const CanFrame& frame : output.frames[j].frames()) {
        if (bus.Send(frame) != Status::kOk) throw std::logic_error("the bus takes no more");
      }
    }
  }
  if (!playback.done()) throw std::logic_error("the run does not end");
  return run;
}

/// Disturbs a tick as the world can do: by lost frames, wrong bits, foreign frames, a late tick, a
/// bus that takes no frames or goes off. It does so rarely enough for runs to get far.
void Disturb(RecordedTick& tick, int number, std::mt19937& random) {
  if (number < 1000) return;
  const auto once_in = [&random](int n) {
    return std::uniform_int_distribution<int>(1, n)(random) == 1;
  };
  const auto any = [&random](int below) {
    return std::uniform_int_distribution<int>(0, below - 1)(random);
  };
  if (once_in(200)) tick.frame_count = 0;
  for (std::size_t i = 0; i < tick.frame_count; ++i) {
    CanFrame& frame = tick.frames[i].frame;
    if (once_in(4000))
      frame.data[static_cast<std::size_t>(any(8))] ^= static_cast<std::uint8_t>(1 << any(8));
    if (once_in(4000)) frame.id ^= 1U << any(11);
    if (once_in(4000)) frame.size = static_cast<std::uint8_t>(any(9));
    if (once_in(4000)) frame.remote = true;
  }
  if (once_in(3000)) tick.elapsed = static_cast<std::int8_t>(any(8) - 1);
  if (once_in(20000)) tick.send_status = Status::kWouldBlock;
  if (once_in(20000)) tick.receive_status = Status::kBusOff;
}

struct Emulation {
  int status = -1;
  std::string text;
  std::string output;
};

/// Runs the firmware. Every instruction takes 1.024 us (-icount shift=10), in which SysTick, at
/// 25 MHz, counts 25.6.
Emulation Emulate(const Machine& machine, const std::vector<std::string>& arguments,
                  const std::string& output, const std::string& firmware = "tumbler-playback") {
  std::string semihosting = "enable=on,target=native,arg=tumbler-playback";
  for (const std::string& argument : arguments) semihosting += ",arg=" + argument;
  Program qemu({"/usr/bin/env", "qemu-system-arm", "-machine", machine.qemu, "-display", "none",
                "-monitor", "none", "-serial", "none", "-icount", "shift=10,align=off,sleep=off",
                "-semihosting-config", semihosting, "-kernel", Firmware(machine, firmware)});
  Emulation emulation;
  emulation.status = qemu.Wait();
  emulation.text = qemu.text();
  if (std::filesystem::exists(output)) emulation.output = ReadFile(output);
  return emulation;
}

Emulation Emulate(const Machine& machine, const ExampleDrives& drives, const Played& run) {
  const testing::TemporaryFolder folder;
  WriteFile(folder / "recording", run.recording);
  return Emulate(machine,
                 {drives.protocol, std::to_string(run.cycles), kBranch, folder / "recording",
                  folder / "output"},
                 folder / "output");
}

/// Describes where two outputs first differ; empty when they do not differ.
std::string FirstDifference(const Played& run, const std::string& other) {
  const auto [here, there] =
      std::mismatch(run.output.begin(), run.output.end(), other.begin(), other.end());
  if (here == run.output.end() && there == other.end()) return "";
  const auto at = static_cast<std::size_t>(here - run.output.begin());
  const auto tick =
      std::upper_bound(run.tick_ends.begin(), run.tick_ends.end(), at) - run.tick_ends.begin();
  const std::size_t begin = tick == 0 ? 0 : run.tick_ends[static_cast<std::size_t>(tick) - 1];
  std::size_t offset = at - begin;
  std::string what = "head";
  if (at >= run.output.size() || at >= other.size()) {
    what = "length";
  } else if (offset >= kPlaybackHeadBytes) {
    static constexpr std::array kFields{
        "planned position", "planned velocity", "planned torque", "planned acceleration",
        "limited position", "limited velocity", "limited torque", "encoded position",
        "encoded velocity", "encoded torque"};
    offset -= kPlaybackHeadBytes;
    for (int joint = 0;; ++joint) {
      if (offset < 40) {
        what = fmt::format("joint {}: {}", joint, kFields[offset / 4]);
        break;
      }
      const auto frames =
          static_cast<std::uint8_t>(run.output[at - offset + kPlaybackJointBytes - 1]);
      const std::size_t size = kPlaybackJointBytes + frames * RecordedTick::kFrameBytes;
      if (offset < size) {
        what = offset == 40
                   ? fmt::format("joint {}: number of frames", joint)
                   : fmt::format("joint {}: frame {}", joint,
                                 (offset - kPlaybackJointBytes) / RecordedTick::kFrameBytes);
        break;
      }
      offset -= size;
    }
  }
  return fmt::format("first difference in tick {}, {} (byte {} of {} here, {} there)", tick, what,
                     at, run.output.size(), other.size());
}

struct Figures {
  struct State {
    int ticks = 0;
    double mean = 0;  ///< Mean number of instructions of a tick.
    double most = 0;
  };
  std::map<std::string, State> states;
  // Both in bytes: the stack from the start to the end of Configure, and that below the loop that
  // calls Tick.
  int set_up_stack = 0;
  int tick_stack = 0;
};

Figures ReadFigures(const std::string& text) {
  Figures figures;
  // This follows from QEMU's command line: 1.024 us at 25 MHz. A loop of known length, with the few
  // instructions around it, confirms it.
  constexpr double per_instruction = 25.6;
  const auto loop = MatchesOf("10000 instructions took ([0-9]+) counts", text);
  if (loop.empty()) {
    ADD_FAILURE() << text;
    return figures;
  }
  EXPECT_GE(std::stod(loop[0][1]) / per_instruction, 10000);
  EXPECT_LE(std::stod(loop[0][1]) / per_instruction, 10015);
  for (const auto& match :
       MatchesOf("state ([a-z ]+): ([0-9]+) ticks, mean ([0-9]+), most ([0-9]+) counts", text)) {
    figures.states[match[1]] = {std::stoi(match[2]), std::stod(match[3]) / per_instruction,
                                std::stod(match[4]) / per_instruction};
  }
  for (const auto& match : MatchesOf("set-up used ([0-9]+) and ticks ([0-9]+)", text)) {
    figures.set_up_stack = std::stoi(match[1]);
    figures.tick_stack = std::stoi(match[2]);
  }
  return figures;
}

/// Finds the deepest stack below a function, from the compiler's files on functions and calls.
class CallGraph {
 public:
  /// Reads the graph of all objects in a folder.
  explicit CallGraph(const std::filesystem::path& folder) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.path().extension() != ".ci") continue;
      const std::string text = ReadFile(entry.path());
      for (const auto& match :
           MatchesOf("node: \\{ title: \"([^\"]+)\" label: \"[^\"]*\\\\n([0-9]+) bytes \\(([a-z]+)",
                     text)) {
        if (match[3] != "static") throw std::runtime_error(match[1] + " has no fixed frame");
        frames_[match[1]] = std::stoi(match[2]);
      }
      for (const auto& match :
           MatchesOf("edge: \\{ sourcename: \"([^\"]+)\" targetname: \"([^\"]+)\"", text)) {
        calls_[match[1]].insert(match[2]);
        // Whoever knows no sensor may call the estimate of the pitch, which calls the sensor.
        if (match[2] == "__indirect_call" && match[1].find("SensorWatch") == std::string::npos)
          calls_[match[1]].insert(kPitchCall);
      }
    }
    // The only indirect calls in the core are those of a drive, of the pitch and of the sensor.
    const std::string pitch = "^(.*:)?_ZN7tumbler11SensorWatch(4Take|7EndTick|5Trust)E";
    const std::string method =
        "^(.*:)?_ZNK?7tumbler([0-9]+[A-Za-z0-9_]+Drive(INS_[A-Za-z0-9_]+E)?"
        "(6Encode|6Decode|16encoded_setpoint|8feedback|5state)|8XsensMti6Decode)E";
    for (const auto& [name, bytes] : frames_) {
      if (!MatchesOf(method, name).empty()) calls_["__indirect_call"].insert(name);
      if (!MatchesOf(pitch, name).empty()) calls_[kPitchCall].insert(name);
    }
    if (calls_[kPitchCall].size() < 3) throw std::runtime_error("the pitch's methods are missing");
  }

  /// The deepest stack [bytes] of a function and those that it calls.
  /// @throws std::runtime_error  on recursion.
  int DepthOf(const std::string& function) {
    if (!open_.insert(function).second) throw std::runtime_error(function + " is recursive");
    int below = 0;
    for (const std::string& callee : calls_[function]) below = std::max(below, DepthOf(callee));
    open_.erase(function);
    if (function == "__indirect_call" || function == kPitchCall) return below;
    const auto frame = frames_.find(function);
    return below + (frame == frames_.end() ? kLibraryFrame : frame->second);
  }

  [[nodiscard]] std::size_t methods() { return calls_["__indirect_call"].size(); }

 private:
  static constexpr const char* kPitchCall = "__pitch_call";
  /// Assumed for functions of libraries: memcpy, memcmp, conversions of 64 bits.
  static constexpr int kLibraryFrame = 96;
  std::map<std::string, int> frames_;
  std::map<std::string, std::set<std::string>> calls_;
  std::set<std::string> open_;
};

class CortexM : public ::testing::TestWithParam<std::tuple<Machine, ExampleDrives>> {};

TEST_P(CortexM, SendsTheBytesThatThisMachineSendsForTheWholeGait) {
  const auto& [machine, drives] = GetParam();
  const Played run = PlayHere(drives);
  ASSERT_EQ(run.nodes, (std::set<std::string>{"handstand", "downstand", "handstand, swapped",
                                              "downstand, swapped", "roll"}));
  ASSERT_EQ(run.faults, 0);
  const Emulation emulation = Emulate(machine, drives, run);
  ASSERT_EQ(emulation.status, 0) << emulation.text;
  EXPECT_EQ(FirstDifference(run, emulation.output), "");

  const Figures figures = ReadFigures(emulation.text);
  EXPECT_GT(figures.tick_stack, 100);
  EXPECT_LE(figures.tick_stack, kTickStackMax);
  EXPECT_LE(figures.set_up_stack, kSetUpStackMax);
  EXPECT_EQ(figures.states.size(), run.states.size());
  fmt::print(
      "Cortex-{}, {}: {} ticks the same; stack: {} bytes at set-up, {} below the loop; "
      "instructions a tick:\n",
      machine.name, drives.protocol, run.tick_ends.size(), figures.set_up_stack,
      figures.tick_stack);
  for (const auto& [state, counts] : figures.states) {
    fmt::print("  {:<16} {:6} ticks, mean {:5.0f}, most {:5.0f}\n", state, counts.ticks,
               counts.mean, counts.most);
    EXPECT_LE(counts.most, kInstructionsMax) << state;
  }
}

TEST_P(CortexM, SendsTheBytesThatThisMachineSendsWhateverTheWorldDoes) {
  const auto& [machine, drives] = GetParam();
  std::uint32_t faults = 0;
  std::set<ExecutorState> states;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    std::mt19937 random(seed);
    int ticks = 0;
    const Played run = PlayHere(drives, [&](RecordedTick& tick, const TickRecord& /*last*/) {
      Disturb(tick, ++ticks, random);
    });
    faults |= run.faults;
    states.insert(run.states.begin(), run.states.end());
    const Emulation emulation = Emulate(machine, drives, run);
    ASSERT_EQ(emulation.status, 0) << emulation.text;
    EXPECT_EQ(FirstDifference(run, emulation.output), "");
    const Figures figures = ReadFigures(emulation.text);
    EXPECT_LE(figures.tick_stack, kTickStackMax);
    for (const auto& [state, counts] : figures.states)
      EXPECT_LE(counts.most, kInstructionsMax) << state;
  }
  // The disturbances must have had effects.
  EXPECT_GE(std::popcount(faults), 2);
  EXPECT_TRUE(states.contains(ExecutorState::kFault));
}

/// The content of a flight record of tumbler run, as if this machine had played it.
Played FromRecord(const std::string& bytes) {
  FlightRecord record({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()},
                      "gait.rec");
  Played run;
  const auto entry = std::make_unique<TickEntry>();
  std::array<std::uint8_t, std::max(RecordedTick::kMaxBytes, kPlaybackMaxBytes)> packed{};
  const auto append = [&packed](std::string& to, std::size_t count) {
    to.append(reinterpret_cast<const char*>(packed.data()), count);
  };
  std::int64_t last = -1;
  while (record.Next(*entry)) {
    RecordedTick tick;
    tick.elapsed = static_cast<std::int8_t>(entry->tick - last);
    last = entry->tick;
    tick.receive_status = entry->receive_status;
    tick.send_status = entry->send_status;
    tick.frame_count = static_cast<std::uint8_t>(entry->received_count);
    std::copy_n(entry->received.begin(), entry->received_count, tick.frames.begin());
    append(run.recording, Pack(tick, packed));
    TickOutput output;
    output.frames = entry->frames;
    output.record = entry->record;
    append(run.output, Pack(output, packed));
    run.tick_ends.push_back(run.output.size());
    run.faults |= output.record.faults;
    for (std::size_t j = 0; j < output.record.joint_count; ++j) {
      if (output.record.joints[j].correction_rad == 0) continue;
      ++run.corrected;
      break;
    }
  }
  return run;
}

TEST_P(CortexM, RepeatsAFlightRecordOfTheRobotInSimulation) {
  const auto& [machine, drives] = GetParam();
  if (LoadDrives(testing::SourcePath(drives.file)).rate_hz != 1000)
    GTEST_SKIP() << "a tick of the firmware is 1 ms";
  const testing::TemporaryFolder folder;
  Program program({testing::ProgramPath("tumbler run"), "sim",
                   testing::SourcePath("primitives/cartwheel.toml"), "--drives",
                   testing::SourcePath(drives.file), "--cycles", std::to_string(kCycles),
                   "--branch", kBranch, "--record", folder / "gait.rec"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  const Played run = FromRecord(ReadFile(folder / "gait.rec"));
  ASSERT_GT(run.tick_ends.size(), 20'000U);
  ASSERT_EQ(run.faults, 0);
  const Emulation emulation = Emulate(machine, drives, run);
  ASSERT_EQ(emulation.status, 0) << emulation.text;
  EXPECT_EQ(FirstDifference(run, emulation.output), "");
}

class CortexMFirmware : public ::testing::TestWithParam<Machine> {};

TEST_P(CortexMFirmware, RepeatsAFlightRecordWithFeedbackAndASensor) {
  const testing::TemporaryFolder folder;
  const std::string robots = testing::SourcePath("primitives/robots/");
  // A push, so that the feedback has something to do.
  WriteFile(
      folder / "twin.toml",
      ReadFile(robots + "tumbler_twin_sensor.toml") +
          "\n[[push]]\nlink = \"middle\"\nstart_s = 6.0\nduration_s = 0.1\nforce_n = [4.0, 0.0]\n");
  Program program({testing::ProgramPath("tumbler run"), "sim",
                   testing::SourcePath("primitives/gait_sensor.toml"), "--drives",
                   robots + "tumbler_drives_sensor.toml", "--twin", folder / "twin.toml",
                   "--cycles", "1", "--branch", kBranch, "--record", folder / "gait.rec"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  const Played run = FromRecord(ReadFile(folder / "gait.rec"));
  ASSERT_GT(run.tick_ends.size(), 10'000U);
  ASSERT_GT(run.corrected, 200);
  ASSERT_EQ(run.faults, 0);
  WriteFile(folder / "recording", run.recording);
  const Emulation emulation =
      Emulate(GetParam(), {"mit", "1", kBranch, folder / "recording", folder / "output", "sensor"},
              folder / "output", "tumbler-playback-sensor");
  ASSERT_EQ(emulation.status, 0) << emulation.text;
  EXPECT_EQ(FirstDifference(run, emulation.output), "");
  const Figures figures = ReadFigures(emulation.text);
  EXPECT_LE(figures.tick_stack, kTickStackMax);
  fmt::print(
      "Cortex-{}, feedback and sensor: {} ticks the same, {} of them corrected; "
      "instructions a tick:\n",
      GetParam().name, run.tick_ends.size(), run.corrected);
  for (const auto& [state, counts] : figures.states) {
    fmt::print("  {:<16} {:6} ticks, mean {:5.0f}, most {:5.0f}\n", state, counts.ticks,
               counts.mean, counts.most);
    EXPECT_LE(counts.most, kFeedbackInstructionsMax) << state;
  }
}

TEST_P(CortexMFirmware, AbortsAMotionAsThisMachineDoesWhateverTheWayAndTheLegsRoles) {
  struct Abort {
    const char* node;
    int ticks;  // since the node began
    Reaction reaction;
    int cycles = 2;
  };
  // After one cycle the legs' roles are exchanged.
  for (const Abort& abort :
       {Abort{"handstand", 50, Reaction::kHold}, Abort{"handstand", 400, Reaction::kRollOut},
        Abort{"handstand, swapped", 400, Reaction::kRollOut}, Abort{"roll", 60, Reaction::kFold},
        Abort{"roll, swapped", 60, Reaction::kFold, 1}}) {
    SCOPED_TRACE(fmt::format("{} after {} ticks", abort.node, abort.ticks));
    int ticks = 0;
    const ExampleDrives drives = ExampleOfEveryProtocol()[0];
    const Played run = PlayHere(
        drives,
        [&](RecordedTick& tick, const TickRecord& last) {
          const bool here = last.state == ExecutorState::kRunning &&
                            Gait().graph.node(last.node).name.view() == abort.node;
          if (here && ++ticks == abort.ticks) tick.elapsed = 5;
        },
        abort.cycles);
    ASSERT_EQ(run.faults, 1U << static_cast<unsigned>(Fault::kLateTick));
    ASSERT_TRUE(run.reactions.contains(abort.reaction));
    const Emulation emulation = Emulate(GetParam(), drives, run);
    ASSERT_EQ(emulation.status, 0) << emulation.text;
    EXPECT_EQ(FirstDifference(run, emulation.output), "");
    const Figures figures = ReadFigures(emulation.text);
    EXPECT_LE(figures.tick_stack, kTickStackMax);
    for (const auto& [state, counts] : figures.states)
      EXPECT_LE(counts.most, kInstructionsMax) << state;
  }
}

TEST_P(CortexMFirmware, HasNoHeapNoExceptionsNoRunTimeTypesAndNoMathLibrary) {
  Program nm({"/usr/bin/env", "arm-none-eabi-nm", Firmware(GetParam())});
  ASSERT_EQ(nm.Wait(), 0) << nm.text();
  std::set<std::string> symbols;
  std::istringstream lines(nm.text());
  for (std::string line; std::getline(lines, line);)
    symbols.insert(line.substr(line.find_last_of(' ') + 1));
  ASSERT_TRUE(symbols.contains("memcpy"));  // This shows that it is a list of symbols.
  for (const std::string& symbol : symbols) {
    EXPECT_THAT(MatchesOf("malloc|calloc|realloc|free|sbrk|^_Zn[wa]|^__cxa|^_Unwind|personality|"
                          "^_ZTI|^_ZTS|printf|sqrt|^sin|^cos|^pow|^exp|^log|_impure",
                          symbol),
                ::testing::IsEmpty());
  }
}

/// The bytes of a primitive in flash, by the linker's list of symbols.
int PrimitiveBytesOf(const Machine& machine) {
  Program nm({"/usr/bin/env", "arm-none-eabi-nm", "-S", Firmware(machine)});
  EXPECT_EQ(nm.Wait(), 0) << nm.text();
  const auto found = MatchesOf("[0-9a-f]+ ([0-9a-f]+) [a-zA-Z] [^\n]*kPrimitivesE", nm.text());
  EXPECT_EQ(found.size(), 1U);
  return found.empty() ? 0 : std::stoi(found[0][1], nullptr, 16) / Gait().primitive_count;
}

TEST_P(CortexMFirmware, FitsASmallBoard) {
  Program size({"/usr/bin/env", "arm-none-eabi-size", Firmware(GetParam())});
  ASSERT_EQ(size.Wait(), 0) << size.text();
  std::istringstream numbers(size.text().substr(size.text().find('\n')));
  int text = 0;
  int data = 0;
  int bss = 0;
  numbers >> text >> data >> bss;
  // The gait has primitives for a robot that lies, too. A small board plays a gait without them.
  const int primitives = Gait().primitive_count;
  const int spared = (primitives - 3) * PrimitiveBytesOf(GetParam());
  fmt::print("Cortex-{}: text {} with {} primitives, {} with three, data {}, bss {} bytes\n",
             GetParam().name, text, primitives, text - spared, data, bss);
  EXPECT_GT(text - spared, 50'000);  // Three primitives alone have more.
  EXPECT_LT(text - spared + data, 128 * 1024);
  EXPECT_LT(data + bss, 16 * 1024);
}

TEST_P(CortexMFirmware, NeedsABoundedStackOnEveryPathThroughATick) {
  const std::filesystem::path build =
      std::filesystem::path(Firmware(GetParam())).parent_path().parent_path();
  CallGraph graph(build);
  EXPECT_EQ(graph.methods(), 5 * DriveProtocols::kCount + 1);
  const int depth = graph.DepthOf("_ZN7tumbler8Executor4TickERKNS_9TickInputERNS_10TickOutputE");
  fmt::print("Cortex-{}: a tick needs at most {} bytes of stack\n", GetParam().name, depth);
  EXPECT_GT(depth, 200);
  EXPECT_LE(depth, kTickStackMax);
}

TEST_P(CortexMFirmware, SaysWhatIsWrongAndFails) {
  const testing::TemporaryFolder folder;
  WriteFile(folder / "recording", "");
  WriteFile(folder / "cut", std::string("\1\0\0\2abc", 7));
  WriteFile(folder / "full", std::string("\1\0\0\377", 4));
  const auto run = [&](const std::vector<std::string>& arguments, const char* problem) {
    const Emulation emulation = Emulate(GetParam(), arguments, folder / "output");
    EXPECT_EQ(emulation.status, 1);
    EXPECT_THAT(emulation.text, ::testing::HasSubstr(problem));
  };
  const std::string out = folder / "output";
  run({"mit", "2", "roll", folder / "recording"}, "too few arguments");
  run({"can", "2", "roll", folder / "recording", out}, "drives have to be");
  run({"mit", "two", "roll", folder / "recording", out}, "cycles have to be");
  run({"mit", "2", "rock", folder / "recording", out}, "no such branch");
  run({"mit", "2", "roll", folder / "none", out}, "the recording cannot be read");
  run({"mit", "2", "roll", folder / "recording", folder / "no/output"}, "cannot be written");
  run({"mit", "2", "roll", folder / "cut", out}, "the recording is cut off");
  run({"mit", "2", "roll", folder / "full", out}, "too many frames");
  run({"mit", "2", "roll", folder / "recording", out, "senses"}, "may be sensor");
}

TEST(CortexMComparison, NamesTheFirstDifference) {
  const Played run = PlayHere(ExampleOfEveryProtocol()[0]);
  EXPECT_EQ(FirstDifference(run, run.output), "");
  const std::size_t tick = 5000;
  std::string other = run.output;
  // The second joint follows the head, and the first joint with its frame.
  const std::size_t joint = kPlaybackHeadBytes + kPlaybackJointBytes + RecordedTick::kFrameBytes;
  other[run.tick_ends[tick - 1] + joint + 17] ^= 1;
  other.back() = static_cast<char>(other.back() ^ 1);
  EXPECT_THAT(FirstDifference(run, other),
              ::testing::HasSubstr("first difference in tick 5000, joint 1: limited position"));
  EXPECT_THAT(FirstDifference(run, run.output.substr(0, run.tick_ends[7] + 3)),
              ::testing::HasSubstr("in tick 8, length"));
}

INSTANTIATE_TEST_SUITE_P(Qemu, CortexM,
                         ::testing::Combine(::testing::ValuesIn(kMachines),
                                            ::testing::ValuesIn(ExampleOfEveryProtocol())),
                         [](const auto& instance) {
                           return fmt::format("{}_{}", std::get<0>(instance.param).name,
                                              std::get<1>(instance.param).protocol);
                         });
INSTANTIATE_TEST_SUITE_P(Qemu, CortexMFirmware, ::testing::ValuesIn(kMachines),
                         [](const auto& instance) { return std::string(instance.param.name); });

}  // namespace
}  // namespace tumbler
