// Plays a motion on the twin, as `tumbler run sim` and studies do, and prints how many ticks it
// took and a hash of all that a flight record and the truth beside it hold of them. Like
// found_motion.cc it is compiled for machines for which a parser of URDFs is not at hand, too.

#include <bit>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <span>
#include <string>

#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/simulated_motion.h"
#include "offline/studies/varied_run.h"
#include "runtime/assembly/run_parts.h"

namespace tumbler {
namespace {

/// FNV-1a of the bits of numbers.
class Hash {
 public:
  void Take(std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) {
      value_ = (value_ ^ ((bits >> (8 * byte)) & 0xffU)) * 0x100000001b3U;
    }
  }
  void Take(double number) { Take(std::bit_cast<std::uint64_t>(number)); }
  void Take(std::span<const double> numbers) {
    for (const double number : numbers) Take(number);
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

void TakeTick(const TickRecord& record, Hash& hash) {
  hash.Take(static_cast<std::uint64_t>(record.state));
  hash.Take(double{record.primitive_time_s});
  for (const JointRecord& joint : std::span(record.joints).first(record.joint_count)) {
    for (const JointSetpoint& setpoint : {joint.planned, joint.limited, joint.encoded}) {
      hash.Take(double{setpoint.position_rad});
      hash.Take(double{setpoint.velocity_rad_s});
      hash.Take(double{setpoint.torque_nm});
    }
    hash.Take(double{joint.measured.position_rad});
    hash.Take(double{joint.measured.velocity_rad_s});
    hash.Take(double{joint.measured.torque_nm});
  }
}

void TakeTruth(const TwinState& truth, Hash& hash) {
  for (const double number : {truth.root_x_m, truth.root_z_m, truth.root_pitch_rad,
                              truth.root_vx_m_s, truth.root_vz_m_s, truth.root_pitch_rate_rad_s})
    hash.Take(number);
  hash.Take(truth.joint_positions_rad);
  hash.Take(truth.joint_velocities_rad_s);
  hash.Take(truth.joint_torques_nm);
}

int PlayAndPrint(const std::string& file) {
  const SimulatedMotion motion(LoadMotion(file));
  const DrivesConfig drives =
      LoadDrivesOf(JointsOf(motion.file()), "", ReadTextFile, GainsOf(motion.file()));
  const SharedRobot shared = ShareRobot(motion, drives, SimulatedRobotConfig{});
  RunSettings settings;
  settings.end = RunEnd::kTorqueOff;
  const RobotVariation model = DrawRobot(shared.scene, Spreads{}, 0, 1, 0);
  VariedRun run({motion, nullptr, settings}, shared, model);
  Hash hash;
  int ticks = 0;
  for (; run.Step(); ++ticks) {
    TakeTick(run.record(), hash);
    TakeTruth(run.robot().state(), hash);
  }
  std::printf("%d ticks, %016llx, pitch %a\n", ticks, static_cast<unsigned long long>(hash.value()),
              run.robot().state().root_pitch_rad);
  return ticks > 0 ? 0 : 1;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: played_run MOTION\n";
    return 1;
  }
  return tumbler::PlayAndPrint(argv[1]);
}
