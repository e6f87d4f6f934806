#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/primitive_toml.h"
#include "common/sequence.h"
#include "common/toml_reader.h"

namespace tumbler {

/// The version that this build reads.
inline constexpr int kSequenceFileVersion = 1;

/// How far apart the end of one primitive and the start of the next may be.
struct JoinTolerances {
  // Of the setpoints. Splines meet exactly where their tasks say the same number; this allows for
  // its last digits.
  double joint_position_rad = 1e-6;
  double joint_velocity_rad_s = 1e-6;
  double joint_acceleration_rad_s2 = 1e-6;
  // Of the robot, where the simulation leaves it. The next motion was made for its entry pose; how
  // much it forgives has to be tried (`tumbler-chain simulate`).
  double root_z_m = 0.002;
  double root_pitch_rad = 0.02;
};

/// A sequence with all that its file says about it.
struct SequenceFile {
  SequenceGraph<double> graph;
  std::vector<PrimitiveFile> primitives;     ///< In the order of the graph's indices.
  std::vector<std::string> primitive_names;  ///< As the file names them, likewise.
  JoinTolerances tolerances;
  double swap_root_pitch_rad = 0;  ///< How far the root is turned where roles are exchanged.
  /// For each node, how far from its recorded exit the root may end in a simulation.
  std::vector<double> exit_pitch_tolerance_rad;

  std::string path;  ///< For messages, like the lines of nodes and edges in the file.
  std::vector<std::uint32_t> node_lines;
  std::vector<std::uint32_t> edge_lines;

  [[nodiscard]] const PrimitiveFile& PrimitiveOf(int node) const {
    return primitives[static_cast<std::size_t>(graph.node(node).primitive)];
  }
  /// Pitch of the robot when the primitive of a node speaks of `pitch_rad`.
  [[nodiscard]] double RobotPitch(int node, double pitch_rad) const {
    return pitch_rad + (graph.node(node).swapped ? swap_root_pitch_rad : 0.0);
  }
};

/// One quantity at the transition from one node to another.
struct JoinComparison {
  int edge = 0;
  std::string joint;     ///< Of the robot; empty for the root.
  std::string quantity;  ///< `position`, `height`, ...; with where, if it is compared with a hold.
  const char* unit = "";
  double exit = 0;        ///< How `from` leaves it, in the terms of `to`; or what a hold makes it.
  double entry = 0;       ///< How `to` takes it up; or what a hold makes it.
  double difference = 0;  ///< exit - entry; of angles of the root, to the nearest turn.
  double tolerance = 0;

  [[nodiscard]] bool fits() const { return difference <= tolerance && -difference <= tolerance; }
};

/// An angle less whole turns, within -pi ... pi.
double NearestTurn(double angle_rad);

/// Everything that has to agree at every edge: position, velocity and acceleration of each joint of
/// the robot by the coefficients of both splines (at rest at both ends where the transition is
/// held), height and pitch of the root by the simulated exit of one and the entry of the other.
/// Position along x is free: a sequence walks. In the order of edges.
std::vector<JoinComparison> CompareJoins(const SequenceFile& file);

/// One line: names, quantity, both values, how far apart, what is allowed.
std::string Describe(const SequenceFile& file, const JoinComparison& comparison);

/// Reads a sequence and the primitives that it names (relative to its folder); docs/formats.md
/// describes it. Checks structure and names, that all primitives move the same joints of the same
/// robot, that every stop can be finished in a safe node, and that every node keeps the limits of
/// the joints that play it, for all t, by the control points.
/// @throws FileError with file, line, key, value and what is allowed.
/// @param read  where texts come from, instead of the file system.
SequenceFile ReadSequence(const std::string& path, const FileReader& read = {});

/// The same, and proves every join (CompareJoins). What it returns can be armed.
/// @throws FileError besides, about the first edge where something does not fit.
SequenceFile LoadSequence(const std::string& path, const FileReader& read = {});

/// What a runtime is given to play: a sequence, proved by LoadSequence, or a primitive, which
/// becomes a sequence of itself alone. @throws FileError likewise.
SequenceFile LoadMotion(const std::string& path, const FileReader& read = {});

/// The sequence in the scalar that the executor uses. @throws std::invalid_argument when a
/// primitive does not fit it (see ToRuntime of a primitive).
Sequence<float> ToRuntime(const SequenceFile& file);

}  // namespace tumbler
