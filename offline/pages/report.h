#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tumbler {

/// A collision or visual shape in the plane of the robot, in the frame of its link (x along the
/// link's x, z up).
struct ReportShape {
  /// A convex polygon, its corners counter-clockwise in x and z, with a radius swept around it. One
  /// corner makes a disc, two make a capsule.
  std::vector<std::array<double, 2>> corners_m;
  double radius_m = 0;
  bool collides = false;  ///< Collision shapes are drawn dark, the others light.
};

/// A link of the robot. Its frame is at its joint to the parent (URDF's convention); the root's
/// frame may be anywhere on the root.
struct ReportLink {
  std::string name;
  /// The shapes that are drawn. Give each link its body as a light shape, because its collision
  /// shapes may be no more than a few spheres.
  std::vector<ReportShape> shapes;
};

/// One instant of the motion.
struct ReportSample {
  double time_s = 0;
  /// x [m], z [m], pitch [rad] of each link, in the order of `links`.
  std::vector<std::array<double, 3>> link_poses;
  std::vector<double> joint_positions_rad;
  std::vector<double> joint_velocities_rad_s;
  std::vector<double> joint_torques_nm;
  double root_pitch_rad = 0;
  struct Force {
    double x_m = 0, z_m = 0;            ///< Where the force acts.
    double fx_n = 0, fz_n = 0;          ///< The force on the robot.
    double normal_x = 0, normal_z = 1;  ///< Unit normal of the surface, towards the robot.
  };
  std::vector<Force> forces;  ///< Of the contacts that carry force now.
  /// Of the joints without a motor. Empty: not known.
  std::vector<double> passive_positions_rad;
};

/// A point of the solver's progress: cost and largest violation of one evaluation.
struct ReportEvaluation {
  int evaluation = 0;
  double cost = 0;
  double violation = 0;
  bool global = false;  ///< Whether it belongs to the global search, or to the local solver.
};

/// The largest torque of any joint, of all steps of a simulation and not only of the samples.
struct ReportPeak {
  int joint = 0;
  double time_s = 0;
  double torque_nm = 0;  ///< Its size.
};

/// A table of texts: the names of the columns, then rows of as many texts.
struct ReportTable {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
};

/// The ground or an obstacle, with its label: a convex polygon with a radius swept around it. One
/// corner makes a disc, two make a bar with round ends.
struct ReportObstacle {
  std::string name;
  std::vector<std::array<double, 2>> corners_m;  ///< x, z, counter-clockwise.
  double radius_m = 0;
};

/// Everything that the page shows. Names, values and limits of joints are in one order.
struct ReportData {
  std::string title;      ///< e.g. `handstand`
  std::string subtitle;   ///< e.g. the tool's version and the seed; no date.
  double duration_s = 0;  ///< Of the motion; samples may go on after it (settling).
  double settle_s = 0;    ///< How much of what comes after it the task calls settling.
  std::vector<std::string> joint_names;
  /// Index in `links` of the link that each joint moves; empty when joint i moves link i + 1.
  std::vector<int> joint_links;
  std::vector<double> torque_limits_nm;                    ///< Of each joint, or empty: none.
  std::vector<std::array<double, 2>> position_limits_rad;  ///< Of each joint, or empty: none.
  /// The first is the root: its path is drawn, and a camera follows it.
  std::vector<ReportLink> links;
  std::vector<ReportObstacle> obstacles;
  std::optional<double> ground_z_m;  ///< Of level ground, which is marked in metres.
  /// At least two, evenly spaced, about 200 a second.
  std::vector<ReportSample> samples;
  /// May be empty. Leave out evaluations that failed: all values must be finite.
  std::vector<ReportEvaluation> evaluations;
  /// How many evaluations the whole search took: those that are shown, and those of other starts.
  std::int64_t evaluation_count = 0;
  std::optional<ReportPeak> peak_torque;  ///< Empty: that of the samples is shown.
  ReportTable minima;                     ///< The different motions that were found; may be empty.
  ReportTable window;  ///< In which ranges of the ground the model is as asked; may be empty.
  /// How the window was found, or why there is none; empty: nothing is said of one.
  std::string window_note;
  /// Names, and values with their units, in the order in which they are shown.
  std::vector<std::pair<std::string, std::string>> certificate;
};

/// Writes `DIR/index.html`, one page that needs no network, and creates DIR where it is missing.
///
/// The page plays the motion. Its address may end in a fragment of these parts, joined by `&`:
///   - `t=0.75`: that time [s], standing still;
///   - `view=robot`: the robot alone, as large as the window;
///   - `view=strip`: the strip of poses alone;
///   - `camera=fit`: the whole motion, `camera=follow`: the robot in the middle; by default the one
///     that suits the motion;
///   - `trail=off`: without the faint earlier poses;
///   - `theme=light`, `theme=dark`: by default the one that the browser prefers.
/// An existing page is replaced only once the new one is complete.
/// @returns the page's path.
/// @throws std::invalid_argument  naming the field, when a number is not finite, a size or an index
/// is wrong, or times do not increase. Nothing is written then.
/// @throws std::runtime_error  with the path, when it cannot be written.
std::string WriteReport(const ReportData& data, const std::string& directory);

}  // namespace tumbler
