#include "offline/studies/abort_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/program.h"
#include "offline/scene/normal.h"

namespace tumbler {
namespace {

/// A tick that is later than this is answered at the usual rates of ticks [s].
constexpr double kAnswered_s = 0.004;
/// The seeds of what happens to robots are not those of the robots, nor those of the search.
constexpr std::uint64_t kChecks = 0x6368'6563'6b73'0001;

Json FiguresToJson(const ImpactFigures& figures) {
  return {{"impact_median_m_s", figures.median_m_s},
          {"impact_90_percent_m_s", figures.ninetieth_m_s},
          {"impact_max_m_s", figures.worst_m_s},
          {"rest", figures.rest}};
}

std::string TextOf(const char* name, const ImpactFigures& figures, std::size_t aborts) {
  return fmt::format(
      "  {:<20} median {:.2f}, 90 % {:.2f}, worst {:.2f} m/s; {} of {} rest where the motion "
      "begins or ends\n",
      name, figures.median_m_s, figures.ninetieth_m_s, figures.worst_m_s, figures.rest, aborts);
}

}  // namespace

ImpactFigures FiguresOf(const std::vector<CheckedAbort>& aborts,
                        AbortOutcome CheckedAbort::*which) {
  ImpactFigures figures;
  std::vector<double> impacts;
  for (const CheckedAbort& abort : aborts) {
    impacts.push_back((abort.*which).impact_m_s);
    if (!(abort.*which).rests_as.empty()) ++figures.rest;
  }
  if (impacts.empty()) return figures;
  std::ranges::sort(impacts);
  figures.median_m_s = impacts[impacts.size() / 2];
  figures.ninetieth_m_s = impacts[impacts.size() * 9 / 10];
  figures.worst_m_s = impacts.back();
  return figures;
}

std::int64_t AbortCheckResult::outside_limits() const {
  std::int64_t outside = 0;
  for (const CheckedAbort& abort : aborts)
    outside += abort.with.setpoints_outside_limits + abort.without.setpoints_outside_limits;
  return outside;
}

AbortCheckResult CheckAborts(const AbortStudy& study) {
  const std::vector<AbortTrials> of_thread(Index(std::max(1, study.threads)),
                                           LoadAbortTrials(study));
  const Primitive<double>& primitive = of_thread.front().primitive();
  if (!primitive.aborts.present()) {
    throw Refused(study.primitive + ": has no table of aborts; let tumbler abort find one and " +
                  "write it with --write");
  }
  AbortCheckResult result;
  result.name = primitive.name.view();
  result.study = study;
  std::vector<CheckedAbort> aborts(Index(study.robots));
  std::atomic<int> played = 0;
  ParallelFor(2 * study.robots, study.threads, [&](int i, int thread) {
    if (study.interrupt != nullptr && *study.interrupt) return;
    const int robot = i / 2;
    const AbortTrials& trials = of_thread[Index(thread)];
    Normal random(study.seed ^ kChecks, static_cast<std::uint64_t>(robot));
    AbortTrial trial;
    trial.variation = AbortRobot(study, trials.shared(), robot);
    trial.time_s = random.DrawUniform() * primitive.duration_s;
    trial.cause = static_cast<AbortCause>(robot % kAbortCauseCount);
    trial.late_s = kAnswered_s + random.DrawUniform() * (study.late_s - kAnswered_s);
    const bool with = i % 2 == 0;
    if (with) trial.table = primitive.aborts;
    CheckedAbort& abort = aborts[Index(robot)];
    (with ? abort.with : abort.without) = trials.Play(trial);
    if (with) {
      abort.time_s = trial.time_s;
      abort.cause = trial.cause;
    }
    ++played;
    if (thread == 0 && study.progress) study.progress(played, 2 * study.robots);
  });
  if (study.interrupt == nullptr || !*study.interrupt) result.aborts = std::move(aborts);
  return result;
}

std::string ToText(const AbortCheckResult& result) {
  const std::size_t aborts = result.aborts.size();
  std::string text = fmt::format(
      "{}: {} aborts at random times by stops, ticks late by up to {:.6g} ms, silence and repeated "
      "replies; spreads times {:.6g}, seed {}\n"
      "  the hardest impact of each\n",
      result.name, aborts, 1e3 * result.study.late_s, result.study.scale, result.study.seed);
  text += TextOf("with its table", FiguresOf(result.aborts, &CheckedAbort::with), aborts);
  text += TextOf("without", FiguresOf(result.aborts, &CheckedAbort::without), aborts);
  text += fmt::format("  setpoints outside their limits: {}\n", result.outside_limits());
  return text;
}

Json ToJson(const AbortCheckResult& result) {
  Json json = {{"primitive", result.name},
               {"aborts", result.aborts.size()},
               {"late_s", result.study.late_s},
               {"seed", result.study.seed},
               {"scale", result.study.scale}};
  json["with"] = FiguresToJson(FiguresOf(result.aborts, &CheckedAbort::with));
  json["without"] = FiguresToJson(FiguresOf(result.aborts, &CheckedAbort::without));
  json["setpoints_outside_limits"] = result.outside_limits();
  json["each"] = Json::Array();
  for (const CheckedAbort& abort : result.aborts) {
    json["each"].Append({{"time_s", abort.time_s},
                         {"cause", ToString(abort.cause)},
                         {"reaction", ToString(abort.with.reaction)},
                         {"impact_m_s", abort.with.impact_m_s},
                         {"impact_without_m_s", abort.without.impact_m_s}});
  }
  return json;
}

}  // namespace tumbler
