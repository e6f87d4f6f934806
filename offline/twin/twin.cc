#include "offline/twin/twin.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "offline/contact/contact_model.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/problem/task_toml.h"

namespace tumbler {
namespace {

constexpr std::size_t Index(int i) { return static_cast<std::size_t>(i); }

/// The same tree with every joint driven by a torque.
Tree<Plane> Unprescribed(Tree<Plane> tree) {
  for (Dof<Plane>& dof : tree.dofs) dof.prescribed = false;
  return tree;
}

}  // namespace

struct Twin::Implementation {
  Implementation(const PrimitiveFile& file, const TwinConfig& c, SimulatedBus& b,
                 std::vector<SimulatedDrive*> d)
      : config(c),
        problem(TaskOf(file).problem),
        tree(WithLosses(Unprescribed(problem.robot.tree), problem, c)),
        dynamics(tree),
        contact(problem.contact, problem.robot.shapes, problem.obstacles),
        bus(b),
        drives(std::move(d)),
        q(problem.start_q),
        qd(q.size()),
        qdd(q.size()),
        tau(q.size()) {
    if (drives.size() != problem.joints.size()) {
      throw std::invalid_argument("a twin needs one drive for each joint of its primitive");
    }
    if (config.step_ns <= 0) throw std::invalid_argument("the twin's step must be positive");
    Drive();
  }

  static Tree<Plane> WithLosses(Tree<Plane> tree, const Problem& problem,
                                const TwinConfig& config) {
    for (const ActuatedJoint& joint : problem.joints) {
      tree.dofs[Index(joint.dof)].damping_nm_s_per_rad += config.joint_damping_nm_s_per_rad;
    }
    return tree;
  }

  /// Lets every drive measure its joint and act for one step.
  void Drive() {
    for (std::size_t j = 0; j < drives.size(); ++j) {
      const std::size_t dof = Index(problem.joints[j].dof);
      tau[dof] = drives[j]->Step(time_ns, q[dof], qd[dof]);
    }
  }

  void Accelerations(const std::vector<double>& position, const std::vector<double>& velocity) {
    dynamics.SetState(position, velocity);
    contact.Apply(dynamics);
    dynamics.Solve(qdd, tau);
  }

  /// Two-stage Runge-Kutta (midpoint): the step is set by the drives' loops and far below what the
  /// contact needs.
  void Integrate(double h) {
    Accelerations(q, qd);
    normal_force = 0;
    for (const ActiveContact<Plane>& a : contact.active()) {
      peak_penetration = std::max(peak_penetration, a.depth_m);
      normal_force += a.normal_force_n;
    }
    std::vector<double>& qm = scratch_q;
    std::vector<double>& vm = scratch_v;
    qm = q;
    vm = qd;
    for (std::size_t i = 0; i < q.size(); ++i) {
      qm[i] += 0.5 * h * qd[i];
      vm[i] += 0.5 * h * qdd[i];
    }
    Accelerations(qm, vm);
    for (std::size_t i = 0; i < q.size(); ++i) {
      q[i] += h * vm[i];
      qd[i] += h * qdd[i];
    }
  }

  TwinConfig config;
  Problem problem;
  Tree<Plane> tree;
  HybridDynamics<Plane> dynamics;
  ContactModel<Plane> contact;
  SimulatedBus& bus;
  std::vector<SimulatedDrive*> drives;
  std::vector<double> q, qd, qdd, tau, scratch_q, scratch_v;
  std::int64_t time_ns = 0;
  double peak_penetration = 0;
  double normal_force = 0;
};

Twin::Twin(const PrimitiveFile& file, const TwinConfig& config, SimulatedBus& bus,
           std::vector<SimulatedDrive*> drives)
    : implementation_(std::make_unique<Implementation>(file, config, bus, std::move(drives))) {}
Twin::~Twin() = default;

void Twin::AdvanceTo(std::int64_t time_ns) {
  Implementation& m = *implementation_;
  while (m.time_ns < time_ns) {
    const std::int64_t next = std::min(m.time_ns + m.config.step_ns, time_ns);
    m.bus.AdvanceTo(m.time_ns);
    m.Drive();
    m.Integrate(1e-9 * static_cast<double>(next - m.time_ns));
    m.time_ns = next;
  }
  m.bus.AdvanceTo(time_ns);
  m.Drive();
}

TwinState Twin::state() const {
  const Implementation& m = *implementation_;
  TwinState state;
  state.time_ns = m.time_ns;
  if (m.problem.robot.root_dofs == 3) {
    state.root_x_m = m.q[0];
    state.root_z_m = m.q[1];
    state.root_pitch_rad = m.q[2];
    state.root_vx_m_s = m.qd[0];
    state.root_vz_m_s = m.qd[1];
    state.root_pitch_rate_rad_s = m.qd[2];
  }
  for (const ActuatedJoint& joint : m.problem.joints) {
    state.joint_positions_rad.push_back(m.q[Index(joint.dof)]);
    state.joint_velocities_rad_s.push_back(m.qd[Index(joint.dof)]);
    state.joint_torques_nm.push_back(m.tau[Index(joint.dof)]);
  }
  state.peak_penetration_m = m.peak_penetration;
  state.normal_force_n = m.normal_force;
  return state;
}

}  // namespace tumbler
