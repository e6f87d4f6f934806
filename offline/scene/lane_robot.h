#pragma once

#include <array>
#include <bit>
#include <cstddef>

#include "common/core/capacity.h"
#include "offline/model/contact_law.h"
#include "offline/scene/packet.h"

namespace tumbler {

/// What all robots of an ensemble share: how many bodies, and which carries which.
struct LaneModel {
  static constexpr std::size_t kMaxJoints = tumbler::kMaxJoints;
  /// The root link, and the links that joints move.
  static constexpr std::size_t kMaxBodies = kMaxJoints + 1;
  static constexpr std::size_t kMaxDofs = kMaxJoints + 3;
  static constexpr std::size_t kMaxPoints = 24;
  static constexpr std::size_t kMaxGrounds = 4;
  static constexpr std::size_t kMaxStones = 4;

  /// The joint i moves body i + 1. Its degree of freedom is 3 + i, after x, z and pitch of the
  /// root.
  std::size_t joints = 0;
  std::array<std::size_t, kMaxBodies> parent{};  ///< Body that carries a body; of the root: itself.
  std::array<double, kMaxBodies> axis{};         ///< +1 about -y, -1 about +y.
  std::size_t points = 0;                        ///< Contact points, each with a radius.
  /// Those of one body follow each other, the root's first.
  std::array<std::size_t, kMaxPoints> point_body{};
  /// The first point of each body or of the next that has one, and behind them `points`.
  std::array<std::size_t, kMaxBodies + 1> first_point{};
  std::size_t grounds = 0;  ///< Half-spaces.
  std::size_t stones = 0;   ///< All other obstacles.
  /// Whether a bar holds the root's x and z.
  bool hinged = false;
  ContactSmoothing smoothing = ContactSmoothing::kCubic;
  ContactDamping damping_law = ContactDamping::kNoPull;
};

/// A joint of a robot in lanes with its drive. SI units.
template <class S>
struct LaneJoint {
  S rotor_inertia, viscous_friction, dry_friction;
  S lower, upper;  ///< Where the stops are [rad].
  S torque_max;
  S kp, kd;
  S feed_forward;     ///< Factor of the feed-forward torque.
  S zero_error;       ///< The encoder's reading less the true angle [rad].
  S delay;            ///< From a tick to when its setpoint acts [s], at most a tick's length.
  S velocity_filter;  ///< Time constant with which the drive sees its velocity [s]; 0: at once.
  S torque_lag;       ///< Time constant of its current loop [s]; 0: none.
};

/// Everything in which robots of an ensemble can differ, for one robot (S = double), or for as many
/// as a packet has lanes. SI units. All members are S.
template <class S>
struct LaneRobot {
  struct Body {
    S offset_x, offset_z;  ///< Origin of the frame in the parent's at q = 0 [m].
    S mass, centre_x, centre_z, inertia;
  };
  using Joint = LaneJoint<S>;
  struct Point {
    S x, z, radius;
  };
  struct Ground {
    S normal_x, normal_z, distance;  ///< normal . p = distance on the surface.
  };
  /// An obstacle that ends: a box with a radius swept around it, as in Shape. Where its sides are 0
  /// it is a disc or a capsule.
  struct Stone {
    S centre_x, centre_z;
    S cosine, sine;  ///< Of its pitch.
    S half_x, half_z, radius;
  };
  S gravity_x, gravity_z;
  S bar_friction;  ///< Viscous, of the root's bearing where a bar holds it [N m s/rad].
  S stiffness, damping, mu, v_max, d_on, d_off;  ///< As in ContactLaw.
  S stop_stiffness, stop_damping;
  std::array<Body, LaneModel::kMaxBodies> bodies;
  std::array<Joint, LaneModel::kMaxJoints> joints;
  std::array<Point, LaneModel::kMaxPoints> points;
  std::array<Ground, LaneModel::kMaxGrounds> grounds;
  std::array<Stone, LaneModel::kMaxStones> stones;
};

/// Positions and velocities of robots: x and z of the root [m], its pitch [rad], then the joints.
template <class S>
struct LaneState {
  std::array<S, LaneModel::kMaxDofs> q;
  std::array<S, LaneModel::kMaxDofs> v;
  std::array<S, LaneModel::kMaxJoints> seen;  ///< Velocities of joints, as their drives see them.
  std::array<S, LaneModel::kMaxJoints> exerted;  ///< Torques of motors whose current loops lag.
};

/// The setpoint of one joint for one tick.
template <class S>
struct LaneSetpoint {
  S position, velocity;
  /// Feed-forward torque of a drive; acceleration where joints are prescribed.
  S third;
};

/// Robots, states or setpoints of one lane each, as one of packets, and back. All members of T
/// have the type that it is a template of.
template <template <class> class T>
T<Packet> PackLanes(const std::array<T<double>, Packet::kLanes>& each) {
  constexpr std::size_t kNumbers = sizeof(T<double>) / sizeof(double);
  std::array<Packet, kNumbers> packed;
  for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
    const auto numbers = std::bit_cast<std::array<double, kNumbers>>(each[lane]);
    for (std::size_t i = 0; i < kNumbers; ++i) packed[i].set_lane(lane, numbers[i]);
  }
  return std::bit_cast<T<Packet>>(packed);
}
/// The lanes of two packets in one of single precision.
template <template <class> class T>
T<WidePacket> WidenLanes(const T<Packet>& low, const T<Packet>& high) {
  constexpr std::size_t kNumbers = sizeof(T<double>) / sizeof(double);
  const auto a = std::bit_cast<std::array<Packet, kNumbers>>(low);
  const auto b = std::bit_cast<std::array<Packet, kNumbers>>(high);
  std::array<WidePacket, kNumbers> wide;
  for (std::size_t i = 0; i < kNumbers; ++i) wide[i] = WidePacket::Of(a[i], b[i]);
  return std::bit_cast<T<WidePacket>>(wide);
}
template <template <class> class T>
T<double> LaneOf(const T<Packet>& packed, std::size_t lane) {
  constexpr std::size_t kNumbers = sizeof(T<double>) / sizeof(double);
  const auto packets = std::bit_cast<std::array<Packet, kNumbers>>(packed);
  std::array<double, kNumbers> numbers;
  for (std::size_t i = 0; i < kNumbers; ++i) numbers[i] = packets[i].lane(lane);
  return std::bit_cast<T<double>>(numbers);
}

}  // namespace tumbler
