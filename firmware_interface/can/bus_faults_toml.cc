#include "firmware_interface/can/bus_faults_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "common/toml_reader.h"

namespace tumbler {

namespace {

constexpr std::int64_t kBusFaultsFileVersion = 1;
constexpr double kLongest_s = 1e6;
constexpr double kLongestDelay_s = 10;

constexpr std::array<std::string_view, 11> kKinds = {
    "loss",  "duplicate",  "delay", "reorder",   "flip",     "bit-errors",
    "short", "disconnect", "stall", "link-down", "link-gone"};

std::int64_t Nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

BusFault ReadFault(TomlTable& table, std::span<const std::string> nodes) {
  BusFault fault;
  const std::string kind = table.String("kind");
  const auto found = std::ranges::find(kKinds, kind);
  if (found == kKinds.end()) {
    table.Fail("kind", fmt::format("is '{}'; allowed: {}", kind, fmt::join(kKinds, ", ")));
  }
  fault.kind = static_cast<BusFaultKind>(found - kKinds.begin());
  fault.start_ns = Nanoseconds(table.Number("start_s", {0, kLongest_s, false}, 0));
  if (table.Has("duration_s")) {
    fault.end_ns = fault.start_ns + Nanoseconds(table.Number("duration_s", {0, kLongest_s, true}));
  }
  const bool on_the_wire =
      fault.kind == BusFaultKind::kShort || fault.kind == BusFaultKind::kBitErrors;
  const bool of_an_interface =
      fault.kind == BusFaultKind::kLinkDown || fault.kind == BusFaultKind::kLinkGone ||
      fault.kind == BusFaultKind::kStall || fault.kind == BusFaultKind::kDisconnect;
  if (!on_the_wire && (of_an_interface || table.Has("node"))) {
    const std::string name = table.String("node");
    const auto node = std::ranges::find(nodes, name);
    if (node == nodes.end()) {
      table.Fail("node", fmt::format("is '{}'; allowed: {}", name, fmt::join(nodes, ", ")));
    }
    fault.node = static_cast<int>(node - nodes.begin());
  }
  const bool of_frames = fault.kind <= BusFaultKind::kBitErrors;
  if (of_frames && table.Has("ids")) {
    for (const double id : table.Numbers("ids", {0, 0x1fff'ffff, false})) {
      if (id != std::floor(id)) {
        table.Fail("ids", fmt::format("holds {}; identifiers are whole numbers", id));
      }
      fault.ids.push_back(static_cast<std::uint32_t>(id));
    }
    if (fault.ids.empty()) table.Fail("ids", "is empty; leave it out for all frames");
  }
  if (fault.kind == BusFaultKind::kBitErrors) {
    fault.probability = table.Number("rate", {0, 1, false});
  } else if (of_frames) {
    fault.probability = table.Number("probability", {0, 1, false}, 1);
  }
  if (fault.kind == BusFaultKind::kDelay) {
    fault.delay_ns = Nanoseconds(table.Number("delay_s", {0, kLongestDelay_s, true}));
  }
  if (fault.kind == BusFaultKind::kReorder) {
    fault.delay_ns = Nanoseconds(table.Number("delay_s", {0, kLongestDelay_s, true}, 0.01));
  }
  return fault;
}

BusFaultPlan Read(TomlTable& file, std::span<const std::string> nodes) {
  const std::string format = file.String("format");
  if (format != "tumbler-bus-faults") {
    file.Fail("format", fmt::format("is '{}'; allowed: tumbler-bus-faults", format));
  }
  file.Integer("version", kBusFaultsFileVersion, kBusFaultsFileVersion);
  BusFaultPlan plan;
  plan.seed = static_cast<std::uint64_t>(file.Integer("seed", 0, INT64_MAX, 1));
  for (TomlTable& table : file.Tables("fault")) plan.faults.push_back(ReadFault(table, nodes));
  file.RejectUnknownKeys();
  return plan;
}

}  // namespace

BusFaultPlan LoadBusFaults(const std::string& path, std::span<const std::string> nodes) {
  TomlTable file = TomlTable::ParseFile(path);
  return Read(file, nodes);
}

BusFaultPlan ParseBusFaults(std::string_view text, const std::string& name,
                            std::span<const std::string> nodes) {
  TomlTable file = TomlTable::Parse(text, name);
  return Read(file, nodes);
}

}  // namespace tumbler
