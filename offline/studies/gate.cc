#include "offline/studies/gate.h"

#include <algorithm>

#include "common/files/program.h"

namespace tumbler {

bool GateOutcome::open() const {
  return !robots.empty() &&
         std::ranges::all_of(robots, [](const TrialOutcome& robot) { return robot.stands(); });
}

GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const RobotPosterior& posterior, const GateSettings& settings) {
  if (LoadMotion(motion).graph.edge_count > 0)
    throw Refused(motion + ": goes on for ever; the gate takes motions that end, one by one");
  RobustnessStudy study;
  study.motion = motion;
  study.drives = drives;
  Trials trials(study);
  GateOutcome outcome;
  for (int i = 0; i <= settings.draws; ++i) {
    const std::vector<double> coordinates =
        i == 0 ? posterior.mean
               : posterior.Draw(settings.deviations, settings.seed, static_cast<std::uint64_t>(i));
    RobotVariation robot = VariationOf(trials.scene(), posterior.quantities, coordinates);
    outcome.robots.push_back(trials.Play(robot));
  }
  return outcome;
}

}  // namespace tumbler
