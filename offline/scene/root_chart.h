#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "common/core/functions.h"
#include "offline/model/plane.h"
#include "offline/model/space_vector.h"
#include "offline/model/spatial.h"

namespace tumbler {

/// The axes in which the angles of a root are zero. In the plane they are the world's for good: the
/// pitch says all.
template <class Space>
struct RootChart {
  static constexpr bool kMoves = false;
  /// What MoveOn leaves for the way back.
  struct Turn {};
};

/// The axes in which the angles of a floating root are zero: a chart of orientations around the
/// present one, which is moved on after each step of an integration. So three angles are enough
/// within a step, however the robot tumbles, and none of them comes near a singularity.
///
/// The root is turned by R = R0 Rp(a0) Rx(a1) Rz(a2), with a pitch about -y, a roll about x and a
/// yaw about z, each in the axes that the ones before it have turned (RootKind::kFloating). After a
/// step
///
///   R0 <- R,   a <- 0,   a' <- E(a) a',
///
/// where E a' is the angular velocity in the new axes, its components about -y, x and z, which are
/// the rates of the angles while they are zero. In terms of small changes the map of (a, a') is
/// [E 0; F E] (PullBack).
template <>
struct RootChart<Spatial> {
  static constexpr bool kMoves = true;
  /// Of the first of the angles, among the root's degrees of freedom.
  static constexpr std::size_t kFirst = 3;
  using Triple = std::array<double, 3>;

  SpaceMatrix axes = SpaceMatrix::Identity();  ///< R0.

  /// Angles and rates at the end of a step.
  struct Turn {
    Triple angles{}, rates{};
  };

  /// The rotation at these angles.
  [[nodiscard]] SpaceMatrix At(const Triple& a) const {
    return axes * Spatial::RotationBy({0, -1, 0}, a[0]).m * Spatial::RotationBy({1, 0, 0}, a[1]).m *
           Spatial::RotationBy({0, 0, 1}, a[2]).m;
  }

  /// Moves on to where the root is.
  /// @param angles, rates  of the root, which get those in the new chart.
  Turn MoveOn(double* angles, double* rates) {
    Turn turn;
    for (std::size_t i = 0; i < 3; ++i) turn.angles[i] = angles[i], turn.rates[i] = rates[i];
    axes = Orthonormal(At(turn.angles));
    const Triple w = Times(Rates(turn.angles), turn.rates);
    for (std::size_t i = 0; i < 3; ++i) angles[i] = 0, rates[i] = w[i];
    return turn;
  }

  /// The cotangents of angles and rates before MoveOn, of those after it.
  /// @tparam Number  of any kind that can be added, and multiplied by a number.
  template <class Number>
  static void PullBack(const Turn& turn, Number* angles, Number* rates) {
    const std::array<Triple, 3> E = Rates(turn.angles), F = RateSlopes(turn);
    std::array<Number, 3> by_angle, by_rate;
    for (std::size_t i = 0; i < 3; ++i) {
      by_angle[i] = E[0][i] * angles[0] + E[1][i] * angles[1] + E[2][i] * angles[2] +
                    F[0][i] * rates[0] + F[1][i] * rates[1] + F[2][i] * rates[2];
      by_rate[i] = E[0][i] * rates[0] + E[1][i] * rates[1] + E[2][i] * rates[2];
    }
    for (std::size_t i = 0; i < 3; ++i) angles[i] = by_angle[i], rates[i] = by_rate[i];
  }

 private:
  /// E(a), which does not depend on the pitch: with b the roll and g the yaw
  ///
  ///   [ cos g cos b   sin g  0 ]
  ///   [-sin g cos b   cos g  0 ]
  ///   [ sin b         0      1 ].
  static std::array<Triple, 3> Rates(const Triple& a) {
    const auto [sb, cb] = portable::SinCos(a[1]);
    const auto [sg, cg] = portable::SinCos(a[2]);
    return {{{cg * cb, sg, 0}, {-sg * cb, cg, 0}, {sb, 0, 1}}};
  }
  /// F: the derivative of E(a) a' by a, less that of E by the new angles E da, which are zero,
  /// times the new rates.
  static std::array<Triple, 3> RateSlopes(const Turn& turn) {
    const auto [sb, cb] = portable::SinCos(turn.angles[1]);
    const auto [sg, cg] = portable::SinCos(turn.angles[2]);
    const auto& [pitch, roll, yaw] = turn.rates;
    const std::array<Triple, 3> E = Rates(turn.angles);
    const Triple w = Times(E, turn.rates);
    std::array<Triple, 3> F{};
    F[0][1] = -cg * sb * pitch;
    F[1][1] = sg * sb * pitch;
    F[2][1] = cb * pitch;
    F[0][2] = -sg * cb * pitch + cg * roll;
    F[1][2] = -cg * cb * pitch - sg * roll;
    for (std::size_t i = 0; i < 3; ++i) {
      F[2][i] -= w[0] * E[1][i];
      F[0][i] -= w[1] * E[2][i];
      F[1][i] += w[0] * E[2][i];
    }
    return F;
  }
  static Triple Times(const std::array<Triple, 3>& m, const Triple& v) {
    Triple product{};
    for (std::size_t i = 0; i < 3; ++i)
      product[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    return product;
  }
  /// The rotation that a matrix is but for rounding, by a step of Newton's method for the
  /// orthogonal factor, R (3 - R^T R) / 2.
  static SpaceMatrix Orthonormal(const SpaceMatrix& R) {
    const SpaceMatrix square = R.transpose() * R;
    return R * (1.5 * SpaceMatrix::Identity() - 0.5 * square);
  }
};

}  // namespace tumbler
