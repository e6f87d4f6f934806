// Feeds arbitrary bytes to the loaders of the runtime's files: primitives, sequences, drives, data
// sheets of drives, faults, bus faults and, where there is a simulation, twin files. Each loader
// gets every input, and all but one refuse it by its first line. Either a loader refuses the input
// with a FileError that says why, or the result has all the properties that the code behind the
// loader relies on.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/can/bus_faults_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/faults_toml.h"
#ifdef TUMBLER_HAS_SIMULATION
#include "offline/twin/twin_toml.h"
#endif
#include "tests/support/files.h"

namespace tumbler {
namespace {

void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "a loader lets through what it must not: %s\n", what);
  std::abort();
}
#define TUMBLER_REQUIRE(condition) Require(condition, #condition)

/// Runs `read`. A refusal must be one that a person can use.
template <class Read>
void ReadOrRefuse(const Read& read) {
  try {
    read();
  } catch (const FileError& error) {
    const std::string_view message = error.what();
    TUMBLER_REQUIRE(message.starts_with("file.toml") || message.starts_with("primitives/"));
    TUMBLER_REQUIRE(message.size() > std::string_view("file.toml: ").size());
  }
}

const std::string kFolder = testing::SourcePath("primitives/");

#ifdef TUMBLER_HAS_SIMULATION
/// The motion with the robot that a twin file is about.
const SimulatedMotion& Gait() {
  static const SimulatedMotion gait(LoadMotion(kFolder + "nominal/gait.toml"));
  return gait;
}
#endif

/// The shipped CiA 402 drives; the data sheet of each is the input.
const std::string& DrivesWithDataSheet() {
  static const std::string drives = testing::ReplacedAll(
      ReadTextFile(kFolder + "robots/tumbler_drives_cia402.toml"), "protocol = \"canopen-csp\"",
      "protocol = \"canopen-csp\"\neds = \"file.toml\"");
  return drives;
}

void CheckPrimitive(const PrimitiveFile& file) {
  const Primitive<double>& primitive = file.primitive;
  TUMBLER_REQUIRE(primitive.joint_count >= 1 && primitive.joint_count <= kMaxJoints);
  for (const JointMotion<double>& joint : primitive.motions()) {
    const JointLimits<double>& limits = joint.limits;
    TUMBLER_REQUIRE(std::isfinite(limits.position_min_rad + limits.position_max_rad));
    TUMBLER_REQUIRE(limits.velocity_max_rad_s > 0 && limits.acceleration_max_rad_s2 > 0);
    for (const double point : joint.position.control_points()) {
      TUMBLER_REQUIRE(limits.position_min_rad <= point && point <= limits.position_max_rad);
    }
  }
}

void CheckDrives(const DrivesConfig& config) {
  TUMBLER_REQUIRE(!config.drives.empty() && config.drives.size() <= kMaxJoints);
  TUMBLER_REQUIRE(config.WorstCaseLoad() <= 1);
  DriveBank bank;
  for (const DriveEntry& entry : config.drives)
    TUMBLER_REQUIRE(bank.Add(entry.config) == Status::kOk);
}

void CheckFaults(const ExecutorConfig& config) {
  TUMBLER_REQUIRE(config.stale_ticks_max >= 1 && config.late_ticks_max >= 0);
  TUMBLER_REQUIRE(!config.reactions.Has(Reaction::kCollapse) || config.collapse.configured);
  for (std::size_t f = 0; f < kFaultCount; ++f) {
    TUMBLER_REQUIRE(config.reactions(static_cast<Fault>(f), ExecutorState::kDisarmed) ==
                    Reaction::kIgnore);
  }
  TUMBLER_REQUIRE(config.reactions(Fault::kOperatorStop, ExecutorState::kRunning) !=
                  Reaction::kIgnore);
}

void ReadAll(const std::string& text) {
  ReadOrRefuse([&] { CheckPrimitive(ParsePrimitive(text, "file.toml")); });
  ReadOrRefuse([&] {
    const FileReader read = [&](const std::string& path) -> std::string {
      if (path == "file.toml") return text;
      for (const char* name : {"handstand.toml", "downstand.toml", "roll.toml"}) {
        if (path.ends_with(name)) return ReadTextFile(kFolder + "nominal/" + name);
      }
      throw FileError("file.toml", 0, path, "cannot be read");
    };
    const SequenceFile file = LoadMotion("file.toml", read);
    TUMBLER_REQUIRE(file.graph.node_count >= 1);
    for (const JoinComparison& join : CompareJoins(file)) TUMBLER_REQUIRE(join.fits());
  });
  const FileReader none = [](const std::string& path) -> std::string {
    throw FileError(path, 1, "", "is not there");
  };
  ReadOrRefuse([&] { CheckDrives(ParseDrives(text, "file.toml", DrivesUse::kRun, none)); });
  ReadOrRefuse([&] {
    const FileReader sheet = [&](const std::string& path) -> std::string {
      TUMBLER_REQUIRE(path == "file.toml");
      return text;
    };
    CheckDrives(ParseDrives(DrivesWithDataSheet(), "file.toml", DrivesUse::kRun, sheet));
  });
  ReadOrRefuse([&] {
    const std::vector<FaultsJoint> joints{{"leg1", -2, 2}, {"leg2", -2, 2}};
    ExecutorConfig config;
    ParseFaults(text, "file.toml", joints, config);
    CheckFaults(config);
  });
  ReadOrRefuse([&] {
    const std::vector<std::string> nodes{"leg1", "leg2", "host"};
    ParseBusFaults(text, "file.toml", nodes);
  });
#ifdef TUMBLER_HAS_SIMULATION
  ReadOrRefuse([&] { ParseTwin(text, "file.toml", Gait()); });
#endif
}

}  // namespace
}  // namespace tumbler

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tumbler::ReadAll(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
