#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/planar_robot.h"

namespace tumbler {

/// A point that is fixed to a link: where it is and how fast, in the world, and the derivatives of
/// both in positions and velocities of the degrees of freedom that carry the link.
///
/// With a_i the axis of a revolute joint, s_i = +-1 its sense, u_i the direction of a prismatic one
/// and perp(x, z) = (-z, x), the point p moves at
///
///   v = sum_i J_i qd_i,   J_i = dp/dq_i = s_i perp(p - a_i) or u_i,
///   dv/dqd_i = J_i,       dv/dq_i = dJ_i/dt = s_i perp(v - v_a_i) or w_i perp(u_i),
///
/// where w_i is the angular velocity of what carries joint i, and v_a_i the velocity of its axis.
struct LinkPoint {
  /// Its two coordinates.
  enum class Axis { kX, kZ };
  /// A degree of freedom that carries the link.
  struct Joint {
    std::size_t dof = 0;
    bool revolute = true;
    double sense = 1;                   ///< Of a revolute joint: +1 about -y, -1 about +y.
    std::array<double, 2> offset_m{};   ///< Its origin in the frame of what carries it.
    std::array<double, 2> direction{};  ///< Of a prismatic joint, likewise.
    bool operator==(const Joint&) const = default;
  };

  std::string link;
  std::array<double, 2> point_m{};    ///< x and z in the link's frame.
  std::vector<Joint> chain;           ///< From the root to the link; none: there is no point.
  std::array<double, 2> in_body_m{};  ///< In the frame of the chain's last body.

  bool operator==(const LinkPoint&) const = default;
  [[nodiscard]] bool present() const { return !chain.empty(); }

  /// A coordinate of the point [m], or its rate [m/s].
  /// @param q, qd  of all degrees of freedom.
  [[nodiscard]] double Value(Axis axis, bool rate, std::span<const double> q,
                             std::span<const double> qd) const;
  /// Adds the derivatives of `scale` times that.
  void AddSlopes(Axis axis, bool rate, double scale, std::span<const double> q,
                 std::span<const double> qd, std::span<double> by_q, std::span<double> by_qd) const;

 private:
  struct Places;
  [[nodiscard]] Places At(std::span<const double> q, std::span<const double> qd) const;
};

/// The point at (x, z) [m] in the frame of a link.
/// @throws std::invalid_argument  with the reason, as the end of a sentence about the link, when it
/// is none of the robot's, does not move, or has a frame that is turned out of the plane.
LinkPoint PointOfLink(const PlanarRobot& robot, std::string_view link,
                      const std::array<double, 2>& point_m);

}  // namespace tumbler
