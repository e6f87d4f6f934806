#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "common/core/index.h"
#include "offline/problem/cost_term.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/timetable.h"

namespace tumbler {

/// The quantities at the stages of a motion of which smooth maxima are taken.
struct StageValues {
  std::vector<double> torque;       ///< By stage, then joint [N m].
  std::vector<double> penetration;  ///< MotionOutputs::Penetration, by stage.
};

/// What the stages of a simulated motion leave behind, by stage: the torques of the joints and the
/// depth of contacts, for the smooth maxima; and, where a gradient is to follow, everything that
/// Adjoint needs to go back through them without a second simulation.
template <class Space>
class MotionRecord {
 public:
  using Dynamics = SceneDynamicsIn<Space>;

  /// @param motion  is kept by reference.
  /// @param robot   likewise.
  MotionRecord(const ParametricMotion& motion, Dynamics& robot);

  /// Makes room for the stages of a timetable. That for derivatives is made by the first
  /// PrepareDerivatives after it.
  void Resize(const Timetable& table);
  void PrepareDerivatives();

  /// Stores the torques of the robot as it was just evaluated.
  /// @returns the stage as the cost sees it.
  CostPoint StoreTorques(std::size_t stage) {
    double* const torques = &values_.torque[stage * joints_];
    for (std::size_t j = 0; j < joints_; ++j) torques[j] = robot_.tau[Index(order_[free_ + j])];
    return {robot_.q, robot_.qd, {torques, joints_}};
  }
  /// Stores how fast contacts slide under load (ContactForces::LoadedSlip), and returns it.
  double StoreSlip(std::size_t stage) { return slip_[stage] = robot_.contact->LoadedSlip(); }
  void StorePenetration(std::size_t stage, double penetration) {
    values_.penetration[stage] = penetration;
  }
  /// Stores the derivatives of the penetration in the positions.
  void StorePenetrationSlopes(std::size_t stage, const typename Dynamics::Numbers& by_q) {
    double* const slopes = &penetration_slope_[stage * order_.size()];
    for (std::size_t i = 0; i < order_.size(); ++i) slopes[i] = by_q[Index(order_[i])];
  }
  /// Stores the derivatives of the dynamics, and what the cost saw.
  /// @param slope  that of the state, 2 numbers for each free degree of freedom.
  void StoreDerivatives(std::size_t stage, const double* slope);

  /// A stored stage as the cost saw it. Positions and velocities are there only where an integral
  /// of the cost depends on them.
  [[nodiscard]] CostPoint At(std::size_t stage) const {
    const std::span<const double> torques(&values_.torque[stage * joints_], joints_);
    if (!integrates_state_) return {{}, {}, torques};
    const std::size_t n = robot_.n;
    const double* const states = &states_[stage * 2 * n];
    return {{states, n}, {states + n, n}, torques};
  }
  /// Whether an integral of the cost is of the slip under load.
  [[nodiscard]] bool integrates_slip() const { return integrates_slip_; }
  /// That of a stage.
  [[nodiscard]] double slip(std::size_t stage) const { return slip_[stage]; }
  /// Adds `scale` times the derivatives of a stage's slip by positions and velocities.
  void AddSlipSlopes(std::size_t stage, double scale, typename Dynamics::Numbers& by_q,
                     typename Dynamics::Numbers& by_qd) const {
    const double* slopes = &slip_slopes_[stage * 2 * robot_.n];
    for (std::size_t i = 0; i < robot_.n; ++i) by_q[i] += scale * *slopes++;
    for (std::size_t i = 0; i < robot_.n; ++i) by_qd[i] += scale * *slopes++;
  }

  [[nodiscard]] const StageValues& values() const { return values_; }
  /// The derivatives of the penetration in the positions, in `order`.
  [[nodiscard]] const double* penetration_slopes(std::size_t stage) const {
    return &penetration_slope_[stage * order_.size()];
  }
  /// Whether zeros between joints of different limbs are left out of the rows below, and those for
  /// accelerations are of M, which has such zeros, rather than of input, which has none. So a robot
  /// in space with its many joints is less to go back through. In the plane a contact of the task's
  /// own may act between any two bodies, and gradients keep to the last bit what they were.
  static constexpr bool kSparse = std::is_same_v<Space, Spatial>;
  /// The entries of a row that are stored, in `order`: the first ones, and [begin, end).
  struct Entries {
    int first, begin, end;
    [[nodiscard]] int count() const { return first + end - begin; }
  };
  [[nodiscard]] const Entries& entries(int i) const { return entries_[Index(i)]; }
  /// dg of a stage in factored form (SceneDynamics::DifferentiateFactored): the rows of R^T for the
  /// free degrees of freedom, which are whole; then, for each degree of freedom in `order`, its
  /// `entries` of the rows of D_q^T and D_qd^T, and if it is actuated, of input^T, or of M.
  [[nodiscard]] const double* dynamics(std::size_t stage) const {
    return &dynamics_[stage * stage_size_];
  }
  /// The slope of the state, where the duration is free.
  [[nodiscard]] const double* state_slope(std::size_t stage) const {
    return &dynamics_[(stage + 1) * stage_size_ - 2 * free_];
  }
  /// The free degrees of freedom, then those of the joints.
  [[nodiscard]] const std::vector<int>& order() const { return order_; }
  /// Whether an integral of the cost depends on positions or velocities.
  [[nodiscard]] bool integrates_state() const { return integrates_state_; }

 private:
  void FindEntries();
  /// Calls visit(k, dof) for the k-th stored entry, of this degree of freedom.
  template <class Visit>
  void ForEachEntry(const Entries& entries, Visit&& visit) const {
    for (int i = 0; i < entries.first; ++i) visit(i, Index(order_[Index(i)]));
    for (int i = entries.begin; i < entries.end; ++i)
      visit(entries.first + i - entries.begin, Index(order_[Index(i)]));
  }

  Dynamics& robot_;
  std::size_t free_, joints_;  // numbers of free degrees of freedom and of joints
  std::vector<int> order_;
  std::vector<Entries> entries_;  // of the rows of each degree of freedom in `order_`
  bool keeps_slope_;              // of the state
  bool integrates_state_ = false;
  bool integrates_slip_ = false;
  std::size_t stage_size_;  // of `dynamics_`
  StageValues values_;
  std::vector<double> penetration_slope_;
  std::vector<double> dynamics_;
  std::vector<double> states_;       // positions, then velocities, of a stage
  std::vector<double> slip_;         // of a stage, where the cost asks for it
  std::vector<double> slip_slopes_;  // by positions, then by velocities
  typename HybridDynamics<Space>::Derivatives derivatives_;
};

}  // namespace tumbler
