#include "offline/studies/space_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/toml_reader.h"
#include "offline/certify/space_trial.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/normal.h"
#include "offline/solve/guess.h"
#include "offline/studies/spread_names.h"

namespace tumbler {
namespace in_space {
namespace {

constexpr std::uint64_t kPushSeed = 0x9b1a615e;  // so that pushes say nothing of the robot

/// @throws std::invalid_argument  about a purpose that is none of a robot in space.
std::vector<DueInSpace> TargetsOf(const std::string& path, const PrimitiveFile& file,
                                  const Problem& problem) {
  try {
    return DueTargetsInSpace(problem, file.purpose);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: {}", path, error.what()));
  }
}

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

SpaceTrial PlayOne(const Problem& problem, const PrimitiveFile& file, const std::vector<double>& x,
                   const std::vector<DueInSpace>& targets, const SpaceStudy& study,
                   const DriveGains& gains, int index) {
  const SpaceScene& model = problem.space->scene;
  const RobotVariation variation =
      DrawRobot(model, study.spreads, study.scale, study.seed, static_cast<std::uint64_t>(index));
  PlayedRobot<Spatial> played{Varied(model, variation), gains, 0, study.period_s, std::nullopt};
  std::vector<JointMotion<double>::Spline> feed_forward;
  for (const JointMotion<double>& motion : file.primitive.motions())
    feed_forward.push_back(motion.torque);
  const double last_s = LastDue(targets);
  if (study.push_n > 0) {
    // Late enough that the robot has settled, and so early that it has time to fall.
    constexpr double kPushed_s = 0.1, kBefore_s = 0.2, kAfter_s = 0.7;
    Normal random(study.seed ^ kPushSeed, static_cast<std::uint64_t>(index));
    const double from_s = last_s + kBefore_s, to_s = last_s + study.hold_s - kAfter_s;
    const auto [sine, cosine] = portable::SinCos(2 * std::numbers::pi * random.DrawUniform());
    played.push = RootPush<Spatial>{from_s + (to_s - from_s) * random.DrawUniform(), kPushed_s,
                                    SpaceVector(cosine, sine, 0) * study.push_n};
  }
  return TryInSpace(problem, x, feed_forward, targets, played, study.hold_s);
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
  const PrimitiveFile file = LoadPrimitive(study.motion);
  const Task task = TaskOf(file, TaskSpaces::kPlaneAndSpace);
  const Problem& problem = task.problem;
  const std::vector<DueInSpace> targets = in_space::TargetsOf(study.motion, file, problem);
  if (targets.empty()) {
    throw std::invalid_argument(
        fmt::format("{}: it is for nothing that a robot could meet or miss", study.motion));
  }
  if (study.push_n > 0 && std::ranges::none_of(targets, &DueInSpace::lasts)) {
    throw std::invalid_argument(fmt::format(
        "--push: nothing that {} is for is to last, so that no robot is judged after its push",
        study.motion));
  }
  const std::vector<double> x = ParametersOf(file.primitive);
  SpaceStudyResult result{study, file.drives.value_or(problem.drive_gains()), {}};
  std::vector<SpaceTrial> trials(Index(study.robots));
  std::vector<char> played(trials.size(), 0);
  std::mutex mutex;
  int known = 0;
  ParallelFor(study.robots, study.threads, [&](int i, int /*thread*/) {
    if (study.interrupt != nullptr && *study.interrupt) return;
    trials[Index(i)] = in_space::PlayOne(problem, file, x, targets, study, result.gains, i);
    played[Index(i)] = 1;
    const std::lock_guard<std::mutex> lock(mutex);
    ++known;
    if (study.progress) study.progress(known);
  });
  for (std::size_t i = 0; i < trials.size(); ++i) {
    if (played[i] != 0) result.trials.push_back(std::move(trials[i]));
  }
  return result;
}

Share SpaceStudyResult::share() const {
  const auto count = std::ranges::count_if(trials, &SpaceTrial::as_asked);
  return ShareOf(static_cast<int>(count), static_cast<int>(trials.size()));
}

std::vector<std::pair<std::string, int>> SpaceStudyResult::Missed() const {
  std::vector<std::pair<std::string, int>> missed;
  if (trials.empty()) return missed;
  for (const JudgedTarget& judged : trials.front().purpose)
    missed.emplace_back(judged.target.name(), 0);
  for (const SpaceTrial& trial : trials) {
    for (std::size_t i = 0; i < missed.size(); ++i)
      missed[i].second += trial.purpose[i].met().value_or(false) ? 0 : 1;
  }
  return missed;
}

bool IsMotionInSpace(const std::string& path) {
  TomlTable root = TomlTable::ParseFile(path);
  if (!root.Has("format") || root.String("format") != "tumbler-primitive") return false;
  std::optional<TomlTable> entry = root.OptionalTable("entry");
  return entry && entry->Has("root_quaternion");
}

std::string ToText(const SpaceStudyResult& result) {
  const SpaceStudy& study = result.study;
  std::string text = fmt::format(
      "{}: {} as asked\n  through drives of {} N m/rad and {} N m s/rad, setpoints every {:.3g} "
      "ms, spreads x {}, seed {}{}{}; no protocol, executor or bus is simulated\n",
      study.motion, ToText(result.share()), result.gains.kp_nm_per_rad,
      result.gains.kd_nm_s_per_rad, 1e3 * study.period_s, study.scale, study.seed,
      study.hold_s > 0 ? fmt::format(", held for {:.3g} s more", study.hold_s) : "",
      study.push_n > 0 ? fmt::format(", pushed from any side with {:.3g} N for 0.1 s", study.push_n)
                       : "");
  for (const auto& [name, count] : result.Missed()) {
    if (count > 0) text += fmt::format("    {} miss {}\n", count, name);
  }
  return text;
}

Json ToJson(const SpaceStudyResult& result) {
  const Share share = result.share();
  auto missed = Json::Array();
  for (const auto& [name, count] : result.Missed())
    missed.Append({{"of", name}, {"robots", count}});
  Json spreads = Json::Object();
  for (const SpreadName& name : kSpreadNames) {
    if (!name.none(result.study.spreads)) spreads[name.key] = name.JsonOf(result.study.spreads);
  }
  return {{"motion", result.study.motion},
          {"where", "model in space, through drives"},
          {"robots", share.of},
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
          {"missed", missed}};
}

}  // namespace tumbler
