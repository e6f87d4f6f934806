#include "common/files/sequence_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "common/files/primitive_keys.h"
#include "common/files/primitive_limits.h"
#include "common/files/primitive_rounding.h"
#include "common/files/sequence_keys.h"

namespace tumbler {

namespace {

using Motion = JointMotion<double>;
using namespace sequence_keys;

std::string ReadText(const std::string& path, const FileReader& read) {
  return read ? read(path) : ReadTextFile(path);
}

// ---- The file -----------------------------------------------------------------------------------

class SequenceReader {
 public:
  SequenceReader(TomlTable root, const FileReader& read) : root_(std::move(root)), read_(read) {
    file_.path = root_.file();
  }

  SequenceFile Read() {
    if (root_.String("format", "") == kPrimitiveHeader.format) {
      root_.Fail("format",
                 fmt::format("is '{}', which is one motion; a sequence says '{}' and names the "
                             "primitives that it plays. What a motion alone does is shown by "
                             "tumbler run sim and tumbler view",
                             kPrimitiveHeader.format, kHeader.format));
    }
    ReadHeader(root_, kHeader);
    ReadKeys(root_, kNameKeys, file_.graph);
    if (std::optional<TomlTable> table = root_.OptionalTable("tolerances"))
      ReadKeys(*table, kToleranceKeys, file_.tolerances);
    ReadPrimitives();
    ReadSwap();
    ReadNodes();
    ReadAfterFalls();
    ReadEdges();
    ReadKeys(root_, kStartKeys, file_);
    ReadBegin();
    root_.RejectUnknownKeys();
    CheckAfterFalls();
    CheckNodes();
    CheckGraph();
    CheckLimits();
    return std::move(file_);
  }

 private:
  void ReadPrimitives() {
    TomlTable table = root_.Table("primitives");
    const std::vector<std::string> names = table.Keys();
    if (names.empty() || names.size() > Index(kMaxSequencePrimitives)) {
      root_.Fail("primitives", fmt::format("has {} entries; allowed: from 1 ... {}", names.size(),
                                           kMaxSequencePrimitives));
    }
    for (const std::string& name : names) {
      const std::string named = table.String(name);
      const std::filesystem::path path = std::filesystem::path(root_.file()).parent_path() / named;
      std::error_code error;
      if (!read_ && !std::filesystem::exists(path, error)) {
        table.Fail(name, fmt::format("'{}' does not exist (looked for {})", named, path.string()));
      }
      file_.primitives.push_back(ParsePrimitive(TextOf(table, name, path.string()), path.string()));
      file_.primitive_names.push_back(name);
      CheckSameRobot(table, name, named);
    }
  }

  /// The text of a primitive that the file names.
  std::string TextOf(const TomlTable& table, const std::string& name, const std::string& path) {
    try {
      return ReadText(path, read_);
    } catch (const FileError& error) {
      table.Fail(name, fmt::format("cannot be read: {}", error.what()));
    }
  }

  /// Throws unless the newest primitive moves the same joints of the same robot as the first one.
  void CheckSameRobot(const TomlTable& table, const std::string& name, const std::string& named) {
    const PrimitiveFile& first = file_.primitives.front();
    const PrimitiveFile& other = file_.primitives.back();
    const Primitive<double>& a = first.primitive;
    const Primitive<double>& b = other.primitive;
    if (a.joint_count != b.joint_count) {
      table.Fail(name,
                 fmt::format("'{}' moves {} joints, '{}' {}; all primitives of a sequence "
                             "move the same joints",
                             named, b.joint_count, file_.primitive_names.front(), a.joint_count));
    }
    for (std::size_t j = 0; j < b.motions().size(); ++j) {
      if (a.joints[j].name == b.joints[j].name) continue;
      table.Fail(name,
                 fmt::format("joint {} of '{}' is '{}', of '{}' it is '{}'; all primitives of a "
                             "sequence move the same joints, in the same order",
                             j, named, b.joints[j].name.view(), file_.primitive_names.front(),
                             a.joints[j].name.view()));
    }
    if (first.entry.is_in_space() != other.entry.is_in_space()) {
      const auto space = [](const PrimitiveFile& file) {
        return file.entry.is_in_space() ? "in space" : "in the plane";
      };
      table.Fail(name,
                 fmt::format("'{}' is of a robot {}, '{}' of one {}; all primitives of a "
                             "sequence move the robot in the same space",
                             named, space(other), file_.primitive_names.front(), space(first)));
    }
    if (first.provenance.robot_hash != other.provenance.robot_hash) {
      table.Fail(name, fmt::format("'{}' was made for another robot ({}) than '{}' ({}); make it "
                                   "again with the same URDF",
                                   named, other.provenance.robot_hash,
                                   file_.primitive_names.front(), first.provenance.robot_hash));
    }
  }

  void RefuseInSpace(const char* key, const char* what) const {
    if (!file_.primitives.front().entry.is_in_space()) return;
    root_.Fail(key, fmt::format("{}, and is for robots in the plane so far; leave it out", what));
  }

  void ReadSwap() {
    Graph& graph = file_.graph;
    for (std::size_t j = 0; j < graph.partner.size(); ++j)
      graph.partner[j] = static_cast<std::uint8_t>(j);
    std::optional<TomlTable> table = root_.OptionalTable("swap");
    if (!table) return;
    RefuseInSpace("swap", "turns the root by a pitch");
    has_swap_ = true;
    ReadKeys(*table, kSwapKeys, file_);
  }

  void ReadNodes() {
    Graph& graph = file_.graph;
    std::vector<TomlTable> tables = root_.Tables("node");
    if (tables.empty() || tables.size() > Index(kMaxSequenceNodes)) {
      root_.Fail("node", fmt::format("has {} entries; allowed: from 1 ... {}", tables.size(),
                                     kMaxSequenceNodes));
    }
    for (TomlTable& table : tables) {
      NodeEntry node;
      node.exit_pitch_tolerance_rad = file_.tolerances.root_pitch_rad;
      ReadKeys(table, kNodeKeys, node);
      if (graph.FindNode(node.name.view()) >= 0)
        table.Fail("name", fmt::format("'{}' is there twice", node.name.view()));
      const auto& names = file_.primitive_names;
      const auto found = std::find(names.begin(), names.end(), node.primitive_name);
      if (found == names.end()) {
        table.Fail("primitive", fmt::format("is '{}'; allowed: {} (of [primitives])",
                                            node.primitive_name, fmt::join(names, ", ")));
      }
      node.primitive = static_cast<int>(found - names.begin());
      if (node.swapped && !has_swap_) {
        table.Fail("swapped",
                   "is true, but the file does not say which joints are exchanged: "
                   "give it a [swap]");
      }
      file_.exit_pitch_tolerance_rad.push_back(node.exit_pitch_tolerance_rad);
      file_.node_lines.push_back(table.LineOf("name"));
      node_keys_.push_back(table.path());
      after_falls_.push_back(
          {table.Has("after_fall"), node.after_fall_name, table.LineOf("after_fall")});
      graph.node_storage[Index(graph.node_count++)] = node;
    }
  }

  void ReadAfterFalls() {
    Graph& graph = file_.graph;
    for (int i = 0; i < graph.node_count; ++i) {
      const AfterFall& after_fall = after_falls_[Index(i)];
      if (!after_fall.given) continue;
      const int other = graph.FindNode(after_fall.name);
      if (other < 0 || other == i || after_falls_[Index(other)].given) {
        std::string allowed;
        for (int k = 0; k < graph.node_count; ++k) {
          if (k != i && !after_falls_[Index(k)].given)
            allowed += (allowed.empty() ? "" : ", ") + std::string(graph.node(k).name.view());
        }
        FailAfterFall(
            i, fmt::format("is {}; allowed: another node that has none itself: {}",
                           other < 0 ? "no node" : fmt::format("'{}'", after_fall.name), allowed));
      }
      if (!root_.Has("begin")) {
        FailAfterFall(i,
                      "is for robots that get up, and the sequence does not say how they may lie; "
                      "give it a [begin], or leave this out");
      }
      graph.node_storage[Index(i)].after_fall = other;
    }
  }

  /// Throws unless what is played in place of a node leads on like it.
  void CheckAfterFalls() const {
    const Graph& graph = file_.graph;
    for (int i = 0; i < graph.node_count; ++i) {
      const int other = graph.node(i).after_fall;
      if (other < 0) continue;
      CheckBeginsAlike(i, other);
      const SequenceNode &here = graph.node(i), &there = graph.node(other);
      if (here.safe != there.safe || here.ends_cycle != there.ends_cycle) {
        FailAfterFall(i, fmt::format("is '{}', which has another safe or ends_cycle; allowed: the "
                                     "same, as it is played in place of this one",
                                     there.name.view()));
      }
      for (const SequenceEdge<double>& edge : graph.edges()) {
        if (edge.from != i && edge.from != other) continue;
        const int twin = edge.from == i ? other : i;
        const bool matched = std::ranges::any_of(graph.edges(), [&](const auto& e) {
          return e.from == twin && e.when == edge.when && e.branch == edge.branch;
        });
        if (matched) continue;
        FailAfterFall(
            i, fmt::format("is '{}', and of both only '{}' has an edge with when = \"{}\"{}; "
                           "allowed: edges for the same, as it is played in place of this one",
                           there.name.view(), graph.node(edge.from).name.view(),
                           kWhen[static_cast<std::size_t>(edge.when)],
                           edge.when == EdgeCondition::kBranch
                               ? fmt::format(" of the branch '{}'", edge.branch.view())
                               : ""));
      }
    }
  }

  [[noreturn]] void FailAfterFall(int node, const std::string& problem) const {
    throw FileError(file_.path, after_falls_[Index(node)].line,
                    node_keys_[Index(node)] + ".after_fall", problem);
  }

  /// Throws unless a node can be played in place of another.
  void CheckBeginsAlike(int node, int other) const {
    const auto check = [&](const std::string& what, double here, double there, double tolerance,
                           const char* unit) {
      if (std::abs(there - here) <= tolerance) return;
      FailAfterFall(
          node,
          fmt::format("is '{}', which begins with {} {} {} away; allowed: {} {}, as it is "
                      "played in place of this one",
                      file_.graph.node(other).name.view(), what,
                      MessageNumber(std::abs(there - here)), unit, MessageNumber(tolerance), unit));
    };
    for (int j = 0; j < file_.primitives.front().primitive.joint_count; ++j) {
      check(fmt::format("joint '{}'", JointName(file_, Index(j))), FirstPosition(node, j),
            FirstPosition(other, j), file_.tolerances.joint_position_rad, "rad");
    }
    const PrimitivePose& here = file_.PrimitiveOf(node).entry;
    const PrimitivePose& there = file_.PrimitiveOf(other).entry;
    check("the root", here.root_z_m, there.root_z_m, file_.tolerances.root_z_m, "m");
    const double turned_rad = NearestTurn(file_.RobotPitch(other, there.root_pitch_rad) -
                                          file_.RobotPitch(node, here.root_pitch_rad));
    check("the root's pitch", 0, turned_rad, file_.tolerances.root_pitch_rad, "rad");
  }

  void ReadEdges() {
    Graph& graph = file_.graph;
    std::vector<TomlTable> tables = root_.OptionalTables("edge");
    if (tables.size() > Index(kMaxSequenceEdges)) {
      root_.Fail("edge", fmt::format("has {} entries; allowed: at most {}", tables.size(),
                                     kMaxSequenceEdges));
    }
    for (TomlTable& table : tables) {
      EdgeEntry edge;
      edge.file = &file_;
      ReadKeys(table, kEdgeKeys, edge);
      if (edge.settle_s < edge.least_settle_s()) {
        table.Fail("settle_s",
                   fmt::format("is {}; allowed: from {} (the settle time of '{}') ... "
                               "{}",
                               MessageNumber(edge.settle_s), MessageNumber(edge.least_settle_s()),
                               graph.node(edge.from).name.view(), kMaxSettle));
      }
      const std::string_view when = kWhen[static_cast<std::size_t>(edge.when)];
      if (edge.when != EdgeCondition::kBranch && table.Has("branch")) {
        table.Fail("branch", fmt::format("belongs to an edge with when = \"branch\"; this one says "
                                         "\"{}\"",
                                         when));
      }
      for (const SequenceEdge<double>& other : graph.edges()) {
        if (other.from != edge.from || other.when != edge.when || !(other.branch == edge.branch)) {
          continue;
        }
        table.Fail("from",
                   fmt::format("'{}' has two edges for {}: it could not be told which to take",
                               graph.node(edge.from).name.view(),
                               edge.when == EdgeCondition::kBranch
                                   ? fmt::format("the branch '{}'", edge.branch.view())
                                   : fmt::format("when = \"{}\"", when)));
      }
      file_.edge_lines.push_back(table.LineOf("from"));
      graph.edge_storage[Index(graph.edge_count++)] = edge;
    }
  }

  void ReadBegin() {
    std::optional<TomlTable> table = root_.OptionalTable("begin");
    if (!table) return;
    RefuseInSpace("begin", "tells poses apart by a pitch");
    ReadKeys(*table, kBeginKeys, file_);
    Graph& graph = file_.graph;
    graph.beginning_within_rad = file_.begin_within_rad;
    for (int i = 0; i < graph.node_count; ++i) {
      graph.last_pitch_rad[Index(i)] =
          file_.RobotPitch(i, file_.PrimitiveOf(i).exit.root_pitch_rad);
    }
    for (int b = 0; b < graph.beginning_count; ++b) {
      const SequenceBeginning<double>& beginning = graph.beginning_storage[Index(b)];
      const std::string_view name = graph.node(beginning.node).name.view();
      CheckFirstPositions(*table, beginning.node);
      for (int other = 0; other < b; ++other) {
        const SequenceBeginning<double>& before = graph.beginning_storage[Index(other)];
        const double apart_rad = std::abs(NearestTurn(beginning.pitch_rad - before.pitch_rad));
        if (apart_rad > 2 * file_.begin_within_rad) continue;
        table->Fail("nodes",
                    fmt::format("has '{}', which begins {} rad of pitch from '{}': it could not be "
                                "told which to take; allowed: above twice within_rad, {} rad",
                                name, MessageNumber(apart_rad), graph.node(before.node).name.view(),
                                MessageNumber(2 * file_.begin_within_rad)));
      }
    }
  }

  /// Where a joint of the robot begins in a node.
  [[nodiscard]] double FirstPosition(int node, int j) const {
    const Primitive<double>& primitive = file_.PrimitiveOf(node).primitive;
    const Motion& path = primitive.joints[Index(file_.graph.RoleOf(node, j))];
    return path.position.control_points().front();
  }

  /// Throws unless the joints begin in this node where they do in the start node.
  void CheckFirstPositions(const TomlTable& table, int node) const {
    const Graph& graph = file_.graph;
    for (int j = 0; j < file_.primitives.front().primitive.joint_count; ++j) {
      const double here = FirstPosition(node, j), start = FirstPosition(graph.start, j);
      const double tolerance = file_.tolerances.joint_position_rad;
      if (std::abs(here - start) <= tolerance) continue;
      table.Fail("nodes", fmt::format("has '{}', in which joint '{}' begins at {} rad, and in '{}' "
                                      "at {} rad; allowed: {} rad apart",
                                      graph.node(node).name.view(), JointName(file_, Index(j)),
                                      MessageNumber(here), graph.node(graph.start).name.view(),
                                      MessageNumber(start), MessageNumber(tolerance)));
    }
  }

  [[noreturn]] void FailNode(int node, const std::string& problem) const {
    throw FileError(file_.path, file_.node_lines[Index(node)], node_keys_[Index(node)], problem);
  }

  /// The node to which the edge kAlways leads, or -1.
  [[nodiscard]] int Following(int node) const {
    const int edge = NextEdge(file_.graph, node, 0, {});
    return edge < 0 ? -1 : file_.graph.edge(edge).to;
  }

  /// Throws unless every node can be reached, and a stop in any node comes to its end.
  void CheckGraph() const {
    const Graph& graph = file_.graph;
    std::vector<bool> reached(Index(graph.node_count), false);
    std::vector<int> open = {graph.start};
    reached[Index(graph.start)] = true;
    for (const SequenceBeginning<double>& beginning : graph.beginnings()) {
      if (reached[Index(beginning.node)]) continue;
      reached[Index(beginning.node)] = true;
      open.push_back(beginning.node);
    }
    while (!open.empty()) {
      const int node = open.back();
      open.pop_back();
      const auto reach = [&](int next) {
        if (next < 0 || reached[Index(next)]) return;
        reached[Index(next)] = true;
        open.push_back(next);
      };
      reach(graph.node(node).after_fall);
      for (const SequenceEdge<double>& edge : graph.edges())
        if (edge.from == node) reach(edge.to);
    }
    for (int i = 0; i < graph.node_count; ++i) {
      const std::string_view name = graph.node(i).name.view();
      if (!reached[Index(i)]) {
        FailNode(i, fmt::format("no edge leads to '{}' from the start, '{}'", name,
                                graph.node(graph.start).name.view()));
      }
      CheckStop(i, i, 0);
    }
  }

  /// Throws unless a stop comes to its end from a node on, `steps` after it came at node `first`,
  /// whichever nodes are played in place of others.
  void CheckStop(int first, int node, int steps) const {
    const Graph& graph = file_.graph;
    if (graph.node(node).safe) return;
    const int next = Following(node);
    if (next < 0) {
      FailNode(node, fmt::format("'{}' is not safe, but a sequence can end there: give it an "
                                 "edge with when = \"always\", or say safe = true",
                                 graph.node(node).name.view()));
    }
    if (steps >= graph.node_count) {
      FailNode(first, fmt::format("a stop at '{}' never ends: no node that follows by when = "
                                  "\"always\" is safe",
                                  graph.node(first).name.view()));
    }
    CheckStop(first, next, steps + 1);
    const int in_its_place = graph.node(next).after_fall;
    if (in_its_place >= 0) CheckStop(first, in_its_place, steps + 1);
  }

  void CheckNodes() const {
    if (std::any_of(file_.graph.edges().begin(), file_.graph.edges().end(),
                    [](const auto& e) { return e.when == EdgeCondition::kCyclesDone; }) &&
        std::none_of(file_.graph.nodes().begin(), file_.graph.nodes().end(),
                     [](const SequenceNode& node) { return node.ends_cycle; })) {
      root_.Fail("edge", "waits for cycles to be done, but no node says ends_cycle = true");
    }
  }

  /// Throws unless every joint of the robot keeps its own limits on the path that it plays, which
  /// may be another joint's.
  void CheckLimits() const {
    const Graph& graph = file_.graph;
    for (int i = 0; i < graph.node_count; ++i) {
      const PrimitiveFile& file = file_.PrimitiveOf(i);
      for (int j = 0; j < file.primitive.joint_count; ++j) {
        const Motion& path = file.primitive.joints[Index(graph.RoleOf(i, j))];
        CheckPath(i, file.primitive.joints[Index(j)], path);
      }
    }
  }

  void CheckPath(int node, const Motion& joint, const Motion& path) const {
    for (const Bound& bound : BoundsOf(path, joint.limits)) {
      if (bound.Holds()) continue;
      const double excess = std::max(bound.path.max - bound.max, bound.min - bound.path.min);
      FailNode(
          node,
          fmt::format(
              "primitive '{}', joint '{}'{}: {}: {} too much",
              file_.primitive_names[Index(file_.graph.node(node).primitive)], joint.name.view(),
              joint.name == path.name ? "" : fmt::format(" on the path of '{}'", path.name.view()),
              ToText(bound), MessageNumber(excess)));
    }
  }

  TomlTable root_;
  const FileReader& read_;
  SequenceFile file_;
  bool has_swap_ = false;
  std::vector<std::string> node_keys_;
  struct AfterFall {
    bool given = false;
    std::string name;
    std::uint32_t line = 0;
  };
  std::vector<AfterFall> after_falls_;  // of the nodes
};

}  // namespace

std::vector<KeyTable> SequenceKeyTables() {
  const char* const source = "common/files/sequence_toml.cc";
  const KeyRow primitives{"", "`[primitives]`", "required",
                          fmt::format("1 to {}", kMaxSequencePrimitives),
                          "name in this file = primitive file, relative to this one's folder"};
  return {{source, "sequence",
           Joined({{RowOf(kHeader)}, RowsOf(kNameKeys), RowsOf(kStartKeys), {primitives}})},
          {source, "swap", RowsOf(kSwapKeys)},
          {source, "node", RowsOf(kNodeKeys)},
          {source, "edge", RowsOf(kEdgeKeys)},
          {source, "begin", RowsOf(kBeginKeys)},
          {source, "tolerances", RowsOf(kToleranceKeys)}};
}

SequenceFile ReadSequence(const std::string& path, const FileReader& read) {
  return SequenceReader(TomlTable::Parse(ReadText(path, read), path), read).Read();
}

std::string EditNotes(const std::string& path, std::span<const PrimitiveFile> primitives) {
  std::string notes;
  for (const PrimitiveFile& file : primitives) {
    if (file.provenance.edited.empty()) continue;
    notes += fmt::format(
        "{}: warning: primitive '{}' was changed by hand after it was made and verified: {}\n",
        path, file.primitive.name.view(), file.provenance.edited);
  }
  return notes;
}

SequenceFile LoadSequence(const std::string& path, const FileReader& read) {
  SequenceFile file = ReadSequence(path, read);
  for (const JoinComparison& comparison : CompareJoins(file)) {
    if (comparison.fits()) continue;
    throw FileError(path, file.edge_lines[Index(comparison.edge)],
                    fmt::format("edge[{}]", comparison.edge), Describe(file, comparison));
  }
  return file;
}

namespace {

/// Throws unless all primitives start and end at rest, as what plays them needs.
void CheckRests(const SequenceFile& file) {
  for (std::size_t i = 0; i < file.primitives.size(); ++i) {
    const PrimitiveFile& primitive = file.primitives[i];
    for (const Motion& motion : primitive.primitive.motions()) {
      const std::span<const double> rates = motion.position.control_points(1);
      for (const bool at_end : {false, true}) {
        const double rate = at_end ? rates.back() : rates.front();
        if (std::abs(rate) <= file.tolerances.joint_velocity_rad_s) continue;
        throw FileError(
            file.path, 0, "primitive",
            fmt::format(
                "'{}' {} with joint '{}' at {} rad/s; allowed here: at rest, {} rad/s or "
                "less. It is for tumbler optimize (--start-from, --guess) and tumbler chain",
                file.primitive_names[i], at_end ? "ends" : "starts", motion.name.view(),
                MessageNumber(rate), MessageNumber(file.tolerances.joint_velocity_rad_s)));
      }
    }
    if (primitive.entry.root_moves() || primitive.exit.root_moves()) {
      throw FileError(
          file.path, 0, "primitive",
          fmt::format("'{}' {} with its root in motion; allowed here: at rest. It is for "
                      "tumbler optimize (--start-from, --guess) and tumbler chain",
                      file.primitive_names[i], primitive.entry.root_moves() ? "starts" : "ends"));
    }
  }
}

}  // namespace

SequenceFile LoadMotion(const std::string& path, const FileReader& read) {
  const std::string text = ReadText(path, read);
  if (TomlTable::Parse(text, path).String("format", "") == kHeader.format) {
    SequenceFile sequence = LoadSequence(path, read);
    CheckRests(sequence);
    return sequence;
  }
  SequenceFile file;
  file.path = path;
  file.primitives.push_back(ParsePrimitive(text, path));
  file.graph = GraphOf(file.primitives[0].primitive);
  file.primitive_names.emplace_back(file.graph.name.view());
  file.exit_pitch_tolerance_rad.push_back(0.05);
  file.node_lines.push_back(1);
  CheckRests(file);
  return file;
}

std::optional<DriveGains> GainsOf(const SequenceFile& file) {
  if (const auto& gains = file.PrimitiveOf(file.graph.start).drives) return gains;
  for (const PrimitiveFile& primitive : file.primitives) {
    if (primitive.drives) return primitive.drives;
  }
  return {};
}

Sequence<float> ToRuntime(const SequenceFile& file) {
  Sequence<float> sequence;
  const Graph& from = file.graph;
  SequenceGraph<float>& graph = sequence.graph;
  graph.name = from.name;
  graph.start = from.start;
  graph.node_count = from.node_count;
  graph.node_storage = from.node_storage;
  graph.edge_count = from.edge_count;
  graph.partner = from.partner;
  graph.swap_pitch_rad = static_cast<float>(file.swap_root_pitch_rad);
  graph.end = from.end;
  graph.beginning_count = from.beginning_count;
  graph.beginning_within_rad = static_cast<float>(from.beginning_within_rad);
  for (std::size_t b = 0; b < from.beginnings().size(); ++b) {
    graph.beginning_storage[b] = {from.beginnings()[b].node,
                                  static_cast<float>(from.beginnings()[b].pitch_rad)};
  }
  for (std::size_t i = 0; i < from.last_pitch_rad.size(); ++i)
    graph.last_pitch_rad[i] = static_cast<float>(from.last_pitch_rad[i]);
  for (int e = 0; e < from.edge_count; ++e) {
    const SequenceEdge<double>& edge = from.edge(e);
    graph.edge_storage[Index(e)] = {edge.from, edge.to, static_cast<float>(edge.settle_s),
                                    edge.when, edge.branch};
  }
  sequence.primitive_count = static_cast<int>(file.primitives.size());
  for (std::size_t i = 0; i < file.primitives.size(); ++i) {
    try {
      sequence.primitives[i] = ToRuntime(file.primitives[i].primitive);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(
          fmt::format("primitive '{}': {}", file.primitive_names[i], error.what()));
    }
  }
  return sequence;
}

}  // namespace tumbler
