#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/fixed_string.h"
#include "common/primitive.h"

namespace tumbler {

/// Capacities of a sequence; the real-time side allocates nothing.
inline constexpr int kMaxSequencePrimitives = 8;
inline constexpr int kMaxSequenceNodes = 16;
inline constexpr int kMaxSequenceEdges = 32;

/// When a transition is taken. At the end of a node, at most one edge of each kind can apply
/// (branches: of each name).
enum class EdgeCondition : std::uint8_t {
  kAlways,      ///< When no other applies.
  kBranch,      ///< When the operator has asked for the edge's branch.
  kCyclesDone,  ///< When as many cycles as were asked for are complete.
};

/// One passage of a primitive.
struct SequenceNode {
  FixedString<48> name;
  int primitive = 0;        ///< Index of the primitive that is played.
  bool swapped = false;     ///< Played with the joints' roles exchanged.
  bool safe = false;        ///< The robot can stay where this ends.
  bool ends_cycle = false;  ///< A cycle is complete when this is.
};

/// An allowed transition from the end of one node to the start of another.
template <typename Scalar>
struct SequenceEdge {
  int from = 0;
  int to = 0;
  Scalar settle_s = 0;  ///< How long the last setpoint of `from` is held before `to` begins.
  EdgeCondition when = EdgeCondition::kAlways;
  FixedString<32> branch;  ///< Name of the branch; empty unless the condition is kBranch.
};

/// The order in which primitives may follow each other: nodes are primitives, with or without their
/// joints' roles exchanged, edges are allowed transitions. Pure data of fixed size; freestanding.
///
/// Roles: a robot that looks the same after its root was turned plays a primitive in that attitude
/// too, if the joints exchange their parts: there, joint `partner[j]` does what the primitive says
/// of joint j. So primitives are stored once, and a gait alternates between both roles.
///
/// Its loader (`common/sequence_toml.h`) proves what a graph promises; see there.
template <typename Scalar>
struct SequenceGraph {
  FixedString<48> name;
  int start = 0;  ///< The node with which it begins.
  int node_count = 0;
  std::array<SequenceNode, kMaxSequenceNodes> node_storage;
  int edge_count = 0;
  std::array<SequenceEdge<Scalar>, kMaxSequenceEdges> edge_storage;
  /// Joint that takes over the part of joint j when roles are exchanged; j itself where none does.
  /// Its own inverse.
  std::array<std::uint8_t, kMaxJoints> partner{};

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

  /// The joint of the primitive whose path joint j of the robot follows in this node; and, the
  /// exchange being its own inverse, the joint of the robot that follows path j.
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

  /// The number by which a branch goes in the core: its first edge; -1 where no edge is taken by
  /// this name, so that an operator's wrong one can be refused.
  [[nodiscard]] constexpr int FindBranch(std::string_view branch) const noexcept {
    for (int i = 0; i < edge_count; ++i) {
      if (edge(i).when == EdgeCondition::kBranch && edge(i).branch.view() == branch) return i;
    }
    return -1;
  }
  [[nodiscard]] constexpr bool HasBranch(std::string_view branch) const noexcept {
    return FindBranch(branch) >= 0;
  }
  /// The name of a branch by its number; empty where there is none.
  [[nodiscard]] constexpr std::string_view BranchName(int number) const noexcept {
    if (number < 0 || number >= edge_count) return {};
    return edge(number).branch.view();
  }
};

/// What is wanted of a running sequence.
struct SequenceRequest {
  int cycles = 0;                ///< End after so many; 0: go on until something else ends it.
  std::string_view branch = {};  ///< Take this branch where there is one; empty: none.
  bool stop = false;             ///< End at the next safe node.
};

/// What is wanted of a sequence when it is begun: so many cycles, and then the branch, where one is
/// named. After the branch, what follows is played to its end, or to the next safe node.
/// @param cycles  0 with a branch: take it at the first chance; 0 without: go on until something
/// else ends it.
[[nodiscard]] inline SequenceRequest PlannedRequest(int cycles, std::string_view branch,
                                                    int cycles_done, bool branched) noexcept {
  if (branch.empty()) return {cycles};
  if (branched) return {cycles_done > 1 ? cycles_done : 1};
  return {0, cycles_done >= cycles ? branch : std::string_view()};
}

/// The edge to take at the end of a node, or -1: the sequence ends there.
///
/// In this order: a stop ends at a safe node, and otherwise only hurries on along kAlways; then the
/// branch asked for; then, with the cycles done, the edge for that, or the end if the node is safe;
/// then kAlways. A node without kAlways is safe (the loader sees to it), so a sequence ends in safe
/// nodes only.
/// @param cycles_done  complete cycles, with the one that this node ends.
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

/// A primitive alone, as a sequence.
template <typename Scalar>
[[nodiscard]] SequenceGraph<Scalar> GraphOf(const Primitive<Scalar>& primitive) noexcept {
  SequenceGraph<Scalar> graph;
  graph.name = primitive.name;
  graph.node_count = 1;
  graph.node_storage[0].name = primitive.name;
  graph.node_storage[0].safe = true;
  for (std::size_t j = 0; j < graph.partner.size(); ++j)
    graph.partner[j] = static_cast<std::uint8_t>(j);
  return graph;
}

/// A graph with the primitives that it plays: all that an executor needs.
template <typename Scalar>
struct Sequence {
  SequenceGraph<Scalar> graph;
  int primitive_count = 0;
  std::array<Primitive<Scalar>, kMaxSequencePrimitives> primitives;

  [[nodiscard]] const Primitive<Scalar>& PrimitiveOf(int node) const noexcept {
    return primitives[static_cast<std::size_t>(graph.node(node).primitive)];
  }
};

}  // namespace tumbler
