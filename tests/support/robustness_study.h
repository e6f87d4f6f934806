#pragma once

#include <string>

#include "offline/studies/study.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

namespace tumbler {

inline const Scene& TumblerScene() {
  static const Scene scene = HandstandProblem().scene;
  return scene;
}
inline const PlanarRobot& Tumbler() { return TumblerScene().robot; }

/// Of a motion in `primitives/`, with the drives that it was found for.
inline RobustnessStudy StudyOf(const std::string& motion) {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/" + motion);
  return study;
}

/// With the drives of the example that have a sensor, and what that sensor does wrong.
inline RobustnessStudy SensorStudyOf(const std::string& motion) {
  RobustnessStudy study = StudyOf(motion);
  study.drives = testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml");
  study.twin = testing::SourcePath("primitives/robots/tumbler_twin_sensor.toml");
  return study;
}

/// A study of which about a third does not stand.
inline RobustnessStudy HardStudy() {
  RobustnessStudy study = StudyOf("handstand.toml");
  study.scale = 2.5;
  study.seed = 17;
  return study;
}

/// The path of a new file with this text.
inline std::string Written(const testing::TemporaryFolder& folder, const std::string& name,
                           const std::string& text) {
  std::string path = folder / name;
  testing::WriteFile(path, text);
  return path;
}

}  // namespace tumbler
