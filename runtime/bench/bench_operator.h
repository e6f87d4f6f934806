#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "runtime/bench/bench_world.h"

namespace tumbler {

/// Somebody who stands beside the robot, and answers what drives cannot know. Whoever asks has the
/// torque off; `meanwhile` is called again and again until there is an answer.
class BenchOperator {
 public:
  BenchOperator() = default;
  BenchOperator(const BenchOperator&) = delete;
  BenchOperator& operator=(const BenchOperator&) = delete;
  virtual ~BenchOperator() = default;

  /// Told when a motion is about to begin, and when it is at its farthest, to be asked about
  /// afterwards.
  virtual void NoteBefore() {}
  virtual void NoteFarthest() {}

  /// Whether to go on with what was said.
  virtual bool Confirm(const std::string& what, const std::function<void()>& meanwhile) = 0;
  /// Which of these joints turned; empty: none of them.
  virtual std::string WhichTurned(const std::vector<std::string>& joints,
                                  const std::function<void()>& meanwhile) = 0;
  /// Whether the joint's angle grew.
  virtual bool Grew(const std::string& joint, const std::function<void()>& meanwhile) = 0;
  /// Asks to put a joint to an angle, and to leave it there. @returns whether it is there.
  virtual bool Place(const std::string& joint, double angle_rad,
                     const std::function<void()>& meanwhile) = 0;
  /// Asks to turn a joint by hand to both ends of its way. @returns whether that was done.
  virtual bool TurnThrough(const std::string& joint, double lower_rad, double upper_rad,
                           const std::function<void()>& meanwhile) = 0;
};

/// The texts of an operator, a line for each answer.
struct OperatorScript {
  std::string answers;  ///< File with the answers; empty: they come from standard input.
  bool yes = false;     ///< Whether Confirm is answered at once.
  /// A simulated robot, whose joints turn as it is asked for, and which is described; null: the
  /// robot is real.
  SimulatedHands* hands = nullptr;
};

/// Asks on standard output. Answers come from a file or from standard input; what they are is
/// printed where nobody types them.
/// @throws FileError  when the file cannot be read. A missing answer throws Refused when it is
/// asked for.
std::unique_ptr<BenchOperator> MakeAskedOperator(const OperatorScript& script);

/// The operator of a simulated robot, who sees what is true, and does what is asked.
std::unique_ptr<BenchOperator> MakeSimulatedOperator(SimulatedHands& hands);

}  // namespace tumbler
