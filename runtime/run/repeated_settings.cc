#include "runtime/run/repeated_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "runtime/record/configuration_fields.h"

namespace tumbler {
namespace {

/// How strong a reaction is at least and at most. `abort` is what a motion's table says of the
/// time, and damp where it says nothing.
struct Strength {
  Reaction least, most;
};
Strength StrengthOf(Reaction reaction) {
  if (reaction == Reaction::kAbort) return {Reaction::kHold, Reaction::kDamp};
  return {reaction, reaction};
}

/// Whether the reaction is at least as strong as the other, whatever either comes to.
bool IsAsStrong(Reaction reaction, Reaction other) {
  if (reaction == other) return true;
  const Reaction least = StrengthOf(reaction).least;
  return Stronger(least, StrengthOf(other).most) == least;
}

/// The end of a run by its configuration.
RunEnd EndOf(const RunProcedureConfig& config) {
  if (config.lower_ticks != 0) return RunEnd::kLower;
  if (config.end_hold_ticks == 0) return RunEnd::kTorqueOff;
  return config.go_home ? RunEnd::kSafe : RunEnd::kHold;
}

/// How little an end lets the robot down.
int RankOf(RunEnd end) {
  switch (end) {
    case RunEnd::kTorqueOff:
      return 0;
    case RunEnd::kLower:
      return 1;
    case RunEnd::kHold:
    case RunEnd::kSafe:
      return 2;
  }
  return 0;
}

std::string NameOf(RunEnd end) { return std::string(kRunEndNames[static_cast<std::size_t>(end)]); }

template <typename Config>
std::vector<double> NumbersOf(const Config& config) {
  std::vector<double> numbers;
  VisitNumbers(config, [&numbers](const ConfigField& /*field*/, const auto& value) {
    numbers.push_back(static_cast<double>(value));
  });
  return numbers;
}

/// Compares the settings of a record with those of now, and takes over what is to be.
class Repeater {
 public:
  Repeater(const RecordConfiguration& recorded, const SequenceGraph<float>& graph,
           const std::function<bool(const std::string&)>& given, RepeatedSettings& result)
      : recorded_(recorded), graph_(graph), given_(given), result_(result) {}

  /// @param of  what the configuration is of, for messages, e.g. `joint leg1: `.
  template <typename Config>
  void Numbers(const std::string& of, const Config& recorded, Config& now) {
    const std::vector<double> numbers = NumbersOf(recorded);
    std::size_t i = 0;
    VisitNumbers(now, [&](const ConfigField& field, auto& value) {
      const double was = numbers[i++];
      if (Lacks(field.key) || Decided(field, was, static_cast<double>(value))) return;
      if (Settle(of, field, was, static_cast<double>(value)))
        value = static_cast<std::remove_reference_t<decltype(value)>>(was);
    });
  }

  /// Whether runs did not have this number or fault yet when the record was made.
  [[nodiscard]] bool Lacks(const std::string& key) const {
    return std::ranges::find(recorded_.lacks, key) != recorded_.lacks.end();
  }

  void Reactions() {
    if (given_("--faults")) return;
    for (const FaultInfo& info : kFaultTable) {
      if (info.fault == Fault::kNone || Lacks(info.name)) continue;
      std::vector<std::string> was, is;
      for (const StateInfo& state : kStateTable) {
        const Reaction now = result_.executor.reactions(info.fault, state.state);
        const Reaction then = recorded_.executor.reactions(info.fault, state.state);
        if (IsAsStrong(then, now)) {
          result_.executor.reactions.Set(info.fault, state.state, then);
        } else {
          was.push_back(fmt::format("{} while {}", ToString(then), state.name));
          is.push_back(fmt::format("{} while {}", ToString(now), state.name));
        }
      }
      if (was.empty()) continue;
      result_.milder.push_back({fmt::format("reactions: {}", info.name),
                                fmt::format("{}", fmt::join(was, ", ")),
                                fmt::format("{}", fmt::join(is, ", ")), "--faults"});
    }
    if (result_.executor.reactions.Has(Reaction::kCollapse) &&
        recorded_.executor.collapse.configured) {
      result_.executor.collapse.configured = true;
      result_.executor.collapse.position_rad = recorded_.executor.collapse.position_rad;
      Numbers("collapse: ", recorded_.executor.collapse, result_.executor.collapse);
    }
  }

 private:
  /// Whether the value of now holds without a word.
  [[nodiscard]] bool Decided(const ConfigField& field, double was, double now) const {
    if (was == now) return true;
    switch (field.repetition) {
      case Repetition::kOfMotion:
      case Repetition::kOfNowAndSaid:
        return false;
      case Repetition::kOfNow:
      case Repetition::kEnd:
        return true;
      case Repetition::kWordOfThatDay:
        return was < 0 || given_(field.option);
      case Repetition::kPoseLimit:
        // A run that knows no pose has the default, which is no limit at all.
        return was >= static_cast<double>(ExecutorConfig().moved_max_rad) || given_(field.option);
      case Repetition::kGreaterIsMilder:
      case Repetition::kSmallerIsMilder:
        return *field.option != '\0' && given_(field.option);
    }
    return true;
  }

  /// Says of two different values what has to be said. @returns whether to take the record's.
  bool Settle(const std::string& of, const ConfigField& field, double was, double now) {
    switch (field.repetition) {
      case Repetition::kOfMotion:
        return true;
      case Repetition::kOfNowAndSaid:
        result_.notes.push_back(
            fmt::format("{}{} is {:.6g}; it was {:.6g} in the run that was "
                        "recorded ({})",
                        of, field.key, now, was, field.option));
        return false;
      case Repetition::kWordOfThatDay:
        result_.milder.push_back({of + field.key, NodeText(was), NodeText(now), field.option});
        return false;
      case Repetition::kPoseLimit:
      case Repetition::kGreaterIsMilder:
      case Repetition::kSmallerIsMilder: {
        const bool stricter =
            field.repetition == Repetition::kSmallerIsMilder ? was > now : was < now;
        if (stricter) return true;
        result_.milder.push_back(
            {of + field.key, fmt::format("{:.6g}", was), fmt::format("{:.6g}", now), field.option});
        return false;
      }
      case Repetition::kOfNow:
      case Repetition::kEnd:
        break;
    }
    return false;
  }

  [[nodiscard]] std::string NodeText(double node) const {
    if (node < 0) return "not said";
    if (node >= graph_.node_count) return fmt::format("node {:.0f}", node);
    return std::string(graph_.node(static_cast<int>(node)).name.view());
  }

  const RecordConfiguration& recorded_;
  const SequenceGraph<float>& graph_;
  const std::function<bool(const std::string&)>& given_;
  RepeatedSettings& result_;
};

}  // namespace

RepeatedSettings SettingsToRepeat(const RecordConfiguration& recorded,
                                  const ExecutorConfig& executor, RunSettings settings,
                                  const RunParts& parts,
                                  const std::function<bool(const std::string& option)>& given) {
  const SequenceGraph<float>& graph = parts.sequence->graph;
  RepeatedSettings result{executor, ProcedureConfigOf(settings, parts.drives, graph), {}, {}};
  Repeater repeater(recorded, graph, given, result);
  const RunEnd end = EndOf(result.procedure), recorded_end = EndOf(recorded.procedure);
  if (!given("--end") && !repeater.Lacks("end_hold_ticks")) {
    if (RankOf(recorded_end) < RankOf(end))
      result.milder.push_back({"end of the run", NameOf(recorded_end), NameOf(end), "--end"});
    if (RankOf(recorded_end) > RankOf(end)) {
      settings.end = recorded_end;
      result.procedure = ProcedureConfigOf(settings, parts.drives, graph);
    }
  }
  repeater.Numbers("", recorded.executor, result.executor);
  repeater.Numbers("", recorded.procedure, result.procedure);
  repeater.Reactions();
  for (std::size_t i = 0; i < parts.drives.drives.size(); ++i) {
    repeater.Numbers(fmt::format("joint {}: ", parts.drives.drives[i].joint),
                     recorded.executor.joints[i], result.executor.joints[i]);
  }
  return result;
}

std::string DescribeMilder(const std::string& record, const std::vector<MilderSetting>& milder) {
  std::string text = fmt::format(
      "{}: the run that was recorded had milder settings, which are not taken over unasked:",
      record);
  for (const MilderSetting& setting : milder) {
    text += fmt::format("\n  {}: {} in the record, {} now; ", setting.name, setting.recorded,
                        setting.now);
    text += setting.option.empty() ? "no option allows it"
                                   : fmt::format("choose with {}", setting.option);
  }
  return text;
}

}  // namespace tumbler
