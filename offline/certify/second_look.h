#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/files/purpose.h"
#include "offline/certify/certificate.h"
#include "offline/certify/driven_motion.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A motion looked at again, by a rollout with a step 16 times finer than the one that found it,
/// in space 4 times.
/// What the solver's own step hides, such as the spike of an impact between two of its steps or a
/// landing that holds in its arithmetic only, shows here.
struct SecondLook {
  double step_s = 0;
  /// What the `terminal` terms of the cost with a weight ask for, each at its instant. Where the
  /// motion is to end at rest, also where the robot is 2 s later: each position asked for at the
  /// end of the settle phase, and the speed. A velocity of 0 asked for there is judged 2 s later
  /// only.
  std::vector<PurposeFigure> purpose;
  /// That a robot which was as asked 2 s later does not stay.
  struct Leaving {
    double after_s = 0;    ///< The end of the motion.
    PurposeFigure figure;  ///< The position that was asked for, and where it is then.
    Disturbance disturbance;
  };
  /// Absent where the robot stays until kStays_s: with exact joints, or as drives play the motion
  /// (PlayThroughDrives) with each of kDisturbances.
  std::optional<Leaving> leaving;
  /// The drives; none where it was not played through drives (PlayedThroughDrives).
  std::optional<DriveGains> drives;
  /// Largest |torque| of any joint's motor up to the end of the settle phase.
  double peak_torque_nm = 0;
  /// Largest of |torque| / limit, less 1, of any joint's motor up to there, and more by what the
  /// motor lacks of its limit at its speed (Motor::LackAt). Above 0, a limit is exceeded.
  double torque_excess = -1;
  /// The same of the 2 s after it, in which the joints are held.
  double held_torque_excess = -1;
  double peak_penetration_m = 0;
  /// The nearest that two of the robot's own shapes that are to stay apart come to each other up to
  /// there (`Scene::self_contact`). Negative where they overlap, infinite without such shapes.
  double self_clearance_m = std::numeric_limits<double>::infinity();
  double self_clearance_time_s = 0;
  std::string self_clearance_of;  ///< "leg1_link/0 and leg2_link/1"
  double clearance_m = 0;         ///< The least that the task allows.
  /// By how much a joint without a motor goes beyond its limits, up to 2 s after the end where the
  /// motion ends at rest [rad, m]. No stop is simulated, so that the motion means nothing then.
  double passive_excess = 0;
  double passive_time_s = 0;
  std::string passive_joint;  ///< "the joint without a motor 'wrist'", and where it is.
  /// In space: the farthest that one shape slides on one thing while it carries weight, up to the
  /// end of the settle phase, and which shape. Of several points that touch, such as the corners of
  /// a box, that counts which slides fastest at the time. Absent in the plane, where nobody looks.
  std::optional<double> slip_m;
  std::string slip_of;
  /// Thickness of the compliant layer, which no contact may go through.
  double layer_m = std::numeric_limits<double>::infinity();
  bool finite = true;

  /// Whether the motion can be written: every target is met, the robot stays there, no torque
  /// exceeds its limit, no contact goes through the layer, the robot's own shapes stay apart, and
  /// joints without a motor stay within their limits.
  [[nodiscard]] bool acceptable() const;
  /// What stands against it, as text: "pitch, settled: asked 1.5708, got 0.0012 rad (within 0.05)".
  [[nodiscard]] std::string Objections() const;
};

/// How long after its end a motion that ends at rest is played to see whether the robot stays [s].
/// One that stands on too small a foot is within every tolerance after 2 s, and falls after 4 s.
inline constexpr double kStays_s = 10;
/// The same in space, where a second costs more.
inline constexpr double kStaysInSpace_s = 5;

/// How much a floor slopes that is called level: 2 mm in a metre. A motion that only just stands
/// falls on it, and by what drives, bus and encoders round as well.
inline constexpr double kUnevenness_rad = 2e-3;

/// How much a robot leans that is said to stand in its pose. A motion that passes near a fall, or
/// lands on either of two sides, does another thing then, and by what the wire rounds as well.
inline constexpr double kLean_rad = 0.5e-3;

inline constexpr std::array<Disturbance, 4> kDisturbances = {{{.slope_rad = kUnevenness_rad},
                                                              {.slope_rad = -kUnevenness_rad},
                                                              {.lean_rad = kLean_rad},
                                                              {.lean_rad = -kLean_rad}}};

/// Whether a task's motion is to end at rest: it has a settle phase, its cost asks for a velocity
/// of 0 at the end of it, and there is something to rest on.
bool EndsAtRest(const Problem& problem);

/// Whether the second look plays a task's motion through drives: not where a feedback is found for
/// the hold, which catches what drives cannot hold.
bool PlayedThroughDrives(const Problem& problem);

/// The second look and the summary of a motion, from one simulation.
struct FineLook {
  SecondLook look;
  MotionSummary summary;
};
/// @param refinement  the solver's step in units of the one used here; none: RefinementOf.
FineLook LookFinely(Problem problem, std::vector<double> x,
                    std::optional<double> refinement = std::nullopt);

/// The second look alone.
/// @param x           parameters of the motion.
/// @param refinement  likewise.
SecondLook LookAgain(const Problem& problem, const std::vector<double>& x,
                     std::optional<double> refinement = std::nullopt);

}  // namespace tumbler
