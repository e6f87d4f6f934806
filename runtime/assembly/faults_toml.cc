#include "runtime/assembly/faults_toml.h"

#include <fmt/format.h>

#include <array>
#include <optional>
#include <vector>

#include "common/toml_reader.h"

namespace tumbler {

namespace {

constexpr std::int64_t kFaultsFileVersion = 1;
constexpr std::int64_t kMostTicks = 1'000'000;

Reaction ReadReaction(TomlTable& table, std::string_view key) {
  static constexpr auto kNames = [] {
    std::array<std::string_view, kReactionCount> names;
    for (std::size_t i = 0; i < kReactionCount; ++i) names[i] = kReactionTable[i].name;
    return names;
  }();
  const std::string name = table.Choice(key, kNames, "");
  for (const ReactionInfo& info : kReactionTable) {
    if (name == info.name) return info.reaction;
  }
  return Reaction::kIgnore;  // Not reached: Choice takes no other.
}

void SetOne(TomlTable& table, std::string_view key, Fault fault, ExecutorState state,
            Reaction reaction, FaultTable& reactions) {
  if (reactions.Set(fault, state, reaction)) return;
  table.Fail(key, reaction == Reaction::kIgnore
                      ? std::string("is ignore; a stop of the operator is never ignored")
                      : fmt::format("is {}; while {} allowed: ignore, disable", ToString(reaction),
                                    ToString(state)));
}

/// `fault = "damp"` for all states, or `fault = { running = "damp" }`.
void ReadRow(TomlTable& table, const FaultInfo& info, FaultTable& reactions) {
  const std::string key = FaultsKey(info.name);
  if (!table.Has(key)) return;
  if (!table.IsTable(key)) {
    const Reaction reaction = ReadReaction(table, key);
    for (const StateInfo& state : kStateTable) {
      if (state.state == ExecutorState::kDisarmed) continue;
      // While arming nothing is driven yet: whatever is to be done then is torque off.
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

CollapseConfig ReadCollapse(TomlTable& table, std::span<const FaultsJoint> joints,
                            CollapseConfig collapse) {
  collapse.stiffness = static_cast<float>(
      table.Number("stiffness", {0.01, 1, false}, static_cast<double>(collapse.stiffness)));
  TomlTable pose = table.Table("position_rad");
  for (std::size_t i = 0; i < joints.size(); ++i) {
    collapse.position_rad[i] = static_cast<float>(pose.Number(
        joints[i].name, {joints[i].position_min_rad, joints[i].position_max_rad, false}));
  }
  collapse.configured = true;
  return collapse;
}

void Read(TomlTable& file, std::span<const FaultsJoint> joints, ExecutorConfig& config) {
  ExecutorConfig read = config;
  const std::string format = file.String("format");
  if (format != "tumbler-faults") {
    file.Fail("format", fmt::format("is '{}'; allowed: tumbler-faults", format));
  }
  file.Integer("version", kFaultsFileVersion, kFaultsFileVersion);
  if (auto limits = file.OptionalTable("limits")) {
    const auto read_limit = [&limits](const char* key, std::int64_t min, std::int64_t max,
                                      int& value) {
      value = static_cast<int>(limits->Integer(key, min, max, value));
    };
    read_limit("stale_ticks_max", 1, 1000, read.stale_ticks_max);
    read_limit("sequence_errors_max", 1, 1000, read.sequence_errors_max);
    read_limit("late_ticks_max", 0, 1000, read.late_ticks_max);
    read_limit("arming_ticks_max", 1, kMostTicks, read.arming_ticks_max);
  }
  if (auto collapse = file.OptionalTable("collapse")) {
    read.collapse = ReadCollapse(*collapse, joints, read.collapse);
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
