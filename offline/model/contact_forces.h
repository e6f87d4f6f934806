#pragma once

#include <cstdint>
#include <span>

namespace tumbler {

template <class Space>
class HybridDynamics;

/// One contact that carries force.
template <class Space>
struct ActiveContact {
  int shape = 0;         ///< Index of the robot's shape on which `force` acts.
  int obstacle = -1;     ///< Index of the obstacle; -1 where another shape of the robot is touched.
  int other_shape = -1;  ///< Index of that other shape; -1 where an obstacle is touched.
  double depth_m = 0;    ///< How deep it is in the compliant layer, d_on - d.
  double normal_force_n = 0;
  typename Space::Vector point;   ///< p_rob relative to the origin of the dynamics [m].
  typename Space::Vector force;   ///< The force on the robot's shape [N].
  typename Space::Vector normal;  ///< Unit normal towards that shape.
};

/// Adds up what ContactForces::Pieces tells of several contacts, by the hash of Fowler, Noll and
/// Vo.
class ContactPieces {
 public:
  /// @param contact  which contact it is.
  /// @param piece    as PieceOf says.
  void Add(std::uint64_t contact, std::uint64_t piece) {
    for (const std::uint64_t number : {contact, piece}) hash_ = (hash_ ^ number) * 0x100000001b3U;
  }
  [[nodiscard]] std::uint64_t number() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

/// The contact forces on a robot, for the integration of its motion. `ContactModel` is the general
/// implementation; another may be written for one robot alone.
///
/// The order of calls is given in HybridDynamics.
template <class Space>
class ContactForces {
 public:
  virtual ~ContactForces() = default;

  /// Adds the wrench of every active contact to `dynamics`, after its SetState. No heap.
  virtual void Apply(HybridDynamics<Space>& dynamics) = 0;

  /// Adds the derivatives of the wrenches of the last Apply to `dynamics`, after its Solve.
  virtual void Differentiate(HybridDynamics<Space>& dynamics) const = 0;

  /// The contacts of the last Apply, valid until the next.
  [[nodiscard]] virtual std::span<const ActiveContact<Space>> active() const = 0;

  /// Names the formulas that the forces of the last Apply come from, as a number: it changes where
  /// a contact begins or ends, or passes from one formula of the law to another. In between, forces
  /// are smooth functions of the state.
  [[nodiscard]] virtual std::uint64_t Pieces() const = 0;

  /// Adds `scale` times the derivative of the depth of an active contact by all positions.
  virtual void AddDepthSlopes(const HybridDynamics<Space>& dynamics,
                              const ActiveContact<Space>& active, double scale,
                              std::span<double> slopes) const = 0;

  /// How fast the contacts of the last Apply slide, each by its load [N m/s]: the sum of
  ///
  ///   |N| gamma(|v_t| / v_max) |v_t|,
  ///
  /// with the tangential velocity v_t. Friction turns mu times as much into heat. Above the slip
  /// speed v_max it is the load times how fast the contact slides; slower creep, which stands for
  /// sticking, counts for less. It is as smooth as the forces, and 0 without load.
  [[nodiscard]] virtual double LoadedSlip() const = 0;
  /// Adds `scale` times its derivatives by all positions and velocities.
  virtual void AddLoadedSlipSlopes(const HybridDynamics<Space>& dynamics, double scale,
                                   std::span<double> by_q, std::span<double> by_qd) const = 0;
};

}  // namespace tumbler
