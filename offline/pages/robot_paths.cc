#include "offline/pages/robot_paths.h"

#include <algorithm>
#include <map>

#include "common/core/index.h"
#include "offline/certify/chain.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/pages/shown_scene.h"

namespace tumbler {
namespace {

std::vector<double> Between(const std::vector<double>& a, const std::vector<double>& b,
                            double share) {
  std::vector<double> between(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) between[i] = a[i] + share * (b[i] - a[i]);
  return between;
}

}  // namespace

struct RobotPaths::Implementation {
  explicit Implementation(const SequenceFile& motion_in)
      : motion(motion_in),
        problem(motion.ProblemOf(0)),
        scene(ReportScene(problem)),
        dynamics(problem.scene.robot.tree) {
    for (const PassiveJoint& joint : problem.scene.robot.passive)
      passive_names.push_back(problem.scene.robot.tree.dofs[Index(joint.dof)].name);
  }

  SimulatedMotion motion;
  const Problem& problem;
  ReportData scene;
  std::vector<std::string> passive_names;
  HybridDynamics<Plane> dynamics;
  std::map<int, std::vector<ReportSample>> plans;
};

RobotPaths::RobotPaths(const SequenceFile& motion)
    : implementation_(std::make_unique<Implementation>(motion)) {}
RobotPaths::~RobotPaths() = default;
RobotPaths::RobotPaths(RobotPaths&&) noexcept = default;

const ReportData& RobotPaths::scene() const { return implementation_->scene; }

const std::vector<std::string>& RobotPaths::passive_names() const {
  return implementation_->passive_names;
}

ReportSample RobotPaths::Pose(const std::array<double, 3>& root, std::span<const double> joints_rad,
                              std::span<const double> passive_rad) {
  Implementation& m = *implementation_;
  MotionSample sample;
  sample.q = m.problem.start_q;
  sample.qd.assign(sample.q.size(), 0);
  const PlanarRobot& robot = m.problem.scene.robot;
  if (robot.root_dofs == 3) std::copy(root.begin(), root.end(), sample.q.begin());
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    sample.q[robot.DofOfJoint(j)] = joints_rad[j];
  }
  for (std::size_t i = 0; i < passive_rad.size() && i < robot.passive.size(); ++i)
    sample.q[Index(robot.passive[i].dof)] = passive_rad[i];
  sample.torque.assign(m.problem.joints.size(), 0);
  m.dynamics.SetState(sample.q, sample.qd);
  sample.dynamics = &m.dynamics;
  ReportSample shown = ShownSample(m.problem, sample);
  if (passive_rad.empty()) shown.passive_positions_rad.clear();
  return shown;
}

const std::vector<ReportSample>& RobotPaths::PlanOf(int node) {
  Implementation& m = *implementation_;
  const auto found = m.plans.find(node);
  if (found != m.plans.end()) return found->second;
  ChainOptions options;
  options.cycles = 1;
  options.last_hold_s = kExitAfter_s;
  std::vector<ReportSample>& plan = m.plans[node];
  SimulateChain(m.motion.Alone(node), options, [&m, &plan](int, const MotionSample& sample) {
    ReportSample shown = ShownSample(m.problem, sample);
    shown.forces.clear();
    if (plan.empty() || shown.time_s > plan.back().time_s) plan.push_back(std::move(shown));
  });
  return plan;
}

ReportSample RobotPaths::PlanAt(int node, double time_s) {
  const std::vector<ReportSample>& plan = PlanOf(node);
  const auto after =
      std::lower_bound(plan.begin(), plan.end(), time_s,
                       [](const ReportSample& sample, double t) { return sample.time_s < t; });
  if (after == plan.begin()) return plan.front();
  if (after == plan.end()) return plan.back();
  const ReportSample& b = *after;
  const ReportSample& a = *(after - 1);
  const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
  ReportSample sample = a;
  sample.time_s = time_s;
  sample.root_pitch_rad += share * (b.root_pitch_rad - a.root_pitch_rad);
  for (std::size_t k = 0; k < sample.link_poses.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      sample.link_poses[k][c] += share * (b.link_poses[k][c] - a.link_poses[k][c]);
    }
  }
  sample.joint_positions_rad = Between(a.joint_positions_rad, b.joint_positions_rad, share);
  sample.passive_positions_rad = Between(a.passive_positions_rad, b.passive_positions_rad, share);
  sample.joint_velocities_rad_s =
      Between(a.joint_velocities_rad_s, b.joint_velocities_rad_s, share);
  sample.joint_torques_nm = Between(a.joint_torques_nm, b.joint_torques_nm, share);
  return sample;
}

void Place(ReportSample& sample, double dx_m, double turn_rad) {
  sample.root_pitch_rad += turn_rad;
  for (auto& pose : sample.link_poses) {
    pose[0] += dx_m;
    pose[2] += turn_rad;
  }
}

}  // namespace tumbler
