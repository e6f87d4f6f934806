#include "offline/rehearsal/twin/twin_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/toml_reader.h"
#include "offline/problem/obstacle_toml.h"
#include "offline/scene/rest_pose.h"

namespace tumbler {
namespace {

constexpr int kTwinVersion = 1;
constexpr Range kPlace{-1e3, 1e3};

void CheckKind(TomlTable& root) {
  const std::string format = root.String("format");
  if (format != "tumbler-twin")
    root.Fail("format", fmt::format("is '{}'; allowed: 'tumbler-twin'", format));
  root.Integer("version", kTwinVersion, kTwinVersion);
}

std::string Join(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

class TwinReader {
 public:
  TwinReader(TomlTable root, const SimulatedMotion& motion)
      : root_(std::move(root)), motion_(motion.file()), scene_(motion.scene()) {
    const Primitive<double>& first = motion_.PrimitiveOf(motion_.graph.start).primitive;
    for (const JointMotion<double>& joint : first.motions())
      joints_.emplace_back(joint.name.view());
    for (std::size_t i = 0; i < scene_.robot.body_names.size(); ++i) {
      if (!scene_.robot.tree.dofs[i].massless) links_.push_back(scene_.robot.body_names[i]);
    }
    for (const Obstacle<Plane>& obstacle : scene_.obstacles) obstacles_.push_back(obstacle.name);
  }

  SimulatedRobotConfig Read() {
    CheckKind(root_);
    static_cast<void>(root_.String("motion", ""));
    static_cast<void>(root_.String("drives", ""));
    TwinConfig& twin = config_.twin;
    twin.step_ns = std::llround(
        1e9 * root_.Number("step_s", {1e-6, 1e-3}, 1e-9 * static_cast<double>(twin.step_ns)));
    ReadMotors();
    ReadLinks();
    ReadContact();
    ReadObstacles();
    ReadPatches();
    ReadPushes();
    if (std::optional<TomlTable> stop = root_.OptionalTable("stop")) {
      double& k = twin.stop_stiffness_nm_per_rad;
      double& c = twin.stop_damping_nm_s_per_rad;
      k = stop->Number("stiffness_nm_per_rad", {0, 1e4}, k);
      c = stop->Number("damping_nm_s_per_rad", {0, 50}, c);
    }
    if (std::optional<TomlTable> fall = root_.OptionalTable("fall")) {
      config_.posture.rest_s = fall->Number("rest_s", {0.01, 10}, config_.posture.rest_s);
      if (fall->Has("clear_links")) {
        config_.posture.clear_links = fall->Strings("clear_links");
        for (const std::string& link : config_.posture.clear_links)
          RequireOneOf(*fall, "clear_links", link, "link", links_);
      }
    }
    // Last, since it may let the robot come to rest on all of the above.
    std::optional<TomlTable> start = root_.OptionalTable("start");
    if (start) {
      twin.held = start->Boolean("held", twin.held);
      TakeStartKeys(*start);
    }
    root_.RejectUnknownKeys();
    if (start) ReadStart(*start);
    return std::move(config_);
  }

 private:
  static void RequireOneOf(const TomlTable& table, std::string_view key, const std::string& name,
                           const char* what, const std::vector<std::string>& names) {
    if (std::find(names.begin(), names.end(), name) != names.end()) return;
    table.Fail(key, fmt::format("'{}' is not a {} here; allowed: {}", name, what, Join(names)));
  }

  void ReadMotor(TomlTable& table, JointMotor& motor, JointLosses& losses) {
    if (table.Has("torque_max_nm"))
      motor.torque_max_nm = table.Number("torque_max_nm", {1e-3, 1e4});
    if (table.Has("base_speed_rad_s"))
      motor.base_speed_rad_s = table.Number("base_speed_rad_s", {0, 1e4, true});
    if (table.Has("no_load_speed_rad_s"))
      motor.no_load_speed_rad_s = table.Number("no_load_speed_rad_s", {0, 1e4, true});
    motor.encoder_counts_per_turn = static_cast<int>(
        table.Integer("encoder_counts_per_turn", 0, 1 << 26, motor.encoder_counts_per_turn));
    motor.answer_delay_s = table.Number("answer_delay_s", {0, 0.1}, motor.answer_delay_s);
    motor.torque_time_constant_s =
        table.Number("torque_time_constant_s", {0, 0.1}, motor.torque_time_constant_s);
    motor.ambient_c = table.Number("ambient_c", {-50, 150}, motor.ambient_c);
    motor.heating_k_per_nm2 = table.Number("heating_k_per_nm2", {0, 1e4}, motor.heating_k_per_nm2);
    motor.thermal_time_constant_s =
        table.Number("thermal_time_constant_s", {0.1, 1e5}, motor.thermal_time_constant_s);
    if (table.Has("rotor_inertia_kg_m2"))
      losses.rotor_inertia_kg_m2 = table.Number("rotor_inertia_kg_m2", {0, 10});
    losses.viscous_friction_nm_s_per_rad = table.Number("viscous_friction_nm_s_per_rad", {0, 10},
                                                        losses.viscous_friction_nm_s_per_rad);
    losses.dry_friction_nm = table.Number("dry_friction_nm", {0, 5}, losses.dry_friction_nm);
  }

  void ReadMotors() {
    std::vector<JointMotor>& motors = config_.motors;
    std::vector<JointLosses>& losses = config_.twin.joints;
    motors.resize(joints_.size());
    losses.resize(joints_.size());
    std::optional<TomlTable> all = root_.OptionalTable("motor");
    if (!all) return;
    for (const std::string& key : all->Keys()) {
      if (all->IsTable(key)) RequireOneOf(*all, key, key, "joint", joints_);
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      ReadMotor(*all, motors[j], losses[j]);
      std::optional<TomlTable> own = all->OptionalTable(joints_[j]);
      if (own) ReadMotor(*own, motors[j], losses[j]);
      const JointMotor& motor = motors[j];
      if (std::isfinite(motor.base_speed_rad_s) != std::isfinite(motor.no_load_speed_rad_s) ||
          (std::isfinite(motor.base_speed_rad_s) &&
           !(motor.no_load_speed_rad_s > motor.base_speed_rad_s))) {
        const TomlTable& table = own ? *own : *all;
        const char* const key =
            table.Has("no_load_speed_rad_s") ? "no_load_speed_rad_s" : "base_speed_rad_s";
        table.Fail(key,
                   fmt::format("gives joint {} a base speed of {} and a no-load speed of {} rad/s; "
                               "allowed: both or neither, the second above the first",
                               joints_[j], motor.base_speed_rad_s, motor.no_load_speed_rad_s));
      }
    }
  }

  void ReadLinks() {
    std::optional<TomlTable> factors = root_.OptionalTable("mass_factor");
    if (!factors) return;
    for (const std::string& link : factors->Keys()) {
      RequireOneOf(*factors, link, link, "link", links_);
      config_.twin.mass_factor.emplace_back(link, factors->Number(link, {0.1, 10}));
    }
  }

  void ReadContact() {
    std::optional<TomlTable> table = root_.OptionalTable("contact");
    if (!table) return;
    ContactLaw law = scene_.contact;
    law.stiffness_n_per_m =
        table->Number("stiffness_n_per_m", {0, 1e8, true}, law.stiffness_n_per_m);
    law.damping_n_s_per_m = table->Number("damping_n_s_per_m", {0, 1e6}, law.damping_n_s_per_m);
    law.mu = table->Number("mu", {0, 10}, law.mu);
    law.v_max_m_per_s = table->Number("v_max_m_per_s", {1e-6, 1e3}, law.v_max_m_per_s);
    scene_.contact = law;
    config_.twin.contact = law;
  }

  void ReadObstacles() {
    for (TomlTable& table : root_.OptionalTables("obstacle")) {
      const Obstacle<Plane> obstacle = ReadObstacle(table);
      if (std::find(obstacles_.begin(), obstacles_.end(), obstacle.name) != obstacles_.end()) {
        table.Fail("name", fmt::format("'{}' is there already; allowed: a name besides {}",
                                       obstacle.name, Join(obstacles_)));
      }
      if (table.Has("mu")) {
        FrictionPatch patch;
        patch.obstacle = obstacle.name;
        patch.mu = table.Number("mu", {0, 10});
        config_.twin.patches.push_back(patch);
      }
      obstacles_.push_back(obstacle.name);
      scene_.obstacles.push_back(obstacle);
      config_.twin.obstacles.push_back(obstacle);
    }
  }

  void ReadPatches() {
    for (TomlTable& table : root_.OptionalTables("patch")) {
      FrictionPatch patch;
      patch.obstacle = table.String("obstacle");
      RequireOneOf(table, "obstacle", patch.obstacle, "obstacle", obstacles_);
      patch.mu = table.Number("mu", {0, 10});
      patch.from_x_m = table.Number("from_x_m", kPlace);
      patch.to_x_m = table.Number("to_x_m", {patch.from_x_m, kPlace.max, true});
      config_.twin.patches.push_back(patch);
    }
  }

  void ReadPushes() {
    constexpr std::array<std::string_view, 2> kSince = {"start", "enabled"};
    for (TomlTable& table : root_.OptionalTables("push")) {
      Push push;
      push.link = table.String("link");
      RequireOneOf(table, "link", push.link, "link", links_);
      push.start_s = table.Number("start_s", {0, 1e6});
      push.since_enabled = table.Choice("since", kSince, "enabled") == "enabled";
      push.duration_s = table.Number("duration_s", {0, 1e6, true});
      const std::vector<double> force = table.Numbers("force_n", {-1e4, 1e4}, 2);
      push.force_n = {force[0], force[1]};
      if (table.Has("point_m")) {
        const std::vector<double> point = table.Numbers("point_m", kPlace, 2);
        push.point_m = {point[0], point[1]};
      }
      config_.twin.pushes.push_back(push);
    }
  }

  /// So that an unknown key is named before the robot is put anywhere.
  void TakeStartKeys(TomlTable& start) {
    pose_ = StartOf(motion_);
    pose_.root_x_m = start.Number("x_m", kPlace, pose_.root_x_m);
    pose_.root_pitch_rad = start.Number("pitch_rad", kPlace, pose_.root_pitch_rad);
    placed_ = start.Has("z_m");
    pose_.root_z_m = start.Number("z_m", kPlace, pose_.root_z_m);
    if (std::optional<TomlTable> joints = start.OptionalTable("joints_rad")) {
      for (const std::string& name : joints->Keys())
        RequireOneOf(*joints, name, name, "joint", joints_);
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        pose_.joint_positions_rad[j] =
            joints->Number(joints_[j], {-100, 100}, pose_.joint_positions_rad[j]);
      }
    }
    moved_ = start.Has("pitch_rad") || start.Has("joints_rad");
  }

  /// Without a height, a robot that does not start in the motion's own pose is lowered until it
  /// rests.
  void ReadStart(TomlTable& start) {
    if (scene_.robot.root_dofs == 3 && moved_ && !placed_) {
      try {
        pose_ = PoseAt(RestPose(scene_, PositionsIn(pose_, scene_.robot)), scene_.robot);
      } catch (const std::runtime_error& error) {
        start.Fail("",
                   fmt::format("{}; change the joints or the pitch, or give z_m", error.what()));
      }
    }
    config_.start = pose_;
  }

  TomlTable root_;
  const SequenceFile& motion_;
  Scene scene_;  // as it becomes
  std::vector<std::string> joints_, links_, obstacles_;
  PrimitivePose pose_;
  bool placed_ = false;
  bool moved_ = false;
  SimulatedRobotConfig config_;
};

}  // namespace

TwinSources ReadTwinSources(const std::string& path) {
  TomlTable root = TomlTable::ParseFile(path);
  CheckKind(root);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  const auto file = [&](const char* key) {
    const std::string name = root.String(key, "");
    return name.empty() ? name : (folder / name).string();
  };
  return {file("motion"), file("drives")};
}

SimulatedRobotConfig LoadTwin(const std::string& path, const SimulatedMotion& motion) {
  return TwinReader(TomlTable::ParseFile(path), motion).Read();
}

SimulatedRobotConfig ParseTwin(std::string_view text, const std::string& name,
                               const SimulatedMotion& motion) {
  return TwinReader(TomlTable::Parse(text, name), motion).Read();
}

}  // namespace tumbler
