#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "offline/pages/report.h"
#include "offline/pages/space_page.h"
#include "runtime/executor/tick_entry.h"

namespace tumbler {

/// Something that happened at an instant of a run.
struct RunEvent {
  enum class Kind {
    kState,    ///< The executor entered a state, or began a node.
    kRequest,  ///< The operator, or the program that stands for one, asked for something.
    kRefusal,  ///< A request was refused.
    kFault,    ///< A fault was latched.
    kTiming,   ///< Control periods were missed, or ticks not recorded.
    kTruth,    ///< The simulated robot rests, falls or is pushed.
  };
  double time_s = 0;
  Kind kind = Kind::kState;
  std::string text;
};
const char* ToString(RunEvent::Kind kind);

/// A node of the sequence, from its start to the end of its settling.
struct RunBand {
  double from_s = 0;
  double to_s = 0;
  int node = 0;
  std::string name;
};

/// One tick of a run, without its joints.
struct RunTick {
  double time_s = 0;  ///< Time of its deadline.
  std::int64_t tick = 0;
  ExecutorState state = ExecutorState::kDisarmed;
  Reaction reaction = Reaction::kIgnore;
  int node = 0;
  double primitive_time_s = 0;
};

/// @param zero_ns  time 0 of pages on the clock of the loop.
RunTick TickOf(const TickEntry& entry, std::int64_t zero_ns);

/// All durations of one kind in a run.
struct RunLatency {
  std::string name;
  std::string meaning;
  std::vector<std::int64_t> values_ns;  ///< In increasing order.

  /// The smallest value that a share of all values does not exceed [ns]; 0 without values.
  [[nodiscard]] std::int64_t PercentileNs(double share) const;
};

/// A run of a robot in space, as pages show it.
struct SpaceRun {
  std::vector<SpaceBody> bodies;
  std::vector<Obstacle<Spatial>> obstacles;
  std::vector<int> joint_hues;  ///< Of each joint's limb.
  /// True, or of the measured joints and a root that stays where the motion begins.
  std::vector<SpaceFrame> frames;
  bool true_root = false;
};

/// The data of a run for the page, with every tick; or of a primitive, which has only a plan.
///
/// Time 0 is where the first motion begins (state running), so that runs can be laid over each
/// other. In a run without a motion it is the first tick.
struct RunData {
  std::string name;       ///< Name of the file.
  bool recorded = false;  ///< Whether this is a run, not a primitive.
  bool damaged = false;   ///< Whether parts of its record could not be read, which facts name.
  std::vector<std::pair<std::string, std::string>> facts;  ///< For people: name, value with unit.
  ReportData scene;  ///< The robot and its ground, without samples.
  std::string robot_hash;
  double period_s = 0;

  std::vector<RunTick> ticks;            ///< Empty for a primitive.
  std::vector<JointRecord> joint_ticks;  ///< Joint j of tick i at i * joint count + j.
  std::vector<RunEvent> events;          ///< In the order of time.
  std::vector<RunBand> bands;
  std::vector<RunLatency> latencies;

  /// The planned motion of the robot. In each node it is the nominal simulation of the primitive,
  /// which begins at the x where the node before ended; between nodes the robot rests. For a
  /// primitive, joint values are those of the splines, and torques the feed-forward.
  std::vector<ReportSample> plan;
  /// The true motion of the simulated robot; empty where it is not known.
  std::vector<ReportSample> truth;
  std::vector<std::string> passive_names;  ///< Of the joints without a motor, in samples' order.
  /// Of a robot in space. Then the scene has the names of joints alone, and there is neither plan
  /// nor truth.
  std::optional<SpaceRun> space;

  [[nodiscard]] std::size_t joint_count() const { return scene.joint_names.size(); }
  [[nodiscard]] const JointRecord& joint(std::size_t tick, std::size_t joint) const {
    return joint_ticks[tick * joint_count() + joint];
  }
  /// The measured position less the limited setpoint that it answers [rad]. None while the position
  /// is not controlled, or before the first reply.
  [[nodiscard]] std::optional<double> FollowingError(std::size_t tick, std::size_t joint) const;
};

/// Reads a flight record.
/// @param truth_log  LCM log with TUMBLER_TRUTH of that run, which replaces the truth in the
/// record;
///                   empty: the record's.
/// @throws RecordError, FileError or std::runtime_error  naming the file.
RunData ReadRun(const std::string& path, const std::string& truth_log);

/// Reads a primitive, and computes its plan when it is played alone. @throws FileError.
RunData ReadPlan(const std::string& path);

/// The differences of one quantity of a joint between two runs, at the same ticks since their
/// motions began.
struct RunDifference {
  std::string joint;
  std::string quantity;  ///< e.g. `measured position`
  std::string unit;
  std::int64_t ticks = 0;  ///< Ticks that both runs have.
  double max = 0;          ///< Largest |b - a|.
  double max_at_s = 0;     ///< Time of the largest difference.
  double rms = 0;          ///< Root of the mean square of b - a.
};
/// The differences of all joints; empty unless both are records with the same period.
std::vector<RunDifference> Compare(const RunData& a, const RunData& b);

}  // namespace tumbler
