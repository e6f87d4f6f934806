#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware_interface/drives/drives_toml.h"
#include "offline/ensemble/variation.h"
#include "offline/problem/simulated_motion.h"
#include "offline/rehearsal/twin/simulated_robot.h"
#include "runtime/assembly/run_settings.h"

namespace tumbler {

/// A study of how many robots survive a motion. Every trial depends on the study and its own number
/// alone.
struct RobustnessStudy {
  std::string motion;  ///< Primitive or sequence file.
  std::string drives;  ///< Drives file; empty: the default drives.
  std::string twin;    ///< Twin file for what all robots share; empty: none.
  RunSettings run;     ///< Cycles, branch.
  std::uint64_t seed = 1;
  double scale = 1;  ///< Of all spreads.
  Spreads spreads;
};

/// What became of one robot.
struct TrialOutcome {
  enum class Verdict {
    kStands,   ///< Everything as asked and planned, in every motion.
    kAmiss,    ///< It completed the motions, but was not as asked after one of them.
    kFell,     ///< It came to rest in another pose.
    kOverlap,  ///< Its own shapes overlapped.
    kFault,    ///< The run ended in a fault, or was refused.
  };
  Verdict verdict = Verdict::kStands;
  int motions = 0;     ///< Motions that ended.
  std::string in;      ///< The node after which it was first not as asked; empty if none.
  std::string reason;  ///< In words; empty where it stands.
  RobotVariation variation;
};

/// Plays a study's robots, each through the runtime, simulated drives and twin. The files are read
/// once, for all copies. Not thread-safe: each thread takes a copy.
class Trials {
 public:
  /// @throws FileError, Refused, std::runtime_error as `tumbler-run sim` does.
  explicit Trials(const RobustnessStudy& study);

  /// Plays robot number `index`.
  TrialOutcome Play(std::uint64_t index);

  /// Name of the motion.
  [[nodiscard]] std::string name() const;

 private:
  RobustnessStudy study_;
  SimulatedMotion motion_;
  DrivesConfig drives_;
  SimulatedRobotConfig robot_;
  Scene scene_;
};

/// "stands", "amiss", "fell", "overlap" or "fault"
[[nodiscard]] const char* ToString(TrialOutcome::Verdict verdict);

}  // namespace tumbler
