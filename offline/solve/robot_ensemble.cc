#include "offline/solve/robot_ensemble.h"

#include <algorithm>
#include <array>

#include "common/core/index.h"

namespace tumbler {
namespace {

/// How long a robot stands before the motion, so that it rests on its own ground.
constexpr double kStands_s = 0.5;

/// What is added to a robot's state when the motion begins.
LaneState<double> DisplacementOf(const PlanarRobot& robot, const RobotVariation& variation) {
  LaneState<double> by{};
  const auto q = variation.StartPositions(robot), v = variation.StartRates(robot);
  std::copy(q.begin(), q.end(), by.q.begin());
  std::copy(v.begin(), v.end(), by.v.begin());
  return by;
}

/// @param draw    of the robots.
/// @param robots  whole packets.
Ensemble EnsembleOf(const RobustTask& task, const RobotDraw& draw,
                    const std::vector<RobotVariation>& robots) {
  const Problem& problem = task.problem;
  const RobustSettings& settings = task.settings;
  const std::size_t joints = task.joints;
  Ensemble ensemble;
  ensemble.steps = draw.steps;
  ensemble.steps.per_tick *= FinerStepsFor(problem.scene.contact, settings.spreads, draw.scale);
  for (std::size_t j = 0; j < joints; ++j)
    ensemble.held[j] = {Packet::Of(problem.joints[j].start_rad), Packet::Of(0), Packet::Of(0)};
  PacketSetpoints hold;
  for (int k = 0; k < RobustTask::Ticks(kStands_s); ++k)
    hold.insert(hold.end(), ensemble.held.begin(), ensemble.held.begin() + joints);
  for (std::size_t first = 0; first < robots.size(); first += Packet::kLanes) {
    std::array<LaneRobot<double>, Packet::kLanes> each;
    std::array<LaneState<double>, Packet::kLanes> states, displaced;
    for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
      const RobotVariation& variation = robots[first + lane];
      each[lane] = LanesOf(problem, variation).robot;
      states[lane] = StartState(problem);
      displaced[lane] = DisplacementOf(problem.scene.robot, variation);
    }
    LaneState<Packet> state = PackLanes<LaneState>(states);
    HeldSetpoints<Packet> held = ensemble.held;
    LaneWatch<Packet> watch;
    ensemble.robots.push_back(PackLanes<LaneRobot>(each));
    task.kernel.drive(task.lanes.model, ensemble.robots.back(), ensemble.steps, hold, held, state,
                      watch);
    const LaneState<Packet> by = PackLanes<LaneState>(displaced);
    for (std::size_t dof = 0; dof < joints + 3; ++dof) {
      for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
        state.q[dof].set_lane(lane, state.q[dof].lane(lane) + by.q[dof].lane(lane));
        state.v[dof].set_lane(lane, state.v[dof].lane(lane) + by.v[dof].lane(lane));
      }
    }
    ensemble.states.push_back(state);
    if (!draw.sensors) continue;
    const double most_s = settings.duration_max_s.value_or(problem.duration_s);
    const double time_s = most_s + problem.settle_s + RobustTask::kLater_s;
    ensemble.noise.emplace_back(*settings.feedback, Index(RobustTask::Ticks(time_s)) + 1, draw.seed,
                                ensemble.noise.size());
  }
  return ensemble;
}

}  // namespace

RankingEnsemble ForRanking(const Ensemble& robots) {
  RankingEnsemble wide;
  wide.steps = robots.steps;
  for (std::size_t j = 0; j < wide.held.size(); ++j) {
    const LaneSetpoint<Packet>& held = robots.held[j];
    wide.held[j] = {static_cast<float>(held.position.lane(0)),
                    static_cast<float>(held.velocity.lane(0)),
                    static_cast<float>(held.third.lane(0))};
  }
  const std::size_t packets = robots.robots.size();
  wide.count = packets * Packet::kLanes;
  for (std::size_t p = 0; p < packets; p += 2) {
    const std::size_t next = (p + 1) % packets;
    wide.robots.push_back(WidenLanes<LaneRobot>(robots.robots[p], robots.robots[next]));
    wide.states.push_back(WidenLanes<LaneState>(robots.states[p], robots.states[next]));
  }
  return wide;
}

Ensemble PartOf(const Ensemble& robots, std::size_t first, std::size_t count) {
  Ensemble part;
  part.held = robots.held;
  part.steps = robots.steps;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t packet = (first + i) % robots.robots.size();
    part.robots.push_back(robots.robots[packet]);
    part.states.push_back(robots.states[packet]);
    if (!robots.noise.empty()) part.noise.push_back(robots.noise[packet]);
  }
  return part;
}

Ensemble DrawEnsemble(const RobustTask& task, const RobotDraw& draw,
                      const std::vector<std::uint64_t>& which) {
  std::vector<RobotVariation> robots;
  robots.reserve(which.size());
  for (const std::uint64_t robot : which) {
    robots.push_back(
        DrawRobot(task.problem.scene, task.settings.spreads, draw.scale, draw.seed, robot));
  }
  return EnsembleOf(task, draw, robots);
}

Ensemble ModelOnSlopes(const RobustTask& task, std::span<const double> slopes_rad,
                       LaneSteps steps) {
  Spreads none;
  none.mass = 0;
  none.LeaveGround();
  std::vector<RobotVariation> robots(slopes_rad.size(),
                                     DrawRobot(task.problem.scene, none, 0, 0, 0));
  for (std::size_t i = 0; i < robots.size(); ++i) robots[i].slope_rad = slopes_rad[i];
  return EnsembleOf(task, {.steps = steps}, robots);
}

Ensemble ModelEnsemble(const RobustTask& task, LaneSteps steps, bool sensors) {
  return DrawEnsemble(task, {.steps = steps, .sensors = sensors},
                      std::vector<std::uint64_t>(Packet::kLanes));
}

}  // namespace tumbler
