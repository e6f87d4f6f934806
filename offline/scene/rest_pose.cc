#include "offline/scene/rest_pose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/scene/lowest_height.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {
namespace {

constexpr double kStep_s = 1e-4;
constexpr double kTime_s = 5;
/// Numerical air resistance. It shortens the rocking and has no effect at rest.
constexpr double kAir_per_s = 5;
constexpr std::size_t kX = 0, kZ = 1, kPitch = 2;

/// Whether nothing moves any more. On a slope, friction that grows with the speed of slipping lets
/// the robot creep. That counts as rest where dry friction would hold it, and it goes on evenly
/// (but for the air), below the speed at which friction is fully there.
bool AtRest(const SceneDynamics& robot, const Scene& scene) {
  constexpr double kStill = 1e-7, kFree = 1e-5;
  const Plane::Vector& g = scene.robot.tree.gravity;
  const bool slope = g.x() != 0 && std::abs(g.x()) < scene.contact.mu * std::abs(g.y());
  for (const int dof : robot.free) {
    const std::size_t i = Index(dof);
    const double speed = std::abs(robot.qd[i]), acceleration = std::abs(robot.qdd[i]);
    if (slope && i == kX) {
      if (!(speed < scene.contact.v_max_m_per_s &&
            acceleration < kFree + 1.01 * kAir_per_s * speed))
        return false;
    } else if (!(speed < kStill && acceleration < kFree)) {
      return false;
    }
  }
  return true;
}

}  // namespace

double TouchingHeight(const Scene& scene, const std::vector<double>& q) {
  SceneDynamics robot(scene);
  std::copy(q.begin(), q.end(), robot.q.begin());
  return LowestHeight(robot, scene, kZ);
}

double TurnFromHanging(const Scene& scene, std::span<const double> q) {
  HybridDynamics<Plane> dynamics(scene.robot.tree);
  const std::vector<double> at_rest(q.size());
  dynamics.SetState(q, at_rest);
  Plane::Vector moment = Plane::Vector::Zero();  // of the masses, about the bar
  const Plane::Vector bar = dynamics.position(static_cast<int>(kPitch));
  for (std::size_t i = kPitch; i < scene.robot.tree.dofs.size(); ++i) {
    const Dof<Plane>& dof = scene.robot.tree.dofs[i];
    const int body = static_cast<int>(i);
    moment +=
        dof.mass_kg * (dynamics.position(body) + dynamics.rotation(body) * dof.mass_centre - bar);
  }
  constexpr double kOnTheBar_kg_m = 1e-9;
  if (moment.norm() < kOnTheBar_kg_m) return 0;
  constexpr double kPi = std::numbers::pi;
  return std::remainder(portable::Atan2(moment.y(), moment.x()) + kPi / 2, 2 * kPi);
}

double RestingPitch(const Scene& scene, std::span<const double> q) {
  return q[kPitch] - std::remainder(TurnFromHanging(scene, q), std::numbers::pi);
}

std::vector<double> RestPose(const Scene& scene, std::vector<double> q) {
  SceneDynamics robot(scene);
  const double pitch = q[kPitch];
  std::copy(q.begin(), q.end(), robot.q.begin());
  robot.q[kZ] = LowestHeight(robot, scene, kZ);
  SceneDynamics::State y = robot.AtRest(robot.q);
  // A spring swings for longer than a robot rocks.
  const double time_s = scene.robot.passive.empty() ? kTime_s : 4 * kTime_s;
  const std::size_t free = robot.free.size();
  for (int step = 0; step < static_cast<int>(time_s / kStep_s); ++step) {
    const auto slope = [&](int, const SceneDynamics::State& y_s, double* k) {
      robot.SetFree(y_s);
      robot.TouchAndSolve();
      robot.TakeSlope(k);
      return step == 0 || !AtRest(robot, scene);
    };
    const bool moved = StepSemiImplicitEuler(y, free, kStep_s, slope, kAir_per_s);
    for (std::size_t i = 0; i < free; ++i) q[Index(robot.free[i])] = y[i];
    if (!moved) return q;
    // It fell over, or past all obstacles, or its position is not a number.
    if (!(std::abs(q[kPitch] - pitch) <= std::numbers::pi / 2 &&
          std::abs(q[kZ]) <= 2 * kLowestReach_m && std::isfinite(q[0]))) {
      break;
    }
  }
  throw std::runtime_error(fmt::format(
      "the robot does not come to rest at its start: it ends at x {:.4g} m, z {:.4g} m, "
      "pitch {:.4g} rad",
      q[0], q[kZ], q[kPitch]));
}

}  // namespace tumbler
