#include "offline/problem/start_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/files/file_keys.h"
#include "offline/problem/bounds_toml.h"
#include "offline/problem/joint_units.h"
#include "offline/problem/task_keys.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/buried_shape.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {
namespace {

/// How far from rest the pitch of a robot on a bar may be asked for [rad].
constexpr double kStartPitchOnBar = 0.5;

/// Checks that a joint begins as fast as the motion before leaves it.
void CheckGivenVelocity(TomlTable& start, const StartPose& given, const ActuatedJoint& joint,
                        const char* unit, const JointMotion<double>& motion) {
  const bool ends_moving =
      std::ranges::any_of(given.primitive->motions(), [](const JointMotion<double>& other) {
        return std::abs(other.position.control_points(1).back()) > kStartJointTolerance;
      });
  // After a motion that ends at rest the joints are held.
  const double velocity = ends_moving ? motion.position.control_points(1).back() : 0;
  const double apart = std::abs(velocity - joint.start_rad_s);
  if (apart <= kStartJointTolerance) return;
  start.Fail(
      "joints_rad_s",
      fmt::format("has '{0}' at {1} {6}, but {2} has it at {3} {6}: {4} {6} apart; allowed: <= "
                  "{5} {6}",
                  motion.name.view(), MessageNumber(joint.start_rad_s), given.from,
                  MessageNumber(velocity), MessageNumber(apart),
                  MessageNumber(kStartJointTolerance), unit));
}

class StartReader {
 public:
  StartReader(TomlTable& root, const std::optional<StartPose>& given,
              std::span<const double> passive_start, Problem& problem)
      : root_(root),
        given_(given),
        passive_start_(passive_start.begin(), passive_start.end()),
        problem_(problem) {}

  void Read(TomlTable& start) {
    const std::size_t n = scene_.robot.tree.dofs.size();
    problem_.start_q.assign(n, 0.0);
    for (const ActuatedJoint& joint : problem_.joints) {
      problem_.start_q[static_cast<std::size_t>(joint.dof)] = joint.start_rad;
    }
    if (given_) {
      TakeGivenPassive(start);
      CheckGivenJoints(start, *given_, problem_);
    }
    for (std::size_t i = 0; i < passive_start_.size(); ++i)
      problem_.start_q[Index(scene_.robot.passive[i].dof)] = passive_start_[i];
    if (scene_.robot.root_dofs == 0) {
      CheckNotBuried(start, "joints_rad", "", "");
      return;
    }
    TaskStart root;
    ReadKeys(start, kTaskStartKeys, root);
    ReadRates(start, root);
    root_.RejectUnknownKeys();  // A misspelt key is often the reason why the pose does not rest.
    if (scene_.robot.hinged()) scene_.bar = {root.x_m, root.z_m.value_or(0)};
    if (given_) {
      TakeGivenRoot(start, root);
    } else {
      Place(start, root);
    }
  }

 private:
  void ReadRates(TomlTable& start, TaskStart& root) {
    const bool given_motion = given_ && !given_->own;
    for (const FileKey<TaskStart>& key : kTaskStartRateKeys) {
      const std::string_view name = key.text.name;
      if (!start.Has(name)) continue;
      if (given_motion)
        start.Fail(name, fmt::format("is that of {} here; leave it out", given_->from));
      if (scene_.robot.hinged() && !name.starts_with("pitch"))
        start.Fail(name, "moves what the bar holds; leave it out");
    }
    ReadKeys(start, kTaskStartRateKeys, root);
    problem_.start_root_rates = {root.x_m_s, root.z_m_s, root.pitch_rad_s};
    problem_.free_start_rates = {
        CheckedBounds(start, {"velocity", "m/s", "x_min_m_s", "x_max_m_s", "x_m_s"}, root.x_min_m_s,
                      root.x_max_m_s, root.x_m_s),
        CheckedBounds(start, {"velocity", "m/s", "z_min_m_s", "z_max_m_s", "z_m_s"}, root.z_min_m_s,
                      root.z_max_m_s, root.z_m_s),
        CheckedBounds(start,
                      {"velocity", "rad/s", "pitch_min_rad_s", "pitch_max_rad_s", "pitch_rad_s"},
                      root.pitch_min_rad_s, root.pitch_max_rad_s, root.pitch_rad_s)};
  }

  void TakeGivenRoot(TomlTable& start, const TaskStart& root) {
    const PrimitivePose& pose = *given_->pose;
    if (const double apart = std::abs(pose.root_pitch_rad - root.pitch_rad);
        !given_->own && !(apart <= kStartPitchTolerance)) {
      start.Fail("pitch_rad", fmt::format("is {} rad, but {} has the root's pitch at {} rad: {} "
                                          "rad apart; allowed: <= {} rad",
                                          MessageNumber(root.pitch_rad), given_->from,
                                          MessageNumber(pose.root_pitch_rad), MessageNumber(apart),
                                          kStartPitchTolerance));
    }
    CheckGivenBar(start);
    problem_.start_q[0] = pose.root_x_m;
    problem_.start_q[1] = pose.root_z_m;
    problem_.start_q[kPitchOfRoot] = pose.root_pitch_rad;
    problem_.start_root_rates = {pose.root_x_m_s, pose.root_z_m_s, pose.root_pitch_rad_s};
  }

  /// Puts the robot where the task says, or on the ground.
  void Place(TomlTable& start, const TaskStart& root) {
    problem_.start_q[0] = root.x_m;
    problem_.start_q[1] = root.z_m.value_or(0);
    problem_.start_q[kPitchOfRoot] = root.pitch_rad;
    if (scene_.robot.hinged()) {
      HangAtRest(start);
      CheckNotBuried(start, "z_m", fmt::format("is {}: ", MessageNumber(scene_.bar.y())), "");
      return;
    }
    if (root.z_m) {
      CheckNotBuried(start, "z_m", fmt::format("is {}: ", MessageNumber(*root.z_m)),
                     "; without z_m the robot is put on the ground");
      return;
    }
    std::optional<double> touching_m;
    try {
      touching_m = TouchingHeight(scene_, problem_.start_q);
      problem_.start_q = RestPose(scene_, problem_.start_q);
    } catch (const std::runtime_error& error) {
      if (touching_m) CheckFirmGround(start, *touching_m);
      start.Fail("", fmt::format("{}; change the joints or the pitch, or give z_m to start from a "
                                 "pose that is not at rest",
                                 error.what()));
    }
    CheckNotBuried(start, "", "at rest on ground as soft as [contact] says: ",
                   "; give contact.stiffness_n_per_m a larger value");
  }

  /// Checks that the ground can carry the robot in its pose, as deep in it as the compliant layer
  /// is thick.
  void CheckFirmGround(TomlTable& start, double touching_m) const {
    double mass_kg = 0;
    for (const Dof<Plane>& dof : scene_.robot.tree.dofs) mass_kg += dof.mass_kg;
    const double weight_n = mass_kg * scene_.robot.tree.gravity.norm();
    SceneDynamics robot(scene_);
    std::copy(problem_.start_q.begin(), problem_.start_q.end(), robot.q.begin());
    robot.q[1] = touching_m - scene_.contact.d_on_m;
    robot.Touch();
    double carried_n = 0;
    for (const ActiveContact<Plane>& active : robot.contact->active())
      carried_n += scene_.contact.stiffness_n_per_m * active.depth_m;
    if (carried_n == 0 || weight_n <= carried_n) return;
    start.Fail("", fmt::format("the robot weighs {:.4g} N, and ground as soft as [contact] says "
                               "carries up to {:.4g} N in this pose, d_on_m deep; give "
                               "contact.stiffness_n_per_m a larger value",
                               weight_n, carried_n));
  }

  /// Puts a robot on its bar at rest: with its centre of mass straight below or above the bar.
  void HangAtRest(TomlTable& start) {
    const double asked = problem_.start_q[kPitchOfRoot];
    problem_.start_q[kPitchOfRoot] = RestingPitch(scene_, problem_.start_q);
    const double apart = std::abs(problem_.start_q[kPitchOfRoot] - asked);
    if (apart <= kStartPitchOnBar) return;
    start.Fail("pitch_rad",
               fmt::format("is {} rad, where the robot does not stay: with these "
                           "joints it is at rest at {:.4g} rad, and half turns from "
                           "there; allowed: <= {} rad from one of these",
                           MessageNumber(asked), problem_.start_q[kPitchOfRoot], kStartPitchOnBar));
  }

  /// Checks that the given pose hangs from the task's bar.
  void CheckGivenBar(TomlTable& start) {
    if (!scene_.robot.hinged()) return;
    const PrimitivePose& pose = *given_->pose;
    const double apart =
        portable::Length(pose.root_x_m - scene_.bar.x(), pose.root_z_m - scene_.bar.y());
    if (apart <= 1e-9) return;
    start.Fail(
        "", fmt::format("has the bar at x {} m, z {} m, but {} has it at x {} m, z {} m; "
                        "give both the same",
                        MessageNumber(scene_.bar.x()), MessageNumber(scene_.bar.y()), given_->from,
                        MessageNumber(pose.root_x_m), MessageNumber(pose.root_z_m)));
  }

  /// Checks that no shape starts deeper in an obstacle than the compliant layer is thick.
  /// @param key, said, remedy  the key that puts the robot there, what it says, and what else might
  ///                           help.
  void CheckNotBuried(TomlTable& start, const char* key, const std::string& said,
                      const char* remedy) {
    const std::optional<BuriedShape> buried = FindBuried<Plane>(scene_, problem_.start_q);
    if (!buried) return;
    start.Fail(
        key,
        fmt::format("{}there collision shape {} is {} m inside '{}'; allowed: where none is "
                    "inside an obstacle{}",
                    said, buried->shape, MessageNumber(buried->by_m), buried->obstacle, remedy));
  }

  /// Passive joints start where the given pose has them.
  void TakeGivenPassive(TomlTable& start) {
    if (given_->pose->passive_positions_rad.size() != passive_start_.size()) {
      start.Fail("", fmt::format("has {} joints without a motor, but {} has {}; give both the same "
                                 "[passive]",
                                 passive_start_.size(), given_->from,
                                 given_->pose->passive_positions_rad.size()));
    }
    passive_start_ = given_->pose->passive_positions_rad;
  }

  TomlTable& root_;
  const std::optional<StartPose>& given_;
  std::vector<double> passive_start_;  // of each passive joint
  Problem& problem_;
  Scene& scene_ = problem_.scene;
};

}  // namespace

void CheckGivenJoints(TomlTable& start, const StartPose& given, const Problem& problem) {
  TomlTable joints = start.Table("joints_rad");
  const std::span<const JointMotion<double>> motions = given.primitive->motions();
  for (const ActuatedJoint& joint : problem.joints) {
    const std::string& name = problem.name_of(joint);
    const JointUnits units = UnitsOf(problem, joint);
    const auto motion = std::find_if(motions.begin(), motions.end(),
                                     [&](const auto& m) { return m.name.view() == name; });
    if (motion == motions.end())
      joints.Fail(name, fmt::format("is a joint of the task, but {} has none of it", given.from));
    const double position =
        given.pose->joint_positions_rad[static_cast<std::size_t>(motion - motions.begin())];
    const double apart = std::abs(position - joint.start_rad);
    if (!given.own) CheckGivenVelocity(start, given, joint, units.velocity, *motion);
    if (apart <= kStartJointTolerance) continue;
    joints.Fail(
        name,
        fmt::format("is {0} {5}, but {1} has it at {2} {5}: {3} {5} apart; allowed: <= "
                    "{4} {5}",
                    MessageNumber(joint.start_rad), given.from, MessageNumber(position),
                    MessageNumber(apart), MessageNumber(kStartJointTolerance), units.position));
  }
}

std::vector<double> ReadPassiveStart(TomlTable& root, const Scene& scene) {
  std::vector<double> passive;
  TomlTable start = root.Table("start").Table("joints_rad");
  TomlTable end = root.Table("end").Table("joints_rad");
  for (const PassiveJoint& joint : scene.robot.passive) {
    const std::string& name = scene.robot.tree.dofs[Index(joint.dof)].name;
    if (end.Has(name))
      end.Fail(name, "has no motor that could bring it there; leave it out, or out of [passive]");
    const RobotJointLimits& urdf = scene.robot.limits[Index(joint.dof)];
    const Range range{std::max(urdf.lower_rad, -100.0), std::min(urdf.upper_rad, 100.0)};
    if (!start.Has(name) && (joint.rest_rad < range.min || joint.rest_rad > range.max)) {
      root.Table("passive").Table(name).Fail(
          "rest_rad", fmt::format("is {}, where the joint starts as start.joints_rad does not "
                                  "name it; allowed: its limits, {} ... {}, or give its start",
                                  MessageNumber(joint.rest_rad), MessageNumber(range.min),
                                  MessageNumber(range.max)));
    }
    passive.push_back(start.Has(name) ? start.Number(name, range) : joint.rest_rad);
  }
  return passive;
}

void ReadStart(TomlTable& root, TomlTable& start, const std::optional<StartPose>& given,
               std::span<const double> passive_start, Problem& problem) {
  StartReader(root, given, passive_start, problem).Read(start);
}

}  // namespace tumbler
