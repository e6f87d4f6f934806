#include "offline/twin/twin_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/files/file_keys.h"
#include "offline/problem/contact_toml.h"
#include "offline/problem/motor_toml.h"
#include "offline/problem/obstacle_toml.h"
#include "offline/problem/space_task.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/buried_shape.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/rest_pose.h"
#include "offline/twin/twin_keys.h"

namespace tumbler {
namespace {

/// The files that a twin file names, as it names them.
TwinSources SourcesIn(TomlTable& root) {
  TwinSources files;
  ReadKeys(root, kTwinFileKeys, files);
  for (const auto& key : kTwinFileKeys) {
    const std::string_view name = key.text.name;
    if (root.Has(name) && root.String(name).empty())
      root.Fail(name, "is ''; allowed: a file's name; leave the key out where there is none");
  }
  return files;
}

class TwinReader {
 public:
  /// @param folder  with which the paths in the file begin.
  TwinReader(TomlTable root, const SimulatedMotion& motion, std::filesystem::path folder)
      : root_(std::move(root)),
        motion_(motion.file()),
        scene_(motion.scene()),
        folder_(std::move(folder)) {
    if (motion.problem().space) space_ = motion.problem().space->scene;
    const Primitive<double>& first = motion_.PrimitiveOf(motion_.graph.start).primitive;
    for (const JointMotion<double>& joint : first.motions())
      joints_.emplace_back(joint.name.view());
    const auto take_names = [this](const auto& scene) {
      for (std::size_t i = 0; i < scene.robot.body_names.size(); ++i) {
        if (!scene.robot.tree.dofs[i].massless) links_.push_back(scene.robot.body_names[i]);
      }
      for (const auto& obstacle : scene.obstacles) obstacles_.push_back(obstacle.name);
    };
    space_ ? take_names(*space_) : take_names(scene_);
  }

  SimulatedRobotConfig Read() {
    ReadHeader(root_, kTwinHeader);
    const TwinSources files = SourcesIn(root_);
    if (!files.robot.empty()) TakeRobot((folder_ / files.robot).string());
    TwinConfig& twin = config_.twin;
    ReadKeys(root_, kTwinStepKeys, twin);
    ReadMotors();
    ReadLinks();
    ReadContact();
    ReadObstacles();
    ReadPatches();
    ReadPushes();
    ReadSensor();
    if (std::optional<TomlTable> stop = root_.OptionalTable("stop"))
      ReadKeys(*stop, kStopKeys, twin);
    if (std::optional<TomlTable> fall = root_.OptionalTable("fall")) {
      ReadKeys(*fall, kFallKeys, config_.posture);
      for (const std::string& link : config_.posture.clear_links)
        RequireOneOf(*fall, "clear_links", link, "link", links_);
    }
    // The start comes last, since it may let the robot come to rest on everything read before.
    std::optional<TomlTable> start = root_.OptionalTable("start");
    if (start) space_ ? TakeStartKeysInSpace(*start) : TakeStartKeys(*start);
    root_.RejectUnknownKeys();
    if (start) space_ ? ReadStartInSpace(*start) : ReadStart(*start);
    CheckNotBuried();
    return std::move(config_);
  }

 private:
  /// Another robot of the same links and joints in the place of the motion's, on its ground.
  void TakeRobot(const std::string& path) {
    const Provenance& from = motion_.PrimitiveOf(motion_.graph.start).provenance;
    std::string text;
    try {
      text = ReadTextFile(path);
    } catch (const FileError& error) {
      root_.Fail("robot", error.what());
    }
    Problem problem =
        ParseTask(from.task_toml, from.task_file, text, path, TaskSpaces::kPlaneAndSpace).problem;
    const auto names = [](const Scene& scene, const std::optional<SpaceScene>& space) {
      return space ? space->robot.body_names : scene.robot.body_names;
    };
    const std::vector<std::string> nominal = names(scene_, space_);
    if (problem.space) {
      space_ = config_.space_scene = std::move(problem.space->scene);
    } else {
      config_.scene = scene_ = std::move(problem.scene);
    }
    if (const std::vector<std::string> own = names(scene_, space_); own != nominal) {
      root_.Fail("robot", fmt::format("is a robot of the links {}; allowed: one of those of the "
                                      "motion's, {}",
                                      Join(own), Join(nominal)));
    }
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
      MotorEntry motor;
      ReadKeys(*all, kMotorKeys, motor);
      std::optional<TomlTable> own = all->OptionalTable(joints_[j]);
      if (own) ReadKeys(*own, kMotorKeys, motor);
      motors[j] = motor;
      losses[j] = motor;
      constexpr double kNone = std::numeric_limits<double>::infinity();
      CheckTorqueSpeedCurve(own ? *own : *all, joints_[j], motor.base_speed_rad_s.value_or(kNone),
                            motor.no_load_speed_rad_s.value_or(kNone));
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
    ContactLaw& law = space_ ? space_->contact : scene_.contact;
    ReadContactForces(*table, law);
    config_.twin.contact = law;
  }

  void ReadObstacles() {
    for (TomlTable& table : root_.OptionalTables("obstacle")) {
      std::string name;
      if (space_) {
        const Obstacle<Spatial> obstacle = ReadSpaceObstacle(table);
        name = obstacle.name;
        space_->obstacles.push_back(obstacle);
        config_.twin.obstacles_in_space.push_back(obstacle);
      } else {
        const Obstacle<Plane> obstacle = ReadObstacle(table);
        name = obstacle.name;
        scene_.obstacles.push_back(obstacle);
        config_.twin.obstacles.push_back(obstacle);
      }
      if (std::find(obstacles_.begin(), obstacles_.end(), name) != obstacles_.end()) {
        table.Fail("name", fmt::format("'{}' is there already; allowed: a name besides {}", name,
                                       Join(obstacles_)));
      }
      TwinObstacle own;
      ReadKeys(table, kTwinObstacleKeys, own);
      if (own.mu) config_.twin.patches.push_back({name, *own.mu});
      obstacles_.push_back(name);
    }
  }

  void ReadPatches() {
    for (TomlTable& table : root_.OptionalTables("patch")) {
      PatchEntry patch;
      patch.obstacles = &obstacles_;
      ReadKeys(table, kPatchKeys, patch);
      config_.twin.patches.push_back(patch);
    }
  }

  void ReadPushes() {
    for (TomlTable& table : root_.OptionalTables("push")) {
      PushEntry push;
      push.links = &links_;
      ReadKeys(table, kPushKeys, push);
      if (space_) {
        ReadKeys(table, kSpacePushKeys, push);
      } else {
        ReadKeys(table, kPlanePushKeys, push);
        push.force_n = {push.force_in_plane_n[0], 0, push.force_in_plane_n[1]};
        push.point_m = {push.point_in_plane_m[0], 0, push.point_in_plane_m[1]};
      }
      config_.twin.pushes.push_back(push);
    }
  }

  void ReadSensor() {
    for (const char* const key : {"sensor", "sensor_failure"}) {
      if (space_ && root_.Has(key))
        root_.Fail(key, "is for robots in the plane so far; leave it out for one in space");
    }
    if (std::optional<TomlTable> sensor = root_.OptionalTable("sensor"))
      ReadKeys(*sensor, kTwinSensorKeys, config_.sensor);
    for (TomlTable& table : root_.OptionalTables("sensor_failure")) {
      SensorFailureEntry failure;
      ReadKeys(table, kSensorFailureKeys, failure);
      config_.sensor.failures.push_back(failure);
    }
  }

  /// Reads the keys of the start before the robot is put there, so that unknown keys are refused
  /// first.
  void TakeStartKeys(TomlTable& start) {
    pose_ = StartOf(motion_);
    TwinStart root{config_.twin.held, config_.twin.stand_m, pose_.root_x_m, pose_.root_pitch_rad,
                   std::nullopt};
    ReadKeys(start, kTwinStartKeys, root);
    config_.twin.held = root.held;
    config_.twin.stand_m = root.stand_m;
    pose_.root_x_m = root.x_m;
    pose_.root_pitch_rad = root.pitch_rad;
    pose_.root_z_m = root.z_m.value_or(pose_.root_z_m);
    placed_ = root.z_m.has_value();
    if (scene_.robot.hinged()) {
      for (const char* const key : {"x_m", "z_m"}) {
        if (start.Has(key))
          start.Fail(key, "moves the robot off its bar, whose place the task has; leave it out");
      }
    }
    TakeStartJoints(start);
    moved_ = start.Has("pitch_rad") || start.Has("joints_rad");
    turned_ = start.Has("pitch_rad");
  }

  void TakeStartJoints(TomlTable& start) {
    std::optional<TomlTable> joints = start.OptionalTable("joints_rad");
    if (!joints) return;
    for (const std::string& name : joints->Keys())
      RequireOneOf(*joints, name, name, "joint", joints_);
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      pose_.joint_positions_rad[j] =
          joints->Number(joints_[j], {-100, 100}, pose_.joint_positions_rad[j]);
    }
  }

  void TakeStartKeysInSpace(TomlTable& start) {
    pose_ = StartOf(motion_);
    SpaceTwinStart root{config_.twin.held, config_.twin.stand_m,  pose_.root_x_m,
                        pose_.root_y_m,    pose_.root_quaternion, std::nullopt};
    ReadKeys(start, kSpaceTwinStartKeys, root);
    config_.twin.held = root.held;
    config_.twin.stand_m = root.stand_m;
    pose_.root_x_m = root.x_m;
    pose_.root_y_m = root.y_m;
    pose_.root_z_m = root.z_m.value_or(pose_.root_z_m);
    pose_.root_quaternion = UnitQuaternion(start, "quaternion", root.quaternion);
    placed_ = root.z_m.has_value();
    TakeStartJoints(start);
    moved_ = start.Has("quaternion") || start.Has("joints_rad");
  }

  void ReadStartInSpace(TomlTable& start) {
    if (moved_ && !placed_) {
      try {
        pose_ = ToPrimitivePose(RestPose(*space_, ToSpacePose(pose_)));
      } catch (const std::runtime_error& error) {
        start.Fail(
            "", fmt::format("{}; change the joints or the quaternion, or give z_m", error.what()));
      }
    }
    config_.start = pose_;
  }

  /// Sets the start pose. A robot that does not start in the motion's own pose, and has no height,
  /// is lowered until it rests; on a bar it hangs at rest unless its pitch is given.
  void ReadStart(TomlTable& start) {
    if (scene_.robot.hinged()) {
      if (moved_ && !turned_)
        pose_.root_pitch_rad = RestingPitch(scene_, PositionsIn(pose_, scene_.robot));
    } else if (scene_.robot.root_dofs == 3 && moved_ && !placed_) {
      try {
        pose_ = PoseAt(RestPose(scene_, PositionsIn(pose_, scene_.robot)), scene_.robot);
      } catch (const std::runtime_error& error) {
        start.Fail("",
                   fmt::format("{}; change the joints or the pitch, or give z_m", error.what()));
      }
    }
    config_.start = pose_;
  }

  /// Checks that no shape starts in an obstacle, of the task or of this file.
  void CheckNotBuried() const {
    PrimitivePose pose = config_.start.value_or(StartOf(motion_));
    pose.root_z_m += config_.twin.stand_m;
    std::optional<BuriedShape> buried;
    if (space_) {
      RootChart<Spatial> chart;
      chart.axes = ToRotation(pose.root_quaternion);
      buried = FindBuried<Spatial>(*space_, ToSpacePose(pose).q, chart);
    } else {
      buried = FindBuried<Plane>(scene_, PositionsIn(pose, scene_.robot));
    }
    if (!buried) return;
    root_.Fail(root_.Has("start") ? "start" : "",
               fmt::format("collision shape {} begins {} m inside '{}'; allowed: where none is "
                           "inside an obstacle",
                           buried->shape, MessageNumber(buried->by_m), buried->obstacle));
  }

  TomlTable root_;
  const SequenceFile& motion_;
  Scene scene_;                      // as the file changes it
  std::optional<SpaceScene> space_;  // likewise, in its place
  std::filesystem::path folder_;
  std::vector<std::string> joints_, links_, obstacles_;
  PrimitivePose pose_;
  bool placed_ = false;
  bool moved_ = false;
  bool turned_ = false;
  SimulatedRobotConfig config_;
};

}  // namespace

std::vector<KeyTable> TwinKeyTables() {
  const char* const source = "offline/twin/twin_keys.h";
  const KeyRow joints{"", "`joints_rad`", "the motion's", "table of joints, -100 to 100", ""};
  return {{source, "twin",
           Joined({{RowOf(kTwinHeader)}, RowsOf(kTwinFileKeys), RowsOf(kTwinStepKeys)})},
          {source, "start", Joined({RowsOf(kTwinStartKeys), {joints}})},
          {source, "motor", RowsOf(kMotorKeys)},
          {source, "stop", RowsOf(kStopKeys)},
          {source, "obstacle", RowsOf(kTwinObstacleKeys)},
          {source, "patch", RowsOf(kPatchKeys)},
          {source, "push", Joined({RowsOf(kPushKeys), RowsOf(kPlanePushKeys)})},
          {source, "sensor", RowsOf(kTwinSensorKeys)},
          {source, "sensor_failure", RowsOf(kSensorFailureKeys)},
          {source, "fall", RowsOf(kFallKeys)}};
}

std::vector<KeyTable> SpaceTwinKeyTables() {
  const char* const source = "offline/twin/twin_keys.h";
  return {{source, "start_in_space", RowsOf(kSpaceTwinStartKeys)},
          {source, "push_in_space", RowsOf(kSpacePushKeys)}};
}

TwinSources ReadTwinSources(const std::string& path) {
  TomlTable root = TomlTable::ParseFile(path);
  ReadHeader(root, kTwinHeader);
  const TwinSources files = SourcesIn(root);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  const auto beside = [&folder](const std::string& name) {
    return name.empty() ? name : (folder / name).string();
  };
  return {beside(files.motion), beside(files.drives), beside(files.robot)};
}

std::vector<std::string> FilesOfTwin(const std::string& path) {
  if (path.empty()) return {};
  std::vector<std::string> files = {path};
  const TwinSources named = ReadTwinSources(path);
  for (const std::string& file : {named.motion, named.drives, named.robot})
    if (!file.empty()) files.push_back(file);
  return files;
}

SimulatedRobotConfig LoadTwin(const std::string& path, const SimulatedMotion& motion) {
  return TwinReader(TomlTable::ParseFile(path), motion, std::filesystem::path(path).parent_path())
      .Read();
}

SimulatedRobotConfig ParseTwin(std::string_view text, const std::string& name,
                               const SimulatedMotion& motion) {
  return TwinReader(TomlTable::Parse(text, name), motion, std::filesystem::path(name).parent_path())
      .Read();
}

}  // namespace tumbler
