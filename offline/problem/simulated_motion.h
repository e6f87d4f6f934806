#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/problem/problem.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// A motion for simulation: a sequence, and the problem (with its scene) that each of its
/// primitives was made for. The texts of a primitive are parsed once, when its problem is first
/// asked for; copies share what has been parsed.
///
/// Not thread-safe.
class SimulatedMotion {
 public:
  /// @param takes  whether its robot may be one in space. Then `scene` is empty, and the problem's
  ///               `space` has the scene.
  explicit SimulatedMotion(SequenceFile file, TaskSpaces takes = TaskSpaces::kPlane);

  [[nodiscard]] const SequenceFile& file() const { return file_; }

  /// The problem of a primitive, given by its index.
  /// @throws FileError when the texts of the primitive cannot be used, or its purpose is of
  /// something that its robot has not.
  [[nodiscard]] const Problem& ProblemOf(std::size_t primitive) const;
  /// The problem of the primitive that a node plays.
  [[nodiscard]] const Problem& ProblemAt(int node) const;
  /// The problem of the primitive with which the motion starts.
  [[nodiscard]] const Problem& problem() const { return ProblemAt(file_.graph.start); }
  /// The scene in which the motion starts.
  [[nodiscard]] const Scene& scene() const { return problem().scene; }

  /// The motion of one node, and nothing after it.
  [[nodiscard]] SimulatedMotion Alone(int node) const;

 private:
  void CheckPurpose(std::size_t primitive, const Problem& problem) const;

  SequenceFile file_;
  TaskSpaces takes_;
  mutable std::vector<std::shared_ptr<const Problem>> problems_;  // by primitive; null: not yet
};

/// What is simulated is one robot, whatever its motions were made with.
/// @throws FileError when primitives were made for other [motor] or [passive] than the first, or as
/// ProblemOf does.
void RequireOneRobot(const SimulatedMotion& motion);

/// Checks that all primitives were made for the same ground, because a sequence is played on one.
/// @throws FileError naming the first primitive whose task has another contact law or other
/// obstacles than the first.
void RequireSameGround(const SimulatedMotion& motion);

}  // namespace tumbler
