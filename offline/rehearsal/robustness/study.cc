#include "offline/rehearsal/robustness/study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/index.h"
#include "common/parallel_for.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;
constexpr Verdict kVerdicts[] = {Verdict::kStands, Verdict::kAmiss, Verdict::kFell,
                                 Verdict::kOverlap, Verdict::kFault};

}  // namespace

Share ShareOf(int count, int of) {
  Share share{count, of};
  if (of == 0) return share;
  constexpr double z = 1.959963984540054;
  const double n = of, p = count / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  share.low = count == 0 ? 0 : std::max(0.0, middle - half);
  share.high = count == of ? 1 : std::min(1.0, middle + half);
  return share;
}

int RobustnessResult::Count(Verdict verdict) const {
  return static_cast<int>(
      std::count_if(trials.begin(), trials.end(),
                    [&](const TrialOutcome& trial) { return trial.verdict == verdict; }));
}

Share RobustnessResult::stands() const {
  return ShareOf(Count(Verdict::kStands), static_cast<int>(trials.size()));
}

std::vector<Influence> RobustnessResult::Influences() const {
  std::vector<Influence> influences;
  const int failed = static_cast<int>(trials.size()) - Count(Verdict::kStands);
  if (failed == 0 || failed == static_cast<int>(trials.size())) return influences;
  const std::size_t quantities = trials.front().variation.deviates.size();
  for (std::size_t q = 0; q < quantities; ++q) {
    Influence influence;
    influence.name = trials.front().variation.deviates[q].name;
    double sum = 0, square = 0, all_square = 0;
    for (const TrialOutcome& trial : trials) {
      const double sigma = trial.variation.deviates[q].sigma;
      all_square += sigma * sigma;
      if (trial.verdict == Verdict::kStands) continue;
      sum += sigma;
      square += sigma * sigma;
    }
    all_square /= static_cast<double>(trials.size());
    influence.mean_sigma = sum / failed;
    influence.excess = square / failed / all_square - 1;
    // Of normal numbers the mean of m has a standard deviation of 1 / sqrt(m), and the mean square
    // one of sqrt(2 / m).
    influence.significance = std::max(std::abs(influence.mean_sigma) / std::sqrt(all_square),
                                      influence.excess / std::sqrt(2.0)) *
                             std::sqrt(static_cast<double>(failed));
    influences.push_back(influence);
  }
  std::stable_sort(
      influences.begin(), influences.end(),
      [](const Influence& a, const Influence& b) { return a.significance > b.significance; });
  return influences;
}

RobustnessResult RunStudy(const RobustnessStudy& study, int count, int threads) {
  const Trials trials(study);
  RobustnessResult result;
  result.name = trials.name();
  result.study = study;
  result.trials.resize(Index(count));
  std::vector<Trials> of_thread(Index(std::max(1, threads)), trials);
  ParallelFor(count, threads, [&](int i, int thread) {
    result.trials[Index(i)] = of_thread[Index(thread)].Play(Index(i));
  });
  return result;
}

std::string ToText(const RobustnessResult& result) {
  const Share share = result.stands();
  std::string text = fmt::format(
      "{}: {} of {} robots are as asked after every motion: {:.1f} % (95 %: {:.1f} ... {:.1f} %)\n"
      "  spreads times {:.6g}, seed {}{}\n",
      result.name, share.count, share.of, 100 * share.value(), 100 * share.low, 100 * share.high,
      result.study.scale, result.study.seed,
      result.study.run.cycles > 0 ? fmt::format(", {} cycles", result.study.run.cycles) : "");
  for (const Verdict verdict : kVerdicts) {
    if (verdict == Verdict::kStands || result.Count(verdict) == 0) continue;
    std::map<std::string, int> nodes;
    for (const TrialOutcome& trial : result.trials) {
      if (trial.verdict == verdict) ++nodes[trial.in.empty() ? "before the first" : trial.in];
    }
    std::string where;
    for (const auto& [node, number] : nodes)
      where += fmt::format("{}{} {}", where.empty() ? "" : ", ", node, number);
    text += fmt::format("  {} {}: {}\n", ToString(verdict), result.Count(verdict), where);
  }
  const std::vector<Influence> influences = result.Influences();
  if (influences.empty()) return text;
  text += "  what those that do not stand have in common [standard deviations]\n";
  for (const Influence& influence : influences) {
    text += fmt::format("    {:<24} mean {:+.2f}, square {:+.0f} %{}\n", influence.name,
                        influence.mean_sigma, 100 * influence.excess,
                        influence.significance > 3 ? "" : "  (may be chance)");
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
               {"robots", share.of},
               {"stand", share.count},
               {"share", share.value()},
               {"share_95_low", share.low},
               {"share_95_high", share.high}};
  json["spreads"] = {{"mass", spreads.mass},
                     {"inertia", spreads.inertia},
                     {"mass_centre_m", spreads.mass_centre_m},
                     {"length", spreads.length},
                     {"friction", spreads.friction},
                     {"stiffness", spreads.stiffness},
                     {"damping", spreads.damping},
                     {"gain", spreads.gain},
                     {"torque_limit", spreads.torque_limit},
                     {"slope_rad", spreads.slope_rad}};
  Json& counts = json["verdicts"];
  for (const Verdict verdict : kVerdicts) counts[ToString(verdict)] = result.Count(verdict);
  Json& influences = json["influences"];
  influences = Json::Array();
  for (const Influence& influence : result.Influences()) {
    influences.Append({{"name", influence.name},
                       {"mean_sigma", influence.mean_sigma},
                       {"square_excess", influence.excess},
                       {"significance", influence.significance}});
  }
  Json& failures = json["not_standing"];
  failures = Json::Array();
  for (std::size_t i = 0; i < result.trials.size(); ++i) {
    const TrialOutcome& trial = result.trials[i];
    if (trial.verdict == Verdict::kStands) continue;
    Json robot = {{"index", i},
                  {"verdict", ToString(trial.verdict)},
                  {"motions", trial.motions},
                  {"in", trial.in},
                  {"reason", trial.reason}};
    for (const auto& [name, sigma] : trial.variation.deviates) robot["sigma"][name] = sigma;
    failures.Append(std::move(robot));
  }
  return json;
}

}  // namespace tumbler
