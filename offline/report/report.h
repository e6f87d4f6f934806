#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace tumbler {

/// A collision or drawing shape in the plane of the robot, in the frame of its link (x along the
/// link's x, z up).
struct ReportShape {
  /// A stroked segment from (x1, z1) to (x2, z2) with a radius: a circle when both ends coincide.
  double x1_m = 0, z1_m = 0, x2_m = 0, z2_m = 0, radius_m = 0;
  bool collides = false;  ///< Collision shapes are drawn dark, the others light.
};

/// A link's frame is where its joint to the parent is (URDF's convention); the root's frame is
/// anywhere on it.
struct ReportLink {
  std::string name;
  /// What is drawn. Give each link its body as a light shape: collision shapes alone may be a few
  /// spheres.
  std::vector<ReportShape> shapes;
};

/// One instant of the motion.
struct ReportSample {
  double time_s = 0;
  std::vector<std::array<double, 3>>
      link_poses;  ///< x [m], z [m], pitch [rad] of each link, in the order of `links`.
  std::vector<double> joint_positions_rad;
  std::vector<double> joint_velocities_rad_s;
  std::vector<double> joint_torques_nm;
  double root_pitch_rad = 0;
  struct Force {
    double x_m = 0, z_m = 0;            ///< where it acts
    double fx_n = 0, fz_n = 0;          ///< on the robot
    double normal_x = 0, normal_z = 1;  ///< Unit normal of the surface, towards the robot.
  };
  std::vector<Force> forces;  ///< Contacts that carry force now.
};

/// A curve of the solver's progress: cost and largest violation after each evaluation.
struct ReportEvaluation {
  int evaluation = 0;
  double cost = 0;
  double violation = 0;
  bool global = false;  ///< of the global search, else of the local solver
};

/// A labelled line or area of the ground and the obstacles.
struct ReportObstacle {
  std::string name;
  enum class Kind { kHalfSpace, kCircle, kBox } kind = Kind::kHalfSpace;
  double x_m = 0, z_m = 0;            ///< A point of the half-space's surface, or the centre.
  double normal_x = 0, normal_z = 1;  ///< Out of the half-space; first side of the box.
  double half_x_m = 0, half_z_m = 0;  ///< Of the box: half its sides without the rounding ...
  double radius_m = 0;                ///< ... by this radius. Of the circle.
};

/// Everything the page shows. Joint values, names and limits are all in one order of joints.
struct ReportData {
  std::string title;      ///< e.g. `handstand`
  std::string subtitle;   ///< e.g. tool version, seed, date-free
  double duration_s = 0;  ///< The motion's; samples may go on after it (settling).
  std::vector<std::string> joint_names;
  /// Index in `links` of the link that each joint moves; empty when joint i moves link i + 1.
  std::vector<int> joint_links;
  std::vector<double> torque_limits_nm;                    ///< Of each joint, or empty: none.
  std::vector<std::array<double, 2>> position_limits_rad;  ///< Of each joint, or empty: none.
  std::vector<ReportLink>
      links;  ///< The first is the root: its path is drawn, a camera follows it.
  std::vector<ReportObstacle> obstacles;
  std::vector<ReportSample> samples;  ///< At least two, evenly spaced, about 200 a second.
  std::vector<ReportEvaluation>
      evaluations;  ///< May be empty. Leave out those that failed: all values must be finite.
  std::vector<std::pair<std::string, std::string>>
      certificate;  ///< Name and value with unit, in order.
};

/// Writes `DIR/index.html`, one page that needs no network, and creates DIR where it is missing.
///
/// The page plays the motion. Its address may end in a fragment of these parts, joined by `&`:
///   `t=0.75`        that time [s], standing still;
///   `view=robot`    the robot alone, as large as the window; `view=strip` the strip of poses
///   alone; `camera=fit`    the whole motion, or `camera=follow` the robot in the middle; by
///   default what suits the motion; `trail=off`     without the faint earlier poses; `theme=light`
///   or `theme=dark`; by default what the browser prefers.
/// An existing page is replaced only once the new one is complete.
/// @returns the page's path.
/// @throws std::invalid_argument naming the field when a number is not finite, a size or an index
/// is wrong, or times
///   do not increase; nothing is written then.
/// @throws std::runtime_error with the path when it cannot be written.
std::string WriteReport(const ReportData& data, const std::string& directory);

}  // namespace tumbler
