#include "offline/problem/self_contact_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {
namespace {

/// Most pairs of own shapes. With more, finding a motion would take too long.
constexpr std::size_t kMostOwnPairs = 1000;

struct SelfContactEntry {
  double clearance_m = SelfContact{}.clearance_m;
  OwnShapes shapes = OwnShapes::kAll;
  /// A shape of the robot, as names see it.
  struct Named {
    std::string name, link;
    int body = 0;
  };
  std::vector<Named> named;
  std::vector<OwnPair> pairs;
};

constexpr std::array<std::string_view, 3> kOwnShapes = {"all", "collision", "none"};

/// The shapes with this name, or all of the link with this name.
std::vector<int> ShapesNamed(TomlTable& table, std::string_view key, const SelfContactEntry& entry,
                             const std::string& name) {
  const std::vector<SelfContactEntry::Named>& all = entry.named;
  std::vector<int> found;
  std::string names;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == name || all[i].link == name) found.push_back(static_cast<int>(i));
    names += (names.empty() ? "" : ", ") + all[i].name;
  }
  if (found.empty()) {
    table.Fail(key,
               fmt::format("names '{}', which is neither a link with shapes nor a shape of the "
                           "robot; its shapes: {}",
                           name, names.empty() ? "none" : names));
  }
  return found;
}

/// Whether the distance of two shapes depends on a joint without a motor: one is on the way from
/// one body to the other.
template <class Robot>
bool DependsOnPassive(const Robot& robot, const OwnPair& pair) {
  int a = robot.own_shapes[Index(pair.a)].body, b = robot.own_shapes[Index(pair.b)].body;
  while (a != b) {  // Parents come before children.
    int& later = a > b ? a : b;
    if (robot.IsPassive(later)) return true;
    later = robot.tree.dofs[Index(later)].parent;
  }
  return false;
}

/// All pairs that a key names, each with the lower index first.
std::vector<OwnPair> ReadPairs(TomlTable& table, std::string_view key,
                               const SelfContactEntry& entry) {
  std::vector<OwnPair> pairs;
  for (const std::vector<std::string>& names : table.StringLists(key)) {
    if (names.size() != 2) {
      table.Fail(key, fmt::format("has an entry of {} names; allowed: two, of links or shapes",
                                  names.size()));
    }
    for (const int a : ShapesNamed(table, key, entry, names[0])) {
      for (const int b : ShapesNamed(table, key, entry, names[1])) {
        if (entry.named[Index(a)].body == entry.named[Index(b)].body) {
          table.Fail(key, fmt::format("names '{}' and '{}', which do not move against each other",
                                      names[0], names[1]));
        }
        pairs.push_back({std::min(a, b), std::max(a, b)});
      }
    }
  }
  return pairs;
}

void LeaveOut(TomlTable& table, std::string_view key, SelfContactEntry& entry) {
  for (const OwnPair& pair : ReadPairs(table, key, entry)) std::erase(entry.pairs, pair);
}

void Add(TomlTable& table, std::string_view key, SelfContactEntry& entry) {
  for (const OwnPair& pair : ReadPairs(table, key, entry)) {
    if (std::ranges::find(entry.pairs, pair) == entry.pairs.end()) entry.pairs.push_back(pair);
  }
}

constexpr std::array kSelfContactKeys = {
    KeyOf<&SelfContactEntry::clearance_m>(
        "clearance_m", {0, 1}, "no two of the robot's own shapes come nearer to each other"),
    KeyOf<&SelfContactEntry::shapes>(
        "shapes", kOwnShapes,
        "which shapes count: `all` that the URDF has, collision and visual (but no meshes), those "
        "of `collision`, or `none`, where links pass beside each other"),
};

// These change the pairs that follow from the keys above.
constexpr std::array kPairKeys = {
    KeyReadBy<SelfContactEntry>("leave_out", LeaveOut,
                                "pairs that may come nearer, by names of links or shapes: "
                                "`[[\"leg1_link\", \"leg2_link/0\"]]`")
        .Schema(
            R"({"type": "array", "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}})")
        .Default("none")
        .Allowed("pairs of names"),
    KeyReadBy<SelfContactEntry>("add", Add,
                                "pairs that are left out by the [rule](method.md#self-contact), "
                                "and are to stay apart all the same")
        .Schema(
            R"({"type": "array", "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}})")
        .Default("none")
        .Allowed("pairs of names"),
};

template <class Space>
void ReadSelfContactOf(TomlTable& root, std::span<const std::vector<double>> q,
                       SceneOf<Space>& scene) {
  SelfContactEntry entry;
  for (const auto& own : scene.robot.own_shapes)
    entry.named.push_back({own.name, own.link, own.body});
  std::optional<TomlTable> table = root.OptionalTable("self_contact");
  if (table) ReadKeys(*table, kSelfContactKeys, entry);
  entry.pairs = SeparatePairs(scene.robot, entry.shapes, entry.clearance_m);
  if (table) ReadKeys(*table, kPairKeys, entry);
  const auto fail = [&](const char* key, const std::string& problem) {
    if (table) table->Fail(key, problem);
    root.Fail(fmt::format("self_contact.{}", key), problem);
  };
  if (entry.pairs.size() > kMostOwnPairs) {
    fail("shapes",
         fmt::format("leaves {} pairs of the robot's own shapes to keep apart; allowed: up "
                     "to {}; take those of \"collision\", or use leave_out",
                     entry.pairs.size(), kMostOwnPairs));
  }
  const auto simulated = std::stable_partition(
      entry.pairs.begin(), entry.pairs.end(),
      [&](const OwnPair& pair) { return !DependsOnPassive(scene.robot, pair); });
  scene.self_contact = {
      entry.clearance_m, {entry.pairs.begin(), simulated}, {simulated, entry.pairs.end()}};
  // Where joints without a motor are at the end, only a simulation says.
  SelfDistancesIn<Space> distances(scene.robot, scene.self_contact.pairs);
  SelfDistancesIn<Space> distances_at_start(scene.robot, scene.self_contact.All());
  for (std::size_t i = 0; i < q.size(); ++i) {
    const SelfClearance nearest = (i == 0 ? distances_at_start : distances).Nearest(q[i]);
    if (nearest.distance_m >= entry.clearance_m) continue;
    fail("clearance_m",
         fmt::format("is {}, but where the motion {}, the robot's own shapes {} are {} m apart; "
                     "allowed: up to what start and end keep; lower it, or use leave_out for pairs "
                     "that pass beside each other or meet by design",
                     MessageNumber(entry.clearance_m), i == 0 ? "starts" : "ends",
                     NameOf(scene.robot, nearest.pair), MessageNumber(nearest.distance_m)));
  }
}

}  // namespace

void ReadSelfContact(TomlTable& root, std::span<const std::vector<double>> q, Scene& scene) {
  ReadSelfContactOf<Plane>(root, q, scene);
}
void ReadSelfContact(TomlTable& root, std::span<const std::vector<double>> q, SpaceScene& scene) {
  ReadSelfContactOf<Spatial>(root, q, scene);
}

KeyTable SelfContactKeyTable() {
  return {"offline/problem/self_contact_toml.cc", "self_contact",
          Joined({RowsOf(kSelfContactKeys), RowsOf(kPairKeys)})};
}

}  // namespace tumbler
