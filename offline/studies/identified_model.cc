#include "offline/studies/identified_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_writer.h"
#include "offline/model/urdf_edit.h"
#include "offline/studies/stated_motors.h"
#include "offline/studies/toml_edit.h"

namespace tumbler {
namespace {

using Kind = RobotQuantity::Kind;

/// The value of a quantity, if it is one of the posterior's.
std::optional<double> ValueOf(const RobotPosterior& posterior, const RobotQuantity& quantity) {
  for (std::size_t i = 0; i < posterior.size(); ++i) {
    if (posterior.quantities[i] == quantity) return posterior.ValueOf(i);
  }
  return std::nullopt;
}

const char* const kEffective =
    "# AN EFFECTIVE MODEL: it moves as the robot did in the records, but does not explain them. "
    "Its\n"
    "# quantities are not the robot's.";

void Head(TomlWriter& writer, const PosteriorFile& file, const char* what) {
  writer.Line(fmt::format("# {}, by tumbler identify fit.", what));
  if (file.effective) writer.Line(kEffective);
  if (!file.weighed)
    writer.Line("# The robot was not weighed: forces are in the drives' newton metres.");
}

/// The keys of a task's ground.
struct GroundKey {
  Kind kind;
  const char* key;
};
constexpr std::array kGroundKeys = {
    GroundKey{Kind::kFriction, "mu"}, GroundKey{Kind::kStiffness, "stiffness_n_per_m"},
    GroundKey{Kind::kDamping, "damping_n_s_per_m"}, GroundKey{Kind::kCreepSpeed, "v_max_m_per_s"}};

}  // namespace

std::string IdentifiedUrdf(const std::string& robot_text, const std::string& robot_name,
                           const Scene& scene, const RobotPosterior& posterior) {
  const RobotVariation robot = VariationOf(scene, posterior.quantities, posterior.mean);
  std::vector<LinkInertia> links;
  const std::size_t first = Index(scene.robot.first_body());
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const RobotVariation::Link& link = robot.links[i];
    // The URDF keeps its lengths, and has the centre of mass where it is.
    const double moved_m =
        link.mass_centre_m + (link.length - 1) * scene.robot.tree.dofs[first + i].mass_centre.x();
    links.push_back({scene.robot.body_names[first + i], link.mass, link.inertia, moved_m});
  }
  return WithInertias(robot_text, robot_name, links);
}

Task IdentifiedTask(const Task& given, const PosteriorFile& file) {
  std::string text = given.task_text;
  for (const GroundKey& ground : kGroundKeys) {
    const auto value = ValueOf(file.posterior, {ground.kind, ""});
    if (value)
      text = WithNumber(text, given.task_file, std::string("contact.") + ground.key, *value);
  }
  Task task = ParseTask(
      text, given.task_file,
      IdentifiedUrdf(given.robot_text, given.robot_file, given.problem.scene, file.posterior),
      given.robot_file);
  task.robot_change = "as identified";
  return task;
}

namespace {

/// Where a torque constant was not fitted, robots have the one that was stated, for certain.
RobotPosterior WithStatedTorque(const PosteriorFile& file) {
  RobotPosterior robots = file.posterior;
  const double stated = AverageOf(StatedIn(file.drives)).torque_factor;
  if (stated == 1 || ValueOf(robots, {Kind::kTorque, ""})) return robots;
  const std::size_t n = robots.size();
  std::vector<double> covariance((n + 1) * (n + 1), 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) covariance[i * (n + 1) + k] = robots.covariance[i * n + k];
  }
  robots.covariance = std::move(covariance);
  robots.quantities.push_back({Kind::kTorque, ""});
  robots.mean.push_back(portable::Log(stated));
  return robots;
}

}  // namespace

void TuneTo(const PosteriorFile& file, const TuningSettings& settings, Task& task) {
  RobustSettings& robust = *task.problem.robust;
  robust.spreads.posterior = std::make_shared<const RobotPosterior>(WithStatedTorque(file));
  robust.spreads.torque_limit = std::max(robust.spreads.torque_limit, settings.untold.torque_limit);
  robust.spreads.delay_s = std::max(robust.spreads.delay_s, settings.untold.delay_s);
  robust.polish_robots = std::min(robust.polish_robots,
                                  file.effective ? settings.robots_of_effective : settings.robots);
  if (file.effective) robust.polish_scale = kEffectiveDeviations;
  robust.polish_rounds = settings.rounds;
  robust.generations = std::min(robust.generations, settings.generations);
}

std::string GroundOf(const PosteriorFile& file, const ContactLaw& law) {
  TomlWriter writer("a ground");
  Head(writer, file, "The ground that was identified: the [contact] of a task");
  writer.Line("[contact]");
  for (const GroundKey& ground : kGroundKeys) {
    if (const auto value = ValueOf(file.posterior, {ground.kind, ""}))
      writer.Number(ground.key, *value);
  }
  writer.Number("d_on_m", law.d_on_m);
  writer.Number("d_off_m", law.d_off_m);
  return writer.Take();
}

namespace {

using MotorKeys = std::map<std::string, std::vector<std::pair<const char*, double>>>;

/// Adds what was found or stated of the drives' motors: of all of them, or of each where they
/// differ.
void AddDrives(const PosteriorFile& file, MotorKeys& motors) {
  std::vector<MotorFacts> found;
  for (const PosteriorDrive& drive : file.drives.of_joint)
    found.push_back(MotorFound(file, drive.joint));
  if (found.empty()) found.push_back(MotorFound(file, ""));
  const auto add = [&](const char* key, double MotorFacts::*of, Kind kind) {
    const bool fitted = ValueOf(file.posterior, {kind, ""}).has_value();
    const auto same = [&](const MotorFacts& motor) { return motor.*of == found.front().*of; };
    if (std::ranges::all_of(found, same)) {
      if (fitted || found.front().*of != MotorFacts{}.*of)
        motors[""].emplace_back(key, found.front().*of);
      return;
    }
    for (std::size_t j = 0; j < found.size(); ++j)
      motors[file.drives.of_joint[j].joint].emplace_back(key, found[j].*of);
  };
  add("torque_factor", &MotorFacts::torque_factor, Kind::kTorque);
  add("torque_time_constant_s", &MotorFacts::torque_time_constant_s, Kind::kTorqueLag);
  add("velocity_filter_s", &MotorFacts::velocity_filter_s, Kind::kVelocityLag);
}

}  // namespace

std::string TwinOf(const PosteriorFile& file) {
  TomlWriter writer("a twin");
  Head(writer, file, "The robot that was identified");
  const RobotPosterior& posterior = file.posterior;
  for (std::size_t i = 0; i < posterior.size(); ++i) {
    const Kind kind = posterior.quantities[i].kind;
    if (kind == Kind::kZero) {
      writer.Line(
          fmt::format("# The encoder of {} read {:.3g} rad more than the true angle; drives.toml "
                      "has its zero corrected.",
                      posterior.quantities[i].of, posterior.mean[i]));
    } else if (kind == Kind::kSlope) {
      writer.Line(fmt::format("# The ground slopes by {:.3g} rad, which a twin file cannot say.",
                              posterior.mean[i]));
    }
  }
  writer.Line("format = \"tumbler-twin\"");
  writer.Line("version = 1");
  writer.Text("drives", "drives.toml");
  writer.Text("robot", "robot.urdf");
  MotorKeys motors;
  for (std::size_t i = 0; i < posterior.size(); ++i) {
    const RobotQuantity& quantity = posterior.quantities[i];
    const double value = std::max(0.0, posterior.ValueOf(i));
    const char* const key = quantity.kind == Kind::kViscous ? "viscous_friction_nm_s_per_rad"
                            : quantity.kind == Kind::kDry   ? "dry_friction_nm"
                            : quantity.kind == Kind::kRotor ? "rotor_inertia_kg_m2"
                                                            : nullptr;
    if (key != nullptr) motors[quantity.of].emplace_back(key, value);
  }
  AddDrives(file, motors);
  for (const auto& [joint, keys] : motors) {
    writer.Line("");
    writer.Line(joint.empty() ? "[motor]" : "[motor." + joint + "]");
    for (const auto& [key, value] : keys) writer.Number(key, value);
  }
  writer.Line("");
  writer.Line("[contact]");
  for (const GroundKey& ground : kGroundKeys) {
    if (const auto value = ValueOf(posterior, {ground.kind, ""})) writer.Number(ground.key, *value);
  }
  return writer.Take();
}

}  // namespace tumbler
