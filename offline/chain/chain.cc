#include "offline/chain/chain.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "common/toml_reader.h"
#include "offline/certificate/certificate.h"
#include "offline/contact/contact_model.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/problem/task_toml.h"

namespace tumbler {
namespace {

constexpr double kPi = std::numbers::pi;
/// A state beyond this (m, rad, and their rates) is a failed simulation.
constexpr double kImplausible = 1e4;
/// A robot that does what it was planned to is nearer to it than this [rad]; one that has tipped
/// over an edge of its feet does not come back.
constexpr double kFallenPitch = 0.5;
// Of a report: as smooth as that of one motion for short chains, and no page of tens of megabytes
// for long ones.
constexpr double kSamplesPerSecond = 200;
constexpr double kMaxSamples = 4000;
/// A primitive played alone is held for as long as its recorded exit is after its end.
constexpr double kPlanHold = 2;
constexpr double kPostureTolerance = 0.1;

constexpr int kStages = 4;  // The classical Runge-Kutta scheme.
constexpr std::array<double, kStages> kA = {0, 0.5, 0.5, 1};
constexpr std::array<double, kStages> kB = {1. / 6, 1. / 3, 1. / 3, 1. / 6};

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

/// What one primitive's task says of the world, and what the primitive does in it.
struct World {
  explicit World(const PrimitiveFile& f)
      : file(f),
        problem(TaskOf(f).problem),
        dynamics(problem.robot.tree),
        contact(problem.contact, problem.robot.shapes, problem.obstacles) {
    for (const JointMotion<double>& motion : file.primitive.motions())
      dof_of_joint.push_back(problem.robot.FindDof(motion.name.view()));
    for (const ContactInterval& interval : file.contacts) {
      for (const ContactShape<Plane>& shape : problem.robot.shapes) {
        if (shape.name == interval.shape) touching_bodies.insert(shape.body);
      }
    }
  }

  const PrimitiveFile& file;
  Problem problem;
  HybridDynamics<Plane> dynamics;
  ContactModel<Plane> contact;
  std::vector<int> dof_of_joint;  // in the order of the primitive's joints
  std::set<int> touching_bodies;  // that touch anything in the plan

  /// The root's pitch when the primitive is played alone, from its own entry.
  struct PlannedPitch {
    double time_s, pitch_rad;
  };
  std::vector<PlannedPitch> plan;

  [[nodiscard]] double PlannedPitchAt(double t) const {
    const auto after = std::lower_bound(plan.begin(), plan.end(), t,
                                        [](const auto& p, double x) { return p.time_s < x; });
    if (after == plan.begin()) return plan.front().pitch_rad;
    if (after == plan.end()) return plan.back().pitch_rad;
    const auto before = after - 1;
    const double share = (t - before->time_s) / (after->time_s - before->time_s);
    return before->pitch_rad + share * (after->pitch_rad - before->pitch_rad);
  }
};

class Simulation {
 public:
  Simulation(const SequenceFile& file, const ChainOptions& options,
             const std::function<void(int, const MotionSample&)>& visitor)
      : file_(file), options_(options), visitor_(visitor) {
    for (const PrimitiveFile& primitive : file.primitives)
      worlds_.push_back(std::make_unique<World>(primitive));
    const World& world = WorldOf(file.graph.start);
    n_ = world.problem.start_q.size();
    for (std::size_t i = 0; i < n_; ++i) {
      if (!world.dynamics.prescribed(static_cast<int>(i))) free_.push_back(i);
    }
    root_ = world.problem.robot.root_dofs == 3;
    for (int node = 0; node < file.graph.node_count; ++node) {
      if (WorldOf(node).plan.empty()) Plan(node);
    }
  }

  ChainOutcome Run() {
    SetStart(file_.graph.start);
    int node = file_.graph.start;
    std::size_t since_cycle = 0;
    bool branched = false;
    for (;;) {
      Passage& passage = outcome_.passages.emplace_back();
      passage.node = node;
      passage.start_s = start_s_ = time_;
      passage.torque_margin_nm = std::numeric_limits<double>::infinity();
      if (!Enter(passage)) break;
      const double x = RootX();
      const double pitch = RootPitch();
      bool going = Move(passage);
      int edge = -1;
      if (going) {
        const bool ends_cycle = file_.graph.node(node).ends_cycle;
        outcome_.cycles += ends_cycle ? 1 : 0;
        since_cycle = ends_cycle ? 0 : since_cycle + 1;
        edge = NextEdge(file_.graph, node, outcome_.cycles, Request(branched));
        branched = branched || (edge >= 0 && file_.graph.edge(edge).when == EdgeCondition::kBranch);
        going = Hold(passage, edge < 0 ? options_.last_hold_s : file_.graph.edge(edge).settle_s);
      }
      passage.travelled_m = RootX() - x;
      passage.turned_rad = RootPitch() - pitch;
      if (going) going = Leave(passage);
      if (!going || edge < 0) break;
      if (since_cycle > Index(file_.graph.node_count) ||
          outcome_.cycles > options_.cycles + file_.graph.node_count) {
        throw std::invalid_argument(fmt::format(
            "the sequence '{}' goes round for ever: give it a number of cycles and a node that "
            "ends a cycle, or a branch on its way",
            file_.graph.name.view()));
      }
      node = file_.graph.edge(edge).to;
    }
    outcome_.duration_s = time_;
    outcome_.travelled_m = RootX() - start_x_;
    return std::move(outcome_);
  }

 private:
  World& WorldOf(int node) { return *worlds_[Index(file_.graph.node(node).primitive)]; }

  [[nodiscard]] SequenceRequest Request(bool branched) const {
    return PlannedRequest(options_.cycles, options_.branch, outcome_.cycles, branched);
  }

  [[nodiscard]] double RootX() const { return root_ ? q_[0] : 0.0; }
  [[nodiscard]] double RootZ() const { return root_ ? q_[1] : 0.0; }
  [[nodiscard]] double RootPitch() const { return root_ ? q_[2] : 0.0; }
  [[nodiscard]] double RootSpeed() const {
    return root_ ? std::max({std::abs(qd_[0]), std::abs(qd_[1]), std::abs(qd_[2])}) : 0.0;
  }

  /// Plays the node's primitive alone, as it was planned.
  void Plan(int node) {
    planning_ = true;
    SetStart(node);
    Passage passage;
    passage.node = node;
    if (Move(passage)) Hold(passage, kPlanHold);
    planning_ = false;
    outcome_ = {};
    time_ = 0;
  }

  void SetStart(int node) {
    q_.fill(0);
    qd_.fill(0);
    time_ = start_s_ = 0;
    const PrimitivePose& entry = WorldOf(node).file.entry;
    if (root_) {
      q_[0] = entry.root_x_m;
      q_[1] = entry.root_z_m;
      q_[2] = file_.RobotPitch(node, entry.root_pitch_rad);
    }
    start_x_ = RootX();
  }

  bool Fail(ChainFailure::Cause cause, int node, std::string text) {
    outcome_.failure = {cause, node, time_, std::move(text)};
    return false;
  }

  /// Pitch less what a pose of the node's primitive says, to the nearest turn.
  [[nodiscard]] double PitchError(int node, double planned_rad) const {
    return root_ ? NearestTurn(RootPitch() - file_.RobotPitch(node, planned_rad)) : 0.0;
  }

  bool Enter(Passage& passage) {
    const PrimitivePose& entry = WorldOf(passage.node).file.entry;
    passage.entry_z_error_m = root_ ? RootZ() - entry.root_z_m : 0.0;
    passage.entry_pitch_error_rad = PitchError(passage.node, entry.root_pitch_rad);
    passage.entry_speed = RootSpeed();
    const JoinTolerances& t = file_.tolerances;
    if (!(std::abs(passage.entry_z_error_m) <= t.root_z_m)) {
      return Fail(ChainFailure::Cause::kEntry, passage.node,
                  fmt::format("root, height: {} m from the entry; allowed: {} m",
                              MessageText(passage.entry_z_error_m), MessageText(t.root_z_m)));
    }
    if (!(std::abs(passage.entry_pitch_error_rad) <= t.root_pitch_rad)) {
      return Fail(
          ChainFailure::Cause::kEntry, passage.node,
          fmt::format("root, pitch: {} rad from the entry; allowed: {} rad",
                      MessageText(passage.entry_pitch_error_rad), MessageText(t.root_pitch_rad)));
    }
    return true;
  }

  bool Leave(Passage& passage) {
    const PrimitivePose& exit = WorldOf(passage.node).file.exit;
    passage.exit_z_error_m = root_ ? RootZ() - exit.root_z_m : 0.0;
    passage.exit_pitch_error_rad = PitchError(passage.node, exit.root_pitch_rad);
    passage.exit_speed = RootSpeed();
    const double half_turn = std::abs(std::remainder(RootPitch(), kPi));
    passage.posture = half_turn <= kPostureTolerance             ? Posture::kLevel
                      : kPi / 2 - half_turn <= kPostureTolerance ? Posture::kUpright
                                                                 : Posture::kInclined;
    const double tolerance = file_.exit_pitch_tolerance_rad[Index(passage.node)];
    if (std::abs(passage.exit_pitch_error_rad) <= tolerance) return true;
    return Fail(ChainFailure::Cause::kExit, passage.node,
                fmt::format("root, pitch: {} rad from the recorded exit; allowed: {} rad",
                            MessageText(passage.exit_pitch_error_rad), MessageText(tolerance)));
  }

  static std::string MessageText(double value) { return fmt::format("{:.4g}", value); }

  bool Move(Passage& passage) {
    World& world = WorldOf(passage.node);
    const double duration = world.file.primitive.duration_s;
    const int steps = StepsOf(world, duration);
    const double start = time_;
    for (int i = 0; i < steps; ++i) {
      if (!Step(passage, world, duration / steps, (i + 0.0) / steps * duration,
                (i + 0.5) / steps * duration, (i + 1.0) / steps * duration)) {
        return false;
      }
      time_ = start + (i + 1.0) / steps * duration;
    }
    return true;
  }

  bool Hold(Passage& passage, double hold_s) {
    World& world = WorldOf(passage.node);
    passage.hold_s = hold_s;
    const int steps = StepsOf(world, hold_s);
    const double start = time_;
    for (int i = 0; i < steps; ++i) {
      if (!Step(passage, world, hold_s / steps, kHeld, kHeld, kHeld)) return false;
      time_ = start + (i + 1.0) / steps * hold_s;
    }
    return true;
  }

  [[nodiscard]] int StepsOf(const World& world, double duration_s) const {
    const double step = options_.step_s > 0 ? options_.step_s : world.problem.solver.step_s;
    return static_cast<int>(std::ceil(duration_s / step - 1e-9));
  }

  /// Puts the robot's joints where the node's primitive has them at this time of it.
  void Prescribe(int node, const World& world, double t) {
    for (int j = 0; j < world.file.primitive.joint_count; ++j) {
      const std::size_t dof = Index(world.dof_of_joint[Index(j)]);
      const auto& path = world.file.primitive.joints[Index(file_.graph.RoleOf(node, j))].position;
      if (t == kHeld) {
        q_[dof] = path.control_points().back();
        qd_[dof] = qdd_[dof] = 0;
        continue;
      }
      const auto sample = path.Evaluate(t);
      q_[dof] = sample.value;
      qd_[dof] = sample.first;
      qdd_[dof] = sample.second;
    }
  }

  void Accelerations(World& world) {
    std::fill(tau_.begin(), tau_.end(), 0.0);
    world.dynamics.SetState({q_.data(), n_}, {qd_.data(), n_});
    world.contact.Apply(world.dynamics);
    world.dynamics.Solve({qdd_.data(), n_}, {tau_.data(), n_});
  }

  /// One step of the free coordinates, from the time t0 of the node to t1.
  bool Step(Passage& passage, World& world, double h, double t0, double t_mid, double t1) {
    const std::array<double, kStages> times = {t0, t_mid, t_mid, t1};
    const auto begin_q = q_;
    const auto begin_qd = qd_;
    std::array<double, Plane::kMaxDofs> k_q{}, k_qd{}, sum_q{}, sum_qd{};
    for (int s = 0; s < kStages; ++s) {
      for (const std::size_t i : free_) {
        q_[i] = begin_q[i] + h * kA[Index(s)] * k_q[i];
        qd_[i] = begin_qd[i] + h * kA[Index(s)] * k_qd[i];
      }
      Prescribe(passage.node, world, times[Index(s)]);
      Accelerations(world);
      if (s == 0 && !Look(passage, world)) return false;
      for (const std::size_t i : free_) {
        k_q[i] = qd_[i];
        k_qd[i] = qdd_[i];
        sum_q[i] += kB[Index(s)] * k_q[i];
        sum_qd[i] += kB[Index(s)] * k_qd[i];
      }
    }
    bool plausible = true;
    for (const std::size_t i : free_) {
      q_[i] = begin_q[i] + h * sum_q[i];
      qd_[i] = begin_qd[i] + h * sum_qd[i];
      plausible = plausible && std::abs(q_[i]) < kImplausible && std::abs(qd_[i]) < kImplausible;
    }
    return plausible || Fail(ChainFailure::Cause::kImplausible, passage.node,
                             "the state leaves every plausible range");
  }

  /// Takes note of the state at the start of a step.
  bool Look(Passage& passage, World& world) {
    const int node = passage.node;
    if (planning_) {
      world.plan.push_back({time_ - start_s_, RootPitch() - file_.RobotPitch(node, 0)});
      return true;
    }
    const double off = PitchError(node, world.PlannedPitchAt(time_ - start_s_));
    const double allowed = std::max(kFallenPitch, file_.exit_pitch_tolerance_rad[Index(node)]);
    if (std::abs(off) > allowed) {
      return Fail(ChainFailure::Cause::kFallen, node,
                  fmt::format("root, pitch: {} rad from the plan; more than {} rad is a fall",
                              MessageText(off), MessageText(allowed)));
    }
    for (std::size_t j = 0; j < world.dof_of_joint.size(); ++j) {
      const double torque = std::abs(tau_[Index(world.dof_of_joint[j])]);
      passage.peak_torque_nm = std::max(passage.peak_torque_nm, torque);
      passage.torque_margin_nm = std::min(
          passage.torque_margin_nm, world.file.primitive.joints[j].limits.torque_max_nm - torque);
    }
    if (visitor_) {
      sample_.time_s = time_;
      sample_.q.assign(q_.begin(), q_.begin() + static_cast<std::ptrdiff_t>(n_));
      sample_.qd.assign(qd_.begin(), qd_.begin() + static_cast<std::ptrdiff_t>(n_));
      sample_.torque.clear();
      for (const int dof : world.dof_of_joint) sample_.torque.push_back(tau_[Index(dof)]);
      sample_.contacts = world.contact.active();
      sample_.dynamics = &world.dynamics;
      visitor_(node, sample_);
    }
    for (const ActiveContact<Plane>& active : world.contact.active()) {
      passage.peak_penetration_m = std::max(passage.peak_penetration_m, active.depth_m);
      const ContactShape<Plane>& shape = world.problem.robot.shapes[Index(active.shape)];
      const std::string& obstacle = world.problem.obstacles[Index(active.obstacle)].name;
      if (active.depth_m >= world.problem.contact.d_on_m) {
        return Fail(ChainFailure::Cause::kCore, node,
                    fmt::format("{} is {} mm deep in {}, through the layer of {} mm", shape.name,
                                MessageText(1e3 * active.depth_m), obstacle,
                                MessageText(1e3 * world.problem.contact.d_on_m)));
      }
      if (world.touching_bodies.count(RoleOfBody(node, world, shape.body)) == 0) {
        return Fail(
            ChainFailure::Cause::kTouch, node,
            fmt::format("{} touches {}, which it never does in the plan", shape.name, obstacle));
      }
    }
    return true;
  }

  /// The body whose part a body of the robot plays in this node.
  [[nodiscard]] int RoleOfBody(int node, const World& world, int body) const {
    const auto& dofs = world.dof_of_joint;
    const auto joint = std::find(dofs.begin(), dofs.end(), body);
    if (joint == dofs.end()) return body;
    return dofs[Index(file_.graph.RoleOf(node, static_cast<int>(joint - dofs.begin())))];
  }

  static constexpr double kHeld = -1;  // instead of a time: after the motion

  const SequenceFile& file_;
  const ChainOptions& options_;
  const std::function<void(int, const MotionSample&)>& visitor_;
  std::vector<std::unique_ptr<World>> worlds_;  // by primitive
  std::size_t n_ = 0;
  std::vector<std::size_t> free_;
  bool root_ = false;
  std::array<double, Plane::kMaxDofs> q_{}, qd_{}, qdd_{}, tau_{};
  double time_ = 0;
  double start_s_ = 0;     // of the node
  bool planning_ = false;  // playing a primitive alone
  double start_x_ = 0;
  MotionSample sample_;
  ChainOutcome outcome_;
};

}  // namespace

const char* ToString(Posture posture) {
  switch (posture) {
    case Posture::kUpright:
      return "upright";
    case Posture::kLevel:
      return "level";
    case Posture::kInclined:
      return "inclined";
  }
  return "unknown";
}

const char* ToString(ChainFailure::Cause cause) {
  switch (cause) {
    case ChainFailure::Cause::kImplausible:
      return "implausible";
    case ChainFailure::Cause::kCore:
      return "core";
    case ChainFailure::Cause::kTouch:
      return "touch";
    case ChainFailure::Cause::kFallen:
      return "fallen";
    case ChainFailure::Cause::kExit:
      return "exit";
    case ChainFailure::Cause::kEntry:
      return "entry";
  }
  return "unknown";
}

void RequireSameGround(const SequenceFile& file) {
  const Problem first = TaskOf(file.primitives.front()).problem;
  for (std::size_t i = 1; i < file.primitives.size(); ++i) {
    if (SameGround(first, TaskOf(file.primitives[i]).problem)) continue;
    throw FileError(file.path, 0, fmt::format("primitives.{}", file.primitive_names[i]),
                    fmt::format("was made for other [contact] or [[obstacle]] than '{}'; give both "
                                "tasks the same and make it again",
                                file.primitive_names.front()));
  }
}

ChainOutcome SimulateChain(const SequenceFile& file, const ChainOptions& options,
                           const std::function<void(int, const MotionSample&)>& visitor) {
  RequireSameGround(file);
  if (!options.branch.empty() && !file.graph.HasBranch(options.branch)) {
    const std::vector<std::string> names = BranchNames(file.graph);
    throw std::invalid_argument(fmt::format(
        "the sequence '{}' has no branch '{}'; its branches: {}", file.graph.name.view(),
        options.branch, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  return Simulation(file, options, visitor).Run();
}

ReportData MakeChainReport(const SequenceFile& file, const ChainOptions& options) {
  const Problem problem = TaskOf(file.primitives.front()).problem;
  const ChainOutcome outcome = SimulateChain(file, options);
  ReportData data = ReportScene(problem);
  data.title = file.graph.name.view();
  data.subtitle = fmt::format("{} passages, {} cycles", outcome.passages.size(), outcome.cycles);
  data.duration_s = outcome.duration_s;
  const double spacing = std::max(1 / kSamplesPerSecond, outcome.duration_s / kMaxSamples);
  double next = 0;
  SimulateChain(file, options, [&](int, const MotionSample& sample) {
    if (sample.time_s < next - 1e-9) return;
    next += spacing;
    data.samples.push_back(ShownSample(problem, sample));
  });
  data.certificate.emplace_back(
      "chain", outcome.failure ? fmt::format("{} at {:.2f} s: {}", ToString(outcome.failure->cause),
                                             outcome.failure->time_s, outcome.failure->text)
                               : "no fall");
  data.certificate.emplace_back("travelled", fmt::format("{:.3f} m", outcome.travelled_m));
  for (const Passage& p : outcome.passages) {
    data.certificate.emplace_back(
        fmt::format("{} at {:.2f} s", file.graph.node(p.node).name.view(), p.start_s),
        fmt::format("{}, pitch off by {:.1e} rad, peak torque {:.2f} N m, penetration {:.2f} mm",
                    ToString(p.posture), p.exit_pitch_error_rad, p.peak_torque_nm,
                    1e3 * p.peak_penetration_m));
  }
  return data;
}

}  // namespace tumbler
