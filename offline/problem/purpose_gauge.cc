#include "offline/problem/purpose_gauge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"

namespace tumbler {

PurposeGauge::PurposeGauge(const PurposeTarget& target, const PlanarRobot& robot)
    : of_(target.of), target_(target.target), root_dofs_(Index(robot.root_dofs)) {
  if (target.is_in_space()) obstacle_ = "it is of a robot in space, and this one is in the plane";
  if (!target.of_point()) return;
  try {
    point_ = PointOfLink(robot, target.link, target.point_m);
  } catch (const std::invalid_argument& error) {
    obstacle_ = "its link " + std::string(error.what());
  }
}

PurposeGauge::PurposeGauge(const PurposeTarget& target, const SpaceRobot& robot)
    : of_(target.of), target_(target.target), root_dofs_(Index(robot.root_dofs)) {
  if (!target.is_in_space()) {
    if (of_ != PurposeTarget::Of::kSpeed)
      obstacle_ = "it is of a robot in the plane, and this one is in space";
    return;
  }
  const auto of = static_cast<SpaceQuantity::Of>(static_cast<int>(of_) -
                                                 static_cast<int>(PurposeTarget::Of::kPosition));
  try {
    quantity_ = QuantityOfLink(robot, of, target.link, target.in_space, target.along);
  } catch (const std::invalid_argument& error) {
    obstacle_ = fmt::format("its link '{}' {}", target.link, error.what());
  }
}

double PurposeGauge::At(std::span<const double> q, std::span<const double> qd,
                        const SpaceMatrix& axes) const {
  if (quantity_.present()) {
    if (!quantity_.IsDefined(q, axes)) return std::numeric_limits<double>::quiet_NaN();
    return quantity_.Near(target_, quantity_.Value(q, qd, axes));
  }
  const auto root = [this](std::span<const double> of, std::size_t dof) {
    return dof < root_dofs_ ? of[dof] : 0.0;
  };
  switch (of_) {
    case PurposeTarget::Of::kX:
      return root(q, 0);
    case PurposeTarget::Of::kZ:
      return root(q, 1);
    case PurposeTarget::Of::kPitch:
      return root(q, 2);
    case PurposeTarget::Of::kXRate:
      return root(qd, 0);
    case PurposeTarget::Of::kZRate:
      return root(qd, 1);
    case PurposeTarget::Of::kPitchRate:
      return root(qd, 2);
    case PurposeTarget::Of::kSpeed: {
      double fastest = 0;
      for (std::size_t i = 0; i < root_dofs_; ++i) fastest = std::max(fastest, std::abs(qd[i]));
      return fastest;
    }
    case PurposeTarget::Of::kPointX:
      return point_.Value(LinkPoint::Axis::kX, false, q, qd);
    case PurposeTarget::Of::kPointZ:
      return point_.Value(LinkPoint::Axis::kZ, false, q, qd);
    case PurposeTarget::Of::kPointXRate:
      return point_.Value(LinkPoint::Axis::kX, true, q, qd);
    case PurposeTarget::Of::kPointZRate:
      return point_.Value(LinkPoint::Axis::kZ, true, q, qd);
    case PurposeTarget::Of::kPosition:
    case PurposeTarget::Of::kVelocity:
    case PurposeTarget::Of::kAngularVelocity:
    case PurposeTarget::Of::kMisalignment:
    case PurposeTarget::Of::kHeading:
      return 0;  // It has an obstacle.
  }
  return 0;
}

double DueTime(const PurposeTarget& target, double duration_s, double settle_s) {
  switch (target.when) {
    case PurposeTarget::When::kEnd:
      return duration_s;
    case PurposeTarget::When::kSettled:
      return duration_s + settle_s;
    case PurposeTarget::When::kLater:
      return duration_s + kExitAfter_s;
    case PurposeTarget::When::kTime:
      return target.time_s;
  }
  return duration_s;
}

}  // namespace tumbler
