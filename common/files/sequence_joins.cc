#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "common/files/sequence_toml.h"

namespace tumbler {

namespace {

// Names of quantities that are compared with a hold, rather than with the other primitive, end in
// one of these.
constexpr std::string_view kBeforeHold = " before the hold";
constexpr std::string_view kAfterHold = " after the hold";

}  // namespace

double TiltBetween(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  const auto up_in = [](const std::array<double, 4>& turned) -> std::array<double, 3> {
    const auto& [w, x, y, z] = turned;
    return {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
  };
  const std::array<double, 3> u = up_in(a), v = up_in(b);
  double square = 0;  // of the chord between them
  for (std::size_t i = 0; i < 3; ++i) square += (u[i] - v[i]) * (u[i] - v[i]);
  const double sine = std::min(1.0, std::sqrt(square) / 2);  // of half the angle
  return 2 * portable::Atan2(sine, std::sqrt(1 - sine * sine));
}

double NearestTurn(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

namespace {

/// Compares the end of an edge's first node with the start of a node.
void CompareJoin(const SequenceFile& file, int e, int to,
                 std::vector<JoinComparison>& comparisons) {
  const SequenceGraph<double>& graph = file.graph;
  const JoinTolerances& tolerances = file.tolerances;
  const SequenceEdge<double>& edge = graph.edge(e);
  const PrimitiveFile& before = file.PrimitiveOf(edge.from);
  const PrimitiveFile& after = file.PrimitiveOf(to);
  const auto add = [&](const std::string& joint, const std::string& quantity, const char* unit,
                       double exit, double entry, double tolerance) {
    comparisons.push_back({e, to, joint, quantity, unit, exit, entry, exit - entry, tolerance});
  };
  for (int j = 0; j < before.primitive.joint_count; ++j) {
    const std::string name(before.primitive.joints[Index(j)].name.view());
    const JointMotion<double>::Spline& left =
        before.primitive.joints[Index(graph.RoleOf(edge.from, j))].position;
    const JointMotion<double>::Spline& met =
        after.primitive.joints[Index(graph.RoleOf(to, j))].position;
    const auto last = [&left](int d) { return left.control_points(d).back(); };
    const auto first = [&met](int d) { return met.control_points(d).front(); };
    add(name, "position", "rad", last(0), first(0), tolerances.joint_position_rad);
    const double v = tolerances.joint_velocity_rad_s;
    const double a = tolerances.joint_acceleration_rad_s2;
    if (edge.settle_s > 0) {  // Both sides meet a hold, which is at rest.
      add(name, std::string("velocity").append(kBeforeHold), "rad/s", last(1), 0, v);
      add(name, std::string("velocity").append(kAfterHold), "rad/s", 0, first(1), v);
      add(name, std::string("acceleration").append(kBeforeHold), "rad/s^2", last(2), 0, a);
      add(name, std::string("acceleration").append(kAfterHold), "rad/s^2", 0, first(2), a);
    } else {
      add(name, "velocity", "rad/s", last(1), first(1), v);
      add(name, "acceleration", "rad/s^2", last(2), first(2), a);
    }
  }
  add("", "height", "m", before.exit.root_z_m, after.entry.root_z_m, tolerances.root_z_m);
  if (before.exit.is_in_space()) {
    add("", "tilt", "rad", TiltBetween(before.exit.root_quaternion, after.entry.root_quaternion), 0,
        tolerances.root_pitch_rad);
    return;
  }
  const double exit =
      file.RobotPitch(edge.from, before.exit.root_pitch_rad) - file.RobotPitch(to, 0);
  add("", "pitch", "rad", exit, after.entry.root_pitch_rad, tolerances.root_pitch_rad);
  JoinComparison& pitch = comparisons.back();
  pitch.difference = NearestTurn(pitch.difference);
  pitch.exit = pitch.entry + pitch.difference;
  if (before.exit.root_moves() || after.entry.root_moves()) {
    const double v = tolerances.root_m_s;
    add("", "velocity along x", "m/s", before.exit.root_x_m_s, after.entry.root_x_m_s, v);
    add("", "velocity along z", "m/s", before.exit.root_z_m_s, after.entry.root_z_m_s, v);
    add("", "pitch rate", "rad/s", before.exit.root_pitch_rad_s, after.entry.root_pitch_rad_s,
        tolerances.root_rad_s);
  }
  const std::vector<double>& left = before.exit.passive_positions_rad;
  const std::vector<double>& met = after.entry.passive_positions_rad;
  for (std::size_t i = 0; i < std::min(left.size(), met.size()); ++i) {
    add(fmt::format("no. {}", i + 1), "position without a motor", "rad", left[i], met[i],
        tolerances.passive_position_rad);
  }
}

}  // namespace

std::vector<JoinComparison> CompareJoins(const SequenceFile& file) {
  const SequenceGraph<double>& graph = file.graph;
  std::vector<JoinComparison> comparisons;
  for (int e = 0; e < graph.edge_count; ++e) {
    const SequenceEdge<double>& edge = graph.edge(e);
    CompareJoin(file, e, edge.to, comparisons);
    const int in_its_place = graph.node(edge.to).after_fall;
    if (in_its_place >= 0) CompareJoin(file, e, in_its_place, comparisons);
  }
  return comparisons;
}
std::string Describe(const SequenceFile& file, const JoinComparison& c) {
  const SequenceEdge<double>& edge = file.graph.edge(c.edge);
  const auto [exit, entry] = DistinctNumbers(c.exit, c.entry);
  const auto primitive = [&](int node) -> const std::string& {
    return file.primitive_names[Index(file.graph.node(node).primitive)];
  };
  const std::string exit_of = c.quantity.ends_with(kAfterHold)
                                  ? std::string("the hold")
                                  : fmt::format("the end of '{}'", primitive(edge.from));
  const std::string entry_of = c.quantity.ends_with(kBeforeHold)
                                   ? std::string("the hold")
                                   : fmt::format("the start of '{}'", primitive(c.to));
  return fmt::format(
      "{} -> {}: {}, {}: {} {} at {} against {} {} at {}: {} {} apart; allowed: {} {}",
      file.graph.node(edge.from).name.view(), file.graph.node(c.to).name.view(),
      c.joint.empty() ? std::string("root") : fmt::format("joint '{}'", c.joint), c.quantity, exit,
      c.unit, exit_of, entry, c.unit, entry_of, MessageNumber(std::abs(c.difference)), c.unit,
      MessageNumber(c.tolerance), c.unit);
}

}  // namespace tumbler
