#include "tests/offline/sample_space_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>

namespace tumbler {
namespace {

using Vector = SpaceVector;

constexpr double kThigh_m = 0.2, kHipWidth_m = 0.06, kFoot_m = 0.025, kPeriod_s = 0.4;
constexpr double kWeight_n = 118, kMotion_s = 2, kEnd_s = 2.3, kHop_s = 1.55;
constexpr std::array kLegs = {"front left", "front right", "hind left", "hind right"};

Pose About(int axis, double angle) {
  Vector v = Vector::Zero();
  v[axis] = std::sin(angle / 2);
  return {Pose::RotationOf(v.x(), v.y(), v.z(), std::cos(angle / 2)), Vector::Zero()};
}
Pose At(double x, double y, double z) { return {SpaceMatrix::Identity(), {x, y, z}}; }

Shape<Spatial> DownTo(double length_m, double radius_m) {
  Spatial::Rotation down;
  down.m = {Vector(0, 0, -1), Vector(0, 1, 0), Vector(1, 0, 0)};
  return Shape<Spatial>::Capsule({0, 0, -length_m / 2}, down, length_m / 2, radius_m);
}

/// The trunk. It stops before it hops.
Pose Trunk(double t) {
  const double way = std::min(t, 1.4);
  const double yaw = 0.5 * way * way / 1.4, hop = std::clamp((t - kHop_s) / 0.4, 0.0, 1.0);
  const double z = 0.33 + 0.008 * std::sin(4 * std::numbers::pi * way / kPeriod_s) +
                   0.8 * hop * (1 - hop) - (t < kHop_s && t > 1.4 ? 0.4 * (t - 1.4) : 0);
  const double roll = 0.05 * std::sin(2 * std::numbers::pi * way / kPeriod_s);
  const Pose at = At(0.62 * way * std::cos(yaw / 2), 0.62 * way * std::sin(yaw / 2), z);
  return at * About(2, yaw) * About(1, -1.2 * hop * (1 - hop)) * About(0, roll);
}

bool OnGround(double t, std::size_t leg) {
  if (t > kHop_s && t < kHop_s + 0.4) return false;
  if (t >= 1.4) return true;
  const double phase = t / kPeriod_s + (leg == 0 || leg == 3 ? 0.0 : 0.5);
  return phase - std::floor(phase) < 0.5;
}

Vector BelowHip(double t, std::size_t leg) {
  const Vector p = Trunk(t) * Vector(leg < 2 ? 0.19 : -0.19, leg % 2 == 0 ? 0.13 : -0.13, 0);
  return {p.x(), p.y(), kFoot_m};
}

/// Where the foot stands in the stance around a time.
Vector Foothold(double t, std::size_t leg) {
  const double shift = leg == 0 || leg == 3 ? 0.0 : 0.5;
  const double middle = (std::floor(t / kPeriod_s + shift) + 0.25 - shift) * kPeriod_s;
  return BelowHip(t >= 1.4 ? 1.4 : std::clamp(middle, 0.0, 1.4), leg);
}

Vector Foot(double t, std::size_t leg) {
  if (OnGround(t, leg) || t >= kHop_s) {
    Vector foot = Foothold(t, leg);
    if (!OnGround(t, leg)) {
      const double hop = (t - kHop_s) / 0.4;
      foot[2] += 0.6 * hop * (1 - hop);
    }
    return foot;
  }
  const double phase = t / kPeriod_s + (leg == 0 || leg == 3 ? 0.0 : 0.5);
  const double s = 2 * (phase - std::floor(phase)) - 1;  // of the swing
  const Vector from = Foothold(t, leg), to = Foothold(std::min(t + kPeriod_s / 2, 1.4), leg);
  Vector foot = from + (to - from) * (s * s * (3 - 2 * s));
  foot[2] += 0.28 * s * (1 - s);
  return foot;
}

/// The robot, its surroundings, and plots without values.
SpaceMotionPage RobotAtNoTime() {
  SpaceMotionPage page;
  page.title = "trot around a bend";
  page.subtitle = "tumbler optimize 0.0, seed 7";
  page.motion_s = kMotion_s;
  page.facts = {{"Duration", "2.000 s"},
                {"Largest torque", "18.2 N·m, 61 % of its limit"},
                {"Lowest clearance", "12 mm"}};
  page.notes = "The robot and its forces are made up.\nIts feet do not slip while they stand.";
  Shape<Spatial> trunk = Shape<Spatial>::Box(Vector::Zero(), {}, {0.2, 0.05, 0.03});
  trunk.radius_m = 0.035;
  page.bodies.push_back({"trunk", {trunk, Shape<Spatial>::Sphere({0.25, 0, 0.03}, 0.045)}});
  for (int leg = 0; leg < 4; ++leg) {
    const std::string name = kLegs.at(static_cast<std::size_t>(leg));
    Spatial::Rotation across;
    across.m = {Vector(0, 1, 0), Vector(-1, 0, 0), Vector(0, 0, 1)};
    const double y = leg % 2 == 0 ? kHipWidth_m : -kHipWidth_m;
    page.bodies.push_back({name + " hip",
                           {Shape<Spatial>::Capsule({0, y / 2, 0}, across, kHipWidth_m / 2, 0.035)},
                           leg});
    page.bodies.push_back({name + " thigh", {DownTo(kThigh_m, 0.03)}, leg});
    page.bodies.push_back(
        {name + " shank",
         {DownTo(kThigh_m, 0.016), Shape<Spatial>::Sphere({0, 0, -kThigh_m}, kFoot_m)},
         leg});
  }
  page.obstacles = {{"ground", Shape<Spatial>::HalfSpace(Vector::Zero(), Vector::UnitZ())},
                    {"step", Shape<Spatial>::Box({0.75, -0.32, 0.05}, {}, {0.12, 0.1, 0.05})},
                    {"post", DownTo(0, 0.03)}};
  Spatial::Rotation up;
  up.m = {Vector(0, 0, 1), Vector(0, 1, 0), Vector(-1, 0, 0)};
  page.obstacles.back().shape = Shape<Spatial>::Capsule({0.3, 0.42, 0.2}, up, 0.2, 0.03);

  const auto plot = [&](const std::string& title, const std::string& unit,
                        std::vector<double> limits) {
    SpacePlot one{title, unit, {}, std::move(limits)};
    for (int leg = 0; leg < 4; ++leg)
      one.series.push_back({kLegs.at(static_cast<std::size_t>(leg)), {}, leg});
    page.plots.push_back(one);
  };
  plot("Hip roll", "rad", {});
  plot("Hip pitch", "rad", {});
  plot("Knee", "rad", {-2.6});
  plot("Knee torque", "N·m", {-30, 30});
  return page;
}

}  // namespace

SpaceMotionPage SampleSpaceMotion() {
  SpaceMotionPage page = RobotAtNoTime();
  const int frames = static_cast<int>(std::lround(kEnd_s * 60));
  for (int i = 0; i <= frames; ++i) {
    SpaceFrame frame;
    const double t = frame.time_s = i / 60.0;
    const Pose root = Trunk(t);
    frame.poses.push_back(root);
    double standing = 0;
    for (std::size_t leg = 0; leg < 4; ++leg) standing += OnGround(t, leg) ? 1 : 0;
    for (std::size_t leg = 0; leg < 4; ++leg) {
      const double side = leg % 2 == 0 ? 1 : -1;
      const Vector foot = Foot(t, leg);
      const Pose hip = root * At(leg < 2 ? 0.19 : -0.19, 0.075 * side, 0);
      const Vector d = hip.rotation.TransposeTimes(foot - hip.translation);
      const double o = kHipWidth_m * side,
                   below = std::sqrt(std::max(1e-4, d.y() * d.y() + d.z() * d.z() - o * o));
      const double roll = std::atan2(d.y(), -d.z()) - std::atan2(o, below);
      const double square = std::min(d.x() * d.x() + below * below, 3.98 * kThigh_m * kThigh_m);
      const double knee = -std::acos(square / (2 * kThigh_m * kThigh_m) - 1);
      const double pitch = -std::atan2(d.x(), below) - knee / 2;
      const Pose hip_body = hip * About(0, roll);
      const Pose thigh = hip_body * At(0, o, 0) * About(1, pitch);
      const Pose shank = thigh * At(0, 0, -kThigh_m) * About(1, knee);
      frame.poses.insert(frame.poses.end(), {hip_body, thigh, shank});
      const double force =
          OnGround(t, leg) ? kWeight_n / standing * (1 + 0.3 * std::cos(12 * t)) : 0;
      if (force > 0) {
        frame.contacts.push_back({foot - kFoot_m * Vector::UnitZ(),
                                  {0.2 * force * std::sin(15 * t), 0.1 * force * side, force}});
      }
      page.plots[0].series[leg].values.push_back(roll);
      page.plots[1].series[leg].values.push_back(pitch);
      page.plots[2].series[leg].values.push_back(knee);
      page.plots[3].series[leg].values.push_back(0.15 * force * std::sin(-knee / 2) * 2);
    }
    page.frames.push_back(frame);
  }
  return page;
}

}  // namespace tumbler
