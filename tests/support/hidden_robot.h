#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "common/core/functions.h"
#include "common/files/toml_reader.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/normal.h"
#include "offline/scene/variation.h"
#include "offline/studies/varied_run.h"
#include "offline/twin/purpose_judge.h"
#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/record_configuration.h"

namespace tumbler::testing {

/// A robot that is not the model, in all that is to be found of one.
struct HiddenRobot {
  RobotVariation variation;
  double torque_factor = 1, velocity_filter_s = 0, torque_lag_s = 0;  ///< Of all drives.
  /// Whether it is set down where its encoders read the start of a motion, as whoever does it by
  /// its drives' zeros. Otherwise its joints are there in truth, and move when drives are armed.
  bool by_encoders = false;
};

/// Masses differ by 10 %, the ground by 40 %, motors by the size of their friction, encoders and
/// the slope by 5 mrad, centres of mass by 4 mm, setpoints are late by some 0.2 ms.
inline HiddenRobot DrawHiddenRobot(const Scene& scene, std::uint64_t seed, std::uint64_t index,
                                   double scale = 1) {
  Spreads spreads;
  spreads.mass = 0.1;
  spreads.friction = spreads.stiffness = spreads.damping = 0.4;
  spreads.mass_centre_m = 4e-3;
  spreads.slope_rad = spreads.zero_rad = 5e-3;
  spreads.delay_s = 0.2e-3;
  HiddenRobot hidden{DrawRobot(scene, spreads, scale, seed, index)};
  Normal normal(seed + 1, index);
  for (RobotVariation::Joint& joint : hidden.variation.joints) {
    joint.viscous_friction_nm_s_per_rad =
        kUsualViscousFriction_nm_s_per_rad * (portable::Exp(0.5 * scale * normal.Draw()) - 1);
    joint.dry_friction_nm = 0.04 * scale * std::abs(normal.Draw());
  }
  return hidden;
}

/// By how much a hidden robot differs besides, as standard deviations of factors: inertias, rotors,
/// the speed of full friction, and lengths, which no fit estimates.
struct HiddenBesides {
  double inertia = 0, rotor = 0, creep_speed = 0, length = 0;
};

inline void AddBesides(const HiddenBesides& by, std::uint64_t seed, std::uint64_t index,
                       HiddenRobot& hidden) {
  Normal normal(seed + 2, index);
  const auto factor = [&normal](double deviation) {
    return portable::Exp(deviation * normal.Draw());
  };
  for (RobotVariation::Link& link : hidden.variation.links) {
    link.inertia *= factor(by.inertia);
    link.length *= factor(by.length);
  }
  const double rotor = factor(by.rotor);
  for (RobotVariation::Joint& joint : hidden.variation.joints) joint.rotor_inertia *= rotor;
  hidden.variation.creep_speed *= factor(by.creep_speed);
}

/// A motion, ready to be played by robots that differ.
class HiddenRuns {
 public:
  HiddenRuns(const std::string& motion, const std::string& drives)
      : motion_file_(motion),
        drives_file_(drives),
        motion_(LoadMotion(motion)),
        shared_(ShareRobot(
            motion_,
            LoadDrivesOf(JointsOf(motion_.file()), drives, ReadTextFile, GainsOf(motion_.file())),
            {})) {}

  [[nodiscard]] const Scene& scene() const { return shared_.scene; }
  [[nodiscard]] const SimulatedMotion& motion() const { return motion_; }
  [[nodiscard]] const SharedRobot& shared() const { return shared_; }

  /// The same motion for robots that differ from this scene, whatever the motion was made for.
  HiddenRuns& OfModel(const Scene& scene) {
    shared_.scene = scene;
    return *this;
  }

  /// Another engine than the twin's for the robots.
  HiddenRuns& Behind(TwinEngine engine) {
    shared_.config.twin.engine = std::move(engine);
    return *this;
  }

  /// Plays the motion by the executor over a simulated bus, and records it.
  /// @returns whether it is as asked.
  bool Record(const HiddenRobot& robot, const std::string& record) const {
    RecordConfiguration configuration;
    configuration.program = "hidden robot";
    configuration.bus = "sim";
    configuration.virtual_time = true;
    configuration.period_ns = static_cast<std::int64_t>(1e9 / shared_.drives.rate_hz);
    configuration.joints = JointsOf(motion_.file());
    configuration.motion_file = motion_file_;
    configuration.drives_file = drives_file_;
    configuration.files = {{motion_file_, ReadTextFile(motion_file_)}};
    if (!drives_file_.empty())
      configuration.files.push_back({drives_file_, ReadTextFile(drives_file_)});
    const RunSettings settings;
    configuration.executor = ExecutorConfigOf(settings, shared_.drives);
    configuration.procedure =
        ProcedureConfigOf(settings, shared_.drives, ToRuntime(motion_.file()).graph);
    FlightRecorderConfig config;
    config.file = record;
    config.configuration = EncodeConfiguration(configuration);
    FlightRecorder recorder(config);
    TickFeed feed({&recorder});
    const bool stands = Play(robot, &feed);
    recorder.Stop("completed");
    return stands;
  }

  /// The same without a record.
  bool Play(const HiddenRobot& robot, TickFeed* feed = nullptr) const {
    SharedRobot shared = shared_;
    for (JointMotor& motor : shared.config.motors) {
      motor.torque_factor = robot.torque_factor;
      motor.velocity_filter_s = robot.velocity_filter_s;
      motor.torque_time_constant_s = robot.torque_lag_s;
    }
    if (robot.by_encoders) {
      shared.config.start = StartOf(motion_.file());
      for (std::size_t j = 0; j < robot.variation.joints.size(); ++j)
        shared.config.start->joint_positions_rad[j] -= robot.variation.joints[j].zero_rad;
    }
    VariedRun run({motion_, nullptr, RunSettings{}, feed}, shared, robot.variation);
    PurposeJudge judge(motion_.file(), shared.scene.robot);
    while (run.Step()) {
      judge.Observe(run.record(), run.loop().time_ns(), run.robot().state());
      if (feed != nullptr) feed->Drain();
      if (feed == nullptr && run.robot().posture().falls() > 0) return false;
    }
    bool stands = run.robot().posture().falls() == 0 && !judge.passages().empty();
    for (const Passage& passage : judge.passages()) stands = stands && !passage.amiss();
    return stands;
  }

 private:
  std::string motion_file_, drives_file_;
  SimulatedMotion motion_;
  SharedRobot shared_;
};

}  // namespace tumbler::testing
