#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/fixed_string.h"
#include "common/core/primitive.h"

namespace tumbler {

/// Capacities of a sequence, since the real-time side allocates nothing.
inline constexpr int kMaxSequencePrimitives = 8;
inline constexpr int kMaxSequenceNodes = 16;
inline constexpr int kMaxSequenceEdges = 32;

/// What is done with a robot that would drop without torque, when a run ends. Wherever the graph
/// has a way, a run that is to end first goes on to a safe node; what is left are stops, faults,
/// and motions that do not end in a safe node.
enum class RunEnd : std::uint8_t {
  /// After a fault that was answered by a hold at the end of a node, the way to the next safe node;
  /// where there is none, as kHold.
  kSafe,
  /// The stiffness fades away slowly. A robot that leans on something sinks; one that balances
  /// loses its balance and drops all the same. Where a drive carries no gains, as kHold.
  kLower,
  kHold,       ///< The robot is held until the operator disarms.
  kTorqueOff,  ///< The torque is taken off where the robot is.
};
/// Their names in files and options, in this order.
inline constexpr std::array<std::string_view, 4> kRunEndNames = {"safe", "lower", "hold",
                                                                 "torque-off"};

/// When an edge is taken. A node has at most one outgoing edge of each kind, and of kBranch one for
/// each branch.
enum class EdgeCondition : std::uint8_t {
  kAlways,      ///< When no other edge applies.
  kBranch,      ///< When the operator has asked for the edge's branch.
  kCyclesDone,  ///< When as many cycles as were asked for are complete.
};

/// A node of the graph: one playing of a primitive.
struct SequenceNode {
  FixedString<48> name;
  int primitive = 0;     ///< Index of the primitive that is played.
  bool swapped = false;  ///< Whether joints exchange their roles while it is played.
  bool safe =
      false;  ///< Whether the robot can stay, without torque, where the primitive leaves it.
  bool ends_cycle = false;  ///< Whether a cycle is complete at the end of this node.
  /// Index of the node that is played in its place once the robot has fallen in this one, and until
  /// it falls in that one, too; -1: none, the same is tried again.
  int after_fall = -1;
};

/// An allowed transition from the end of one node to the start of another.
template <typename Scalar>
struct SequenceEdge {
  int from = 0;         ///< Index of a node.
  int to = 0;           ///< Index of a node.
  Scalar settle_s = 0;  ///< How long the last setpoint of `from` is held before `to` begins.
  EdgeCondition when = EdgeCondition::kAlways;
  FixedString<32> branch;  ///< Name of the branch; empty unless the condition is kBranch.
};

/// How the robot may lie when a run begins with a node.
template <typename Scalar>
struct SequenceBeginning {
  int node = 0;          ///< Index of the node.
  Scalar pitch_rad = 0;  ///< Of the root; of the robot, not of the node's roles.
};

/// The order in which primitives may follow each other. Nodes play primitives, edges are allowed
/// transitions. Pure data of fixed size; freestanding.
///
/// Roles: some robots look the same after their root was turned, if their joints exchange roles.
/// (The tumbler, turned by pi about y, has its legs exchanged.) Such a robot can play a primitive
/// in the turned attitude too: joint `partner[j]` then moves as the primitive says of joint j. So a
/// primitive is stored once, and a gait may alternate between both roles.
///
/// The loader (`common/files/sequence_toml.h`) proves that every sequence in a graph can be played.
template <typename Scalar>
struct SequenceGraph {
  FixedString<48> name;
  int start = 0;  ///< Index of the first node.
  int node_count = 0;
  std::array<SequenceNode, kMaxSequenceNodes> node_storage;
  int edge_count = 0;
  std::array<SequenceEdge<Scalar>, kMaxSequenceEdges> edge_storage;
  /// The joint with which joint j exchanges roles; j itself where it keeps its own. The map is its
  /// own inverse.
  std::array<std::uint8_t, kMaxJoints> partner{};
  /// How far the root is turned where roles are exchanged: the robot's pitch less the primitive's.
  Scalar swap_pitch_rad = 0;
  RunEnd end = RunEnd::kSafe;
  /// The nodes with which a run may begin, `start` among them, all with the joints where `start`
  /// has them first. None: a run begins with `start`, however the robot lies.
  int beginning_count = 0;
  std::array<SequenceBeginning<Scalar>, kMaxSequenceNodes> beginning_storage;
  /// How far the measured pitch may be from that of a beginning, or of a node's end.
  Scalar beginning_within_rad = 0;
  /// The root's pitch where each node leaves the robot; of the robot, not of the node's roles. Only
  /// where there are beginnings.
  std::array<Scalar, kMaxSequenceNodes> last_pitch_rad{};

  [[nodiscard]] constexpr std::span<const SequenceBeginning<Scalar>> beginnings() const noexcept {
    return {beginning_storage.data(), static_cast<std::size_t>(beginning_count)};
  }
  /// Whether a run may begin with this node.
  [[nodiscard]] constexpr bool MayBegin(int node_index) const noexcept {
    for (const SequenceBeginning<Scalar>& beginning : beginnings()) {
      if (beginning.node == node_index) return true;
    }
    return node_index == start;
  }
  [[nodiscard]] constexpr std::span<const SequenceNode> nodes() const noexcept {
    return {node_storage.data(), static_cast<std::size_t>(node_count)};
  }
  [[nodiscard]] constexpr std::span<const SequenceEdge<Scalar>> edges() const noexcept {
    return {edge_storage.data(), static_cast<std::size_t>(edge_count)};
  }
  [[nodiscard]] constexpr const SequenceNode& node(int i) const noexcept {
    return node_storage[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] constexpr const SequenceEdge<Scalar>& edge(int i) const noexcept {
    return edge_storage[static_cast<std::size_t>(i)];
  }

  /// The joint of the primitive whose path the robot's joint j follows in this node. The exchange
  /// is its own inverse, so this is also the robot's joint that follows the primitive's path j.
  [[nodiscard]] constexpr int RoleOf(int node_index, int j) const noexcept {
    return node(node_index).swapped ? partner[static_cast<std::size_t>(j)] : j;
  }

  /// Index of the node with this name, or -1.
  [[nodiscard]] constexpr int FindNode(std::string_view node_name) const noexcept {
    for (int i = 0; i < node_count; ++i) {
      if (node(i).name.view() == node_name) return i;
    }
    return -1;
  }

  /// The number of a branch in the executor, which is the index of the branch's first edge; -1
  /// where no edge has this name.
  [[nodiscard]] constexpr int FindBranch(std::string_view branch) const noexcept {
    for (int i = 0; i < edge_count; ++i) {
      if (edge(i).when == EdgeCondition::kBranch && edge(i).branch.view() == branch) return i;
    }
    return -1;
  }
  [[nodiscard]] constexpr bool HasBranch(std::string_view branch) const noexcept {
    return FindBranch(branch) >= 0;
  }
  /// The name of the branch with this number; empty where there is none.
  [[nodiscard]] constexpr std::string_view BranchName(int number) const noexcept {
    if (number < 0 || number >= edge_count) return {};
    return edge(number).branch.view();
  }
};

/// The operator's request to a running sequence.
struct SequenceRequest {
  int cycles = 0;                ///< End after this many cycles; 0: do not end by cycles.
  std::string_view branch = {};  ///< Take this branch as soon as a node offers it; empty: none.
  bool stop = false;             ///< End at the next safe node.
};

/// The request of a run that was started with a number of cycles and a branch: first the cycles,
/// then the branch, then what follows the branch up to its end or the next safe node.
/// @param cycles       with a branch: 0 takes it at the first chance. Without: 0 goes on until
/// something else ends the run.
/// @param branch       empty: none.
/// @param cycles_done  complete cycles so far.
/// @param branched     whether the branch has been taken.
[[nodiscard]] inline SequenceRequest PlannedRequest(int cycles, std::string_view branch,
                                                    int cycles_done, bool branched) noexcept {
  if (branch.empty()) return {cycles};
  if (branched) return {cycles_done > 1 ? cycles_done : 1};
  return {0, cycles_done >= cycles ? branch : std::string_view()};
}

/// The edge to take at the end of a node, or -1 where the sequence ends.
///
/// The first of these that applies counts:
///   1. a stop ends the sequence in a safe node, and goes on along kAlways from another;
///   2. the branch that was asked for, if an edge has its name;
///   3. when the cycles are done, the edge kCyclesDone, or the end if the node is safe;
///   4. the edge kAlways.
/// The loader makes sure that a node without kAlways is safe, so a sequence ends in safe nodes
/// only.
/// @param cycles_done  complete cycles, including the one that this node ends.
template <typename Scalar>
[[nodiscard]] int NextEdge(const SequenceGraph<Scalar>& graph, int node, int cycles_done,
                           const SequenceRequest& request) noexcept {
  int always = -1, branch = -1, done = -1;
  for (int i = 0; i < graph.edge_count; ++i) {
    const SequenceEdge<Scalar>& edge = graph.edge(i);
    if (edge.from != node) continue;
    if (edge.when == EdgeCondition::kAlways) always = i;
    if (edge.when == EdgeCondition::kCyclesDone) done = i;
    if (edge.when == EdgeCondition::kBranch && !request.branch.empty() &&
        edge.branch.view() == request.branch) {
      branch = i;
    }
  }
  if (request.stop) return graph.node(node).safe ? -1 : always;
  if (branch >= 0) return branch;
  if (request.cycles > 0 && cycles_done >= request.cycles) {
    if (done >= 0) return done;
    if (graph.node(node).safe) return -1;
  }
  return always;
}

/// The graph of a sequence that plays one primitive and ends. Nobody has said that the robot stays
/// there without torque, so its node is not safe.
template <typename Scalar>
[[nodiscard]] SequenceGraph<Scalar> GraphOf(const Primitive<Scalar>& primitive) noexcept {
  SequenceGraph<Scalar> graph;
  graph.name = primitive.name;
  graph.node_count = 1;
  graph.node_storage[0].name = primitive.name;
  for (std::size_t j = 0; j < graph.partner.size(); ++j)
    graph.partner[j] = static_cast<std::uint8_t>(j);
  return graph;
}

/// A graph with its primitives. An executor needs no more to play it.
template <typename Scalar>
struct Sequence {
  SequenceGraph<Scalar> graph;
  int primitive_count = 0;
  std::array<Primitive<Scalar>, kMaxSequencePrimitives> primitives;

  /// The primitive that a node plays.
  [[nodiscard]] const Primitive<Scalar>& PrimitiveOf(int node) const noexcept {
    return primitives[static_cast<std::size_t>(graph.node(node).primitive)];
  }
};

}  // namespace tumbler
