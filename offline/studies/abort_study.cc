#include "offline/studies/abort_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/primitive_hash.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "offline/scene/normal.h"
#include "offline/studies/certify.h"
#include "offline/twin/twin_toml.h"

namespace tumbler {
namespace {

/// What counts beside the impact, for each robot [m/s]: that it does not rest in a known pose, and
/// that its own shapes overlap, which no robot's do.
constexpr double kRestless_m_s = 0.1, kOverlap_m_s = 10;
/// What another way than in the part before has to be worth, in the sum over all parts [m/s].
constexpr double kChange_m_s = 0.3;
/// The robots that every way is played on, and what one may cost of which the others are spared: a
/// factor of the least cost of a way, and what is added [m/s].
constexpr int kFirstRobots = 3;
constexpr double kHopeless = 1.5, kHopeless_m_s = 0.2;
/// Shares of the limits with which a pose is folded into.
constexpr std::array kShares = {0.2, 0.5};
/// By how much a motion may be late and still be rolled out, and how late robots are: shares of
/// the latest tick.
constexpr std::array kLateShares = {0.25, 0.5, 1.0};
/// The seeds of what happens to robots are not those of the robots.
constexpr std::uint64_t kCauses = 0x6162'6f72'7473'0001;

/// The first candidate is to catch; those to roll out follow; the last is to damp.
std::vector<AbortCandidate> CandidatesOf(const Primitive<double>& primitive, double latest_s) {
  std::vector<AbortCandidate> candidates = {{"catch", AbortWay::kCatch, 0, 0, {}}};
  for (const double share : kLateShares) {
    const double late_s = share * latest_s;
    candidates.push_back({fmt::format("roll-out, late by {:.6g} ms at most", 1e3 * late_s),
                          AbortWay::kRollOut,
                          late_s,
                          0,
                          {}});
  }
  std::vector<double> start, end;
  for (const JointMotion<double>& motion : primitive.motions()) {
    start.push_back(motion.position.control_points().front());
    end.push_back(motion.position.control_points().back());
  }
  std::vector<std::pair<const char*, std::vector<double>>> poses = {{"start", start}};
  if (end != start) poses.emplace_back("end", end);
  for (const auto& [name, pose] : poses) {
    for (const double share : kShares) {
      candidates.push_back(
          {fmt::format("fold to the {}, share {}", name, share), AbortWay::kFold, 0, share, pose});
    }
  }
  candidates.push_back({"damp", AbortWay::kDamp, 0, 0, {}});
  return candidates;
}

AbortSpan<double> SpanOf(const AbortCandidate& candidate, double until_s) {
  AbortSpan<double> span;
  span.until_s = until_s;
  span.way = candidate.way;
  span.late_max_s = candidate.late_max_s;
  span.limits_share = candidate.limits_share;
  std::ranges::copy(candidate.position_rad, span.position_rad.begin());
  return span;
}

/// The parts of the motion's time, without costs. They end at whole milliseconds.
std::vector<AbortPart> PartsOf(double duration_s, double step_s) {
  const int most = std::max(1, static_cast<int>(1000 * duration_s));
  const int count = std::clamp(static_cast<int>(std::ceil(duration_s / step_s - 1e-9)), 1, most);
  std::vector<AbortPart> parts(Index(count));
  double from_s = 0;
  for (int k = 0; k < count; ++k) {
    parts[Index(k)].from_s = from_s;
    from_s = std::round(1000 * duration_s * (k + 1) / count) / 1000;
    if (k + 1 == count) from_s = duration_s;
    parts[Index(k)].to_s = from_s;
  }
  return parts;
}

AbortCost CostOf(const std::vector<const AbortOutcome*>& outcomes) {
  AbortCost cost;
  for (const AbortOutcome* const outcome : outcomes) {
    ++cost.robots;
    cost.impact_m_s += outcome->impact_m_s * outcome->impact_m_s;
    cost.torque_nm = std::max(cost.torque_nm, outcome->torque_nm);
    if (!outcome->rests_as.empty()) ++cost.rest;
    if (outcome->overlaps) ++cost.overlap;
    if (outcome->impact_m_s <= cost.worst_m_s) continue;
    cost.worst_m_s = outcome->impact_m_s;
    cost.link = outcome->link;
  }
  cost.impact_m_s = std::sqrt(cost.impact_m_s / cost.robots);
  return cost;
}

/// Plays candidates in parts of the motion, on several threads.
class Search {
 public:
  explicit Search(const AbortStudy& study)
      : study_(study), of_thread_(Index(std::max(1, study.threads)), LoadAbortTrials(study)) {
    candidates_ = CandidatesOf(primitive(), study.late_s);
    parts_ = PartsOf(primitive().duration_s, study.step_s);
    outcomes_.resize(parts_.size(), std::vector<std::vector<AbortOutcome>>(candidates_.size()));
  }

  /// Plays robots `from` to `to` - 1 with all candidates that may be the best.
  /// @returns whether it was not interrupted.
  bool Play(int from, int to) {
    const std::vector<Work> all = WorkOf(from, to);
    std::vector<AbortOutcome> outcomes(all.size());
    std::atomic<int> played = 0;
    const int of = static_cast<int>(all.size());
    ParallelFor(of, study_.threads, [&](int i, int thread) {
      if (study_.interrupt != nullptr && *study_.interrupt) return;
      outcomes[Index(i)] = of_thread_[Index(thread)].Play(TrialOf(all[Index(i)]));
      ++played;
      if (thread == 0 && study_.progress) study_.progress(done_ + played, done_ + of);
    });
    done_ += of;
    for (std::size_t i = 0; i < all.size(); ++i)
      outcomes_[all[i].part][all[i].candidate].push_back(outcomes[i]);
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      parts_[k].costs.clear();
      for (std::size_t c = 0; c < candidates_.size(); ++c)
        parts_[k].costs.push_back(CostOf(OutcomesOf(k, c)));
    }
    return study_.interrupt == nullptr || !*study_.interrupt;
  }

  [[nodiscard]] const std::vector<AbortCandidate>& candidates() const { return candidates_; }
  [[nodiscard]] std::vector<AbortPart>& parts() { return parts_; }
  [[nodiscard]] const Primitive<double>& primitive() const {
    return of_thread_.front().primitive();
  }

 private:
  struct Work {
    std::size_t part, candidate;
    int robot;
  };
  /// The candidate that is played for all roll-outs.
  static constexpr std::size_t kRollOut = 1;

  [[nodiscard]] std::vector<Work> WorkOf(int from, int to) const {
    std::vector<Work> all;
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      for (std::size_t c = 0; c < candidates_.size(); ++c) {
        const AbortWay way = candidates_[c].way;
        // What is too late to be rolled out is damped, and without a table everything is.
        const bool spared = way == AbortWay::kRollOut
                                ? c != kRollOut
                                : way != AbortWay::kDamp && from > 0 && IsHopeless(k, c);
        if (spared) continue;
        for (int robot = from; robot < to; ++robot) all.push_back({k, c, robot});
      }
    }
    return all;
  }

  /// What happens to a robot in a part, whatever the candidate.
  [[nodiscard]] AbortTrial EventOf(std::size_t part, int robot) const {
    Normal random(study_.seed ^ kCauses, part * 4096 + static_cast<std::uint64_t>(robot));
    AbortTrial trial;
    const double from_s = parts_[part].from_s, to_s = parts_[part].to_s;
    trial.time_s = from_s + random.DrawUniform() * (to_s - from_s);
    if (robot % 2 == 0) return trial;
    trial.cause = AbortCause::kLateTick;  // The first is the latest.
    const std::size_t share = kLateShares.size() - 1 - Index(robot / 2) % kLateShares.size();
    trial.late_s = kLateShares[share] * study_.late_s;
    return trial;
  }

  [[nodiscard]] AbortTrial TrialOf(const Work& work) const {
    AbortTrial trial = EventOf(work.part, work.robot);
    trial.variation = AbortRobot(study_, of_thread_.front().shared(), work.robot);
    trial.table.span_count = 1;
    AbortSpan<double>& span = trial.table.span_storage[0];
    span = SpanOf(candidates_[work.candidate], primitive().duration_s);
    span.late_max_s = 1;
    return trial;
  }

  /// What a candidate makes of the robots in a part, as far as they were played.
  [[nodiscard]] std::vector<const AbortOutcome*> OutcomesOf(std::size_t part,
                                                            std::size_t candidate) const {
    const AbortCandidate& way = candidates_[candidate];
    const bool rolls = way.way == AbortWay::kRollOut;
    const std::vector<AbortOutcome>& own = outcomes_[part][rolls ? kRollOut : candidate];
    std::vector<const AbortOutcome*> outcomes;
    for (std::size_t robot = 0; robot < own.size(); ++robot) {
      const bool too_late = rolls && EventOf(part, static_cast<int>(robot)).late_s > way.late_max_s;
      outcomes.push_back(too_late ? &outcomes_[part].back()[robot] : &own[robot]);
    }
    return outcomes;
  }

  [[nodiscard]] bool IsHopeless(std::size_t part, std::size_t candidate) const {
    const std::vector<AbortCost>& costs = parts_[part].costs;
    const double least = std::ranges::min_element(costs, {}, &AbortCost::cost_m_s)->cost_m_s();
    return costs[candidate].cost_m_s() > kHopeless * least + kHopeless_m_s;
  }

  AbortStudy study_;
  std::vector<AbortTrials> of_thread_;
  std::vector<AbortCandidate> candidates_;
  std::vector<AbortPart> parts_;
  std::vector<std::vector<std::vector<AbortOutcome>>> outcomes_;  // part, candidate, robot
  int done_ = 0;
};

/// The candidate for each part with which the sum of all costs is least. @returns how often it
/// changes.
int Choose(std::vector<AbortPart>& parts, double change_m_s) {
  const std::size_t ways = parts.front().costs.size();
  std::vector<std::vector<std::size_t>> before(parts.size(), std::vector<std::size_t>(ways));
  std::vector<double> sums(ways, 0.0);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    std::vector<double> next(ways);
    const auto best = static_cast<std::size_t>(std::ranges::min_element(sums) - sums.begin());
    for (std::size_t c = 0; c < ways; ++c) {
      const bool changes = k > 0 && sums[best] + change_m_s < sums[c];
      before[k][c] = changes ? best : c;
      next[c] = (changes ? sums[best] + change_m_s : sums[c]) + parts[k].costs[c].cost_m_s();
    }
    sums = std::move(next);
  }
  auto way = static_cast<std::size_t>(std::ranges::min_element(sums) - sums.begin());
  int changes = 0;
  for (std::size_t k = parts.size(); k-- > 0;) {
    parts[k].chosen = way;
    if (before[k][way] != way) ++changes;
    way = before[k][way];
  }
  return changes;
}

AbortTable<double> TableOf(const AbortResult& result) {
  AbortTable<double> table;
  for (std::size_t k = 0; k < result.parts.size(); ++k) {
    const AbortPart& part = result.parts[k];
    if (k == 0 || part.chosen != result.parts[k - 1].chosen) ++table.span_count;
    table.span_storage[Index(table.span_count - 1)] =
        SpanOf(result.candidates[part.chosen], part.to_s);
  }
  return table;
}

AbortFigure FigureOf(const AbortResult& result) {
  const AbortStudy& study = result.study;
  AbortFigure figure;
  figure.robots = study.robots;
  figure.seed = study.seed;
  figure.scale = study.scale;
  figure.spreads = TextOf(study.spreads);
  figure.drives_file = PrintableInLine(study.drives);
  if (!study.drives.empty()) figure.drives_hash = HashOfText(ReadTextFile(study.drives));
  for (const AbortPart& part : result.parts) {
    const AbortCost& chosen = part.costs[part.chosen];
    const AbortCost& damped = part.costs.back();
    figure.impact_m_s += chosen.impact_m_s * chosen.impact_m_s;
    figure.impact_max_m_s = std::max(figure.impact_max_m_s, chosen.worst_m_s);
    figure.damped_impact_m_s += damped.impact_m_s * damped.impact_m_s;
    figure.damped_impact_max_m_s = std::max(figure.damped_impact_max_m_s, damped.worst_m_s);
  }
  const auto parts = static_cast<double>(result.parts.size());
  figure.impact_m_s = std::sqrt(figure.impact_m_s / parts);
  figure.damped_impact_m_s = std::sqrt(figure.damped_impact_m_s / parts);
  return figure;
}

/// The ways in the order in which they are told.
constexpr std::array kColumns = {AbortWay::kCatch, AbortWay::kRollOut, AbortWay::kFold,
                                 AbortWay::kDamp};

const char* NameOf(AbortWay way) {
  constexpr std::array kNames = {"catch", "fold", "roll-out", "damp"};
  return kNames[static_cast<std::size_t>(way)];
}

std::string TextOf(const AbortCost& cost) {
  return fmt::format("{:.2f}/{:.2f}{}{}", cost.impact_m_s, cost.worst_m_s,
                     cost.rest == cost.robots ? " " : "~", cost.overlap > 0 ? "x" : " ");
}

}  // namespace

double AbortCost::cost_m_s() const {
  return 0.5 * (impact_m_s + worst_m_s) +
         (kRestless_m_s * (robots - rest) + kOverlap_m_s * overlap) / robots;
}

AbortTrials LoadAbortTrials(const AbortStudy& study) {
  SimulatedMotion motion(LoadMotion(study.primitive), TaskSpaces::kPlaneAndSpace);
  if (motion.file().graph.node_count != 1 || motion.file().graph.edge_count != 0) {
    throw Refused(study.primitive +
                  ": is a sequence; a table of aborts is in a primitive: name its primitives");
  }
  SimulatedRobotConfig robot;
  if (!study.twin.empty()) robot = LoadTwin(study.twin, motion);
  std::string drives = study.drives;
  if (drives.empty() && !study.twin.empty()) drives = ReadTwinSources(study.twin).drives;
  const DrivesConfig loaded =
      LoadDrivesOf(JointsOf(motion.file()), drives, ReadTextFile, GainsOf(motion.file()));
  SharedRobot shared = ShareRobot(motion, loaded, std::move(robot));
  if (shared.space_scene && study.spreads.length != 0) {
    throw Refused(fmt::format(
        "{}: is of a robot in space, whose links do not differ in length so far: leave out "
        "--length",
        study.primitive));
  }
  shared.WithScene([&study](const auto& scene) {
    const std::string mistake = MistakeInRanges(scene.contact, study.spreads);
    if (!mistake.empty() && !scene.obstacles.empty())
      throw Refused(fmt::format("{}: {}", study.primitive, mistake));
  });
  return {std::move(motion), std::move(shared)};
}

RobotVariation AbortRobot(const AbortStudy& study, const SharedRobot& shared, int index) {
  return shared.WithScene([&study, index](const auto& scene) {
    Spreads spreads = study.spreads;
    if (scene.obstacles.empty())  // Robots cannot differ in a ground that is not there.
      spreads.LeaveGround();
    return DrawRobot(scene, spreads, index == 0 ? 0 : study.scale, study.seed,
                     static_cast<std::uint64_t>(index));
  });
}

AbortResult FindAborts(const AbortStudy& study) {
  AbortResult result;
  result.primitive_hash = HashOfText(ReadTextFile(study.primitive));
  Search search(study);
  result.name = search.primitive().name.view();
  result.study = study;
  result.candidates = search.candidates();
  const int first = std::min(kFirstRobots, study.robots);
  if (!search.Play(0, first) || !search.Play(first, study.robots)) return result;
  result.parts = std::move(search.parts());
  double change_m_s = kChange_m_s;
  while (Choose(result.parts, change_m_s) >= kMaxAbortSpans) change_m_s *= 2;
  result.table = TableOf(result);
  result.figure = FigureOf(result);
  return result;
}

void WriteAborts(const AbortResult& result) {
  if (HashOfText(ReadTextFile(result.study.primitive)) != result.primitive_hash) {
    throw Refused(
        fmt::format("{}: was changed while the table was searched for, which is not for "
                    "what is there now; nothing was written, start again",
                    result.study.primitive));
  }
  PrimitiveFile file = LoadPrimitive(result.study.primitive);
  file.primitive.aborts = result.table;
  file.abort_figure = result.figure;
  PendingFile(result.study.primitive, ToToml(file)).Commit();
}

std::string ToText(const AbortResult& result) {
  std::string text = fmt::format(
      "{}: the hardest impact of each way to abort it [m/s], root mean square / worst of {} "
      "robots,\n"
      "of roll-outs and folds the best (~: not all of them rest where the motion begins or ends; "
      "x: "
      "own\n"
      "shapes overlap); spreads times {:.6g}, seed {}\n\n",
      result.name, result.study.robots, result.study.scale, result.study.seed);
  text += fmt::format("  {:>13}", "time [s]");
  for (const AbortWay way : kColumns) text += fmt::format("  {:>11}", NameOf(way));
  text += "  best\n";
  for (const AbortPart& part : result.parts) {
    text += fmt::format("  {:5.3f} - {:5.3f}", part.from_s, part.to_s);
    for (const AbortWay way : kColumns) {
      const AbortCost* least = nullptr;
      for (std::size_t c = 0; c < part.costs.size(); ++c) {
        const AbortCost& cost = part.costs[c];
        const bool less = least == nullptr || cost.cost_m_s() < least->cost_m_s();
        if (result.candidates[c].way == way && less) least = &cost;
      }
      text += fmt::format("  {:>11}", TextOf(*least));
    }
    text += fmt::format("  {}\n", result.candidates[part.chosen].name);
  }
  const AbortFigure& figure = result.figure;
  text += fmt::format(
      "\nover all parts {:.2f} m/s, at worst {:.2f}; always damped {:.2f}, at worst {:.2f}\n",
      figure.impact_m_s, figure.impact_max_m_s, figure.damped_impact_m_s,
      figure.damped_impact_max_m_s);
  return text;
}

Json ToJson(const AbortResult& result) {
  Json json = {{"primitive", result.name},
               {"robots", result.study.robots},
               {"seed", result.study.seed},
               {"scale", result.study.scale},
               {"late_s", result.study.late_s}};
  json["parts"] = Json::Array();
  for (const AbortPart& part : result.parts) {
    Json entry = {{"from_s", part.from_s},
                  {"to_s", part.to_s},
                  {"chosen", result.candidates[part.chosen].name}};
    entry["ways"] = Json::Array();
    for (std::size_t c = 0; c < part.costs.size(); ++c) {
      const AbortCost& cost = part.costs[c];
      entry["ways"].Append({{"way", result.candidates[c].name},
                            {"robots", cost.robots},
                            {"impact_m_s", cost.impact_m_s},
                            {"impact_max_m_s", cost.worst_m_s},
                            {"link", cost.link},
                            {"torque_max_nm", cost.torque_nm},
                            {"rest", cost.rest},
                            {"overlap", cost.overlap},
                            {"cost_m_s", cost.cost_m_s()}});
    }
    json["parts"].Append(std::move(entry));
  }
  const AbortFigure& figure = result.figure;
  json["impact_m_s"] = figure.impact_m_s;
  json["impact_max_m_s"] = figure.impact_max_m_s;
  json["damped_impact_m_s"] = figure.damped_impact_m_s;
  json["damped_impact_max_m_s"] = figure.damped_impact_max_m_s;
  return json;
}

}  // namespace tumbler
