#include "offline/problem/robust_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/file_keys.h"
#include "common/files/primitive_keys.h"
#include "offline/problem/bounds_toml.h"

namespace tumbler {
namespace {

struct RobustEntry : Spreads, LaneDrive, RobustSettings {
  RobustEntry() : Spreads(), LaneDrive(RobustSettings{}.drive), RobustSettings() {}
};

constexpr Range kPart{0, 1};

/// Reads a number, `{ from = A, to = B }` or `{ factor = F }`.
template <GroundSpread Spreads::*kMember, const GroundSpreadLimits& kLimits>
void ReadGroundSpread(TomlTable& table, std::string_view key, RobustEntry& entry) {
  if (!table.IsTable(key)) {
    entry.*kMember = table.Number(key, {0, kLimits.most_deviation});
    return;
  }
  TomlTable range = table.Table(key);
  const bool factor = range.Has("factor");
  if (factor == (range.Has("from") || range.Has("to"))) {
    table.Fail(key, fmt::format("{}; allowed: {}: write a number, {{ from = A, to = B }} or "
                                "{{ factor = F }}",
                                factor ? "has a factor beside from and to"
                                       : "is a table without from, to and factor",
                                kLimits.Allowed()));
  }
  if (factor) {
    entry.*kMember =
        GroundSpread::EitherWay{range.Number("factor", {1, kLimits.most_factor, true})};
    return;
  }
  GroundSpread::Between between;
  between.from = range.Number("from", {0, kLimits.most_value, true});
  between.to = range.Number("to", {0, kLimits.most_value, true});
  if (const std::string mistake = MistakeIn(between, kLimits); !mistake.empty())
    range.Fail("to", mistake);
  entry.*kMember = between;
}

template <GroundSpread Spreads::*kMember, const GroundSpreadLimits& kLimits>
constexpr FileKey<RobustEntry> GroundKey(std::string_view name, const char* allowed,
                                         const char* meaning, const char* schema) {
  return KeyReadBy<RobustEntry>(name, ReadGroundSpread<kMember, kLimits>, meaning)
      .Default("0.2")
      .Allowed(allowed)
      .Schema(schema);
}

constexpr std::array kRobustKeys = {
    KeyOf<&Spreads::mass, RobustEntry>("mass", kPart, "factor of each link's mass and inertia"),
    KeyOf<&Spreads::inertia, RobustEntry>("inertia", kPart,
                                          "factor of each link's inertia, besides"),
    KeyOf<&Spreads::mass_centre_m, RobustEntry>("mass_centre_m", kPart,
                                                "each link's centre of mass, along its x"),
    KeyOf<&Spreads::length, RobustEntry>("length", kPart, "factor of each link's x"),
    GroundKey<&Spreads::friction, kFrictionSpreadLimits>(
        "friction",
        "0 to 1, or a [range](#spreads-of-the-ground) up to 10 or of a factor up to 100",
        "factor of `contact.mu`, or a range of mu",
        R"({"anyOf": [{"type": "number", "minimum": 0, "maximum": 1}, )"
        R"({"type": "object", "properties": {"from": {"type": "number", "exclusiveMinimum": 0, )"
        R"("maximum": 10}, "to": {"type": "number", "exclusiveMinimum": 0, "maximum": 10}}, )"
        R"("required": ["from", "to"], "additionalProperties": false}, )"
        R"({"type": "object", "properties": {"factor": {"type": "number", "exclusiveMinimum": 1, )"
        R"("maximum": 100}}, "required": ["factor"], "additionalProperties": false}]})"),
    GroundKey<&Spreads::stiffness, kStiffnessSpreadLimits>(
        "stiffness", "likewise, up to 1e8", "factor of the contact's, or a range of it [N/m]",
        R"({"anyOf": [{"type": "number", "minimum": 0, "maximum": 1}, )"
        R"({"type": "object", "properties": {"from": {"type": "number", "exclusiveMinimum": 0, )"
        R"("maximum": 1e8}, "to": {"type": "number", "exclusiveMinimum": 0, "maximum": 1e8}}, )"
        R"("required": ["from", "to"], "additionalProperties": false}, )"
        R"({"type": "object", "properties": {"factor": {"type": "number", "exclusiveMinimum": 1, )"
        R"("maximum": 100}}, "required": ["factor"], "additionalProperties": false}]})"),
    GroundKey<&Spreads::damping, kDampingSpreadLimits>(
        "damping", "likewise, up to 1e6", "likewise [N s/m]",
        R"({"anyOf": [{"type": "number", "minimum": 0, "maximum": 1}, )"
        R"({"type": "object", "properties": {"from": {"type": "number", "exclusiveMinimum": 0, )"
        R"("maximum": 1e6}, "to": {"type": "number", "exclusiveMinimum": 0, "maximum": 1e6}}, )"
        R"("required": ["from", "to"], "additionalProperties": false}, )"
        R"({"type": "object", "properties": {"factor": {"type": "number", "exclusiveMinimum": 1, )"
        R"("maximum": 100}}, "required": ["factor"], "additionalProperties": false}]})"),
    KeyOf<&Spreads::gain, RobustEntry>("gain", kPart, "factor of each joint's kp and kd"),
    KeyOf<&Spreads::torque_limit, RobustEntry>("torque_limit", kPart,
                                               "factor of each joint's torque limit"),
    KeyOf<&Spreads::slope_rad, RobustEntry>("slope_rad", kPart, "of the ground"),
    KeyOf<&Spreads::delay_s, RobustEntry>("delay_s", {0, 1e-3},
                                          "of setpoints, besides the frames' own time"),
    KeyOf<&Spreads::zero_rad, RobustEntry>("zero_rad", kPart, "each encoder's zero"),
    KeyOf<&Spreads::start_rad, RobustEntry>("start_rad", kPart,
                                            "each joint's position when the motion begins"),
    KeyOf<&Spreads::start_rate_rad_s, RobustEntry>("start_rate_rad_s", {0, 10},
                                                   "rates of pitch and joints, likewise"),
    KeyOf<&LaneDrive::kp, RobustEntry>("kp_nm_per_rad", {0, 1e4},
                                       "of every joint's drive, as in the drives file"),
    KeyOf<&LaneDrive::kd, RobustEntry>("kd_nm_s_per_rad", {0, 1e3}, "likewise"),
    KeyOf<&RobustSettings::duration_min_s, RobustEntry>(
        "duration_min_s", {0.05, 20}, "the motion's duration is found, too: not below this ..."),
    KeyOf<&RobustSettings::duration_max_s, RobustEntry>(
        "duration_max_s", {0.05, 20}, "... nor above this; the task's has to lie between them"),
    KeyOf<&RobustSettings::samples, RobustEntry>(
        "samples", {8, 10'000'000}, "random motions, where robots' arrival tells nothing"),
    KeyOf<&RobustSettings::starts, RobustEntry>(
        "starts", {1, 1000}, "motions found for the model, or the best of these"),
    KeyOf<&RobustSettings::improved, RobustEntry>(
        "improved", {1, 1000}, "of these are left, the best for the last improvement"),
    KeyOf<&RobustSettings::polish_robots, RobustEntry>("polish_robots", {8, 100'000},
                                                       "with which the best is improved at last"),
    KeyOf<&RobustSettings::polish_scale, RobustEntry>("polish_scale", {0, 10}, "of their spreads"),
    KeyOf<&RobustSettings::polish_rounds, RobustEntry>(
        "polish_rounds", {1, 8},
        "how often: each time from what was found before, with twice the robots, at last with all"),
    KeyOf<&RobustSettings::generations, RobustEntry>(
        "generations", {1, 100'000}, "of the last improvement, and of a motion that is led"),
};

/// The key of that name.
constexpr FileKey<RobustEntry> Shared(std::string_view name) {
  for (const FileKey<RobustEntry>& key : kRobustKeys) {
    if (key.text.name == name) return key;
  }
  throw std::invalid_argument("no such key");  // while it is compiled
}
/// Spreads that robots in space have.
constexpr std::array kSpaceSpreadKeys = {
    Shared("mass"),      Shared("inertia"), Shared("mass_centre_m"), Shared("friction"),
    Shared("stiffness"), Shared("damping"), Shared("slope_rad")};
constexpr std::array kSpaceRobustKeys = {
    KeyOf<&SpaceRobustSettings::period_s>("period_s", {1e-4, 0.02},
                                          "with which setpoints change: eight motors share a bus "
                                          "at 400 Hz, twelve at 290 Hz"),
    KeyOf<&SpaceRobustSettings::robots>("robots", {2, 10'000},
                                        "that judge each motion; others in each generation"),
    KeyOf<&SpaceRobustSettings::candidates>("candidates", {4, 1000}, "motions in a generation"),
    KeyOf<&SpaceRobustSettings::generations>(
        "generations", {1, 10'000},
        "at most; it ends when no robot has missed anything for a while"),
    KeyOf<&SpaceRobustSettings::sigma_rad>("sigma_rad", {0, 1, true},
                                           "of control points in the first generation, around the "
                                           "motion that was found for the model"),
};

constexpr std::array kFeedbackSearchKeys = {
    KeyOf<&FeedbackSettings::link>("link", "whose absolute angle is fed back")
        .Required()
        .Allowed("a link of the robot"),
    KeyOf<&FeedbackSettings::acts>(
        "acts", FeedbackSettings::kActsNames,
        "`\"hold\"`: in the hold, from 0.2 s after the motion on, with gains and a dead zone that "
        "are found for it; `\"motion\"`: before it, with gains that are found for the path as it "
        "is; `\"always\"`: in both"),
    KeyOf<&FeedbackSettings::knots>(
        "knots", {2, kMaxGainKnots - 2},  // two more are those of the hold
        "of gains that act in the motion, at equal distances from start to end"),
    KeyOf<&FeedbackSettings::correction_max_rad>(
        "correction_max_rad", {0, kMaxCorrection_rad, true},
        "the most that a joint's setpoint is corrected by"),
    KeyOf<&FeedbackSettings::correction_rate_max_rad_s>(
        "correction_rate_max_rad_s", {0, kMaxCorrectionRate_rad_s, true}, "in a second"),
    KeyOf<&FeedbackSettings::from_guess>(
        "from_guess",
        "gains, dead zone and limits of the guess's feedback are taken as they are, and none are "
        "found; of this table only `link` may be there, too, and the duration is the task's"),
    KeyOf<&FeedbackSettings::noise_rad>("noise_rad", {0, 1}, "of the sensor, as in a twin file"),
    KeyOf<&FeedbackSettings::rate_noise_rad_s>("rate_noise_rad_s", {0, 10}, "likewise"),
    KeyOf<&FeedbackSettings::bias_rad>("bias_rad", {0, 1}, "likewise, of either sign"),
    KeyOf<&FeedbackSettings::delay_s>("delay_s", {0, 0.02}, "likewise"),
    KeyOf<&FeedbackSettings::push_n>(
        "push_n", {0, 1e4},
        "force for 0.1 s, to either side, that robots withstand after the motion"),
};

std::optional<FeedbackSettings> ReadFeedbackSearch(TomlTable& robust, const Problem& problem) {
  std::optional<TomlTable> table = robust.OptionalTable("feedback");
  if (!table) return std::nullopt;
  FeedbackSettings settings;
  ReadKeys(*table, kFeedbackSearchKeys, settings);
  if (settings.from_guess) {
    for (const std::string& key : table->Keys()) {
      if (key == "link" || key == "from_guess") continue;
      table->Fail(key,
                  "is about a feedback that is found, and from_guess takes that of the guess; "
                  "leave out one of the two");
    }
    if (robust.Has("duration_max_s")) {
      robust.Fail("duration_max_s",
                  "does not go with robust.feedback.from_guess, whose gains are for the guess's "
                  "duration; leave out one of the two");
    }
  }
  if (problem.scene.robot.tree.gravity.x() != 0) {
    table->Fail(
        "",
        "keeps an angle against the ground, and a sensor measures it against gravity; leave "
        "out this table or slope_rad");
  }
  if (settings.acts == FeedbackSettings::Acts::kMotion && table->Has("push_n")) {
    table->Fail("push_n",
                "is for robots that have a feedback in the hold, and acts is \"motion\"; leave "
                "out one of the two");
  }
  const std::vector<std::string>& links = problem.scene.robot.body_names;
  if (std::ranges::find(links, settings.link) == links.end() || settings.link.empty()) {
    table->Fail("link", fmt::format("is '{}'; allowed: a link of the robot", settings.link));
  }
  return settings;
}

/// The search for robots that differ looks at their roots after the settle phase, in lanes that do
/// not stop in between.
void CheckTerms(TomlTable& root, const Problem& problem) {
  std::vector<TomlTable> tables = root.Tables("cost");
  for (TomlTable& table : tables) {
    const CostTerm term =
        ReadCostTerm(table, problem.scene.robot, problem.duration_s, problem.settle_s);
    if (term.when == CostTerm::When::kTime) {
      table.Fail("time_s",
                 "does not go with [robust], whose search judges robots when they have "
                 "settled; leave out one of the two");
    }
    if (term.point.present()) {
      table.Fail("of", fmt::format("is '{}', which does not go with [robust], whose search judges "
                                   "robots by their root; leave out one of the two",
                                   PurposeTarget::kOfNames[static_cast<std::size_t>(term.of())]));
    }
  }
}

}  // namespace

std::optional<RobustSettings> ReadRobust(TomlTable& root, const Problem& problem) {
  std::optional<TomlTable> table = root.OptionalTable("robust");
  if (!table) return std::nullopt;
  RobustEntry entry;
  ReadKeys(*table, kRobustKeys, entry);
  RobustSettings settings = entry;
  settings.spreads = entry;
  settings.drive = entry;
  settings.feedback = ReadFeedbackSearch(*table, problem);
  if (!problem.target_pitch_rad) {
    root.Fail("robust",
              "judges a motion by the pitch at which robots end; the task asks for none: give it a "
              "[[cost]] with term \"terminal\" of \"pitch\" when \"settled\"");
  }
  CheckTerms(root, problem);
  const auto moves = [](const ActuatedJoint& joint) {
    return joint.start_rad_s != 0 || joint.end_rad_s != 0;
  };
  if (std::ranges::any_of(problem.joints, moves)) {
    root.Fail("robust", "judges robots that start and end at rest; leave out joints_rad_s");
  }
  if (problem.free_duration) {
    root.Fail("duration_min_s",
              "does not go with [robust], which has this key itself; give duration_min_s and "
              "duration_max_s in [robust]");
  }
  CheckedBounds(*table, kBoundedDuration, settings.duration_min_s, settings.duration_max_s,
                problem.duration_s);
  if (problem.scene.robot.hinged()) {
    root.Fail("robust",
              "simulates in steps that are too coarse for a robot that swings on a bar; allowed: "
              "with root = \"planar-xz\"");
  }
  if (const std::string mistake = MistakeInRanges(problem.scene.contact, settings.spreads);
      !mistake.empty()) {
    root.Fail("robust", mistake);
  }
  try {
    static_cast<void>(MakeLaneScene(problem.scene, settings.drive));
  } catch (const std::invalid_argument& error) {
    root.Fail("robust", fmt::format("cannot simulate this task in lanes: {}", error.what()));
  }
  return settings;
}

std::optional<SpaceRobustSettings> ReadSpaceRobust(TomlTable& root, const Problem& problem) {
  std::optional<TomlTable> table = root.OptionalTable("robust");
  if (!table) return std::nullopt;
  RobustEntry entry;
  ReadKeys(*table, kSpaceSpreadKeys, entry);
  SpaceRobustSettings settings;
  ReadKeys(*table, kSpaceRobustKeys, settings);
  settings.spreads = entry;
  if (const std::string mistake = MistakeInRanges(problem.space->scene.contact, settings.spreads);
      !mistake.empty()) {
    root.Fail("robust", mistake);
  }
  return settings;
}

KeyTable SpaceRobustKeyTable() {
  return {"offline/problem/robust_toml.cc", "robust_in_space",
          Joined({RowsOf(kSpaceSpreadKeys), RowsOf(kSpaceRobustKeys)})};
}

KeyTable RobustFeedbackKeyTable() {
  return {"offline/problem/robust_toml.cc", "robust feedback", RowsOf(kFeedbackSearchKeys)};
}

KeyTable RobustKeyTable() {
  return {"offline/problem/robust_toml.cc", "robust", RowsOf(kRobustKeys)};
}

}  // namespace tumbler
