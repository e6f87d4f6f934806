#include "offline/studies/study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <span>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/spread_names.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

/// Plays robots of a study, on several threads.
class Player {
 public:
  Player(const RobustnessStudy& study, int threads) : threads_(std::max(1, threads)) {
    if (study.lanes) {
      lanes_ = std::make_unique<LaneTrials>(study);
    } else {
      of_thread_.assign(Index(threads_), Trials(study));
    }
  }

  [[nodiscard]] const Trials& trials() const {
    return lanes_ ? lanes_->trials() : of_thread_.front();
  }
  /// As many robots as keep all threads busy for a second or so.
  [[nodiscard]] std::size_t batch() const {
    return Index(threads_) * (lanes_ ? 64 * Packet::kLanes : 8);
  }

  std::vector<TrialOutcome> Play(std::span<const std::uint64_t> indices) {
    std::vector<TrialOutcome> outcomes(indices.size());
    const std::size_t each = lanes_ ? Packet::kLanes : 1;
    const int parts = static_cast<int>((indices.size() + each - 1) / each);
    ParallelFor(parts, threads_, [&](int part, int thread) {
      const std::size_t first = Index(part) * each;
      if (!lanes_) {
        outcomes[first] = of_thread_[Index(thread)].Play(indices[first]);
        return;
      }
      const std::size_t count = std::min(each, indices.size() - first);
      std::vector<TrialOutcome> played = lanes_->Play(indices.subspan(first, count));
      std::move(played.begin(), played.end(),
                outcomes.begin() + static_cast<std::ptrdiff_t>(first));
    });
    return outcomes;
  }

 private:
  int threads_;
  std::unique_ptr<LaneTrials> lanes_;  // which threads share
  std::vector<Trials> of_thread_;
};

/// What the plan's files have, as lines of a checkpoint.
std::string KnownLines(const WorkPlan& plan, const std::string& identity,
                       std::optional<WorkFile>& checkpoint) {
  const WorkFile::Work work = CheckpointOf(identity);
  Outcomes known;
  std::string lines;
  if (!plan.checkpoint.empty()) checkpoint.emplace(plan.checkpoint, work, lines);
  ReadCheckpointLines(lines, plan.checkpoint, 2, known);
  for (const std::string& path : plan.merged)
    ReadCheckpointLines(WorkFile::Read(path, work), path, 2, known);
  lines.clear();
  for (const auto& [index, outcome] : known) lines += CheckpointLine(index, outcome);
  return lines;
}

Json MapToJson(const SuccessMap& map) {
  Json json = {{"x", map.x}, {"y", map.y}};
  for (int i = 1; i < SuccessMap::kCells; ++i) json["edges_sigma"].Append(map.EdgeOf(i));
  for (const auto& row : map.cells) {
    Json robots = Json::Array(), stand = Json::Array();
    for (const SuccessMap::Cell& cell : row) {
      robots.Append(cell.robots);
      stand.Append(cell.stand);
    }
    json["robots"].Append(robots);
    json["as_asked"].Append(stand);
  }
  return json;
}

Json LiesToJson(const RobustnessResult& result) {
  Json json = Json::Array();
  for (const Lies& lies : result.HowTheyLay()) {
    Json entry = {{"low_rad", lies.low_rad},
                  {"high_rad", lies.high_rad},
                  {"robots", lies.robots},
                  {"as_asked", lies.stand}};
    for (const auto& [node, count] : lies.begun) entry["begun"][node] = count;
    json.Append(std::move(entry));
  }
  return json;
}

/// A normal number as unlikely as a mean square of m normal numbers [Wilson, Hilferty 1931]: with
/// few of them large squares are usual.
double NormalDeviateOfMeanSquare(double mean_square, int m) {
  const double variance = 2.0 / (9.0 * m);
  const double root = portable::Power(mean_square, 1.0 / 3);
  return (root - (1 - variance)) / std::sqrt(variance);
}

}  // namespace

int RobustnessResult::Count(Verdict verdict) const {
  return static_cast<int>(
      std::count_if(trials.begin(), trials.end(),
                    [&](const TrialOutcome& trial) { return trial.verdict == verdict; }));
}

int RobustnessResult::Judged() const {
  return static_cast<int>(std::ranges::count_if(trials, &TrialOutcome::judged));
}

Share RobustnessResult::stands() const { return ShareOf(Count(Verdict::kStands), Judged()); }

Share RobustnessResult::ends() const {
  return ShareOf(Count(Verdict::kStands) + Count(Verdict::kGotUp), Judged());
}

int RobustnessResult::AmissAtRest() const {
  return static_cast<int>(std::count_if(
      trials.begin(), trials.end(),
      [](const TrialOutcome& trial) { return trial.verdict == Verdict::kAmiss && trial.rests; }));
}

std::vector<Influence> RobustnessResult::Influences() const {
  std::vector<Influence> influences;
  const int judged = Judged(), failed = judged - Count(Verdict::kStands);
  if (failed == 0 || failed == judged) return influences;
  const std::size_t quantities = trials.front().variation.deviates.size();
  for (std::size_t q = 0; q < quantities; ++q) {
    Influence influence;
    influence.name = trials.front().variation.deviates[q].name;
    influence.deviate = q;
    double sum = 0, square = 0, all_square = 0;
    for (const TrialOutcome& trial : trials) {
      if (!trial.judged()) continue;
      const double sigma = trial.variation.deviates[q].sigma;
      all_square += sigma * sigma;
      if (trial.stands()) continue;
      sum += sigma;
      square += sigma * sigma;
    }
    all_square /= judged;
    influence.mean_sigma = sum / failed;
    influence.excess = square / failed / all_square - 1;
    influence.significance = std::max(std::abs(influence.mean_sigma) / std::sqrt(all_square) *
                                          std::sqrt(static_cast<double>(failed)),
                                      NormalDeviateOfMeanSquare(1 + influence.excess, failed));
    influences.push_back(influence);
  }
  std::stable_sort(
      influences.begin(), influences.end(),
      [](const Influence& a, const Influence& b) { return a.significance > b.significance; });
  return influences;
}

int SuccessMap::CellOf(double sigma) const {
  const double width = 2 * half_width / (kCells - 2);
  return std::clamp(static_cast<int>(std::floor((sigma + half_width) / width)) + 1, 0, kCells - 1);
}

double SuccessMap::EdgeOf(int cell) const {
  return -half_width + (cell - 1) * 2 * half_width / (kCells - 2);
}

std::optional<SuccessMap> RobustnessResult::Map() const {
  const std::vector<Influence> influences = Influences();
  if (influences.size() < 2) return std::nullopt;
  SuccessMap map;
  map.x = influences[0].name;
  map.y = influences[1].name;
  map.half_width = 2.1 * (study.scale > 0 ? study.scale : 1);
  for (const TrialOutcome& trial : trials) {
    if (!trial.judged()) continue;
    const auto& deviates = trial.variation.deviates;
    SuccessMap::Cell& cell = map.cells[Index(map.CellOf(deviates[influences[1].deviate].sigma))]
                                      [Index(map.CellOf(deviates[influences[0].deviate].sigma))];
    ++cell.robots;
    if (trial.stands()) ++cell.stand;
  }
  return map;
}

std::vector<Departures> RobustnessResult::Where() const {
  std::map<std::string, std::pair<std::vector<double>, int>> nodes;
  for (const TrialOutcome& trial : trials) {
    if (!trial.fails()) continue;
    auto& [times, others] = nodes[trial.in.empty() ? "before the first" : trial.in];
    if (trial.left_s < 0) {
      ++others;
    } else {
      times.push_back(trial.left_s);
    }
  }
  std::vector<Departures> where;
  for (auto& [node, found] : nodes) {
    auto& [times, others] = found;
    Departures& departures = where.emplace_back();
    departures.in = node;
    departures.left = static_cast<int>(times.size());
    departures.others = others;
    if (times.empty()) continue;
    std::sort(times.begin(), times.end());
    departures.first_s = times.front();
    departures.median_s = times[times.size() / 2];
    departures.last_s = times.back();
  }
  return where;
}

std::vector<Lies> RobustnessResult::HowTheyLay() const {
  std::vector<Lies> classes;
  if (!study.drops || trials.empty()) return classes;
  constexpr double kTurn = 2 * std::numbers::pi, kApart_rad = 0.2;
  std::vector<std::pair<double, const TrialOutcome*>> lies;
  for (const TrialOutcome& trial : trials) lies.emplace_back(trial.lies_rad, &trial);
  std::sort(lies.begin(), lies.end());
  // The circle is cut open where it has a gap, if there is one between the last and the first.
  std::size_t cut = 0;
  while (cut + 1 < lies.size() && lies[cut + 1].first - lies[cut].first <= kApart_rad) ++cut;
  const bool joined = lies.front().first + kTurn - lies.back().first <= kApart_rad;
  if (joined && cut + 1 < lies.size()) {
    for (std::size_t i = 0; i <= cut; ++i) lies[i].first += kTurn;
    std::sort(lies.begin(), lies.end());
  }
  for (const auto& [pitch_rad, trial] : lies) {
    if (classes.empty() || pitch_rad - classes.back().high_rad > kApart_rad)
      classes.push_back({pitch_rad, pitch_rad, 0, 0, {}});
    Lies& last = classes.back();
    last.high_rad = pitch_rad;
    ++last.robots;
    if (trial->stands()) ++last.stand;
    ++last.begun[trial->begun];
  }
  return classes;
}

WorkDone RunStudy(const RobustnessStudy& study, const WorkPlan& plan, const Processes& processes) {
  const std::string identity = IdentityOf(study), files = HashOfFiles(study);
  std::optional<WorkFile> checkpoint;
  Outcomes known;
  ReadCheckpointLines(
      processes.FromFirst(processes.rank() == 0 ? KnownLines(plan, identity, checkpoint)
                                                : std::string()),
      "checkpoint", 2, known);
  std::vector<std::uint64_t> all, mine;  // still to be played by all processes, and by this one
  const auto robots = static_cast<std::uint64_t>(plan.robots);
  const auto shards = static_cast<std::uint64_t>(plan.shards);
  for (auto i = static_cast<std::uint64_t>(plan.shard - 1); i < robots; i += shards) {
    if (known.count(i) > 0) continue;
    if (all.size() % Index(processes.count()) == Index(processes.rank())) mine.push_back(i);
    all.push_back(i);
  }
  Player player(study, plan.threads);
  const std::size_t round = player.batch() * Index(processes.count());
  for (std::size_t done = 0, own = 0; done < all.size(); done += round, own += player.batch()) {
    if (plan.interrupt != nullptr && *plan.interrupt) break;
    const std::size_t first = std::min(own, mine.size());
    const std::size_t count = std::min(player.batch(), mine.size() - first);
    const auto indices = std::span<const std::uint64_t>(mine).subspan(first, count);
    const std::vector<TrialOutcome> outcomes = player.Play(indices);
    if (processes.count() == 1 && !checkpoint) {
      for (std::size_t i = 0; i < count; ++i) known.emplace(indices[i], outcomes[i]);
    } else {
      std::string lines;
      for (std::size_t i = 0; i < count; ++i) lines += CheckpointLine(indices[i], outcomes[i]);
      for (const std::string& text : processes.ToFirst(lines)) {
        ReadCheckpointLines(text, "checkpoint", 1, known);
        if (checkpoint) checkpoint->Add(text);
      }
    }
    if (plan.progress) plan.progress(static_cast<int>(known.size()));
  }
  WorkDone work;
  work.known = static_cast<int>(std::distance(known.begin(), known.lower_bound(robots)));
  if (work.known < plan.robots || processes.rank() > 0) return work;
  RobustnessResult& result = work.result.emplace();
  result.name = player.trials().name();
  result.study = study;
  result.files = files;
  result.study.spreads = player.trials().study().spreads;
  for (std::uint64_t i = 0; i < robots; ++i) {
    result.trials.push_back(known.at(i));
    result.trials.back().variation = player.trials().Draw(i);
  }
  return work;
}

RobustnessResult RunStudy(const RobustnessStudy& study, int count, int threads) {
  WorkPlan plan;
  plan.robots = count;
  plan.threads = threads;
  return *RunStudy(study, plan, Processes()).result;
}

Agreement Compare(const RobustnessResult& first, const RobustnessResult& second) {
  Agreement agreement;
  int standing = 0, same = 0;
  for (std::size_t i = 0; i < first.trials.size(); ++i) {
    const TrialOutcome& a = first.trials[i];
    const TrialOutcome& b = second.trials[i];
    if (a.stands() == b.stands() && a.judged() == b.judged()) ++standing;
    if (a.verdict == b.verdict) {
      ++same;
    } else {
      agreement.differences.push_back({i, a.verdict, b.verdict});
    }
  }
  agreement.standing = ShareOf(standing, static_cast<int>(first.trials.size()));
  agreement.same_verdicts = ShareOf(same, static_cast<int>(first.trials.size()));
  return agreement;
}

std::string ToText(const Agreement& agreement) {
  std::string text = fmt::format(
      "lanes and twin agree whether {} of {} robots are as asked: {}\n"
      "  and on the verdict of {}: {}\n",
      agreement.standing.count, agreement.standing.of, ToText(agreement.standing),
      agreement.same_verdicts.count, ToText(agreement.same_verdicts));
  std::map<std::string, int> kinds;
  for (const Agreement::Difference& d : agreement.differences)
    ++kinds[fmt::format("twin {}, lanes {}", ToString(d.first), ToString(d.second))];
  for (const auto& [kind, count] : kinds) text += fmt::format("  {}: {}\n", kind, count);
  return text;
}

Json ToJson(const Agreement& agreement) {
  Json json = {
      {"robots", agreement.standing.of},          {"agree", agreement.standing.count},
      {"share", agreement.standing.value()},      {"share_95_low", agreement.standing.low},
      {"share_95_high", agreement.standing.high}, {"same_verdict", agreement.same_verdicts.count}};
  Json& differ = json["differ"];
  differ = Json::Array();
  for (const Agreement::Difference& d : agreement.differences)
    differ.Append({{"index", d.index}, {"twin", ToString(d.first)}, {"lanes", ToString(d.second)}});
  return json;
}

std::string UnitOfDepartures(const RobustnessStudy& study) {
  return study.scale == 1 ? "standard deviations" : "standard deviations before --scale";
}

std::string DisturbancesOf(const RobustnessStudy& study) {
  return (study.push_n > 0 ? fmt::format(", pushed with {:.6g} N", study.push_n) : "") +
         (study.sensor_faults ? ", with sensors that fail" : "") +
         (study.drops ? ", dropped in random poses" : "") +
         (study.run.get_ups > 0 ? fmt::format(", robots get up {} times at most", study.run.get_ups)
                                : "");
}

std::string NotJudgedText(const RobustnessResult& result) {
  std::map<std::string, int> reasons;
  for (const TrialOutcome& trial : result.trials) {
    if (!trial.judged()) ++reasons[trial.reason];
  }
  std::string text;
  for (const auto& [reason, count] : reasons) {
    text += fmt::format("{}{} robot{} not judged: {}", text.empty() ? "" : "; ", count,
                        count == 1 ? " was" : "s were", reason);
  }
  return text;
}

namespace {

/// The share in words, or that there is none.
std::string ShareText(const RobustnessResult& result) {
  const Share share = result.stands();
  if (share.of == 0)
    return fmt::format("{}: none of {} robots was judged\n", result.name, result.trials.size());
  const bool all = Index(share.of) == result.trials.size();
  return fmt::format("{}: {} of {} robots{} are as asked after every motion: {}\n", result.name,
                     share.count, share.of, all ? "" : " that were judged", ToText(share));
}

}  // namespace

std::string ToText(const RobustnessResult& result) {
  std::string text = ShareText(result);
  if (const std::string not_judged = NotJudgedText(result); !not_judged.empty())
    text += fmt::format("  {}\n", not_judged);
  text += fmt::format(
      "  {}spreads times {:.6g}, seed {}{}{}\n", result.study.lanes ? "in lanes, " : "",
      result.study.scale, result.study.seed,
      result.study.run.cycles > 0 ? fmt::format(", {} cycles", result.study.run.cycles) : "",
      DisturbancesOf(result.study));
  if (result.study.run.get_ups > 0 && result.Judged() > 0) {
    const Share ends = result.ends();
    text += fmt::format("  {} are as asked in the end, those that got up among them: {}\n",
                        ends.count, ToText(ends));
  }
  std::string counts;
  for (const Verdict verdict : kVerdicts) {
    if (verdict == Verdict::kStands || result.Count(verdict) == 0) continue;
    counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", ToString(verdict),
                          result.Count(verdict));
    if (verdict == Verdict::kAmiss)
      counts += fmt::format(" ({} of them rest at last as after a motion)", result.AmissAtRest());
  }
  if (!counts.empty()) text += fmt::format("  {}\n", counts);
  for (const Departures& d : result.Where()) {
    text += fmt::format("    {}:", d.in);
    if (d.left > 0) {
      text +=
          fmt::format(" {} left the model's way {:.2f} ... {:.2f} s after it began (median {:.2f})",
                      d.left, d.first_s, d.last_s, d.median_s);
    }
    if (result.study.drops) {
      text += fmt::format(" {}", d.others);
    } else if (d.others > 0) {
      text += fmt::format("{} {} kept to it", d.left > 0 ? "," : "", d.others);
    }
    text += "\n";
  }
  for (const Lies& lies : result.HowTheyLay()) {
    text += fmt::format("  {:4} lay at {:+.3f} ... {:+.3f} rad of pitch, {} of them as asked:",
                        lies.robots, lies.low_rad, lies.high_rad, lies.stand);
    for (const auto& [node, count] : lies.begun)
      text += fmt::format(" {} {}", count, node.empty() ? "did not begin" : '"' + node + '"');
    text += "\n";
  }
  if (result.study.drops) {
    std::map<std::string, int> reasons;
    for (const TrialOutcome& trial : result.trials) {
      if (trial.fails()) ++reasons[trial.reason];
    }
    for (const auto& [reason, count] : reasons) text += fmt::format("    {:4} {}\n", count, reason);
    int most = 0, drops = 0;
    for (const TrialOutcome& trial : result.trials) {
      most = std::max(most, trial.motions);
      drops += trial.drops;
    }
    text += fmt::format(
        "  at most {} motion{}; {} drops, of which {} ended with links in each other and do not "
        "count\n",
        most, most == 1 ? "" : "s", drops, drops - static_cast<int>(result.trials.size()));
  }
  const std::vector<Influence> influences = result.Influences();
  if (influences.empty()) return text;
  text += fmt::format("  what those that are not as asked have in common [{}]\n",
                      UnitOfDepartures(result.study));
  for (const Influence& influence : influences) {
    text += fmt::format("    {:<24} mean {:+.2f}, square {:+.0f} %{}\n", influence.name,
                        influence.mean_sigma, 100 * influence.excess,
                        influence.telling() ? "" : "  (may be chance)");
  }
  return text;
}

Json ToJson(const RobustnessResult& result) {
  const Share share = result.stands();
  const Spreads& spreads = result.study.spreads;
  Json json = {{"name", result.name},
               {"motion", result.study.motion},
               {"seed", result.study.seed},
               {"scale", result.study.scale},
               {"cycles", result.study.run.cycles},
               {"hold_s", result.study.run.hold_s},
               {"lanes", result.study.lanes},
               {"push_n", result.study.push_n},
               {"sensor_faults", result.study.sensor_faults},
               {"drops", result.study.drops},
               {"get_ups", result.study.run.get_ups},
               {"robots", result.trials.size()},
               {"judged", share.of},
               {"as_asked", share.count},
               {"share", share.of == 0 ? Json() : Json(share.value())},
               {"share_95_low", share.low},
               {"share_95_high", share.high}};
  Json& spread_values = json["spreads"];
  for (const SpreadName& spread : kSpreadNames) spread_values[spread.key] = spread.JsonOf(spreads);
  Json& counts = json["verdicts"];
  for (const Verdict verdict : kVerdicts) counts[ToString(verdict)] = result.Count(verdict);
  json["amiss_at_rest"] = result.AmissAtRest();
  Json& influences = json["influences"];
  influences = Json::Array();
  for (const Influence& influence : result.Influences()) {
    influences.Append({{"name", influence.name},
                       {"mean_sigma", influence.mean_sigma},
                       {"square_excess", influence.excess},
                       {"significance", influence.significance}});
  }
  Json& where = json["where"];
  where = Json::Array();
  // A robot that was dropped does not begin as the model does, whose way it could leave.
  const std::vector<Departures> departures =
      result.study.drops ? std::vector<Departures>() : result.Where();
  for (const Departures& d : departures) {
    where.Append({{"in", d.in},
                  {"left", d.left},
                  {"kept", d.others},
                  {"first_s", d.first_s},
                  {"median_s", d.median_s},
                  {"last_s", d.last_s}});
  }
  if (result.study.drops) json["lay"] = LiesToJson(result);
  if (const std::optional<SuccessMap> map = result.Map()) json["map"] = MapToJson(*map);
  Json& failures = json["not_as_asked"];
  failures = Json::Array();
  for (std::size_t i = 0; i < result.trials.size(); ++i) {
    const TrialOutcome& trial = result.trials[i];
    if (!trial.fails()) continue;
    Json robot = {{"index", i},
                  {"verdict", ToString(trial.verdict)},
                  {"motions", trial.motions},
                  {"in", trial.in},
                  {"reason", trial.reason},
                  {"left_s", trial.left_s}};
    for (const auto& [name, sigma] : trial.variation.deviates) robot["sigma"][name] = sigma;
    failures.Append(std::move(robot));
  }
  Json& not_judged = json["not_judged"];
  not_judged = Json::Array();
  for (std::size_t i = 0; i < result.trials.size(); ++i) {
    const TrialOutcome& trial = result.trials[i];
    if (trial.judged()) continue;
    not_judged.Append({{"index", i}, {"in", trial.in}, {"reason", trial.reason}});
  }
  return json;
}

}  // namespace tumbler
