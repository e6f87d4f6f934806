#include "offline/solve/rollout.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
#include "offline/scene/even_steps.h"
#include "offline/scene/stepper.h"
#include "offline/solve/adjoint.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/propagation.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

/// Null where gradients are by the adjoint.
std::unique_ptr<ForwardSensitivity> MakeForwardSensitivity(const Problem& problem, double step_s,
                                                           bool own_contact) {
  if (problem.space || problem.solver.gradient == SolverSettings::Gradient::kAdjoint)
    return nullptr;
  if (own_contact)
    throw std::invalid_argument("the forward gradient has the general contact model only");
  return std::make_unique<ForwardSensitivity>(problem,
                                              StepSettings{StepSettings::Scheme::kFixed, step_s});
}

/// A simulation with its adjoint, in the plane or in space.
template <class Space>
struct Engine {
  Engine(const Problem& problem, double step_s, std::unique_ptr<ContactForces<Space>> contact)
      : propagation(problem, step_s, std::move(contact)), adjoint(propagation) {}

  Propagation<Space> propagation;
  Adjoint<Space> adjoint;

  RolloutResult Run(std::span<const double> x, std::span<double> gradient) {
    RolloutResult result = propagation.Run(x, ForwardPass::kGradient);
    if (!result.finite) {
      std::fill(gradient.begin(), gradient.end(), 0.0);
      return result;
    }
    adjoint.Run(result, gradient);
    return result;
  }
};

template <class Space>
void VisitSteps(Propagation<Space>& forward, std::span<const double> x, double extra_s,
                const std::function<void(const MotionSampleIn<Space>&)>& visitor,
                double extra_step_s = 0) {
  using State = typename SceneDynamicsIn<Space>::State;
  SceneDynamicsIn<Space>& robot = forward.robot;
  if (!forward.SetMotion(x))
    throw std::invalid_argument("the motion ends before its cost looks at it");
  State y = StartState(robot, forward.motion.problem());
  RootChart<Space> chart = StartChart<Space>(forward.motion.problem());
  robot.Use(chart);
  MotionSampleIn<Space> sample;
  sample.dynamics = &robot.dynamics;
  const auto visit = [&] {
    sample.q.assign(robot.q.begin(), robot.q.begin() + static_cast<std::ptrdiff_t>(robot.n));
    sample.qd.assign(robot.qd.begin(), robot.qd.begin() + static_cast<std::ptrdiff_t>(robot.n));
    sample.torque.clear();
    for (int j = 0; j < forward.motion.joints(); ++j)
      sample.torque.push_back(robot.tau[Index(forward.motion.joint(j).dof)]);
    sample.contacts = robot.contact->active();
    if constexpr (RootChart<Space>::kMoves) sample.orientation = chart.axes;
    visitor(sample);
  };
  const Timetable& table = forward.table;
  const double settle_step_s =
      table.settles()
          ? *std::max_element(table.length.begin() + table.motion_steps, table.length.end())
          : forward.longest_step_s;
  const EvenSteps extra(extra_s, extra_step_s > 0 ? extra_step_s : settle_step_s);
  const int steps = table.steps() + extra.count;
  const auto step_on = [&]<const Tableau & kScheme>(int step, double h) {
    StepRungeKutta<kScheme>(y, 2 * robot.free.size(), h, [&](int s, const State& y_s, double* k) {
      forward.Evaluate(y_s, table.PointOf(step, s));
      if (s == 0) visit();
      robot.TakeSlope(k);
      return true;
    });
    forward.MoveOn(chart, y);
  };
  double held_s = 0;  // since the end of the motion
  for (int step = 0; step <= steps; ++step) {
    const double h = step < table.steps() ? table.length[Index(step)] : extra.step_s;
    sample.time_s = forward.motion.duration_s() + held_s;
    if (step < table.motion_steps) {
      sample.time_s = table.time[Index(table.PointOf(step, 0))];
    } else {
      held_s += h;
    }
    if (table.classical) {
      step_on.template operator()<kClassical>(step, h);
    } else {
      step_on.template operator()<kDormandPrince>(step, h);
    }
  }
}

}  // namespace

struct Rollout::Implementation {
  Implementation(const Problem& problem, double step_s,
                 std::unique_ptr<ContactForces<Plane>> contact)
      : sensitivity(MakeForwardSensitivity(problem, step_s, contact != nullptr)) {
    if (problem.space) {
      space = std::make_unique<Engine<Spatial>>(problem, step_s, nullptr);
    } else {
      plane = std::make_unique<Engine<Plane>>(problem, step_s, std::move(contact));
    }
  }

  /// Calls `work` with the engine of the problem's algebra.
  template <class Work>
  auto With(Work&& work) {
    return space ? work(*space) : work(*plane);
  }

  std::unique_ptr<ForwardSensitivity> sensitivity;  // null: gradients are by the adjoint
  std::unique_ptr<Engine<Plane>> plane;             // one of the two
  std::unique_ptr<Engine<Spatial>> space;
};

Rollout::Rollout(const Problem& problem, double step_s,
                 std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, step_s, std::move(contact))) {}
Rollout::~Rollout() = default;
Rollout::Rollout(Rollout&&) noexcept = default;

int Rollout::parameter_count() const {
  return implementation_->With([](auto& engine) { return engine.propagation.motion.parameters(); });
}
int Rollout::output_count() const {
  return implementation_->With(
      [](auto& engine) { return engine.propagation.outputs.rows().count(); });
}

RolloutResult Rollout::Run(std::span<const double> x) {
  return implementation_->With(
      [x](auto& engine) { return engine.propagation.Run(x, ForwardPass::kOutputs); });
}

RolloutResult Rollout::Estimate(std::span<const double> x) {
  return implementation_->With(
      [x](auto& engine) { return engine.propagation.Run(x, ForwardPass::kEstimate); });
}

RolloutResult Rollout::Run(std::span<const double> x, std::span<double> gradient) {
  if (gradient.size() != Index(output_count()) * Index(parameter_count())) {
    throw std::invalid_argument(
        "the gradient has a row for each output, a number for each parameter in it");
  }
  if (implementation_->sensitivity) return implementation_->sensitivity->Run(x, gradient);
  return implementation_->With([&](auto& engine) { return engine.Run(x, gradient); });
}

void Rollout::Use(const StepGrid& grid) {
  implementation_->With([&grid](auto& engine) { engine.propagation.Use(grid); });
  implementation_->sensitivity.reset();  // It takes equal steps.
}

void Rollout::Visit(std::span<const double> x, double extra_s,
                    const std::function<void(const MotionSample&)>& visitor, double extra_step_s) {
  VisitSteps(implementation_->plane->propagation, x, extra_s, visitor, extra_step_s);
}

void Rollout::VisitInSpace(std::span<const double> x, double extra_s,
                           const std::function<void(const SpaceSample&)>& visitor) {
  VisitSteps(implementation_->space->propagation, x, extra_s, visitor);
}

}  // namespace tumbler
