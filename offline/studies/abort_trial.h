#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/variation.h"
#include "offline/studies/varied_run.h"
#include "runtime/executor/faults.h"

namespace tumbler {

/// Why a motion cannot simply go on.
enum class AbortCause : std::uint8_t {
  kOperatorStop,     ///< The operator asks for it.
  kLateTick,         ///< The loop sleeps too long.
  kSilence,          ///< The host hears no drive for a while, as behind a USB adapter.
  kRepeatedReplies,  ///< It hears every frame twice.
};
inline constexpr int kAbortCauseCount = 4;
[[nodiscard]] const char* ToString(AbortCause cause);

/// One motion that is aborted.
struct AbortTrial {
  RobotVariation variation;
  double time_s = 0;  ///< Since the motion began, when the cause begins.
  AbortCause cause = AbortCause::kOperatorStop;
  double late_s = 0;                      ///< Of kLateTick: for how long the loop misses its ticks.
  double silent_s = 0.03;                 ///< Of kSilence: for how long.
  std::vector<std::uint32_t> silent_ids;  ///< Of kSilence: of these frames only; empty: of all.
  AbortTable<double> table;               ///< Empty: as if the motion had none.
};

/// What became of the robot.
struct AbortOutcome {
  /// The hardest impact from the cause on: the largest speed with which a point in contact moves
  /// into what it touches, and its link.
  double impact_m_s = 0;
  std::string link;
  double torque_nm = 0;   ///< The largest of a motor from then on.
  bool overlaps = false;  ///< Whether own shapes that are to stay apart overlapped.
  /// The pose in which it rests at last, of those in which the motion begins or ends; empty: it
  /// rests otherwise, or does not.
  std::string rests_as;
  double pitch_rad = 0;                   ///< At last, of the root; 0 in space.
  Fault fault = Fault::kNone;             ///< That was found first; none: a plain stop.
  Reaction reaction = Reaction::kIgnore;  ///< With which it was answered.
  std::int64_t setpoints_outside_limits = 0;
};

/// Plays a primitive's aborts: through the runtime, simulated drives on a simulated bus, and the
/// twin. Not thread-safe: each thread takes a copy.
class AbortTrials {
 public:
  /// @param motion  a primitive alone.
  AbortTrials(SimulatedMotion motion, SharedRobot shared);

  /// Plays the motion until the robot rests after its abort, or for 2.45 s after it, or after its
  /// end where it is rolled out. What is done with a robot that is held at last is no part of it.
  /// @throws Refused  when the run ends before the time of the abort.
  /// @param observe  called once before the first tick, and after every tick; may be empty.
  [[nodiscard]] AbortOutcome Play(const AbortTrial& trial,
                                  const std::function<void(VariedRun&)>& observe = {}) const;

  [[nodiscard]] const Primitive<double>& primitive() const;
  [[nodiscard]] const SharedRobot& shared() const { return shared_; }

 private:
  SimulatedMotion motion_;
  SharedRobot shared_;
};

}  // namespace tumbler
