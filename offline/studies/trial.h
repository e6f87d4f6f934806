#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/variation.h"
#include "offline/studies/drop.h"
#include "offline/studies/varied_run.h"
#include "offline/twin/purpose_judge.h"
#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/run/control_loop.h"

namespace tumbler {

/// A study of how many robots survive a motion. Every trial depends on the study and its own number
/// alone.
struct RobustnessStudy {
  std::string motion;  ///< Primitive or sequence file.
  std::string drives;  ///< Drives file; empty: that which the twin file names, if any.
  std::string twin;    ///< Twin file for what all robots share; empty: none.
  RunSettings run;     ///< Cycles, branch.
  std::uint64_t seed = 1;
  double scale = 1;  ///< Of all spreads.
  Spreads spreads;
  bool lanes = false;  ///< Whether robots are played in lanes (`LaneTrials`), not in the twin.
  /// The force that pushes each robot for 0.1 s, to either side, at a random time in the hold after
  /// the last motion [N]; 0: none does. Robots then have to be back at last, too.
  double push_n = 0;
  /// Whether the sensor of each robot fails from a random time on, in one of its ways.
  bool sensor_faults = false;
  /// Whether each robot is first dropped without torque, in a random pose, and has to get up from
  /// where it lies.
  bool drops = false;

  /// Whether anything happens to robots besides what the drives and twin files say.
  [[nodiscard]] bool disturbs() const { return push_n != 0 || sensor_faults; }
};

/// The drives file of a study's robots; empty: they have DefaultDrives with GainsOf the motion.
std::string DrivesFileOf(const RobustnessStudy& study);

/// What became of one robot.
struct TrialOutcome {
  enum class Verdict {
    kStands,   ///< Everything as asked and planned, in every motion.
    kAmiss,    ///< It completed the motions, but was not as asked after one of them.
    kFell,     ///< It came to rest in another pose.
    kOverlap,  ///< Its own shapes overlapped.
    kFault,    ///< The run ended in a fault, or was refused.
    kGotUp,    ///< It fell, got up, and completed the run; after the last motion it was as asked.
    /// It completed the motions, but whether it was as asked after one of them was not judged, and
    /// it was not amiss after another: it counts neither as as asked nor as amiss.
    kNotJudged,
  };
  Verdict verdict = Verdict::kStands;
  int motions = 0;     ///< Motions that ended.
  std::string in;      ///< The node in or after which it was first not as asked; empty if none.
  std::string reason;  ///< In words; empty where it stands.
  /// When its pitch left the model's for good, since the motion of `in` began [s]; below 0: it did
  /// not.
  double left_s = -1;
  /// Whether it rested at last in a pose in which a motion ends. One that is amiss and rests may
  /// have rocked too long.
  bool rests = false;
  // Of a robot that was dropped:
  int drops = 0;        ///< How often it was, until it did not lie in itself.
  double lies_rad = 0;  ///< Its pitch, less whole turns, with its joints where the motion begins.
  std::string begun;    ///< The node with which its run began; empty: it did not begin.
  RobotVariation variation;

  [[nodiscard]] bool stands() const { return verdict == Verdict::kStands; }
  [[nodiscard]] bool judged() const { return verdict != Verdict::kNotJudged; }
  /// Of one that was judged.
  [[nodiscard]] bool fails() const { return judged() && !stands(); }
};

/// What a robot that is the model is told in one tick, and how it was then.
struct ScriptTick {
  ExecutorState state = ExecutorState::kDisarmed;
  std::int8_t node = 0;
  float primitive_time_s = 0;
  bool held = true;                      ///< Whether the twin still held the robot.
  double pitch_rad = 0;                  ///< Of the root.
  std::vector<JointSetpoint> setpoints;  ///< As encoded on the wire, for each joint.
};

/// A run of the model, until the torque is off. Setpoints depend on the robot only before the
/// motion begins, so that other robots are told the same.
struct Script {
  double tick_s = 1e-3;
  std::vector<ScriptTick> ticks;
  std::vector<double> delay_s;  ///< From a tick to its setpoint's arrival, for each joint.
  std::string broken_off;       ///< By which fault it ended; empty: by none.
};

/// Notes where a robot leaves the model's way for good: where its pitch is last less than a
/// hand's breadth beside the model's.
class DepartureWatch {
 public:
  /// To be called in order, in every tick of the script, or in some of them, those included in
  /// which a motion begins.
  /// @param ticks  how many there are up to the next call.
  void Observe(const ScriptTick& model, double pitch_rad, std::int64_t ticks = 1);
  /// The node in or after whose motion it left, and when, since that motion began; none: -1.
  [[nodiscard]] int node() const { return left_ ? node_ : -1; }
  [[nodiscard]] std::int64_t ticks() const { return left_ ? ticks_ : -1; }

 private:
  bool running_ = false, left_ = false;
  std::int64_t since_ = -1;  // ticks since a motion began; -1: none has
  int node_ = -1;
  std::int64_t ticks_ = -1;
};

/// What the judges saw of a run.
/// @param since_ns  of earlier events of the posture nothing is said.
TrialOutcome OutcomeOf(const PurposeJudge& judge, const PostureWatch& posture,
                       const DepartureWatch& departure, const SequenceFile& file, double tick_s,
                       std::int64_t since_ns = 0);

/// Plays a study's robots, each through the runtime, simulated drives and twin. The files are read
/// once, for all copies. Not thread-safe: each thread takes a copy.
class Trials {
 public:
  /// Plays the model, too. @throws FileError, Refused, std::runtime_error as `tumbler run sim`
  /// does, and Refused when the model itself does not get through without a fault, when the hold is
  /// too short for a push, or when a sensor is to fail and there is none.
  explicit Trials(const RobustnessStudy& study);

  /// Plays robot number `index`.
  TrialOutcome Play(std::uint64_t index);
  /// Plays a robot that is given. Nothing happens to it but what happens to all.
  TrialOutcome Play(const RobotVariation& variation);

  /// Name of the motion.
  [[nodiscard]] std::string name() const;
  /// Robot number `index`.
  [[nodiscard]] RobotVariation Draw(std::uint64_t index) const;
  /// The robot that is the model.
  [[nodiscard]] RobotVariation Model() const;
  [[nodiscard]] const RobustnessStudy& study() const { return study_; }
  [[nodiscard]] const SimulatedMotion& motion() const { return motion_; }
  [[nodiscard]] const DrivesConfig& drives() const { return shared_.drives; }
  /// What all robots share.
  [[nodiscard]] const SimulatedRobotConfig& robot() const { return shared_.config; }
  /// The robot that is the model, and its ground.
  [[nodiscard]] const Scene& scene() const { return shared_.scene; }
  [[nodiscard]] const Script& script() const { return script_; }

 private:
  /// Called after every tick.
  using Observer = std::function<void(const ControlLoop& loop, SimulatedRobot& robot)>;
  /// @param dropped  the drop; none: the robot begins as the motion does.
  /// @returns nothing where it lies in itself after the drop, which no robot does.
  std::optional<TrialOutcome> PlayVaried(const RobotVariation& variation,
                                         SimulatedRobotConfig config, const Observer& observe,
                                         std::optional<DropNumber> dropped = {});
  /// What all robots share, with what happens to this one.
  [[nodiscard]] SimulatedRobotConfig ConfigOf(std::uint64_t index) const;
  /// Between which times in the simulation a push begins.
  [[nodiscard]] std::pair<double, double> PushTimes() const;
  void PlayModel();

  RobustnessStudy study_;
  SimulatedMotion motion_;
  SharedRobot shared_;
  Script script_;
};

/// "stands", "amiss", "fell", "overlap", "fault", "got up" or "not judged"
[[nodiscard]] const char* ToString(TrialOutcome::Verdict verdict);

}  // namespace tumbler
