#pragma once

#include <cstdint>

#include "common/core/sequence.h"

namespace tumbler {

/// Says which motion of a sequence is next: by its edges, the branches and the end that were asked
/// for, the cycles that are complete, and where the robot has fallen.
///
/// A value without clock, drives or sensor: whoever plays the motions tells it when one is over,
/// and what came of it. A run goes
///
///   BeginRun, EnterNode, { EndMotion, NextEdge, ConfirmCycle, Follow, EnterNode }
///
/// with GetUp, and EnterNode of another beginning, in the place of ConfirmCycle and Follow where
/// the robot has fallen.
///
/// A cycle counts from the end of its last motion, which may yet turn out to be a fall: GetUp and
/// TakeCycleBack take it back, until it is confirmed.
class Sequencer {
 public:
  /// What was asked for before the run; see the fields of `ExecutorConfig`.
  struct Plan {
    int cycles = 0;
    int branch = -1;
    int get_ups_max = 0;
  };

  /// Starts anew, in the start node. @param graph  is copied.
  void Configure(const SequenceGraph<float>& graph, const Plan& plan) noexcept;

  [[nodiscard]] const SequenceGraph<float>& graph() const noexcept { return graph_; }
  /// The node that is played, or was played last.
  [[nodiscard]] int node() const noexcept { return node_; }
  /// Complete cycles since the run began.
  [[nodiscard]] int cycles_done() const noexcept { return run_.cycles_done; }
  /// Whether the operator wants the run to end at the next safe node.
  [[nodiscard]] bool finishes() const noexcept { return run_.finishes; }

  /// Forgets everything of the run before.
  void BeginRun() noexcept { run_ = {}; }
  void EnterNode(int node) noexcept { node_ = node; }

  /// The operator's word, for the rest of the run.
  void Finish() noexcept { run_.finishes = true; }
  /// Asks for a branch, which is taken as soon as a node offers it. @pre the graph has it.
  void Want(int branch) noexcept { run_.wanted_branch = branch; }

  /// At the end of the node's motion.
  void EndMotion() noexcept;
  /// The edge that is taken from here, or -1 where the sequence ends. Until `Follow` the operator
  /// may still decide otherwise.
  /// @param home  whether the run ends at the next safe node, whatever else was asked for.
  [[nodiscard]] int NextEdge(bool home) const noexcept;
  /// Takes an edge: a branch that was asked for is done with.
  /// @returns the node to enter.
  [[nodiscard]] int Follow(int edge) noexcept;
  /// The robot is where the cycle leaves it.
  void ConfirmCycle() noexcept { run_.unconfirmed = false; }
  /// A cycle that ended in a fall, or was broken off, was not complete, unless it was confirmed.
  void TakeCycleBack() noexcept;

  /// Whether a robot that has fallen may get up once more.
  [[nodiscard]] bool MayGetUp() const noexcept {
    return run_.get_ups < plan_.get_ups_max && !run_.finishes;
  }
  /// The robot has fallen in the node, and begins anew. Whoever falls again in the same node takes
  /// its `after_fall` from now on, until it falls there, too.
  void GetUp() noexcept;
  /// What is played in the place of a node, by where the robot has fallen in this run.
  [[nodiscard]] int InPlaceOf(int node) const noexcept {
    return (run_.fell_in >> static_cast<unsigned>(node) & 1U) != 0 ? graph_.node(node).after_fall
                                                                   : node;
  }

  /// How far a pitch of the root is from where the node leaves it.
  [[nodiscard]] float FarFromEnd(float pitch_rad) const noexcept;
  /// The beginning of a run in whose pose the robot lies.
  /// @param only  the one that counts; -1: all.
  /// @param node  becomes that beginning's; is left as it is where there is none.
  /// @returns how far the pitch is from it.
  [[nodiscard, gnu::cold]] float NearestBeginning(float pitch_rad, int only,
                                                  int& node) const noexcept;

 private:
  struct Run {
    int cycles_done = 0;
    bool unconfirmed = false;  ///< Whether the last of them may yet turn out to end in a fall.
    bool branched = false;     ///< Whether the plan's branch has been taken.
    bool finishes = false;
    int wanted_branch = -1;  ///< Until it is taken.
    int get_ups = 0;
    /// The nodes in which the robot fell, and whose `after_fall` is played since. A bit for each.
    std::uint32_t fell_in = 0;
  };

  SequenceGraph<float> graph_;
  Plan plan_;
  int node_ = 0;
  Run run_;
};

}  // namespace tumbler
