#include "offline/studies/stated_motors.h"

#include <algorithm>
#include <cstddef>

namespace tumbler {

std::vector<MotorFacts> StatedIn(const PosteriorDrives& drives) {
  std::vector<MotorFacts> stated;
  for (const PosteriorDrive& drive : drives.of_joint)
    stated.push_back({drive.torque_factor, drive.torque_time_constant_s, drive.velocity_filter_s});
  return stated;
}

MotorFacts AverageOf(std::span<const MotorFacts> stated) {
  if (stated.empty()) return {};
  MotorFacts average{0, 0, 0};
  const auto n = static_cast<double>(stated.size());
  for (const MotorFacts& motor : stated) {
    average.torque_factor += motor.torque_factor / n;
    average.torque_time_constant_s += motor.torque_time_constant_s / n;
    average.velocity_filter_s += motor.velocity_filter_s / n;
  }
  // Of equal ones it is what they are, to the bit.
  const auto keep = [&](double MotorFacts::*of) {
    const auto same = [&](const MotorFacts& motor) { return motor.*of == stated.front().*of; };
    if (std::ranges::all_of(stated, same)) average.*of = stated.front().*of;
  };
  keep(&MotorFacts::torque_factor);
  keep(&MotorFacts::torque_time_constant_s);
  keep(&MotorFacts::velocity_filter_s);
  return average;
}

void OwnDrives(std::span<const MotorFacts> stated, std::span<const RobotQuantity> quantities,
               RobotVariation& robot) {
  const MotorFacts average = AverageOf(stated);
  const auto fitted = [quantities](RobotQuantity::Kind kind) {
    return std::ranges::find(quantities, kind, &RobotQuantity::kind) != quantities.end();
  };
  const bool torque = fitted(RobotQuantity::Kind::kTorque);
  const bool filter = fitted(RobotQuantity::Kind::kVelocityLag);
  const bool lag = fitted(RobotQuantity::Kind::kTorqueLag);
  for (std::size_t j = 0; j < robot.joints.size() && j < stated.size(); ++j) {
    RobotVariation::Joint& joint = robot.joints[j];
    const MotorFacts& own = stated[j];
    joint.torque =
        torque ? joint.torque * (own.torque_factor / average.torque_factor) : own.torque_factor;
    const auto departs = [](double found, double of_own, double of_average) {
      return std::max(0.0, found + (of_own - of_average));
    };
    joint.velocity_filter_s =
        filter ? departs(joint.velocity_filter_s, own.velocity_filter_s, average.velocity_filter_s)
               : own.velocity_filter_s;
    joint.torque_lag_s = lag ? departs(joint.torque_lag_s, own.torque_time_constant_s,
                                       average.torque_time_constant_s)
                             : own.torque_time_constant_s;
  }
}

MotorFacts MotorFound(const PosteriorFile& file, const std::string& joint) {
  const std::vector<MotorFacts> stated = StatedIn(file.drives);
  RobotVariation robot;
  robot.joints.resize(std::max<std::size_t>(stated.size(), 1));
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    for (RobotVariation::Joint& each : robot.joints) {
      const double value = file.posterior.ValueOf(i);
      switch (file.posterior.quantities[i].kind) {
        case RobotQuantity::Kind::kTorque:
          each.torque = value;
          break;
        case RobotQuantity::Kind::kVelocityLag:
          each.velocity_filter_s = std::max(0.0, value);
          break;
        case RobotQuantity::Kind::kTorqueLag:
          each.torque_lag_s = std::max(0.0, value);
          break;
        default:
          break;
      }
    }
  }
  OwnDrives(stated, file.posterior.quantities, robot);
  std::size_t own = 0;
  while (own + 1 < stated.size() && file.drives.of_joint[own].joint != joint) ++own;
  return {robot.joints[own].torque, robot.joints[own].torque_lag_s,
          robot.joints[own].velocity_filter_s};
}

}  // namespace tumbler
