#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "firmware_interface/devices/drive_models.h"
#include "runtime/bench/drive_scales.h"

namespace tumbler {
namespace {

enum class ModelTable : std::uint8_t { kNone, kVelocity, kTorque, kMotor };

/// A value of the drives file whose error would scale something.
struct ScaleTerm {
  std::string key;  ///< As the file has it.
  double in_file = 0;
  bool range = true;      ///< Whether it is an end of a range,
  bool from_zero = true;  ///< and that of one that begins at zero.
  bool inverse = false;   ///< Whether the drive's value is the file's divided by the ratio.
  ModelTable table = ModelTable::kNone;
  ScaleRatio ratio;  ///< True scale to the file's, relative to the other terms of its family.
};

ScaleTerm RangeTerm(std::string key, const DriveRange& range, ModelTable table,
                    const ScaleRatio& ratio) {
  return {std::move(key), double{range.max}, true, false, false, table, ratio};
}
/// Of the term that the others of its family are relative to.
constexpr ScaleRatio kYardstick{0, 0, false};

/// Terms that are judged together, because only ratios of their scales are measured.
struct ScaleFamily {
  std::vector<ScaleTerm> terms;
  /// Logarithm of the true scale to which the ratios are relative; nothing: not known, so that each
  /// of the terms may be the one that is right.
  std::optional<double> reference;
};

/// A gain of a drive's law.
struct LawGain {
  const char* key;                     ///< In the drives file.
  const char* term;                    ///< Its term of the law.
  DriveRange ImpedanceRanges::*range;  ///< Where the protocol carries it,
  float DriveEntry::*of_drive;         ///< and where it is the drive's own.
};
constexpr LawGain kStiffness{"kp_nm_per_rad", "kp (position - q)", &ImpedanceRanges::kp_nm_per_rad,
                             &DriveEntry::kp_nm_per_rad};
constexpr LawGain kDamping{"kd_nm_s_per_rad", "kd (velocity - qdot)",
                           &ImpedanceRanges::kd_nm_s_per_rad, &DriveEntry::kd_nm_s_per_rad};

/// Whether a ratio is told to be another than that with this logarithm, whatever its sign.
bool IsOff(const ScaleRatio& ratio, double log = 0) {
  return ratio.told() && std::abs(ratio.log - log) > ScaleRatio::kSame + 2 * ratio.error;
}

/// Terms that are not as the file says, with the logarithms of true scale to the file's.
struct Explanation {
  std::vector<std::pair<std::size_t, double>> wrong;
};

/// The explanations with the fewest wrong terms.
std::vector<Explanation> Explain(const ScaleFamily& family) {
  const std::vector<ScaleTerm>& terms = family.terms;
  std::vector<double> references;
  if (family.reference) {
    references.push_back(*family.reference);
  } else {
    for (const ScaleTerm& term : terms) references.push_back(-term.ratio.log);
  }
  std::vector<Explanation> best;
  for (const double of : references) {
    Explanation one;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const double log = terms[i].ratio.log + of;
      if (std::abs(log) > ScaleRatio::kSame + 2 * terms[i].ratio.error)
        one.wrong.emplace_back(i, log);
    }
    if (!best.empty() && one.wrong.size() > best.front().wrong.size()) continue;
    if (!best.empty() && one.wrong.size() < best.front().wrong.size()) best.clear();
    const auto same_terms = [&one](const Explanation& other) {
      return std::ranges::equal(one.wrong, other.wrong, {}, &std::pair<std::size_t, double>::first,
                                &std::pair<std::size_t, double>::first);
    };
    if (std::ranges::none_of(best, same_terms)) best.push_back(one);
  }
  return best;
}

/// What can be wrong of one drive.
class ScaleJudge {
 public:
  ScaleJudge(const std::string& drive, const DriveEntry& entry, const DriveScales& scales,
             const KnownScales& known)
      : drive_(drive), entry_(entry), scales_(scales), known_(known) {
    if (std::holds_alternative<MitConfig>(entry.config)) {
      models_ = MitModels();
    } else if (std::holds_alternative<AkV3Config>(entry.config)) {
      models_ = AkV3Models();
    }
  }

  Judgement Run() {
    JudgeMotion();
    JudgeTorque();
    return std::move(judgement_);
  }

 private:
  void Judged(const std::string& what) { judgement_.judged.push_back(drive_ + ": " + what); }
  void NotTold(const std::string& what) { judgement_.not_told.push_back(drive_ + ": " + what); }
  [[nodiscard]] std::string ModelsWith(ModelTable table, double value) const;
  [[nodiscard]] std::string Describe(const ScaleTerm& term, double log) const;
  void Report(const ScaleFamily& family, const std::vector<Explanation>& explanations,
              const std::string& evidence);
  [[nodiscard]] static std::string Instead(const std::vector<ScaleTerm>& terms, std::size_t wrong,
                                           double log);
  void JudgeMotion();
  [[nodiscard]] ScaleFamily ReportedMotion(const ScaleRatio& velocity) const;
  void AddAskedMotion(const ScaleRatio& velocity, ScaleFamily& family, std::string& evidence);
  bool JudgeOtherWay(const ScaleFamily& family, const std::string& evidence,
                     const Explanation& ranges);
  void JudgeTorque();
  bool TorqueTells();
  ScaleFamily ReportedTorque();
  void AddAskedTorque(ScaleFamily& family, std::vector<std::string>& evidence);
  void AddGain(const LawGain& gain, const ScaleRatio& ratio, double error_log, ScaleFamily& family,
               std::vector<std::string>& evidence);
  [[nodiscard]] bool torque_asked_told() const {
    return scales_.torque_asked.told() && !scales_.torque_asked.reversed;
  }
  void Reversed(const std::string& what) {
    judgement_.findings.push_back(
        {"wrong-sign", entry_.joint,
         fmt::format("{}: {}: look at how its motor and encoder are set up", drive_, what)});
  }

  const std::string& drive_;
  const DriveEntry& entry_;
  const DriveScales& scales_;
  const KnownScales& known_;
  std::vector<DriveModel> models_;
  Judgement judgement_;
  double position_log_ = 0;  // true scale of reported positions to the file's, as explained
  double velocity_log_ = 0;
};

std::string ScaleJudge::ModelsWith(ModelTable table, double value) const {
  constexpr double kFits = 0.05;
  std::vector<std::string_view> names;
  for (const DriveModel& model : models_) {
    const double of_model = table == ModelTable::kVelocity ? model.velocity_rad_s
                            : table == ModelTable::kTorque ? model.torque_nm
                            : table == ModelTable::kMotor  ? model.pole_pairs_and_gear
                                                           : 0;
    if (of_model > 0 && std::abs(std::log(value / of_model)) <= kFits) names.push_back(model.name);
  }
  return names.empty() ? "" : fmt::format(", as {} is delivered", fmt::join(names, " or "));
}

std::string ScaleJudge::Describe(const ScaleTerm& term, double log) const {
  const double factor = std::exp(term.inverse ? -log : log);
  const double value = term.in_file * factor;
  const char* const sign = term.from_zero ? "" : "+-";
  return fmt::format(
      "{} is {}{:.3g} in the drives file, and about {}{:.3g} in the drive{}, {:.2f} "
      "times as much",
      term.key, sign, term.in_file, sign, value, ModelsWith(term.table, value), factor);
}

/// What would be wrong in place of one term of a family of which only ratios are known.
std::string ScaleJudge::Instead(const std::vector<ScaleTerm>& terms, std::size_t wrong,
                                double log) {
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (i != wrong) keys.push_back(terms[i].key);
  }
  return fmt::format(
      "; unless it is right, and the scales of {} are all {:.2f} times the file's, which is not "
      "told by these measurements",
      fmt::join(keys, " and "), std::exp(-log));
}

void ScaleJudge::Report(const ScaleFamily& family, const std::vector<Explanation>& explanations,
                        const std::string& evidence) {
  const std::vector<ScaleTerm>& terms = family.terms;
  const bool relative = !family.reference;
  if (explanations.empty() || explanations.front().wrong.empty()) return;
  const auto kind = [&](const Explanation& of) {
    const bool range =
        std::ranges::all_of(of.wrong, [&](const auto& wrong) { return terms[wrong.first].range; });
    return range ? "other-range" : "other-constant";
  };
  if (explanations.size() == 1) {
    for (const auto& [i, log] : explanations.front().wrong) {
      judgement_.findings.push_back(
          {terms[i].range ? "other-range" : "other-constant", entry_.joint,
           fmt::format(
               "{}: {}: {}{}", drive_, evidence, Describe(terms[i], log),
               relative && explanations.front().wrong.size() == 1 ? Instead(terms, i, log) : "")});
    }
    return;
  }
  std::vector<std::string> all;
  for (const Explanation& one : explanations) {
    std::vector<std::string> parts;
    for (const auto& [i, log] : one.wrong) parts.push_back(Describe(terms[i], log));
    all.push_back(fmt::format("{}", fmt::join(parts, ", and ")));
  }
  judgement_.findings.push_back(
      {kind(explanations.front()), entry_.joint,
       fmt::format("{}: {}: either {}; which of these is not told by these measurements", drive_,
                   evidence, fmt::join(all, "; or "))});
}

// Positions and velocities. Logarithms are relative to the scale of reported positions.
void ScaleJudge::JudgeMotion() {
  if (!scales_.velocity.told()) {
    NotTold(fmt::format("the scale of its velocity, since its joint moved by {:.4f} rad only",
                        scales_.way_rad));
    return;
  }
  Judged("reported velocity against differences of reported positions");
  if (scales_.velocity.reversed) {
    Reversed("it reports velocities against the motion of its positions");
    return;
  }
  // True scale of reported velocities to that of reported positions.
  const ScaleRatio velocity{-scales_.velocity.log, scales_.velocity.error, false};
  ScaleFamily family = ReportedMotion(velocity);
  std::string evidence = fmt::format(
      "velocities are reported {:.3f} times as fast as positions change", scales_.velocity.value());
  if (scales_.gains_carried) AddAskedMotion(velocity, family, evidence);
  if (!family.reference) {
    NotTold(
        "whether positions and velocities are off by one and the same factor, since its joint "
        "was not turned through a known way");
  }
  const std::vector<Explanation> explanations = Explain(family);
  const bool only_way = std::abs(family.reference.value_or(0)) > ScaleRatio::kSame &&
                        !IsOff(scales_.position_asked) && !IsOff(velocity);
  if (only_way && !JudgeOtherWay(family, evidence, explanations.front())) {
    position_log_ = velocity_log_ = 0;
    return;
  }
  if (!only_way) Report(family, explanations, evidence);
  // Several explanations may be as good; the torque is judged by the first.
  position_log_ = family.reference.value_or(0);
  for (const auto& [i, log] : explanations.front().wrong) {
    if (!family.reference && i == 0) position_log_ = log;
  }
  velocity_log_ = velocity.log + position_log_;
}

/// What scales the positions (first) and velocities that are reported, by the protocol.
/// @param velocity  true scale of reported velocities to that of reported positions.
ScaleFamily ScaleJudge::ReportedMotion(const ScaleRatio& velocity) const {
  ScaleFamily family;
  if (known_.position) family.reference = std::log(*known_.position);
  if (const auto* mit = std::get_if<MitConfig>(&entry_.config)) {
    const bool positions_apart = IsOff(scales_.position_asked);
    const bool velocities_apart = IsOff(scales_.velocity_asked);
    family.terms = {
        RangeTerm(positions_apart ? "reply_range.position_rad" : "range.position_rad",
                  mit->reply.position_rad, ModelTable::kNone, kYardstick),
        RangeTerm(velocities_apart ? "reply_range.velocity_rad_s" : "range.velocity_rad_s",
                  mit->reply.velocity_rad_s, ModelTable::kVelocity, velocity)};
  } else if (const auto* ak = std::get_if<AkV3Config>(&entry_.config)) {
    // Positions are reported in tenths of degrees by the protocol.
    family.reference = 0;
    family.terms = {{"pole_pairs x gear_inside", ak->pole_pairs * double{ak->gear_inside}, false,
                     true, true, ModelTable::kMotor, velocity}};
  } else if (const auto* cia402 = std::get_if<Cia402Config>(&entry_.config)) {
    family.terms = {{"position_units_per_turn", double{cia402->position_units_per_turn}, false,
                     true, true, ModelTable::kNone, kYardstick},
                    {"velocity_units_per_turn_s", double{cia402->velocity_units_per_turn_s}, false,
                     true, true, ModelTable::kNone, velocity}};
  } else {
    // Both are turns by the protocol.
    family.reference = 0;
    family.terms = {{"the scale of the velocity that the drive itself estimates", 1, false, true,
                     false, ModelTable::kNone, velocity}};
  }
  return family;
}

/// Adds the ranges of positions and velocities that are asked for, where they are not those of the
/// reports.
void ScaleJudge::AddAskedMotion(const ScaleRatio& velocity, ScaleFamily& family,
                                std::string& evidence) {
  // What it reports has no range.
  const bool always_apart = std::holds_alternative<AkV3Config>(entry_.config);
  const auto is_apart = [always_apart](const ScaleRatio& ratio) {
    return IsOff(ratio) || (always_apart && ratio.told());
  };
  const ShaftRanges ranges = CommandRanges(entry_.config);
  const ScaleRatio& position_asked = scales_.position_asked;
  if (position_asked.told()) {
    Judged("positions asked for against reported ones");
    evidence += fmt::format(", positions asked for are {:.3f} times those reported",
                            position_asked.value());
  } else {
    NotTold("positions asked for against reported ones");
  }
  if (is_apart(position_asked)) {
    family.terms.push_back(
        RangeTerm("range.position_rad", ranges.position_rad, ModelTable::kNone, position_asked));
  }
  const ScaleRatio& velocity_asked = scales_.velocity_asked;
  if (velocity_asked.told()) {
    Judged("velocities asked for against reported ones");
    evidence += fmt::format(", velocities asked for {:.3f} times", velocity_asked.value());
  } else {
    NotTold("velocities asked for against reported ones");
  }
  if (is_apart(velocity_asked)) {
    family.terms.push_back(RangeTerm("range.velocity_rad_s", ranges.velocity_rad_s,
                                     ModelTable::kVelocity,
                                     {velocity_asked.log + velocity.log,
                                      std::hypot(velocity_asked.error, velocity.error), false}));
  }
}

/// Judges a way by hand that is not that of the limits, where velocities fit positions: other
/// stops, another gear, or both ranges. The torque tells ranges from the others, if its own are
/// right.
/// @returns whether it is the ranges.
bool ScaleJudge::JudgeOtherWay(const ScaleFamily& family, const std::string& evidence,
                               const Explanation& ranges) {
  const auto torque_is = [this](double log) {
    return std::ranges::all_of(std::array{&scales_.stiffness, &scales_.damping},
                               [log](const ScaleRatio* ratio) {
                                 return ratio->told() && !ratio->reversed && !IsOff(*ratio, log);
                               });
  };
  if (torque_is(family.reference.value_or(0))) {
    Report(family, {ranges}, evidence + ", and the way by hand and the torque fit neither");
    return true;
  }
  if (torque_is(0)) {
    Judged(
        "the way by hand, which is another gear_ratio or other stops, since ranges of positions "
        "and velocities that are wrong would show in the torque");
    return false;
  }
  std::vector<std::string> parts;
  for (const auto& [i, log] : ranges.wrong) parts.push_back(Describe(family.terms[i], log));
  judgement_.findings.push_back(
      {"other-range", entry_.joint,
       fmt::format(
           "{}: {}, and the way by hand is another: either {}, or gear_ratio is another, or "
           "its stops are not its limits; which of these is not told by these measurements",
           drive_, evidence, fmt::join(parts, ", and "))});
  return false;
}

// Torques and gains. Logarithms are relative to the scale of reported torques.
void ScaleJudge::JudgeTorque() {
  if (!TorqueTells()) return;
  ScaleFamily family = ReportedTorque();
  std::vector<std::string> evidence;
  AddAskedTorque(family, evidence);
  AddGain(kStiffness, scales_.stiffness, position_log_, family, evidence);
  AddGain(kDamping, scales_.damping, velocity_log_, family, evidence);
  if (evidence.empty()) return;
  std::string against = "reported torque against ";
  if (torque_asked_told()) against += "feed-forward, ";
  Judged(against + "gains and error");
  if (!family.reference) {
    NotTold(
        "whether torque and gains are all off by one and the same factor: only a known load "
        "tells");
  }
  Report(family, Explain(family),
         fmt::format("the torque that it reports is {}", fmt::join(evidence, ", ")));
}

/// Whether a torque is reported that the law explains.
bool ScaleJudge::TorqueTells() {
  const bool current_only = std::holds_alternative<AkV3Config>(entry_.config);
  if (!scales_.torque_reported) {
    NotTold(
        current_only
            ? "the scales of torque and gains: torque_constant_nm_per_a is 0, so that its torque "
              "is not known"
            : "the scales of torque and gains: it reports no torque");
    return false;
  }
  if (scales_.explained < DriveScales::kExplainedMin) {
    NotTold(
        fmt::format("the scales of torque and gains: only {:.0f} % of the torque that it "
                    "reports is explained by kp, kd and feed-forward{}",
                    100 * std::max(scales_.explained, 0.0),
                    current_only ? ", as where the current comes without its sign" : ""));
    return false;
  }
  return true;
}

/// What scales the torque that is reported, by the protocol.
ScaleFamily ScaleJudge::ReportedTorque() {
  ScaleFamily family;
  if (known_.torque) family.reference = std::log(*known_.torque);
  if (const auto* mit = std::get_if<MitConfig>(&entry_.config)) {
    const bool apart = torque_asked_told() && IsOff(scales_.torque_asked);
    family.terms = {RangeTerm(apart ? "reply_range.torque_nm" : "range.torque_nm",
                              mit->reply.torque_nm, ModelTable::kTorque, kYardstick)};
  } else if (const auto* ak = std::get_if<AkV3Config>(&entry_.config)) {
    family.terms = {{"torque_constant_nm_per_a", double{ak->torque_constant_nm_per_a}, false, true,
                     false, ModelTable::kNone, kYardstick}};
  } else if (const auto* cia402 = std::get_if<Cia402Config>(&entry_.config)) {
    family.terms = {{"rated_torque_nm", double{cia402->rated_torque_nm}, false, true, false,
                     ModelTable::kNone, kYardstick}};
  } else {
    // The drive counts its gains and what it reports in the same newton metres.
    family.reference = 0;
    NotTold("the torque constant that the drive itself is set to: only a known load tells");
  }
  return family;
}

/// Adds the range of the torque that is asked for, where it is not that of the reports.
void ScaleJudge::AddAskedTorque(ScaleFamily& family, std::vector<std::string>& evidence) {
  if (!torque_asked_told()) {
    NotTold("the torque that it is asked for against the one that it reports");
    return;
  }
  if (!scales_.gains_carried) return;
  const ScaleRatio& asked = scales_.torque_asked;
  evidence.push_back(fmt::format("{:.3f} times its feed-forward", asked.value()));
  if (IsOff(asked) || std::holds_alternative<AkV3Config>(entry_.config)) {
    family.terms.push_back(RangeTerm("range.torque_nm", CommandRanges(entry_.config).torque_nm,
                                     ModelTable::kTorque, asked));
  }
}

/// Adds a gain.
/// @param ratio      reported torque to the gain's term of the law.
/// @param error_log  logarithm of the true scale of what the gain is multiplied by in that term.
void ScaleJudge::AddGain(const LawGain& gain, const ScaleRatio& ratio, double error_log,
                         ScaleFamily& family, std::vector<std::string>& evidence) {
  if (!ratio.told()) {
    NotTold(fmt::format("the scale of {}", gain.key));
    return;
  }
  if (ratio.reversed) {
    Reversed(fmt::format("it reports torques against {}", gain.term));
    return;
  }
  evidence.push_back(fmt::format("{:.3f} times {}", ratio.value(), gain.term));
  const auto* mit = std::get_if<MitConfig>(&entry_.config);
  const auto* ak = std::get_if<AkV3Config>(&entry_.config);
  const ImpedanceRanges* const ranges = mit != nullptr  ? &mit->command
                                        : ak != nullptr ? &ak->range
                                                        : nullptr;
  const ScaleRatio relative{ratio.log - error_log, ratio.error, false};
  if (ranges != nullptr) {
    family.terms.push_back({std::string("range.") + gain.key, double{(ranges->*gain.range).max},
                            true, true, false, ModelTable::kNone, relative});
  } else {
    family.terms.push_back(
        {gain.key, double{entry_.*gain.of_drive}, false, true, false, ModelTable::kNone, relative});
  }
}

}  // namespace

Judgement JudgeScales(const std::string& drive, const DriveEntry& entry, const DriveScales& scales,
                      const KnownScales& known) {
  return ScaleJudge(drive, entry, scales, known).Run();
}

}  // namespace tumbler
