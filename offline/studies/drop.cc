#include "offline/studies/drop.h"

#include <algorithm>
#include <numbers>
#include <stdexcept>

#include "offline/scene/normal.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {
namespace {

constexpr double kHeight_m = 0.1, kSpeed_m_s = 0.3, kRate_rad_s = 2;

}  // namespace

Drop DrawDrop(const Scene& scene, const DropNumber& number) {
  constexpr std::uint64_t kDrops = 0x6472'6f70'7065'6421;  // another series than the robots'
  constexpr int kTries = 10000;
  constexpr double kPi = std::numbers::pi;
  Normal random((number.seed ^ kDrops) + 1'000'003 * number.attempt, number.index);
  const auto within = [&random](double low, double high) {
    return low + random.DrawUniform() * (high - low);
  };
  const PlanarRobot& robot = scene.robot;
  SelfDistances own(robot, scene.self_contact.pairs);
  Drop drop;
  drop.pose.root_pitch_rad = within(-kPi, kPi);
  drop.pose.joint_positions_rad.resize(robot.joint_count());
  std::vector<double> q;
  for (int tried = 0;; ++tried) {
    if (tried == kTries)
      throw std::runtime_error("the robot's own shapes overlap wherever its joints are");
    for (std::size_t j = 0; j < robot.joint_count(); ++j) {
      const RobotJointLimits& limits = robot.limits[robot.DofOfJoint(j)];
      drop.pose.joint_positions_rad[j] =
          within(std::max(limits.lower_rad, -kPi), std::min(limits.upper_rad, kPi));
    }
    q = PositionsIn(drop.pose, robot);
    if (own.Nearest(q).distance_m > 0) break;
  }
  drop.pose.root_z_m = TouchingHeight(scene, q) + within(0, kHeight_m);
  drop.rates.resize(3 + robot.joint_count());
  drop.rates[0] = within(-kSpeed_m_s, kSpeed_m_s);
  drop.rates[2] = within(-kRate_rad_s, kRate_rad_s);
  return drop;
}

bool LiesInItself(const Scene& scene, const std::vector<double>& joints_rad) {
  const PlanarRobot& robot = scene.robot;
  std::vector<OwnPair> pairs = scene.self_contact.pairs;
  std::erase_if(pairs, [&robot](const OwnPair& pair) {
    const auto body = [&robot](int shape) {
      return robot.own_shapes[static_cast<std::size_t>(shape)].body;
    };
    const auto parent = [&robot](int of) {
      return robot.tree.dofs[static_cast<std::size_t>(of)].parent;
    };
    const int a = body(pair.a), b = body(pair.b);
    return parent(a) == b || parent(b) == a;
  });
  if (pairs.empty()) return false;
  PrimitivePose pose;
  pose.joint_positions_rad = joints_rad;
  return SelfDistances(robot, pairs).Nearest(PositionsIn(pose, robot)).distance_m < 0;
}

}  // namespace tumbler
