#include "offline/studies/space_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <mutex>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/planned_passages.h"
#include "common/files/sequence_toml.h"
#include "offline/certify/driven_motion.h"
#include "offline/certify/space_trial.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/normal.h"
#include "offline/scene/packet.h"
#include "offline/solve/guess.h"
#include "offline/studies/spread_names.h"

namespace tumbler {
namespace in_space {
namespace {

constexpr std::uint64_t kPushSeed = 0x9b1a615e;  // so that pushes say nothing of the robot

/// The motions that each robot plays. What they point to does not move.
class Played {
 public:
  /// @throws std::invalid_argument  about a purpose that is none of a robot in space, and as
  /// PlannedPassages.
  explicit Played(const SpaceStudy& study)
      : motion_(LoadMotion(study.motion), TaskSpaces::kPlaneAndSpace) {
    RequireSameGround(motion_);
    RequireOneRobot(motion_);
    const SequenceFile& file = motion_.file();
    gains_ = GainsOf(file).value_or(motion_.problem().drive_gains());
    for (std::size_t i = 0; i < file.primitives.size(); ++i) {
      const PrimitiveFile& primitive = file.primitives[i];
      Source& source = sources_.emplace_back();
      source.x = ParametersOf(primitive.primitive);
      source.lightest_kg = LightestContact(motion_.ProblemOf(i), source.x);
      for (const JointMotion<double>& joint : primitive.primitive.motions())
        source.feed_forward.push_back(joint.torque);
      source.targets =
          TargetsOf(study.motion, file.primitive_names[i], primitive.purpose, motion_.ProblemOf(i));
    }
    int cycle = 1;
    for (const PlannedPassage& passage : PlannedPassages(file, study.cycles, study.branch)) {
      const Source& source = sources_[Index(file.graph.node(passage.node).primitive)];
      played_.push_back({&motion_.ProblemAt(passage.node), &source.x, source.feed_forward,
                         source.targets,
                         passage.edge < 0 ? study.hold_s : file.graph.edge(passage.edge).settle_s,
                         source.lightest_kg});
      motions_.push_back(
          {std::string(file.graph.node(passage.node).name.view()), cycle, source.targets.size()});
      cycle = passage.cycles + 1;
    }
  }

  [[nodiscard]] const SpaceScene& model() const { return motion_.problem().space->scene; }
  [[nodiscard]] const DriveGains& gains() const { return gains_; }
  [[nodiscard]] std::span<const JudgedMotion> played() const { return played_; }
  [[nodiscard]] const std::vector<StudiedMotion>& motions() const { return motions_; }
  [[nodiscard]] bool for_nothing() const {
    return std::ranges::all_of(motions_, [](const auto& motion) { return motion.targets == 0; });
  }
  /// When the hold of the last motion begins, since the start of the first [s].
  [[nodiscard]] double HoldBegins() const {
    double begins_s = LastDue(played_.back());
    for (std::size_t i = 0; i + 1 < played_.size(); ++i)
      begins_s += played_[i].problem->duration_s + played_[i].hold_s;
    return begins_s;
  }

 private:
  struct Source {
    std::vector<double> x;
    std::vector<JointMotion<double>::Spline> feed_forward;
    std::vector<DueInSpace> targets;
    double lightest_kg = 0;
  };

  static std::vector<DueInSpace> TargetsOf(const std::string& path, const std::string& name,
                                           std::span<const PurposeFigure> purpose,
                                           const Problem& problem) {
    try {
      return DueTargetsInSpace(problem, purpose);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("{}: '{}': {}", path, name, error.what()));
    }
  }

  SimulatedMotion motion_;
  DriveGains gains_;
  std::deque<Source> sources_;  // by primitive
  std::vector<JudgedMotion> played_;
  std::vector<StudiedMotion> motions_;
};

/// Spreads that say something of robots in space.
void CheckSpreads(const Spreads& spreads) {
  for (const SpreadName& name : kSpreadNames) {
    const std::string key = name.key;
    const bool known = key == "mass" || key == "inertia" || key == "mass_centre_m" ||
                       key == "friction" || key == "stiffness" || key == "damping" ||
                       key == "slope_rad";
    if (known || name.none(spreads)) continue;
    throw std::invalid_argument(
        fmt::format("{}: is for robots in the plane so far; allowed in space: --mass, --inertia, "
                    "--mass-centre, --friction, --stiffness, --damping, --slope",
                    name.option));
  }
}

RobotVariation Drawn(const Played& motions, const SpaceStudy& study, int index) {
  return DrawRobot(motions.model(), study.spreads, study.scale, study.seed,
                   static_cast<std::uint64_t>(index));
}

PlayedRobot<Spatial> RobotOf(const Played& motions, const SpaceStudy& study, int index) {
  const RobotVariation variation = Drawn(motions, study, index);
  PlayedRobot<Spatial> played{Varied(motions.model(), variation), motions.gains(), 0,
                              study.period_s, std::nullopt};
  if (study.push_n > 0) {
    // Late enough that the robot has settled, and so early that it has time to fall.
    constexpr double kPushed_s = 0.1, kBefore_s = 0.2, kAfter_s = 0.7;
    Normal random(study.seed ^ kPushSeed, static_cast<std::uint64_t>(index));
    const double begins_s = motions.HoldBegins();
    const double from_s = begins_s + kBefore_s, to_s = begins_s + study.hold_s - kAfter_s;
    const auto [sine, cosine] = portable::SinCos(2 * std::numbers::pi * random.DrawUniform());
    played.push = RootPush<Spatial>{from_s + (to_s - from_s) * random.DrawUniform(), kPushed_s,
                                    SpaceVector(cosine, sine, 0) * study.push_n};
  }
  return played;
}

/// @throws std::invalid_argument  about ground on which steps would have to be shorter than is
/// taken.
void CheckSteps(const Played& motions, const SpaceStudy& study) {
  std::vector<DrivenMotion> driven;
  for (const JudgedMotion& motion : motions.played()) {
    driven.push_back({motion.problem, motion.x, motion.feed_forward, 0, motion.lightest_kg});
  }
  for (int i = 0; i < study.robots; ++i) {
    const PlayedRobot<Spatial> robot = RobotOf(motions, study, i);
    const double step_s = ContactStepInSpace(driven, {&robot, 1});
    if (step_s >= kShortestContactStep_s) continue;
    const ContactLaw& law = robot.scene.contact;
    throw std::invalid_argument(fmt::format(
        "--friction, --stiffness, --damping: robot {} is on ground of {:.3g} N/m, {:.3g} N s/m and "
        "mu {:.3g}, where steps of {:.2g} us are needed; allowed: 1 us or more",
        i, law.stiffness_n_per_m, law.damping_n_s_per_m, law.mu, 1e6 * step_s));
  }
}

}  // namespace
}  // namespace in_space

SpaceStudyResult RunSpaceStudy(const SpaceStudy& study) {
  in_space::CheckSpreads(study.spreads);
  if (study.push_n > 0 && !(study.hold_s >= 1)) {
    throw std::invalid_argument(
        fmt::format("--push: comes in the hold, which is {} s; allowed: with --hold-s 1 or more",
                    study.hold_s));
  }
  const in_space::Played motions(study);
  if (motions.for_nothing()) {
    throw std::invalid_argument(
        fmt::format("{}: it is for nothing that a robot could meet or miss", study.motion));
  }
  if (study.push_n > 0 &&
      std::ranges::none_of(motions.played().back().targets, &DueInSpace::lasts)) {
    throw std::invalid_argument(fmt::format(
        "--push: nothing that {} is for is to last, so that no robot is judged after its push",
        study.motion));
  }
  in_space::CheckSteps(motions, study);
  SpaceStudyResult result{study, motions.gains(), motions.motions(), {}, {}};
  std::vector<SpaceTrial> trials(Index(study.robots));
  std::vector<char> played(trials.size(), 0);
  std::mutex mutex;
  int known = 0;
  constexpr int kPacket = Packet::kLanes;
  ParallelFor((study.robots + kPacket - 1) / kPacket, study.threads, [&](int i, int /*thread*/) {
    if (study.interrupt != nullptr && *study.interrupt) return;
    std::vector<PlayedRobot<Spatial>> robots;
    for (int k = kPacket * i; k < std::min(kPacket * (i + 1), study.robots); ++k)
      robots.push_back(in_space::RobotOf(motions, study, k));
    std::vector<SpaceTrial> tried = TryInSpace(motions.played(), robots, study.interrupt);
    if (study.interrupt != nullptr && *study.interrupt) return;
    std::ranges::move(tried, &trials[Index(kPacket * i)]);
    std::fill_n(&played[Index(kPacket * i)], robots.size(), 1);
    const std::lock_guard<std::mutex> lock(mutex);
    known += static_cast<int>(robots.size());
    if (study.progress) study.progress(known);
  });
  for (std::size_t i = 0; i < trials.size(); ++i) {
    if (played[i] == 0) continue;
    result.trials.push_back(std::move(trials[i]));
    result.deviates.push_back(in_space::Drawn(motions, study, static_cast<int>(i)).deviates);
  }
  return result;
}

Share SpaceStudyResult::share() const {
  const auto count = std::ranges::count_if(trials, &SpaceTrial::as_asked);
  return ShareOf(static_cast<int>(count), static_cast<int>(trials.size()) - Unjudged());
}

int SpaceStudyResult::Unjudged() const {
  return static_cast<int>(std::ranges::count(trials, false, &SpaceTrial::judged));
}

namespace in_space {
namespace {

bool Misses(const JudgedTarget& judged) { return judged.met() == false; }

/// The first motion in which a robot fails; one past the last: none.
std::size_t FirstFailed(const SpaceStudyResult& result, const SpaceTrial& trial) {
  // A state that leaves every plausible range may do so in a motion that is for nothing.
  if (!trial.finite) return trial.ended_in;
  std::size_t motion = 0;
  auto target = trial.purpose.begin();
  for (; motion < result.motions.size(); ++motion) {
    const auto end = target + static_cast<std::ptrdiff_t>(result.motions[motion].targets);
    if (std::any_of(target, end, Misses)) break;
    target = end;
  }
  return motion;
}

std::string NameOf(const SpaceStudyResult& result, std::size_t motion) {
  const StudiedMotion& of = result.motions[motion];
  const bool again = std::ranges::count(result.motions, of.name, &StudiedMotion::name) > 1;
  return again ? fmt::format("{} of cycle {}", of.name, of.cycle) : of.name;
}

}  // namespace
}  // namespace in_space

std::string SpaceStudyResult::ReasonOf(const SpaceTrial& trial) const {
  const std::size_t motion = in_space::FirstFailed(*this, trial);
  if (motion == motions.size()) return "";
  std::vector<std::string> texts;
  if (!trial.finite) texts.emplace_back("its state left every plausible range");
  for (const JudgedTarget& judged : trial.purpose) {
    if (judged.met() == false)
      texts.push_back(fmt::format("{}: {}", judged.name(), judged.Verdict()));
  }
  return fmt::format("{}: {}", in_space::NameOf(*this, motion), fmt::join(texts, "; "));
}

std::vector<int> SpaceStudyResult::FailedIn() const {
  std::vector<int> failed(motions.size(), 0);
  for (const SpaceTrial& trial : trials) {
    const std::size_t motion = in_space::FirstFailed(*this, trial);
    if (motion < failed.size()) ++failed[motion];
  }
  return failed;
}

std::vector<SpaceStudyResult::Missed> SpaceStudyResult::MissedTargets() const {
  std::vector<Missed> missed;
  if (trials.empty()) return missed;
  for (std::size_t motion = 0, i = 0; motion < motions.size(); ++motion) {
    for (std::size_t k = 0; k < motions[motion].targets; ++k, ++i) {
      Missed& target =
          missed.emplace_back(Missed{motion, trials.front().purpose[i].target.name(), 0});
      for (const SpaceTrial& trial : trials) {
        const bool here = in_space::FirstFailed(*this, trial) == motion;
        target.robots += here && in_space::Misses(trial.purpose[i]) ? 1 : 0;
      }
    }
  }
  return missed;
}

bool IsMotionInSpace(const std::string& path) {
  return LoadMotion(path).primitives.front().entry.is_in_space();
}

std::string ToText(const SpaceStudyResult& result) {
  const SpaceStudy& study = result.study;
  std::string text = fmt::format(
      "{}: {}\n  through drives of {} N m/rad and {} N m s/rad, setpoints every {:.3g} "
      "ms, the usual friction and delay, spreads x {}, seed {}{}{}; no protocol, executor or bus "
      "is simulated\n",
      study.motion,
      result.share().of == 0 ? "no robot was judged" : ToText(result.share()) + " as asked",
      result.gains.kp_nm_per_rad, result.gains.kd_nm_s_per_rad, 1e3 * study.period_s, study.scale,
      study.seed, study.hold_s > 0 ? fmt::format(", held for {:.3g} s more", study.hold_s) : "",
      study.push_n > 0 ? fmt::format(", pushed from any side with {:.3g} N for 0.1 s", study.push_n)
                       : "");
  if (const int unjudged = result.Unjudged(); unjudged > 0) {
    text += fmt::format(
        "  {} NOT JUDGED, in no share: an axis of which a heading is asked had none\n", unjudged);
  }
  const std::vector<int> failed = result.FailedIn();
  const bool sequence = result.motions.size() > 1;
  for (std::size_t motion = 0; motion < failed.size(); ++motion) {
    if (sequence && failed[motion] > 0) {
      text += fmt::format("  {} fail in {}\n", failed[motion], in_space::NameOf(result, motion));
    }
    for (const SpaceStudyResult::Missed& missed : result.MissedTargets()) {
      if (missed.motion == motion && missed.robots > 0)
        text += fmt::format("    {} miss {}\n", missed.robots, missed.of);
    }
    const auto lost = std::ranges::count_if(result.trials, [motion](const SpaceTrial& trial) {
      return !trial.finite && trial.ended_in == motion;
    });
    if (lost > 0) text += fmt::format("    {} leave every plausible range\n", lost);
  }
  return text;
}

Json ToJson(const SpaceStudyResult& result) {
  const Share share = result.share();
  auto missed = Json::Array();
  for (const SpaceStudyResult::Missed& of : result.MissedTargets()) {
    missed.Append({{"of", of.of}, {"robots", of.robots}, {"motion", static_cast<int>(of.motion)}});
  }
  auto motions = Json::Array();
  const std::vector<int> failed = result.FailedIn();
  for (std::size_t i = 0; i < failed.size(); ++i) {
    motions.Append({{"node", result.motions[i].name},
                    {"cycle", result.motions[i].cycle},
                    {"failed", failed[i]}});
  }
  Json spreads = Json::Object();
  for (const SpreadName& name : kSpreadNames) {
    if (!name.none(result.study.spreads)) spreads[name.key] = name.JsonOf(result.study.spreads);
  }
  return {{"motion", result.study.motion},
          {"where", "model in space, through drives"},
          {"robots", static_cast<int>(result.trials.size())},
          {"judged", share.of},
          {"as_asked", share.count},
          {"share", share.value()},
          {"share_95_low", share.low},
          {"share_95_high", share.high},
          {"seed", result.study.seed},
          {"scale", result.study.scale},
          {"spreads", spreads},
          {"period_s", result.study.period_s},
          {"hold_s", result.study.hold_s},
          {"push_n", result.study.push_n},
          {"kp_nm_per_rad", result.gains.kp_nm_per_rad},
          {"kd_nm_s_per_rad", result.gains.kd_nm_s_per_rad},
          {"motions", motions},
          {"missed", missed}};
}

}  // namespace tumbler
