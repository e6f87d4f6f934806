// The program in which scripts/count-instructions counts what a robot takes that plays the shipped
// handstand and its hold in the twin, in steps within the error bound. It prints how many
// milliseconds of the robot's time that was.

#include <cstdio>

#include "offline/studies/trial.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

[[gnu::noinline]] bool CountedRobot(Trials& trials) { return trials.Play(trials.Draw(0)).stands(); }

int Main() {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/handstand.toml");
  study.twin = testing::SourcePath("tests/data/error_bound_twin.toml");
  Trials trials(study);
  if (!CountedRobot(trials)) return 1;
  const Script& script = trials.script();
  std::printf("%.0f\n", 1e3 * script.tick_s * static_cast<double>(script.ticks.size()));
  return 0;
}

}  // namespace
}  // namespace tumbler

int main() { return tumbler::Main(); }
