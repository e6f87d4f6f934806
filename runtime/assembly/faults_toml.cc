#include "runtime/assembly/faults_toml.h"

#include <fmt/format.h>

#include <array>
#include <optional>

#include "common/files/file_keys.h"

namespace tumbler {

namespace {

constexpr FileHeader kHeader{"tumbler-faults", 1};

constexpr std::array kLimitKeys = {
    KeyOf<&ExecutorConfig::stale_ticks_max>(
        "stale_ticks_max", {1, 1000},
        "ticks without a reply; by default also 10 ms, where that is longer"),
    KeyOf<&ExecutorConfig::sequence_errors_max>(
        "sequence_errors_max", {1, 1000}, "count of [replies out of order](runtime.md#faults)"),
    KeyOf<&ExecutorConfig::late_ticks_max>("late_ticks_max", {0, 1000},
                                           "missed periods that are made up for"),
    KeyOf<&ExecutorConfig::arming_ticks_max>("arming_ticks_max", {1, 1'000'000},
                                             "ticks until every drive is enabled")
        .Default("0.5 s"),
};

/// The table `[collapse]`, with the joints that it has to name.
struct CollapseEntry : CollapseConfig {
  std::span<const FaultsJoint> joints;
};

void ReadPose(TomlTable& table, std::string_view key, CollapseEntry& collapse) {
  TomlTable pose = table.Table(key);
  for (std::size_t i = 0; i < collapse.joints.size(); ++i) {
    const FaultsJoint& joint = collapse.joints[i];
    collapse.position_rad[i] = static_cast<float>(
        pose.Number(joint.name, {joint.position_min_rad, joint.position_max_rad, false}));
  }
}

constexpr std::array kCollapseKeys = {
    KeyOf<&CollapseConfig::stiffness, CollapseEntry>("stiffness", {0.01, 1}, "share of kp"),
    KeyReadBy<CollapseEntry>("position_rad", ReadPose, "table of joint and position, of all joints")
        .Required()
        .Allowed("inside the limits of every primitive"),
};

/// The reactions that a file can ask for; the others only come of `abort`.
constexpr auto kNames = [] {
  std::array<std::string_view, kReactionCount - 2> names;
  std::size_t count = 0;
  for (const ReactionInfo& info : kReactionTable) {
    if (info.reaction != Reaction::kRollOut && info.reaction != Reaction::kFold)
      names[count++] = info.name;
  }
  return names;
}();

Reaction ReadReaction(TomlTable& table, std::string_view key) {
  const std::string name = table.Choice(key, kNames, "");
  for (const ReactionInfo& info : kReactionTable) {
    if (name == info.name) return info.reaction;
  }
  return Reaction::kIgnore;  // This is never reached, since Choice takes no other name.
}

void SetOne(TomlTable& table, std::string_view key, Fault fault, ExecutorState state,
            Reaction reaction, FaultTable& reactions) {
  if (reactions.Set(fault, state, reaction)) return;
  if (fault == Fault::kPaused) {
    table.Fail(key, fmt::format("is {}; after a pause only disable is allowed: drives have let go",
                                ToString(reaction)));
  }
  if (reaction == Reaction::kAbort)
    table.Fail(key, "is abort; that is for the state running alone: { running = \"abort\" }");
  table.Fail(key, reaction == Reaction::kIgnore
                      ? std::string("is ignore; a stop of the operator is never ignored")
                      : fmt::format("is {}; while {} allowed: ignore, disable", ToString(reaction),
                                    ToString(state)));
}

/// Reads `fault = "damp"`, which is for all states, or `fault = { running = "damp" }`.
void ReadRow(TomlTable& table, const FaultInfo& info, FaultTable& reactions) {
  const std::string key = FaultsKey(info.name);
  if (!table.Has(key)) return;
  if (!table.IsTable(key)) {
    const Reaction reaction = ReadReaction(table, key);
    for (const StateInfo& state : kStateTable) {
      if (state.state == ExecutorState::kDisarmed) continue;
      // While arming nothing is driven yet, so every reaction is torque off there.
      const bool arming = state.state == ExecutorState::kArming && reaction != Reaction::kIgnore;
      SetOne(table, key, info.fault, state.state, arming ? Reaction::kDisable : reaction,
             reactions);
    }
    return;
  }
  TomlTable row = table.Table(key);
  for (const StateInfo& state : kStateTable) {
    const std::string name = FaultsKey(state.name);
    if (state.state == ExecutorState::kDisarmed || !row.Has(name)) continue;
    SetOne(row, name, info.fault, state.state, ReadReaction(row, name), reactions);
  }
}

void Read(TomlTable& file, std::span<const FaultsJoint> joints, ExecutorConfig& config) {
  ExecutorConfig read = config;
  ReadHeader(file, kHeader);
  if (auto limits = file.OptionalTable("limits")) ReadKeys(*limits, kLimitKeys, read);
  if (auto table = file.OptionalTable("collapse")) {
    CollapseEntry collapse{read.collapse, joints};
    ReadKeys(*table, kCollapseKeys, collapse);
    read.collapse = collapse;
    read.collapse.configured = true;
  }
  if (auto reactions = file.OptionalTable("reactions")) {
    for (const FaultInfo& info : kFaultTable) {
      if (info.fault != Fault::kNone) ReadRow(*reactions, info, read.reactions);
    }
    if (read.reactions.Has(Reaction::kCollapse) && !read.collapse.configured) {
      file.Fail("reactions", "asks for collapse, which needs the table [collapse] with a pose");
    }
  }
  file.RejectUnknownKeys();
  config = read;
}

}  // namespace

std::string FaultsKey(std::string_view name) {
  std::string key(name);
  for (char& c : key) {
    if (c == ' ' || c == '-') c = '_';
  }
  return key;
}

std::vector<KeyTable> FaultsKeyTables() {
  std::string reactions;
  for (const std::string_view name : kNames) reactions += fmt::format("`\"{}\"`, ", name);
  const KeyRow reaction{"`[reactions]`", "FAULT", "see there",
                        reactions + "or a table of state and reaction",
                        "a reaction alone holds in every state"};
  return {{"runtime/assembly/faults_toml.cc", "faults",
           Joined({{RowOf(kHeader)},
                   RowsOf(kLimitKeys, "`[limits]`"),
                   RowsOf(kCollapseKeys, "`[collapse]`"),
                   {reaction}})}};
}

void LoadFaults(const std::string& path, std::span<const FaultsJoint> joints,
                ExecutorConfig& config) {
  TomlTable file = TomlTable::ParseFile(path);
  Read(file, joints, config);
}

void ParseFaults(std::string_view text, const std::string& name,
                 std::span<const FaultsJoint> joints, ExecutorConfig& config) {
  TomlTable file = TomlTable::Parse(text, name);
  Read(file, joints, config);
}

}  // namespace tumbler
