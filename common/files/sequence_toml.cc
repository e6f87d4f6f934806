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
#include "common/files/primitive_limits.h"
#include "common/files/primitive_rounding.h"

namespace tumbler {

namespace {

using Motion = JointMotion<double>;
using Graph = SequenceGraph<double>;

constexpr FileHeader kHeader{"tumbler-sequence", kSequenceFileVersion,
                             "is '{0}'; a sequence says '{1}'",
                             "is {0}; this program reads versions up to {1}: use a newer program"};
constexpr double kPi = std::numbers::pi;
// Names of quantities that are compared with a hold, rather than with the other primitive, end in
// one of these.
constexpr std::string_view kBeforeHold = " before the hold";
constexpr std::string_view kAfterHold = " after the hold";
constexpr double kMaxSettle = 60;  // [s]; a longer time is a typing error

std::string ReadText(const std::string& path, const FileReader& read) {
  return read ? read(path) : ReadTextFile(path);
}

// ---- Keys ---------------------------------------------------------------------------------------

constexpr std::array kNameKeys = {
    KeyOf<&Graph::name>("name", "").Required(),
    KeyOf<&Graph::end>("end", kRunEndNames,
                       "of a run, where the robot would drop without torque: on to the next safe "
                       "node where there is a way, else as `hold`; its stiffness fades away, with "
                       "drives that carry gains; held until the operator disarms; torque off where "
                       "it is"),
};

constexpr std::array kToleranceKeys = {
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

std::string_view JointName(const SequenceFile& file, std::size_t j) {
  return file.primitives.front().primitive.joints[j].name.view();
}

std::size_t JointOf(const TomlTable& table, std::string_view key, const SequenceFile& file,
                    const std::string& name) {
  std::string names;
  for (std::size_t j = 0; j < file.primitives.front().primitive.motions().size(); ++j) {
    if (JointName(file, j) == name) return j;
    names += (j > 0 ? ", " : "") + std::string(JointName(file, j));
  }
  table.Fail(key,
             fmt::format("'{}' is not a joint of the primitives; their joints: {}", name, names));
}

void ReadPartners(TomlTable& table, std::string_view key, SequenceFile& file) {
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

constexpr std::array kSwapKeys = {
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
constexpr std::array kNodeKeys = {
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

int NodeOf(TomlTable& table, std::string_view key, const SequenceFile& file) {
  const std::string name = table.String(key);
  const int node = file.graph.FindNode(name);
  if (node >= 0) return node;
  std::string names;
  for (const SequenceNode& known : file.graph.nodes())
    names += (names.empty() ? "" : ", ") + std::string(known.name.view());
  table.Fail(key, fmt::format("is '{}', which is no node; allowed: {}", name, names));
}

constexpr std::array kStartKeys = {
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

void ReadBeginnings(TomlTable& table, std::string_view key, SequenceFile& file) {
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

constexpr std::array kBeginKeys = {
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
constexpr std::array<std::string_view, 3> kWhen = {"always", "branch", "cycles-done"};
constexpr std::array kEdgeKeys = {
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

// ---- The file -----------------------------------------------------------------------------------

class SequenceReader {
 public:
  SequenceReader(TomlTable root, const FileReader& read) : root_(std::move(root)), read_(read) {
    file_.path = root_.file();
  }

  SequenceFile Read() {
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
      file_.primitives.push_back(ParsePrimitive(ReadText(path.string(), read_), path.string()));
      file_.primitive_names.push_back(name);
      CheckSameRobot(table, name, named);
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
    if (first.provenance.robot_hash != other.provenance.robot_hash) {
      table.Fail(name, fmt::format("'{}' was made for another robot ({}) than '{}' ({}); make it "
                                   "again with the same URDF",
                                   named, other.provenance.robot_hash,
                                   file_.primitive_names.front(), first.provenance.robot_hash));
    }
  }

  void ReadSwap() {
    Graph& graph = file_.graph;
    for (std::size_t j = 0; j < graph.partner.size(); ++j)
      graph.partner[j] = static_cast<std::uint8_t>(j);
    std::optional<TomlTable> table = root_.OptionalTable("swap");
    if (!table) return;
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

double NearestTurn(double angle_rad) { return std::remainder(angle_rad, 2 * kPi); }

namespace {

/// Compares the end of an edge's first node with the start of a node.
void CompareJoin(const SequenceFile& file, int e, int to,
                 std::vector<JoinComparison>& comparisons) {
  const Graph& graph = file.graph;
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
    const Motion::Spline& left =
        before.primitive.joints[Index(graph.RoleOf(edge.from, j))].position;
    const Motion::Spline& met = after.primitive.joints[Index(graph.RoleOf(to, j))].position;
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
  const Graph& graph = file.graph;
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

SequenceFile ReadSequence(const std::string& path, const FileReader& read) {
  return SequenceReader(TomlTable::Parse(ReadText(path, read), path), read).Read();
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
                "less. It is for tumbler-optimize (--start-from, --guess) and tumbler-chain",
                file.primitive_names[i], at_end ? "ends" : "starts", motion.name.view(),
                MessageNumber(rate), MessageNumber(file.tolerances.joint_velocity_rad_s)));
      }
    }
    if (primitive.entry.root_moves() || primitive.exit.root_moves()) {
      throw FileError(
          file.path, 0, "primitive",
          fmt::format("'{}' {} with its root in motion; allowed here: at rest. It is for "
                      "tumbler-optimize (--start-from, --guess) and tumbler-chain",
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
