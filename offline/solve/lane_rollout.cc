#include "offline/solve/lane_rollout.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/space_lanes.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/free_duration.h"
#include "offline/solve/motion_outputs.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/smooth_maximum.h"
#include "offline/solve/timetable.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;

/// A smooth maximum leaves out what is e to the power of this below its largest: a part of 1e-10.
constexpr double kLeastExponent = -30;
/// A contact whose SmoothDepth has a smaller exponent is no deeper than 0.7 of what is usable, with
/// the usual sharpness, and counts as none.
constexpr double kShallow = -20;

/// Drives have no part in a plan: its motors bear what the scene says.
template <class Scene>
auto Planned(const Scene& scene) {
  LaneDrive none;
  none.viscous_friction_nm_s_per_rad = 0;
  return MakeLaneScene(scene, none);
}

/// Of all terms of a kind.
double WeightOf(CostTerm::Kind kind, const Problem& problem) {
  double weight = 0;
  for (const CostTerm& term : problem.cost) {
    if (term.kind == kind) weight += term.weight;
  }
  return weight;
}

/// Of the slip under load itself.
double SlipWeightOf(const Problem& problem) {
  double weight = 0;
  for (const CostTerm& term : problem.cost) {
    if (term.kind == CostTerm::Kind::kSlip) weight += term.weight / term.robot_weight_n;
  }
  return weight;
}

/// Robots in lanes, in the plane or in space.
template <class Space>
struct LanesOf {
  using Types = LaneTypes<Space>;

  /// @param scene  LaneScene or SpaceLaneScene.
  template <class Scene>
  LanesOf(const Scene& scene, std::size_t looks) : model(scene.model), at_look(looks) {
    std::array<typename Types::template Robot<double>, Packet::kLanes> robots;
    robots.fill(scene.robot);
    robot = PackLanes<Types::template Robot>(robots);
  }
  typename Types::Model model;
  typename Types::template Robot<Packet> robot;
  typename Types::template State<Packet> start{};
  std::vector<typename Types::template State<Packet>> at_look;
};
using PlaneLanes = LanesOf<Plane>;
using SpaceLanes = LanesOf<Spatial>;

/// Puts the start of a problem's motions into a lane.
void SetStart(const Problem& problem, std::size_t lane, PlaneLanes& lanes) {
  const bool hinged = problem.scene.robot.hinged();
  for (std::size_t d = 0; d < LaneTypes<Plane>::kRootDofs; ++d) {
    const bool held = hinged && d < 2;
    const double bar = d == 0 ? problem.scene.bar.x() : problem.scene.bar.y();
    lanes.start.q[d].set_lane(lane, held ? bar : problem.start_q[d]);
    lanes.start.v[d].set_lane(lane, held ? 0 : problem.start_root_rates[d]);
  }
}
void SetStart(const Problem& problem, std::size_t lane, SpaceLanes& lanes) {
  for (std::size_t d = 0; d < LaneTypes<Spatial>::kRootDofs; ++d) {
    lanes.start.q[d].set_lane(lane, problem.start_q[d]);
    lanes.start.v[d].set_lane(lane, 0);  // At rest.
  }
  for (std::size_t i = 0; i < lanes.start.axes.size(); ++i) {
    const int row = static_cast<int>(i) / 3, column = static_cast<int>(i) % 3;
    lanes.start.axes[i].set_lane(lane, problem.space->start_orientation(row, column));
  }
}

}  // namespace

std::optional<std::string> LaneRollout::WhyNot(const Problem& problem) {
  if (problem.free_duration) return "the duration is free";
  for (const CostTerm& term : problem.cost) {
    const bool has =
        problem.space && (term.kind == CostTerm::Kind::kWork || term.kind == CostTerm::Kind::kSlip);
    if (term.when == CostTerm::When::kThroughout && term.of_state() && !has)
      return "a cost looks at the state throughout the motion";
  }
  try {
    const std::size_t joints = problem.space ? Planned(problem.space->scene).model.joints
                                             : Planned(problem.scene).model.joints;
    if (joints != problem.joints.size()) return "a joint has no path";
    return std::nullopt;
  } catch (const std::invalid_argument& why) {
    return why.what();
  }
}

struct LaneRollout::Implementation {
  Implementation(const Problem& p, const StepGrid& grid, LanePlan::Scheme scheme,
                 const LanePlanKernel<Packet>* fixed)
      : motions(Packet::kLanes, ParametricMotion(p)),
        outputs(motions.front(), p.solver.step_s),
        clearance(p, p.solver.step_s),
        kernel(fixed != nullptr ? *fixed : *PacketPlanKernels().front()),
        effort_weight(WeightOf(CostTerm::Kind::kEffort, p)),
        work_weight(WeightOf(CostTerm::Kind::kWork, p)),
        slip_weight(SlipWeightOf(p)) {
    const bool longer = scheme == LanePlan::Scheme::kFifthOrder;
    const Tableau& tableau = longer ? kDormandPrince : kClassical;
    const Timetable table(tableau, grid, p.duration_s, p.instants());
    plan.scheme = scheme;
    plan.stages = scheme == LanePlan::Scheme::kSemiImplicitEuler ? 1 : tableau.own_stages();
    plan.points_per_step = Index(table.points_per_step);
    plan.steps = table.length;
    if (plan.stages > 1) {
      look_points.emplace(tableau, *std::ranges::max_element(plan.steps));
    }
    for (const double step_s : plan.steps)
      points_in.push_back(look_points ? &look_points->In(step_s) : &LookPoints::Start());
    sizes.resize(plan.steps.size());
    plan.motion_steps = Index(table.motion_steps);
    for (const int step : table.step_at) plan.looks.push_back(Index(step));
    plan.weights = Index(p.degree) + 1;
    for (std::size_t j = 0; j < p.joints.size(); ++j) {
      plan.first_point[j] = points.size();
      points.resize(points.size() + Index(p.joints[j].control_points));
      plan.last_point[j] = points.size() - 1;
    }
    TabulatePaths(table);
    depth.resize(plan.steps.size() * plan.stages);
    torque.resize(depth.size() * p.joints.size());
    if (p.space) {
      space.emplace(Planned(p.space->scene), plan.looks.size());
    } else {
      plane.emplace(Planned(p.scene), plan.looks.size());
    }
  }

  void TabulatePaths(const Timetable& table) {
    const Problem& problem = motions.front().problem();
    weights.resize(problem.joints.size());  // Spans into it stay: no vector of it grows later.
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const int size = problem.joints[j].control_points;
      std::size_t same = 0;
      while (problem.joints[same].control_points != size) ++same;
      if (same == j) {
        Spline spline;
        if (spline.Assign(problem.degree, PathKnots(problem, size, problem.duration_s),
                          std::vector<double>(Index(size))) != Status::kOk)
          throw std::invalid_argument("spline degree and size do not fit together");
        for (const double t : table.time) {
          const Spline::Weights at = spline.EvaluateWeights(t);
          LanePathWeights& w = weights[j].emplace_back();
          w.first = Index(at.first);
          for (std::size_t d = 0; d < w.of.size(); ++d)
            std::copy_n(at.w[d].begin(), plan.weights, w.of[d].begin());
        }
      }
      plan.paths[j] = weights[same];
    }
  }

  /// Puts a motion into a lane.
  void SetLane(std::size_t lane, std::span<const double> x) {
    ParametricMotion& motion = motions[lane];
    if (!motion.Set(x)) throw std::logic_error("lanes have no free duration");
    const Problem& problem = motion.problem();
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const ActuatedJoint& joint = problem.joints[j];
      const EndPoints ends = EndPointsOf(joint, problem.degree, problem.duration_s);
      for (int i = 0; i < joint.control_points; ++i) {
        points[plan.first_point[j] + Index(i)].set_lane(
            lane, ControlPointOf(joint, ends, motion.first_parameter(static_cast<int>(j)), x, i));
      }
    }
    if (space) {
      SetStart(problem, lane, *space);
    } else {
      SetStart(problem, lane, *plane);
    }
  }

  std::vector<RolloutResult> Run(std::span<const std::vector<double>> x, Wanted wanted) {
    // Lanes that nobody asks for repeat the first one.
    for (std::size_t lane = 0; lane < Packet::kLanes; ++lane)
      SetLane(lane, x[lane < x.size() ? lane : 0]);
    return space ? RunIn(*space, kernel.run_in_space, x, wanted)
                 : RunIn(*plane, kernel.run, x, wanted);
  }

  template <class Lanes, class Kernel>
  std::vector<RolloutResult> RunIn(Lanes& lanes, Kernel run, std::span<const std::vector<double>> x,
                                   Wanted wanted) {
    LanePlanRecord<Packet, decltype(lanes.start)> record{torque, depth, lanes.at_look, {}, {},
                                                         {},     {}};
    run(lanes.model, lanes.robot, plan, points, lanes.start, record);
    std::vector<RolloutResult> results;
    for (std::size_t lane = 0; lane < x.size(); ++lane) {
      results.push_back(ResultOf(lane, record));
      if (wanted == Wanted::kAll) results.back().clearance_excess = clearance.Evaluate(x[lane]);
    }
    if (wanted != Wanted::kCost) FindPeaks(results);
    return results;
  }

  template <class State>
  RolloutResult ResultOf(std::size_t lane, const LanePlanRecord<Packet, State>& record) {
    const Problem& problem = motions[lane].problem();
    RolloutResult result = outputs.Begin();
    squares[lane] = effort_weight * record.effort.lane(lane);
    result.cost = squares[lane] + work_weight * record.work.lane(lane) +
                  slip_weight * record.loaded_slip.lane(lane);
    std::vector<double> q(problem.start_q.size()), qd(q.size());
    bool plausible = record.largest.lane(lane) < kImplausibleState;
    for (std::size_t i = 0; i < plan.looks.size(); ++i) {
      for (std::size_t d = 0; d < q.size(); ++d) {
        q[d] = record.at_look[i].q[d].lane(lane);
        qd[d] = record.at_look[i].v[d].lane(lane);
        plausible = plausible && std::isfinite(q[d]) && std::isfinite(qd[d]);
      }
      SpaceMatrix axes;
      CostPoint here{q, qd, {}};
      if constexpr (std::is_same_v<State, SpaceLaneState<Packet>>) {
        axes = AxesOf(record.at_look[i], lane);
        here.axes = &axes;
      }
      for (const CostTerm& term : problem.cost) {
        if (!motions[lane].instants()[i].Has(term)) continue;
        const double part = term.weight * term.Accumulate(0, 1, here);
        result.cost += part;
        if (term.draws()) squares[lane] += part;
        MotionOutputs::RecordTarget(term, here, result);
      }
    }
    if (!plausible || !std::isfinite(result.cost)) return MotionOutputs::Failed(std::move(result));
    return result;
  }

  /// A recorded quantity's smooth maximum, to be found.
  /// @param count  of such quantities at a stage.
  [[nodiscard]] LanePeaks<Packet> PeaksOf(std::span<const Packet> quantity, std::size_t count,
                                          std::size_t which, double unit) {
    LanePeaks<Packet> peaks;
    peaks.quantity = quantity;
    peaks.count = count;
    peaks.which = which;
    peaks.unit = unit;
    peaks.sharpness = motions.front().problem().solver.sharpness;
    peaks.negligible = kLeastExponent;
    peaks.nothing = kExponentOfNothing;
    peaks.looks = points_in;
    peaks.sizes = sizes;
    return peaks;
  }

  /// Writes what peaks make of the results of the last run.
  void FindPeaks(std::span<RolloutResult> results) {
    const std::size_t joints = motions.front().problem().joints.size();
    for (std::size_t j = 0; j < joints; ++j) FindPeakTorques(j, results);
    FindDepths(results);
  }

  void FindPeakTorques(std::size_t j, std::span<RolloutResult> results) {
    const Problem& problem = motions.front().problem();
    LanePeaks<Packet> peaks =
        PeaksOf(torque, problem.joints.size(), j, problem.joints[j].limits.torque_max_nm);
    kernel.find_peaks(plan, peaks);
    for (std::size_t lane = 0; lane < results.size(); ++lane) {
      RolloutResult& result = results[lane];
      if (!result.finite) continue;
      result.peak_torque_nm[j] = std::max(result.peak_torque_nm[j], peaks.at_start.lane(lane));
      if (!outputs.IsTorqueLimited(static_cast<int>(j))) continue;
      result.torque_excess[j] = MotionOutputs::TorqueExcess(
          outputs.TorqueMaximum(peaks.largest.lane(lane), peaks.sum.lane(lane)));
    }
  }

  void FindDepths(std::span<RolloutResult> results) {
    const Problem& problem = motions.front().problem();
    LanePeaks<Packet> peaks = PeaksOf(depth, 1, 0, 1 - problem.solver.core_margin);
    peaks.of = LanePeaks<Packet>::Of::kDepth;
    peaks.least = 1 + kNegligibleExponent / peaks.sharpness;  // as SmoothDepth
    peaks.shallow = kShallow;
    kernel.find_peaks(plan, peaks);
    for (std::size_t lane = 0; lane < results.size(); ++lane) {
      RolloutResult& result = results[lane];
      if (!result.finite) continue;
      const double deepest = peaks.at_start.lane(lane);
      result.any_contact = deepest > 0;
      result.peak_penetration_m = deepest * problem.contact().d_on_m;
      const double sum = peaks.sum.lane(lane);
      if (sum > 0) {
        result.penetration_excess =
            outputs.PenetrationExcess(outputs.PenetrationMaximum(peaks.largest.lane(lane), sum));
      }
    }
  }

  std::vector<ParametricMotion> motions;  // by lane
  MotionOutputs outputs;
  ClearanceConstraint clearance;
  const LanePlanKernel<Packet>& kernel;
  double effort_weight, work_weight, slip_weight;
  LanePlan plan;
  std::optional<LookPoints> look_points;              // of schemes with stages
  std::vector<std::vector<LanePathWeights>> weights;  // by joint; empty where another's serve
  std::vector<Packet> points, torque, depth;
  std::vector<const StepPoints*> points_in;  // each step
  std::vector<Packet> sizes;                 // of a quantity, in each step
  std::optional<PlaneLanes> plane;           // one of the two
  std::optional<SpaceLanes> space;
  std::array<double, Packet::kLanes> squares{};
};

LaneRollout::LaneRollout(const Problem& problem, double step_s, LanePlan::Scheme scheme,
                         const LanePlanKernel<Packet>* kernel)
    : implementation_(
          std::make_unique<Implementation>(problem, EvenGrid(problem, step_s), scheme, kernel)) {}
LaneRollout::LaneRollout(const Problem& problem, const StepGrid& grid,
                         const LanePlanKernel<Packet>* kernel)
    : implementation_(
          std::make_unique<Implementation>(problem, grid, LanePlan::Scheme::kFifthOrder, kernel)) {}
LaneRollout::~LaneRollout() = default;
LaneRollout::LaneRollout(LaneRollout&&) noexcept = default;

std::vector<RolloutResult> LaneRollout::Run(std::span<const std::vector<double>> x, Wanted wanted) {
  if (x.empty() || x.size() > Packet::kLanes)
    throw std::invalid_argument("lanes run one motion to eight");
  return implementation_->Run(x, wanted);
}
const Packet& LaneRollout::torque(std::size_t step, std::size_t joint) const {
  const std::size_t joints = implementation_->motions.front().problem().joints.size();
  return implementation_->torque[step * implementation_->plan.stages * joints + joint];
}
std::span<const double> LaneRollout::steps() const { return implementation_->plan.steps; }
double LaneRollout::squares(std::size_t lane) const { return implementation_->squares[lane]; }
double LaneRollout::effort_weight() const { return implementation_->effort_weight; }
std::int64_t LaneRollout::evaluations() const {
  const LanePlan& plan = implementation_->plan;
  return static_cast<std::int64_t>(plan.steps.size() * plan.stages);
}
double LaneRollout::ClearanceExcess(std::span<const double> x, std::span<double> gradient) {
  return implementation_->clearance.Evaluate(x, gradient);
}

}  // namespace tumbler
