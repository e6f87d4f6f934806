#include "runtime/record/replay.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <memory>
#include <string_view>
#include <type_traits>

#include "runtime/record/recorded_assembly.h"

namespace tumbler {
namespace {

/// The bits of a value. By them a NaN equals itself, and zero differs from minus zero.
template <typename T>
std::uint64_t BitsOf(T value) {
  if constexpr (std::is_same_v<T, float>) {
    return std::bit_cast<std::uint32_t>(value);
  } else {
    return static_cast<std::uint64_t>(value);
  }
}

template <typename T>
std::string ToText(T value) {
  if constexpr (std::is_same_v<T, float>) {
    return fmt::format("{} ({:08x})", value, std::bit_cast<std::uint32_t>(value));
  } else if constexpr (std::is_same_v<T, DriveState>) {
    return fmt::format("{}", static_cast<int>(value));
  } else if constexpr (std::is_enum_v<T>) {
    return ToString(value);
  } else if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else {
    return fmt::format("{}", +value);
  }
}

/// The bits of all fields of a record, in their order.
struct FieldBits {
  std::array<std::uint64_t, 32> bits{};
  std::size_t count = 0;
};

template <typename Record>
FieldBits BitsOfFields(const Record& record) {
  FieldBits fields;
  VisitFields(record, [&fields](const char* /*name*/, const auto& field) {
    fields.bits.at(fields.count++) = BitsOf(field);
  });
  return fields;
}

enum class Fields { kMeasured, kAll };

/// Whether this is a field of a joint's record that comes from its drive.
bool IsFromDrive(std::string_view name) {
  bool from_drive = false;
  ForEachJointField([&](const JointField& field, auto /*in_record*/, auto /*in_message*/) {
    if (field.name == name) from_drive = field.origin == JointField::Origin::kDrive;
  });
  return from_drive;
}

template <typename Record>
std::string TextOfField(const Record& record, std::size_t wanted, std::string& name) {
  std::string text;
  std::size_t i = 0;
  VisitFields(record, [&](const char* field_name, const auto& field) {
    if (i++ != wanted) return;
    name = field_name;
    text = ToText(field);
    const bool detail = name.ends_with(".value") || name.ends_with(".limit");
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(field)>, std::uint32_t>) {
      if (detail)
        text = fmt::format("{} or {} ({:08x})", field, std::bit_cast<float>(field), field);
    }
  });
  return text;
}

/// Fills in names and values of the first field that differs. @returns false if none does.
template <typename Record>
bool FindDifference(const Record& recorded, const Record& replayed, Fields fields,
                    ReplayDifference& difference) {
  const FieldBits a = BitsOfFields(recorded);
  const FieldBits b = BitsOfFields(replayed);
  for (std::size_t i = 0; i < a.count; ++i) {
    if (a.bits[i] == b.bits[i]) continue;
    difference.recorded = TextOfField(recorded, i, difference.field);
    difference.replayed = TextOfField(replayed, i, difference.field);
    if (fields == Fields::kAll || IsFromDrive(difference.field)) return true;
  }
  return false;
}

std::string ToText(const CanFrame& frame) {
  std::string text = fmt::format("{:03X}#{}", frame.id, frame.remote ? "R" : "");
  for (std::size_t i = 0; i < frame.size; ++i) text += fmt::format("{:02X}", frame.data[i]);
  return text;
}

std::string WhatDiffers(const CanFrame& a, const CanFrame& b) {
  if (a.id != b.id || a.extended != b.extended) return "identifier";
  if (a.remote != b.remote) return "remote bit";
  if (a.size != b.size) return "size";
  std::size_t i = 0;
  while (i + 1 < a.data.size() && a.data[i] == b.data[i]) ++i;
  return fmt::format("byte {}", i);
}

}  // namespace

std::optional<ReplayDifference> Compare(const TickEntry& recorded, const TickOutput& replayed,
                                        const std::vector<std::string>& joints) {
  ReplayDifference difference{recorded.index, recorded.tick, {}, {}, {}};
  const auto joint_name = [&joints](std::size_t i) {
    return fmt::format("joint {}", i < joints.size() ? joints[i] : std::to_string(i));
  };
  const auto joint_differs = [&](Fields fields) {
    for (std::size_t i = 0; i < recorded.record.joint_count; ++i) {
      if (!FindDifference(recorded.record.joints[i], replayed.record.joints[i], fields,
                          difference)) {
        continue;
      }
      difference.field = fmt::format("{}: {}", joint_name(i), difference.field);
      return true;
    }
    return false;
  };
  // Measured values are compared first, because the rest follows from them.
  if (joint_differs(Fields::kMeasured) ||
      FindDifference(recorded.record, replayed.record, Fields::kAll, difference) ||
      joint_differs(Fields::kAll)) {
    return difference;
  }
  for (std::size_t i = 0; i < recorded.record.joint_count; ++i) {
    const auto a = recorded.frames[i].frames();
    const auto b = replayed.frames[i].frames();
    if (a.size() != b.size()) {
      difference.field = fmt::format("{}: number of frames", joint_name(i));
      difference.recorded = std::to_string(a.size());
      difference.replayed = std::to_string(b.size());
      return difference;
    }
    for (std::size_t f = 0; f < a.size(); ++f) {
      if (a[f] == b[f]) continue;
      difference.field = fmt::format("{}: frame {}, {}", joint_name(i), f, WhatDiffers(a[f], b[f]));
      difference.recorded = ToText(a[f]);
      difference.replayed = ToText(b[f]);
      return difference;
    }
  }
  return std::nullopt;
}

ReplayResult Replay(FlightRecord& record) {
  const RecordConfiguration& configuration = record.configuration();
  Assembly assembly = Assemble(configuration);
  record.Rewind();
  ReplayResult result;
  const auto entry = std::make_unique<TickEntry>();
  const auto output = std::make_unique<TickOutput>();
  while (record.Next(*entry)) {
    if (entry->index != result.ticks) break;
    assembly.executor().Tick(entry->input(), *output);
    result.difference = Compare(*entry, *output, configuration.joints);
    if (result.difference) return result;
    ++result.ticks;
    result.frames_in += static_cast<std::int64_t>(entry->received_count);
    for (std::size_t i = 0; i < entry->record.joint_count; ++i) {
      result.frames_out += static_cast<std::int64_t>(entry->frames[i].frames().size());
    }
  }
  if (!record.damages().empty()) {
    result.gap =
        fmt::format("byte {}: {}", record.damages().front().offset, record.damages().front().what);
  } else if (!record.lost().empty()) {
    result.gap = fmt::format("{} ticks were not recorded", record.lost().front().count);
  } else if (entry->index > result.ticks) {
    result.gap = "ticks are missing";
  }
  return result;
}

}  // namespace tumbler
