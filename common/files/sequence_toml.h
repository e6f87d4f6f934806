#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/core/sequence.h"
#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"

namespace tumbler {

/// The version that this build reads.
inline constexpr int kSequenceFileVersion = 1;

/// The largest differences between the end of one primitive and the start of the next.
struct JoinTolerances {
  // Between the splines of each joint. They meet exactly where both tasks give the same number; the
  // tolerance allows for its last digits.
  double joint_position_rad = 1e-6;
  double joint_velocity_rad_s = 1e-6;
  double joint_acceleration_rad_s2 = 1e-6;
  // Between the simulated exit of one primitive and the entry pose that the next was made for. How
  // much a motion forgives has to be tried (`tumbler chain simulate`).
  double root_z_m = 0.002;
  double root_pitch_rad = 0.02;
  // Likewise, where the root moves at one of both.
  double root_m_s = 0.02;
  double root_rad_s = 0.1;
  // Likewise, of joints without a motor.
  double passive_position_rad = 0.02;
};

/// The whole content of a sequence file, with its primitives.
struct SequenceFile {
  SequenceGraph<double> graph;
  std::vector<PrimitiveFile> primitives;     ///< In the order of the graph's indices.
  std::vector<std::string> primitive_names;  ///< Their names in the file, in the same order.
  JoinTolerances tolerances;
  double swap_root_pitch_rad = 0;  ///< How far the root is turned where roles are exchanged.
  std::string begin_link;          ///< Whose pitch `graph.beginnings()` are about: the root.
  double begin_within_rad = 0.3;   ///< `graph.beginning_within_rad`; poses of rest are far apart.
  /// For each node, how far the root's pitch may end from the recorded exit in a simulation.
  std::vector<double> exit_pitch_tolerance_rad;

  std::string path;                       ///< Path of the file, for messages.
  std::vector<std::uint32_t> node_lines;  ///< Line of each node in the file, for messages.
  std::vector<std::uint32_t> edge_lines;  ///< Line of each edge in the file, for messages.

  /// The primitive that a node plays.
  [[nodiscard]] const PrimitiveFile& PrimitiveOf(int node) const {
    return primitives[static_cast<std::size_t>(graph.node(node).primitive)];
  }
  /// The robot's pitch where the primitive of a node has the pitch `pitch_rad`.
  [[nodiscard]] double RobotPitch(int node, double pitch_rad) const {
    return pitch_rad + (graph.node(node).swapped ? swap_root_pitch_rad : 0.0);
  }
};

/// One quantity on both sides of an edge. Where the edge holds the last setpoint, velocities and
/// accelerations of both sides are compared with those of the hold, which are zero.
struct JoinComparison {
  int edge = 0;           ///< Index of the edge.
  int to = 0;             ///< Index of the node: the edge's, or the one in its place after a fall.
  std::string joint;      ///< Name of the robot's joint; empty for the root.
  std::string quantity;   ///< `position`, `height`, ...; beside a hold also which side it is.
  const char* unit = "";  ///< Of all values below.
  double exit = 0;        ///< The end of `from`, in the terms of `to`; or that of the hold.
  double entry = 0;       ///< The start of `to`; or that of the hold.
  double difference = 0;  ///< exit - entry; of the root's pitch, less whole turns.
  double tolerance = 0;   ///< The largest |difference| that fits.

  [[nodiscard]] bool fits() const { return difference <= tolerance && -difference <= tolerance; }
};

/// An angle less whole turns, within -pi ... pi.
double NearestTurn(double angle_rad);
/// The angle between what is vertical in two frames of a robot in space, which are turned by these
/// unit quaternions w, x, y, z [rad]. Their headings do not count.
double TiltBetween(const std::array<double, 4>& a, const std::array<double, 4>& b);

/// Compares everything that has to agree at every edge, in the order of edges: position, velocity
/// and acceleration of each joint of the robot, by the coefficients of both splines; height and
/// pitch of the root, and where there are any its velocities and the positions of joints without a
/// motor, by the simulated exit of one primitive and the entry of the next. Where the edge holds,
/// both splines have to be at rest. The position along x is not compared, since a sequence walks.
/// In space what is vertical in the root's frame takes the place of the pitch; heading and level
/// position are not compared.
std::vector<JoinComparison> CompareJoins(const SequenceFile& file);

/// One line of text: names, quantity, both values, how far apart they are, what is allowed.
std::string Describe(const SequenceFile& file, const JoinComparison& comparison);

/// Reads a sequence file (docs/formats.md) and the primitives that it names, relative to its
/// folder. Checks structure and names, that all primitives move the same joints of the same robot,
/// that every stop can be finished in a safe node, and that in every node each joint keeps its own
/// limits for all t, by the control points.
/// @param read  where texts come from; empty: the file system.
/// @throws FileError  with file, line, key, value and what is allowed.
SequenceFile ReadSequence(const std::string& path, const FileReader& read = {});

/// The same, and proves every join (CompareJoins). A robot may be armed with the result.
/// @throws FileError  besides, about the first edge where something does not fit.
SequenceFile LoadSequence(const std::string& path, const FileReader& read = {});

/// Loads a motion for a runtime: a sequence file as LoadSequence does, or a primitive file as a
/// sequence of this primitive alone. The executor starts and ends every primitive at rest.
/// @throws FileError  as LoadSequence; about a joint that moves where a primitive starts or ends.
SequenceFile LoadMotion(const std::string& path, const FileReader& read = {});

/// For people: a line about each primitive that was changed by hand after it was made.
/// @param path  of the motion that has them.
std::string EditNotes(const std::string& path, std::span<const PrimitiveFile> primitives);

/// The gains of the drives through which a motion was found: those of the first of its primitives
/// that says so, beginning with the one at the start. None when no primitive does.
std::optional<DriveGains> GainsOf(const SequenceFile& file);

/// Names of the branches that an operator may ask for, each once, in alphabetical order.
template <typename Scalar>
std::vector<std::string> BranchNames(const SequenceGraph<Scalar>& graph) {
  std::set<std::string> names;
  for (const auto& edge : graph.edges()) {
    if (edge.when == EdgeCondition::kBranch) names.emplace(edge.branch.view());
  }
  return {names.begin(), names.end()};
}

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> SequenceKeyTables();

/// The sequence in the scalar that the executor uses.
/// @throws std::invalid_argument  when a primitive does not fit it (see ToRuntime of a primitive).
Sequence<float> ToRuntime(const SequenceFile& file);

}  // namespace tumbler
