#include "firmware_interface/can/bus_faults_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/files/file_keys.h"

namespace tumbler {

namespace {

constexpr FileHeader kBusFaultsHeader{"tumbler-bus-faults", 1};

/// The name of a BusFaultKind in files, and what happens.
struct KindName {
  std::string_view name;
  const char* meaning;
};
constexpr std::array<KindName, 11> kKinds = {{
    {"loss", "an acknowledged frame is missed by the receiver"},
    {"duplicate", "is received twice"},
    {"delay", "is received later; the order is kept"},
    {"reorder", "is received after the one that follows it"},
    {"flip", "one bit of the payload is inverted, unseen by the CRC"},
    {"bit-errors",
     "bits are disturbed on the wire: error frames, frames sent again, error counters"},
    {"short", "nothing gets through; who tries goes bus-off"},
    {"disconnect", "the node is off the wire: it hears nobody, and nobody acknowledges its frames"},
    {"stall", "the node's frames do not leave its queue, which fills up (ENOBUFS)"},
    {"link-down", "the node's interface is down"},
    {"link-gone", "the node's interface does not exist any more"},
}};

constexpr std::array kPlanKeys = {
    KeyOf<&BusFaultPlan::seed>("seed", Range::NonNegative(),
                               "what probabilities leave open, the same on every machine"),
};

/// A table `[[fault]]`, with the nodes that it may name.
struct FaultEntry : BusFault {
  std::span<const std::string> nodes;
  std::optional<double> duration_s;
};

bool IsOfFrames(const FaultEntry& fault) { return fault.kind <= BusFaultKind::kBitErrors; }
bool IsOnTheWire(const FaultEntry& fault) {
  return fault.kind == BusFaultKind::kShort || fault.kind == BusFaultKind::kBitErrors;
}
bool IsOfAnInterface(const FaultEntry& fault) { return fault.kind >= BusFaultKind::kDisconnect; }

void ReadKind(TomlTable& table, std::string_view key, FaultEntry& fault) {
  const std::string name = table.String(key);
  const auto found = std::ranges::find(kKinds, name, &KindName::name);
  if (found == kKinds.end()) {
    std::array<std::string_view, kKinds.size()> names;
    std::ranges::transform(kKinds, names.begin(), &KindName::name);
    table.Fail(key, fmt::format("is '{}'; allowed: {}", name, fmt::join(names, ", ")));
  }
  fault.kind = static_cast<BusFaultKind>(found - kKinds.begin());
}

void ReadNode(TomlTable& table, std::string_view key, FaultEntry& fault) {
  const std::string name = table.String(key);
  const auto node = std::ranges::find(fault.nodes, name);
  if (node == fault.nodes.end())
    table.Fail(key, fmt::format("is '{}'; allowed: {}", name, fmt::join(fault.nodes, ", ")));
  fault.node = static_cast<int>(node - fault.nodes.begin());
}

void ReadIds(TomlTable& table, std::string_view key, FaultEntry& fault) {
  for (const double id : table.Numbers(key, {0, 0x1fff'ffff})) {
    if (id != std::floor(id))
      table.Fail(key, fmt::format("holds {}; identifiers are whole numbers", id));
    fault.ids.push_back(static_cast<std::uint32_t>(id));
  }
  if (fault.ids.empty()) table.Fail(key, "is empty; leave it out for all frames");
}

constexpr Range kDelay_s{0, 10, true};
constexpr const char* kNode = "`\"host\"`, a joint or, where there is one, `\"sensor\"`";
constexpr std::array kFaultKeys = {
    KeyReadBy<FaultEntry>("kind", ReadKind, "").Required().Allowed("see below"),
    SecondsOf<&BusFault::start_ns, FaultEntry>("start_s", {0, 1e6}, "simulated time"),
    KeyOf<&FaultEntry::duration_s>("duration_s", {0, 1e6, true}, "likewise").Default("to the end"),
    KeyReadBy<FaultEntry>("node", ReadNode, "of `loss` to `flip`, the receiver")
        .Default("every one")
        .Allowed(kNode)
        .Where([](const FaultEntry& fault) { return IsOfFrames(fault) && !IsOnTheWire(fault); }),
    KeyReadBy<FaultEntry>("node", ReadNode, "from `disconnect` on")
        .Required()
        .Allowed(kNode)
        .Where(IsOfAnInterface),
    KeyReadBy<FaultEntry>("ids", ReadIds,
                          "frames with these identifiers; of `loss` to `bit-errors`")
        .Default("all")
        .Allowed("0 to 0x1fffffff")
        .Where(IsOfFrames),
    KeyOf<&BusFault::probability, FaultEntry>("probability", {0, 1},
                                              "of each frame; of `loss` to `flip`")
        .Where([](const FaultEntry& fault) { return IsOfFrames(fault) && !IsOnTheWire(fault); }),
    KeyOf<&BusFault::probability, FaultEntry>("rate", {0, 1}, "of each bit; of `bit-errors`")
        .Required()
        .Where([](const FaultEntry& fault) { return fault.kind == BusFaultKind::kBitErrors; }),
    SecondsOf<&BusFault::delay_ns, FaultEntry>("delay_s", kDelay_s, "of `delay`")
        .Required()
        .Where([](const FaultEntry& fault) { return fault.kind == BusFaultKind::kDelay; }),
    SecondsOf<&BusFault::delay_ns, FaultEntry>("delay_s", kDelay_s, "of `reorder`, the longest")
        .Default("0.01", [](FaultEntry& fault) { fault.delay_ns = 10'000'000; })
        .Where([](const FaultEntry& fault) { return fault.kind == BusFaultKind::kReorder; }),
};

BusFaultPlan Read(TomlTable& file, std::span<const std::string> nodes) {
  ReadHeader(file, kBusFaultsHeader);
  BusFaultPlan plan;
  ReadKeys(file, kPlanKeys, plan);
  for (TomlTable& table : file.Tables("fault")) {
    FaultEntry fault;
    fault.nodes = nodes;
    ReadKeys(table, kFaultKeys, fault);
    if (fault.duration_s) fault.end_ns = fault.start_ns + std::llround(1e9 * *fault.duration_s);
    plan.faults.push_back(fault);
  }
  file.RejectUnknownKeys();
  return plan;
}

}  // namespace

std::vector<KeyTable> BusFaultsKeyTables() {
  const char* const source = "firmware_interface/can/bus_faults_toml.cc";
  std::vector<KeyRow> kinds;
  kinds.reserve(kKinds.size());
  for (const KindName& kind : kKinds)
    kinds.push_back({"", fmt::format("`{}`", kind.name), "", "", kind.meaning});
  return {{source, "bus faults", Joined({{RowOf(kBusFaultsHeader)}, RowsOf(kPlanKeys)})},
          {source, "fault", RowsOf(kFaultKeys)},
          {source, "kinds", kinds, {"kind", "", "", "what happens"}}};
}

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
