#pragma once

// The keys of a sequence's file (common/files/sequence_toml.h).

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "common/files/sequence_toml.h"

namespace tumbler::sequence_keys {

using Graph = SequenceGraph<double>;

inline constexpr FileHeader kHeader{
    "tumbler-sequence", kSequenceFileVersion, "is '{0}'; a sequence says '{1}'",
    "is {0}; this program reads versions up to {1}: use a newer program"};
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kMaxSettle = 60;  // [s]; a longer time is a typing error

inline constexpr std::array kNameKeys = {
    KeyOf<&Graph::name>("name", "").Required(),
    KeyOf<&Graph::end>("end", kRunEndNames,
                       "of a run, where the robot would drop without torque: on to the next safe "
                       "node where there is a way, else as `hold`; its stiffness fades away, with "
                       "drives that carry gains; held until the operator disarms; torque off where "
                       "it is"),
};

inline constexpr std::array kToleranceKeys = {
    // The setpoint may jump by as much as these tolerances allow.
    KeyOf<&JoinTolerances::joint_position_rad>("joint_position_rad", {0, 0.01},
                                               "of the setpoints, by the coefficients"),
    KeyOf<&JoinTolerances::joint_velocity_rad_s>("joint_velocity_rad_s", {0, 0.1}, "likewise"),
    KeyOf<&JoinTolerances::joint_acceleration_rad_s2>("joint_acceleration_rad_s2", {0, 10},
                                                      "likewise"),
    KeyOf<&JoinTolerances::root_z_m>("root_z_m", {0, 1, true},
                                     "of the robot: the simulated exit of one primitive against "
                                     "the entry that the next was made for"),
    KeyOf<&JoinTolerances::root_pitch_rad>("root_pitch_rad", {0, kPi / 2, true},
                                           "likewise, after the swap and less whole turns")
        .Allowed("above 0, to pi/2"),
    KeyOf<&JoinTolerances::root_m_s>("root_m_s", {0, 10, true},
                                     "of the root's velocity along x and z, likewise, where it "
                                     "moves at the exit or at the entry"),
    KeyOf<&JoinTolerances::root_rad_s>("root_rad_s", {0, 10, true}, "of its pitch rate, likewise"),
    KeyOf<&JoinTolerances::passive_position_rad>("passive_position_rad", {0, 1, true},
                                                 "of joints without a motor, likewise"),
};

inline std::string_view JointName(const SequenceFile& file, std::size_t j) {
  return file.primitives.front().primitive.joints[j].name.view();
}

inline std::size_t JointOf(const TomlTable& table, std::string_view key, const SequenceFile& file,
                           const std::string& name) {
  std::string names;
  for (std::size_t j = 0; j < file.primitives.front().primitive.motions().size(); ++j) {
    if (JointName(file, j) == name) return j;
    names += (j > 0 ? ", " : "") + std::string(JointName(file, j));
  }
  table.Fail(key,
             fmt::format("'{}' is not a joint of the primitives; their joints: {}", name, names));
}

inline void ReadPartners(TomlTable& table, std::string_view key, SequenceFile& file) {
  auto& partner = file.graph.partner;
  for (const std::vector<std::string>& pair : table.StringLists(key)) {
    if (pair.size() != 2) {
      table.Fail(key,
                 fmt::format("has an entry of {} names; expected pairs of joints", pair.size()));
    }
    const std::size_t a = JointOf(table, key, file, pair[0]);
    const std::size_t b = JointOf(table, key, file, pair[1]);
    if (a == b) table.Fail(key, fmt::format("exchanges '{}' with itself", pair[0]));
    for (const std::size_t j : {a, b}) {
      if (partner[j] == j) continue;
      table.Fail(key, fmt::format("names '{}' twice; a joint has one partner", JointName(file, j)));
    }
    partner[a] = static_cast<std::uint8_t>(b);
    partner[b] = static_cast<std::uint8_t>(a);
  }
}

inline constexpr std::array kSwapKeys = {
    KeyReadBy<SequenceFile>("joints", ReadPartners,
                            "e.g. `[[\"leg1\", \"leg2\"]]`; joints not named keep their role")
        .Schema(
            R"({"type": "array", "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}})")
        .Required()
        .Allowed("pairs of joints, each joint once"),
    KeyOf<&SequenceFile::swap_root_pitch_rad>("root_pitch_rad", {-2 * kPi, 2 * kPi},
                                              "how far the root is turned in a swapped node")
        .Required()
        .Allowed("-2 pi to 2 pi"),
};

struct NodeEntry : SequenceNode {
  std::string primitive_name;
  std::string after_fall_name;
  double exit_pitch_tolerance_rad = 0;
};
inline constexpr std::array kNodeKeys = {
    KeyOf<&NodeEntry::name, NodeEntry>("name", "").Required().Allowed("1 to 48 bytes, unique"),
    KeyOf<&NodeEntry::primitive_name>("primitive", "")
        .Required()
        .Allowed("a name of `[primitives]`"),
    KeyOf<&NodeEntry::swapped, NodeEntry>("swapped", "with the joints' roles exchanged"),
    KeyOf<&NodeEntry::safe, NodeEntry>(
        "safe", "the robot can stay where this ends without torque: a run may end here"),
    KeyOf<&NodeEntry::ends_cycle, NodeEntry>("ends_cycle", "a cycle is complete with this"),
    KeyOf<&NodeEntry::after_fall_name>(
        "after_fall",
        "the node that is played in place of this one once the robot has fallen in this one and "
        "got up, until it falls in that one")
        .Default("none: the same is tried again")
        .Allowed("another node, which begins and leads on like this one and has none itself"),
    KeyOf<&NodeEntry::exit_pitch_tolerance_rad>(
        "exit_pitch_tolerance_rad", {0, kPi, true},
        "how far from its recorded exit the root may end in a simulation")
        .Default("`tolerances.root_pitch_rad`")
        .Allowed("above 0, to pi"),
};

inline int NodeOf(TomlTable& table, std::string_view key, const SequenceFile& file) {
  const std::string name = table.String(key);
  const int node = file.graph.FindNode(name);
  if (node >= 0) return node;
  std::string names;
  for (const SequenceNode& known : file.graph.nodes())
    names += (names.empty() ? "" : ", ") + std::string(known.name.view());
  table.Fail(key, fmt::format("is '{}', which is no node; allowed: {}", name, names));
}

inline constexpr std::array kStartKeys = {
    KeyReadBy<SequenceFile>(
        "start",
        [](TomlTable& table, std::string_view key, SequenceFile& file) {
          file.graph.start = NodeOf(table, key, file);
        },
        "the first one")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("a node"),
};

inline void ReadBeginnings(TomlTable& table, std::string_view key, SequenceFile& file) {
  Graph& graph = file.graph;
  const auto add = [&](int node) {
    const double pitch_rad = file.RobotPitch(node, file.PrimitiveOf(node).entry.root_pitch_rad);
    graph.beginning_storage[Index(graph.beginning_count++)] = {node, pitch_rad};
  };
  add(graph.start);
  for (const std::string& name : table.Strings(key)) {
    const int node = graph.FindNode(name);
    if (node < 0) table.Fail(key, fmt::format("has '{}', which is no node", name));
    if (graph.MayBegin(node))
      table.Fail(key, fmt::format("has '{}' twice, or it is `start`, which is always one", name));
    add(node);
  }
}

inline constexpr std::array kBeginKeys = {
    KeyReadBy<SequenceFile>("nodes", ReadBeginnings,
                            "with which a run may begin besides `start`: the robot lies as at "
                            "their start")
        .Schema(R"({"type": "array", "items": {"type": "string"}})")
        .Required()
        .Allowed("nodes whose joints begin where those of `start` do"),
    KeyOf<&SequenceFile::begin_link>("link", "the root link, which has the sensor if there is one")
        .Required()
        .Allowed("a link of the robot"),
    KeyOf<&SequenceFile::begin_within_rad>(
        "within_rad", {0, kPi / 2, true},
        "how far the measured pitch may be from that of a node, at its beginning and at its "
        "end")
        .Allowed("above 0, to pi/2"),
};

struct EdgeEntry : SequenceEdge<double> {
  const SequenceFile* file = nullptr;  // has the nodes

  /// The settle time of the primitive that `from` plays: the least that an edge may have.
  [[nodiscard]] double least_settle_s() const { return file->PrimitiveOf(from).primitive.settle_s; }
};
inline constexpr std::array<std::string_view, 3> kWhen = {"always", "branch", "cycles-done"};
inline constexpr std::array kEdgeKeys = {
    KeyReadBy<EdgeEntry>(
        "from",
        [](TomlTable& table, std::string_view key, EdgeEntry& edge) {
          edge.from = NodeOf(table, key, *edge.file);
        },
        "")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("a node"),
    KeyReadBy<EdgeEntry>(
        "to",
        [](TomlTable& table, std::string_view key, EdgeEntry& edge) {
          edge.to = NodeOf(table, key, *edge.file);
        },
        "")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("a node"),
    KeyOf<&EdgeEntry::settle_s, EdgeEntry>("settle_s", {0, kMaxSettle},
                                           "how long the last setpoint is held in between")
        .Default("the primitive's of `from`",
                 [](EdgeEntry& edge) { edge.settle_s = edge.least_settle_s(); })
        .Allowed("from that to 60"),
    KeyOf<&EdgeEntry::when, EdgeEntry>(
        "when", kWhen,
        "when nothing else applies; when the operator asks for the branch; when as many cycles as "
        "were asked for are complete"),
    KeyOf<&EdgeEntry::branch, EdgeEntry>("branch", "its name")
        .Required()
        .Default("required for a branch")
        .Where([](const EdgeEntry& edge) { return edge.when == EdgeCondition::kBranch; }),
};

}  // namespace tumbler::sequence_keys
