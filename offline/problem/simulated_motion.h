#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "common/sequence_toml.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A motion as simulations need it: with the problem, and with it the scene, that each of its
/// primitives was made for. The texts of a primitive are parsed when its problem is first asked
/// for, and once: copies share what has been parsed.
///
/// Not thread-safe.
class SimulatedMotion {
 public:
  explicit SimulatedMotion(SequenceFile file);

  [[nodiscard]] const SequenceFile& file() const { return file_; }

  /// Of a primitive, by its index; `TaskOf` it.
  /// @throws FileError when the texts of the primitive cannot be used.
  [[nodiscard]] const Problem& ProblemOf(std::size_t primitive) const;
  /// Of the primitive that a node plays.
  [[nodiscard]] const Problem& ProblemAt(int node) const;
  /// The scene in which the motion starts.
  [[nodiscard]] const Scene& scene() const { return ProblemAt(file_.graph.start).scene; }

  /// The motion of one node, and nothing after it.
  [[nodiscard]] SimulatedMotion Alone(int node) const;

 private:
  SequenceFile file_;
  mutable std::vector<std::shared_ptr<const Problem>> problems_;  // by primitive; null: not yet
};

}  // namespace tumbler
