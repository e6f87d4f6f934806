#include "runtime/record/record_configuration.h"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "runtime/record/configuration_fields.h"

namespace tumbler {
namespace {

constexpr const char* kFormat = "tumbler-record";
constexpr const char* kLastKnown = "last_known";

template <typename Config>
Json ToJson(const Config& config) {
  Json json = Json::Object();
  // A float is written as the double of the same value, whose text reads back exactly.
  VisitNumbers(config,
               [&json](const ConfigField& field, const auto& value) { json[field.key] = value; });
  return json;
}

Json ToJson(const FaultTable& table) {
  Json json = Json::Object();
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    Json row = Json::Array();
    for (std::size_t s = 0; s < kExecutorStateCount; ++s) {
      row.Append(ToString(table(static_cast<Fault>(f), static_cast<ExecutorState>(s))));
    }
    json[ToString(static_cast<Fault>(f))] = row;
  }
  return json;
}

[[noreturn]] void Fail(const std::string& key, const std::string& problem) {
  throw RecordError(fmt::format("configuration: {}: {}", key, problem));
}

const Json& Member(const Json& json, const std::string& key) {
  const Json* const found = json.Find(key);
  if (found == nullptr) Fail(key, "is missing");
  return *found;
}

/// An array with an entry for each joint. Records up to version 4 have 8 entries, of which those
/// beyond the joints say nothing.
const Json& OfEachJoint(const Json& json, const std::string& key, std::size_t joints) {
  constexpr std::size_t kAlways = 8;
  const Json& member = Member(json, key);
  if (!member.is_array() ||
      (member.size() != joints && !(member.size() == kAlways && joints < kAlways))) {
    Fail(key, fmt::format("is not an array of {} entries, one for each joint", joints));
  }
  return member;
}

template <typename T>
void Take(const Json& json, const std::string& key, T& value) {
  const Json& member = Member(json, key);
  if constexpr (std::is_same_v<T, bool>) {
    if (!member.is_boolean()) Fail(key, "is not true or false");
    value = member.boolean();
  } else if constexpr (std::is_same_v<T, std::string>) {
    if (!member.is_text()) Fail(key, "is not a text");
    value = member.text();
  } else if constexpr (std::is_integral_v<T>) {
    const std::optional<std::int64_t> integer = member.integer();
    if (!integer || !std::in_range<T>(*integer))
      Fail(key, fmt::format("is not an integer of {} bits", 8 * sizeof(T)));
    value = static_cast<T>(*integer);
  } else {
    const double number = member.is_number() ? member.number() : NAN;
    if (!(std::abs(number) <= std::numeric_limits<float>::max())) Fail(key, "is not a number");
    value = static_cast<T>(number);
  }
}

/// @param lacks  gets the keys that the record does not have.
template <typename Config>
void TakeNumbers(const Json& json, Config& config, std::vector<std::string>& lacks) {
  VisitNumbers(config, [&json, &lacks](const ConfigField& field, auto& value) {
    if (field.may_lack && json.Find(field.key) == nullptr) {
      lacks.emplace_back(field.key);
    } else {
      Take(json, field.key, value);
    }
  });
}

void TakeTexts(const Json& json, const std::string& key, std::vector<std::string>& texts) {
  const Json& member = Member(json, key);
  if (!member.is_array()) Fail(key, "is not an array");
  for (const Json& text : member.elements()) {
    if (!text.is_text()) Fail(key, "has an entry that is not a text");
    texts.push_back(text.text());
  }
}

void TakeReactions(const Json& json, FaultTable& table, std::vector<std::string>& lacks) {
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    const std::string key = ToString(static_cast<Fault>(f));
    // Runs that were recorded before there were these faults did not look for them.
    const auto fault = static_cast<Fault>(f);
    if ((fault == Fault::kForeignCommand || fault == Fault::kSensorLost ||
         fault == Fault::kFallen || fault == Fault::kPaused || fault == Fault::kPitchUnknown) &&
        json.Find(key) == nullptr) {
      for (std::size_t s = 0; s < kExecutorStateCount; ++s) {
        table.Set(fault, static_cast<ExecutorState>(s), Reaction::kIgnore);
      }
      lacks.push_back(key);
      continue;
    }
    const Json& row = Member(json, key);
    if (!row.is_array() || row.size() != kExecutorStateCount) {
      Fail(key, fmt::format("is not an array of {} reactions", kExecutorStateCount));
    }
    for (std::size_t s = 0; s < kExecutorStateCount; ++s) {
      std::size_t r = 0;
      while (r < kReactionCount && row[s] != ToString(static_cast<Reaction>(r))) ++r;
      if (r == kReactionCount) {
        Fail(key, fmt::format("has a reaction that is none: {}",
                              row[s].is_text() ? row[s].text() : row[s].Dump(-1)));
      }
      table.Set(static_cast<Fault>(f), static_cast<ExecutorState>(s), static_cast<Reaction>(r));
    }
  }
}

std::span<const std::uint8_t> BytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

std::string DescribeKernel() {
  utsname name{};
  if (uname(&name) != 0) return "unknown";
  return fmt::format("{} {} {} {}", name.sysname, name.release, name.version, name.machine);
}

RecordBytes EncodeConfiguration(const RecordConfiguration& configuration) {
  Json json;
  json["format"] = kFormat;
  json["program"] = configuration.program;
  json["command_line"] = configuration.command_line;
  json["kernel"] = configuration.kernel;
  json["machine"] = {{"kernel", configuration.machine.kernel},
                     {"cpu", configuration.machine.cpu},
                     {"adapter", configuration.machine.adapter}};
  json["bus"] = configuration.bus;
  json["dry_run"] = configuration.dry_run;
  json["virtual_time"] = configuration.virtual_time;
  json["utime_at_zero_us"] = configuration.utime_at_zero_us;
  json["period_ns"] = configuration.period_ns;
  json["joints"] = configuration.joints;
  json["motion_file"] = configuration.motion_file;
  json["drives_file"] = configuration.drives_file;
  json["executor"] = ToJson(configuration.executor);
  json["executor"]["joints"] = Json::Array();
  json["executor"][kLastKnown] = Json::Array();
  for (std::size_t i = 0; i < configuration.joints.size(); ++i) {
    json["executor"]["joints"].Append(ToJson(configuration.executor.joints[i]));
    json["executor"][kLastKnown].Append(ToJson(configuration.executor.last_known[i]));
  }
  json["executor"]["reactions"] = ToJson(configuration.executor.reactions);
  const CollapseConfig& collapse = configuration.executor.collapse;
  if (collapse.configured) {
    json["executor"]["collapse"] = ToJson(collapse);
    json["executor"]["collapse"]["position_rad"] = Json::Array();
    for (std::size_t i = 0; i < configuration.joints.size(); ++i)
      json["executor"]["collapse"]["position_rad"].Append(collapse.position_rad[i]);
  }
  json["run_sequence"] = ToJson(configuration.procedure);
  json["files"] = Json::Array();
  for (const LoadedFile& file : configuration.files) {
    json["files"].Append(
        {{"path", file.path}, {"bytes", file.text.size()}, {"hash", HashOfText(file.text)}});
  }
  RecordBytes bytes;
  std::uint32_t number = 0;
  // JSON is UTF-8, and names of files need not be. The blocks of the files have the exact names.
  AppendBlock(BlockKind::kConfiguration, number++, BytesOf(json.Dump(1)), bytes);
  for (const LoadedFile& file : configuration.files) {
    AppendBlock(BlockKind::kFile, number++, EncodeFile(file.path, file.text), bytes);
  }
  return bytes;
}

RecordConfiguration ParseConfiguration(std::string_view text) {
  const std::optional<Json> parsed = Json::Parse(text);
  if (!parsed) throw RecordError("configuration: is not JSON");
  const Json& json = *parsed;
  std::string format;
  Take(json, "format", format);
  if (format != kFormat) Fail("format", fmt::format("is '{}', not '{}'", format, kFormat));
  RecordConfiguration configuration;
  Take(json, "program", configuration.program);
  TakeTexts(json, "command_line", configuration.command_line);
  Take(json, "kernel", configuration.kernel);
  const Json& machine = Member(json, "machine");
  Take(machine, "kernel", configuration.machine.kernel);
  Take(machine, "cpu", configuration.machine.cpu);
  Take(machine, "adapter", configuration.machine.adapter);
  Take(json, "bus", configuration.bus);
  Take(json, "dry_run", configuration.dry_run);
  Take(json, "virtual_time", configuration.virtual_time);
  Take(json, "utime_at_zero_us", configuration.utime_at_zero_us);
  Take(json, "period_ns", configuration.period_ns);
  if (configuration.period_ns < 1) Fail("period_ns", "is not above 0");
  TakeTexts(json, "joints", configuration.joints);
  if (configuration.joints.empty() || configuration.joints.size() > kMaxJoints) {
    Fail("joints", fmt::format("are {}; this build takes from 1 ... {}",
                               configuration.joints.size(), kMaxJoints));
  }
  Take(json, "motion_file", configuration.motion_file);
  Take(json, "drives_file", configuration.drives_file);
  const Json& executor = Member(json, "executor");
  TakeNumbers(executor, configuration.executor, configuration.lacks);
  if (executor.Find("pause_ticks_max") == nullptr)  // No pause was looked for.
    configuration.executor.pause_ticks_max = std::numeric_limits<int>::max();
  const std::size_t count = configuration.joints.size();
  const Json& joints = OfEachJoint(executor, "joints", count);
  for (std::size_t i = 0; i < count; ++i) {
    TakeNumbers(joints[i], configuration.executor.joints[i], configuration.lacks);
  }
  if (executor.Find(kLastKnown) != nullptr) {
    const Json& known = OfEachJoint(executor, kLastKnown, count);
    for (std::size_t i = 0; i < count; ++i)
      TakeNumbers(known[i], configuration.executor.last_known[i], configuration.lacks);
  }
  TakeReactions(Member(executor, "reactions"), configuration.executor.reactions,
                configuration.lacks);
  if (const Json* const poses = executor.Find("collapse")) {
    CollapseConfig& collapse = configuration.executor.collapse;
    const Json& pose = OfEachJoint(*poses, "position_rad", count);
    collapse.configured = true;
    TakeNumbers(*poses, collapse, configuration.lacks);
    for (std::size_t i = 0; i < count; ++i) {
      if (!pose[i].is_number()) Fail("position_rad", "has an entry that is not a number");
      collapse.position_rad[i] = static_cast<float>(pose[i].number());
    }
  }
  TakeNumbers(Member(json, "run_sequence"), configuration.procedure, configuration.lacks);
  const Json& files = Member(json, "files");
  if (!files.is_array()) Fail("files", "is not an array");
  for (const Json& file : files.elements()) {
    Take(file, "path", configuration.files.emplace_back().path);
  }
  return configuration;
}

}  // namespace tumbler
