#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/space_vector.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

/// A number that a link of a robot in space has: where it is, how it is turned, or how fast, along
/// a direction d of the world; and the derivatives of that number in positions and velocities of
/// the degrees of freedom that carry the link.
///
/// With a_i the axis of a revolute joint and o_i a point of it, or d_i the direction of a prismatic
/// one, a point p of the link moves at v = sum_i J_i qd_i, and the link turns at w = sum_i a_i
/// qd_i:
///
///   J_i = dp/dq_i = a_i x (p - o_i) or d_i,     dv/dqd_i = J_i,     dw/dqd_i = a_i or 0,
///   dv/dq_i = a_i x v_i + w_<i x J_i,           dw/dq_i = a_i x w_i,
///
/// where v_i and w_i are the parts of v and w that the joints from i on make, and w_<i is the part
/// of w that the joints before i make. An axis e of the link changes by a_i x e.
struct SpaceQuantity {
  enum class Of {
    kPosition,         ///< d . p [m]
    kVelocity,         ///< d . v [m/s]
    kAngularVelocity,  ///< d . w [rad/s]
    /// |e - d|, the length of the chord between an axis e of the link and d: 2 sin(angle / 2),
    /// which is the angle itself where that is small [rad]. Its square has a gradient everywhere
    /// but where e points the other way.
    kMisalignment,
    /// The angle [rad] by which an axis e of the link is turned about d, by the right hand: of its
    /// projection onto the plane across d, from that of the world's x (of the world's y where d is
    /// within 26 degrees of x or -x), in (-pi, pi]. Angles that are whole turns apart are the same
    /// heading (Near).
    ///
    /// The projection's length is the sine of the angle between e and d. The slopes grow as its
    /// inverse, and below kLeastProjection there is no heading to speak of (IsDefined): the value
    /// is that of the rounding there, but a number. Where e is along d to 1e-9 there are no slopes.
    kHeading,
  };
  /// Of an axis that is as good as along d: within 1.1 degrees.
  static constexpr double kLeastProjection = 0.02;
  /// A degree of freedom that carries the link.
  struct Joint {
    std::size_t dof = 0;
    bool revolute = true;
    bool turned = false;  ///< Whether it is the first that turns: the root's axes go before it.
    std::array<double, 3> axis{};      ///< Or direction, in the frame of what carries it.
    std::array<double, 3> offset_m{};  ///< Its origin, likewise.
    bool operator==(const Joint&) const = default;
  };

  Of of = Of::kPosition;
  std::string link;
  std::array<double, 3> in_link{};    ///< The point [m], or the axis, in the link's frame.
  std::array<double, 3> direction{};  ///< d, a unit vector of the world.
  std::vector<Joint> chain;           ///< From the root to the link; none: there is no quantity.
  std::array<double, 3> in_body{};    ///< As `in_link`, in the frame of the chain's last body.

  bool operator==(const SpaceQuantity&) const = default;
  [[nodiscard]] bool present() const { return !chain.empty(); }
  [[nodiscard]] bool of_velocity() const {
    return of == Of::kVelocity || of == Of::kAngularVelocity;
  }

  [[nodiscard]] bool of_axis() const { return of == Of::kMisalignment || of == Of::kHeading; }

  /// Of the values that are the same as this one, that which is nearest to `target`. Only headings
  /// have others: halfway round, it is the larger of the two.
  [[nodiscard]] double Near(double target, double value) const {
    return of == Of::kHeading ? NearHeading(target, value) : value;
  }
  /// Whether the robot has such a value now: no axis whose heading is asked for is along d.
  [[nodiscard]] bool IsDefined(std::span<const double> q, const SpaceMatrix& axes) const;

  /// @param q, qd  of all degrees of freedom.
  /// @param axes   of the root (RootChart).
  [[nodiscard]] double Value(std::span<const double> q, std::span<const double> qd,
                             const SpaceMatrix& axes) const;
  /// Adds the derivatives of `scale` times that.
  void AddSlopes(double scale, std::span<const double> q, std::span<const double> qd,
                 const SpaceMatrix& axes, std::span<double> by_q, std::span<double> by_qd) const;

 private:
  struct Places;
  [[nodiscard]] Places At(std::span<const double> q, std::span<const double> qd,
                          const SpaceMatrix& axes) const;
  static double NearHeading(double target, double value);
};

/// @param in_link    the point [m] or the axis, in the frame of the link in the robot's file.
/// @param direction  of the world; made a unit vector, as an axis is.
/// @throws std::invalid_argument  with the reason, as the end of a sentence about the link, when it
/// is none of the robot's or does not move.
SpaceQuantity QuantityOfLink(const SpaceRobot& robot, SpaceQuantity::Of of, std::string_view link,
                             const std::array<double, 3>& in_link,
                             const std::array<double, 3>& direction);

}  // namespace tumbler
