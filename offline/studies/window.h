#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// A property of the ground in which a window is found.
struct GroundProperty {
  const char* name;  ///< For people.
  const char* key;   ///< Of JSON and of a primitive's `[window]`.
  const char* unit;  ///< For people; empty: none.
  double ContactLaw::*value;
  double RobotVariation::*factor;
};
inline constexpr std::array<GroundProperty, 3> kGroundProperties = {{
    {"friction", "mu", "", &ContactLaw::mu, &RobotVariation::friction},
    {"stiffness", "stiffness_n_per_m", "N/m", &ContactLaw::stiffness_n_per_m,
     &RobotVariation::stiffness},
    {"damping", "damping_n_s_per_m", "N s/m", &ContactLaw::damping_n_s_per_m,
     &RobotVariation::damping},
}};

/// The values of one property around the model's with which the model is as asked, without a gap
/// as wide as two neighbours of the scan.
struct PropertyWindow {
  GroundProperty property{};
  double model = 0;                 ///< The task's value.
  std::array<double, 2> scanned{};  ///< Between which values it was looked for.
  /// The least and the largest value of the window that was played.
  std::array<double, 2> ends{};
  /// What became of the robot with the value next to each end, at most 2 % beyond it, and that
  /// value; empty: the scan ends there, and the window reaches at least so far.
  struct Beyond {
    double value = 0;
    TrialOutcome outcome;
  };
  std::array<std::optional<Beyond>, 2> beyond;
  /// Values outside the window, which the scan came to, with which the model is as asked again.
  std::vector<double> again;
};

/// What becomes of the model on ground with any of these frictions and stiffnesses.
struct GroundMap {
  std::vector<double> mu, stiffness_n_per_m;
  std::vector<std::vector<TrialOutcome::Verdict>> verdicts;  ///< [stiffness][mu]
};

/// What a motion takes of its ground: the windows of the model.
struct WindowResult {
  std::string name;
  RobustnessStudy study;     ///< With `lanes` as it was played.
  std::string files;         ///< HashOfFiles of the study when it began.
  std::string not_in_lanes;  ///< Why it was played in the twin; empty: it was played in lanes.
  TrialOutcome model;        ///< On the task's own ground.
  /// In the order of kGroundProperties; empty where the model itself is not as asked.
  std::vector<PropertyWindow> windows;
  std::optional<GroundMap> map;  ///< Where it was played in lanes.
};

/// How closely windows are looked at. These find ends to 2 %, and gaps as wide as 13 % (friction
/// below the task's 0.3: 8 %).
struct WindowScan {
  int steps = 24;  ///< To each side, of equal logarithms; whole packets of lanes.
  int parts = 9;   ///< Of a step at an end, of which one is known.
  int map_mu = 16, map_stiffness = 9;  ///< Sides of the map.
};

/// Finds the windows: each property by itself, in steps of equal logarithms from a twentieth of the
/// task's value to twenty times it (friction: from 0.05 to 2), then at the ends by parts of a step.
/// It is played in lanes, whose steps are fine enough for the hardest ground, or in the
/// twin where lanes cannot have the motion.
/// @pre the study has no pushes, sensors' faults, drops and get-ups.
/// @throws as Trials, and Refused where there is no ground, or one without friction or damping.
WindowResult FindWindows(const RobustnessStudy& study, int threads, const WindowScan& scan = {});

/// The same of a motion that is in no file yet, held as long as by default, with default drives.
/// @throws Refused  as above, and where the motion is none that can be played by itself; and
/// std::runtime_error  when a temporary file cannot be written.
WindowResult FindWindows(const PrimitiveFile& file, int threads);

/// The windows as a primitive's file has them. @throws FileError  when the drives file cannot be
/// read. @pre the model is as asked.
GroundWindow WindowOf(const WindowResult& result);

/// Writes the windows into the motion's primitive. @returns its path.
/// @throws FileError  when a file cannot be read or written.
/// @throws Refused    when a file of the study was changed since it began, the motion is a
/// sequence,
///                    or the model itself was not as asked.
/// @pre the study has no twin file.
std::string CertifyWindow(const WindowResult& result);

/// For people: several lines, ending with a line feed.
std::string ToText(const WindowResult& result);
Json ToJson(const WindowResult& result);

/// A scan of one number, for FindWindows.
/// @param play     says of values whether each is as asked.
/// @param scanned  from and to, around `model`, which is as asked.
/// @param steps    of the scan to each side, at least 1.
/// @param parts    into how many a step is divided at an end, at least 1.
struct Scan {
  std::array<double, 2> ends{};
  std::array<std::optional<double>, 2> beyond;  ///< The nearest value that is not as asked.
  std::vector<double> again;
};
Scan ScanAround(double model, std::array<double, 2> scanned, int steps, int parts,
                const std::function<std::vector<bool>(const std::vector<double>&)>& play);

}  // namespace tumbler
