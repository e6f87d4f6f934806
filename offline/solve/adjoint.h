#pragma once

#include <array>
#include <span>
#include <type_traits>
#include <vector>

#include "common/core/primitive.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/tableau.h"
#include "offline/solve/output_lanes.h"
#include "offline/solve/propagation.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

/// The discrete adjoint of a Propagation: the derivatives of its outputs in the parameters, by
/// going back through its recorded stages, Lanes::kCount outputs at a time.
///
/// The state after a step is y + h sum_s b_s k_s, with k_s = f(y_s) and y_s = y + h sum_r<s a_sr
/// k_r. With the cotangent lambda of the state after the step, those of the stages are
///
///   k_bar_s = h b_s lambda + h sum_r>s a_rs y_bar_r,    y_bar_s = (df/dy)^T k_bar_s + (what the
///   outputs have as derivatives in the stage),          lambda <- lambda + sum_s y_bar_s,
///
/// and those of the joints' paths at the stage, (df/d(q_a, qd_a, qdd_a))^T k_bar_s and likewise,
/// go to the parameters by PathTable::AddToParameters.
///
/// In space, the cotangents of a root's angles and their rates are taken back to the chart of a
/// step before it (RootChart::PullBack).
///
/// The price is that of a matrix times a vector for each stage and output, and hardly depends on
/// the number of parameters. docs/benchmarks.md compares it with ForwardSensitivity.
///
/// No heap after the first Run.
template <class Space>
class Adjoint {
 public:
  using Dynamics = SceneDynamicsIn<Space>;

  /// @param forward  is kept by reference.
  explicit Adjoint(Propagation<Space>& forward);

  /// Writes the gradients of the outputs of forward.Run(x, ForwardPass::kGradient), the last run,
  /// by rows (OutputRows).
  /// @param result  of that run, which is finite.
  void Run(const RolloutResult& result, std::span<double> gradient);

 private:
  static constexpr std::size_t kStates = std::tuple_size_v<typename Dynamics::State>;
  static constexpr int kMaxDofs = Dynamics::kMaxDofs;
  /// A robot in space has more joints, and so more outputs.
  using Lanes = OutputLanes<std::is_same_v<Space, Plane> ? 4 : 8>;
  using StateBar = std::array<Lanes, kStates>;
  using Column = std::array<Lanes, kMaxDofs>;
  using Entries = typename MotionRecord<Space>::Entries;

  /// An output that goes back in a lane.
  struct Lane {
    int output = -1;   // none
    int joint = -1;    // whose torque it is of; -1: of none
    double limit = 0;  // of that torque
  };
  /// What goes back through the steps.
  struct Pullback {
    Pullback();
    std::array<Lane, Lanes::kCount> lanes;
    int penetration_lane = -1;                           // of the penetration's output; -1: none
    StateBar adjoint;                                    // lambda
    std::array<StateBar, Tableau::kMaxStages> y_bar;     // by stage
    int point = 0;                                       // of `paths`
    std::array<std::array<Lanes, 3>, kMaxJoints> paths;  // of q, qd and qdd
  };

  /// The cost, when it is among the outputs, has the first lane.
  [[nodiscard]] bool has_cost() const { return pullback_.lanes[0].output == OutputRows::kCost; }

  template <const Tableau& kScheme>
  void RunScheme(const RolloutResult& result, std::span<double> gradient);
  template <const Tableau& kScheme>
  void PullBack(std::span<double> gradient);
  template <const Tableau& kScheme>
  void PullBackStage(int step, int s);
  [[gnu::always_inline]] static Lanes RowTimes(const double*& row, const Entries& entries,
                                               const Column& v);
  void AddInstants(int step, std::size_t& end);
  void AddInstant(std::size_t instant);
  void AddStretch(std::size_t stage, double growth, double b, const StateBar& k_bar);
  void AddCurveSlopes(std::size_t stage);
  void AddStateSlopes(const typename Dynamics::Numbers& by_q,
                      const typename Dynamics::Numbers& by_qd, bool moving, StateBar& y_bar);
  void CollectPathsAt(int point);
  void AddToParameters();

  Propagation<Space>& forward_;
  int free_, joints_, dofs_;  // numbers of free degrees of freedom, of joints, and of both
  Pullback pullback_;
  std::vector<Lanes> parameters_;  // the cotangents of the parameters
};

}  // namespace tumbler
