#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/purpose.h"
#include "common/files/toml_reader.h"
#include "offline/model/planar_robot.h"
#include "offline/problem/link_point.h"
#include "offline/problem/space_quantity.h"

namespace tumbler {

/// An instant of a motion, as the cost sees it.
struct CostPoint {
  /// Positions of all degrees of freedom [m, rad].
  std::span<const double> q;
  /// Velocities of all degrees of freedom [m/s, rad/s].
  std::span<const double> qd;
  /// Torques of the actuated joints [N m]. Empty for terms at a single instant, which have none.
  std::span<const double> torque;
  /// The axes in which the root's angles are zero, in space (RootChart). Null in the plane.
  const SpaceMatrix* axes = nullptr;
};

/// The derivatives of the cost in everything that a CostPoint holds.
struct CostSlopes {
  std::span<double> q;
  std::span<double> qd;
  std::span<double> torque;
};

/// One term of the cost: its weight times a quantity of the motion. This header, cost_term.cc and
/// cost_values.cc describe each kind of term completely: its keys in a task, its value and slopes.
/// Rollouts and their gradients treat all terms alike.
struct CostTerm {
  enum class Kind {
    kSquare,  ///< (value - target)^2 of a coordinate of the root, or of a point of a link.
    kLinear,  ///< value - target, as in [AB04, Eq. 34].
    kEffort,  ///< |tau|^2.
    /// The power that the motors give, sum of tau qd [W]. Its integral between two states at rest
    /// of the same height is what contacts and joints turn into heat: feet that slide cost it.
    kWork,
    /// How fast contacts slide, each by its share in bearing the robot's weight [m/s]:
    /// ContactForces::LoadedSlip over the weight. The integral is how far the whole weight would
    /// have to slide for as much heat. It is nothing that a CostPoint shows: rollouts, which have
    /// the contacts, add it themselves (SlipWeight), and only throughout a motion.
    kSlip,
  };
  /// The names of the kinds in a task, in their order.
  static constexpr std::array<std::string_view, 5> kKindNames = {"terminal", "terminal-linear",
                                                                 "effort", "work", "slip"};
  /// Positions of the root, then their rates, then those of a point of a link, as in a task.
  static constexpr std::array<std::string_view, 10> kCoordinateNames = {
      "x",          "z",       "pitch",   "x_rate",       "z_rate",
      "pitch_rate", "point_x", "point_z", "point_x_rate", "point_z_rate"};
  enum class When {
    kEnd,         ///< At t_f, where the motion ends.
    kSettled,     ///< After the settle phase, legs held.
    kThroughout,  ///< The integral over motion and settle phase.
    kTime,        ///< At `time_s`.
  };
  Kind kind = Kind::kSquare;
  When when = When::kEnd;
  double weight = 1;
  /// The degree of freedom that a term in a coordinate is about; of a point: 0 for x, 1 for z.
  int dof = 0;
  /// Whether that term takes the velocity of the coordinate, or else its position.
  bool of_velocity = false;
  /// A term in a coordinate takes the coordinate less this [m, rad, m/s or rad/s].
  double target = 0;
  /// A motion whose value is farther than this from the target does not serve its purpose. The cost
  /// does not depend on it.
  double tolerance = kAngleTolerance_rad;
  /// Since the start of the motion; of `kTime`.
  double time_s = 0;
  /// The point that the coordinate is of. Without one it is the root's.
  LinkPoint point = {};
  /// What takes the place of coordinate and point in space.
  SpaceQuantity quantity = {};
  /// Of `kWork`: the degree of freedom of each joint whose torque is in CostPoint::torque.
  std::vector<std::size_t> joint_dofs = {};
  /// Of `kSlip`: the weight of the robot [N].
  double robot_weight_n = 1;
  /// Whether the task gives the target from the value at the start. A problem's `target` is
  /// absolute all the same.
  bool from_start = false;
  /// That target, from the value at the start.
  double target_from_start = 0;

  /// Defaults: 3 degrees; a foot's radius of the shipped robot; and a speed that friction ends
  /// within a few centimetres.
  static constexpr double kAngleTolerance_rad = 0.05, kLengthTolerance_m = 0.02,
                          kRateTolerance = 0.1;

  /// The coordinate or its rate. PurposeTarget has them in the same order.
  [[nodiscard]] PurposeTarget::Of of() const {
    if (quantity.present()) {
      return static_cast<PurposeTarget::Of>(static_cast<int>(PurposeTarget::Of::kPosition) +
                                            static_cast<int>(quantity.of));
    }
    constexpr int kPoint = static_cast<int>(PurposeTarget::Of::kPointX);
    return static_cast<PurposeTarget::Of>(point.present() ? kPoint + dof + (of_velocity ? 2 : 0)
                                                          : dof + (of_velocity ? 3 : 0));
  }

  bool operator==(const CostTerm&) const = default;

  /// Whether the quantity is a coordinate of the root or of a point, or made of one.
  [[nodiscard]] bool of_coordinate() const {
    return kind == Kind::kSquare || kind == Kind::kLinear;
  }
  /// Whether the quantity depends on positions or velocities.
  [[nodiscard]] bool of_state() const { return kind != Kind::kEffort; }
  /// What the terms of kSlip make of ContactForces::LoadedSlip in all [1/(N m)]; 0 without one.
  [[nodiscard]] static double SlipWeight(std::span<const CostTerm> cost) {
    double sum = 0;
    for (const CostTerm& term : cost)
      if (term.kind == Kind::kSlip) sum += term.weight / term.robot_weight_n;
    return sum;
  }
  /// Whether this is a target of the root's pitch after the motion.
  [[nodiscard]] bool targets_pitch() const {
    constexpr int kPitch = 2;
    return kind == Kind::kSquare && !of_velocity && dof == kPitch && when != When::kTime &&
           !quantity.present();
  }

  /// What a term in a coordinate is about.
  [[nodiscard]] double Value(const CostPoint& at) const;
  /// The same as it is judged: a heading is that of its angles which is nearest to the target, and
  /// not a number where there is none (SpaceQuantity::IsDefined).
  [[nodiscard]] double Result(const CostPoint& at) const;
  /// Adds the derivatives of `scale` times that to `slopes`.
  void AddValueSlopes(double scale, const CostPoint& at, const CostSlopes& slopes) const;

  /// How far the pitch is from its target [rad]. 0 unless this term draws it there.
  [[nodiscard]] double TargetError(const CostPoint& at) const {
    return targets_pitch() && weight > 0 ? std::abs(OffTarget(at)) : 0;
  }

  /// Whether the term is a square at an instant that draws the motion to its target.
  [[nodiscard]] bool draws() const { return kind == Kind::kSquare && weight > 0; }
  /// The square root of what such a term adds to the cost, with the sign of how far the motion is
  /// off its target.
  [[nodiscard]] double Residual(const CostPoint& at) const {
    return std::sqrt(weight) * OffTarget(at);
  }

  /// Returns `sum`, plus `scale` times the quantity or its integrand, but for that of kSlip. The
  /// weight is left to the caller.
  [[nodiscard]] double Accumulate(double sum, double scale, const CostPoint& at) const {
    switch (kind) {
      case Kind::kEffort:
        for (const double torque : at.torque) sum += scale * torque * torque;
        return sum;
      case Kind::kWork:
        for (std::size_t j = 0; j < at.torque.size(); ++j)
          sum += scale * at.torque[j] * at.qd[joint_dofs[j]];
        return sum;
      case Kind::kSlip:
        return sum;
      case Kind::kSquare:
        return sum + scale * OffTarget(at) * OffTarget(at);
      case Kind::kLinear:
        return sum + scale * OffTarget(at);
    }
    return sum;
  }
  /// Adds the derivatives of what Accumulate adds to `slopes`.
  void AddSlopes(double scale, const CostPoint& at, const CostSlopes& slopes) const {
    switch (kind) {
      case Kind::kEffort:
        for (std::size_t j = 0; j < at.torque.size(); ++j)
          slopes.torque[j] += scale * 2 * at.torque[j];
        return;
      case Kind::kWork:
        for (std::size_t j = 0; j < at.torque.size(); ++j) {
          slopes.torque[j] += scale * at.qd[joint_dofs[j]];
          slopes.qd[joint_dofs[j]] += scale * at.torque[j];
        }
        return;
      case Kind::kSlip:
        return;
      case Kind::kSquare:
        AddValueSlopes(scale * 2 * OffTarget(at), at, slopes);
        return;
      case Kind::kLinear:
        AddValueSlopes(scale, at, slopes);
        return;
    }
  }

 private:
  [[nodiscard]] std::size_t coordinate() const { return static_cast<std::size_t>(dof); }
  [[nodiscard]] LinkPoint::Axis axis() const { return static_cast<LinkPoint::Axis>(dof); }
  [[nodiscard]] double OffTarget(const CostPoint& at) const {
    return quantity.Near(target, Value(at)) - target;
  }
};

/// An instant at which terms of a cost look at the motion.
struct CostInstant {
  CostTerm::When when = CostTerm::When::kEnd;  ///< Not kThroughout.
  double time_s = 0;                           ///< Since the start of the motion.
  bool held = false;   ///< Whether the joints are at their ends: in and after the settle phase.
  double since_s = 0;  ///< Since the instant before it, or the start.

  [[nodiscard]] bool Has(const CostTerm& term) const {
    return term.when == when && (when != CostTerm::When::kTime || term.time_s == time_s);
  }
};

/// All instants of a cost in the order of time, the end of the motion and of the settle phase among
/// them whether a term looks there or not.
/// @throws std::invalid_argument  about a time that is not between the start and the end of the
/// settle phase.
std::vector<CostInstant> InstantsOf(std::span<const CostTerm> cost, double duration_s,
                                    double settle_s);

/// Reads a `[[cost]]` of a task (docs/formats.md).
/// @param duration_s, settle_s  of the task's motion and settle phase.
/// @throws FileError with file, line, key, value and allowed range.
CostTerm ReadCostTerm(TomlTable& table, const PlanarRobot& robot, double duration_s,
                      double settle_s);

/// Its keys, for docs/formats.md.
KeyTable CostKeyTable();

}  // namespace tumbler
