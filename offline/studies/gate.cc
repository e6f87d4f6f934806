#include "offline/studies/gate.h"

#include <algorithm>

namespace tumbler {

bool GateOutcome::open() const {
  return !robots.empty() &&
         std::ranges::all_of(robots, [](const TrialOutcome& robot) { return robot.stands(); });
}

GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const RobotPosterior& posterior, const GateSettings& settings) {
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
