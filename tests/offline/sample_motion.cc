#include "tests/offline/sample_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace tumbler {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGravity = 9.81;
constexpr double kMiddleHalf = 0.15;   // m
constexpr double kLeg = 0.20;          // m
constexpr double kFootSide = 0.04;     // m, of a foot's sphere from the leg's axis
constexpr double kFootRadius = 0.010;  // m
constexpr double kEndRadius = 0.030;   // m
constexpr double kMiddleMass = 1.0;    // kg
constexpr double kLegMass = 0.4;       // kg
constexpr double kDuration = 1.2;      // s
constexpr double kSettling = 0.3;      // s

struct Point {
  double x = 0, z = 0;
};
Point operator+(Point a, Point b) { return {a.x + b.x, a.z + b.z}; }
Point operator-(Point a, Point b) { return {a.x - b.x, a.z - b.z}; }
Point operator*(double s, Point a) { return {s * a.x, s * a.z}; }
double Cross(Point a, Point b) { return a.x * b.z - a.z * b.x; }
Point Turn(double angle, Point a) {
  return {std::cos(angle) * a.x - std::sin(angle) * a.z,
          std::sin(angle) * a.x + std::cos(angle) * a.z};
}

/// From 0 before `from` to 1 after `to`, with no jump in the first two derivatives.
double Step(double t, double from, double to) {
  const double s = std::clamp((t - from) / (to - from), 0.0, 1.0);
  return s * s * s * (10 + s * (-15 + 6 * s));
}

/// A bump of height 1 between `from` and `to`.
double Bump(double t, double from, double to) {
  const double middle = (from + to) / 2;
  return Step(t, from, middle) - Step(t, middle, to);
}

double Pitch(double t) {
  const double ring = t > 1.0 ? 0.03 * std::sin(16 * (t - 1.0)) * std::exp(-6 * (t - 1.0)) : 0;
  return kPi / 2 * Step(t, 0.22, 1.0) + ring * Step(t, 1.0, 1.1);
}

/// Leg 1 squats, kicks off and swings up; leg 2 squats and straightens below the body.
std::array<double, 2> Joints(double t) {
  const double squat = 0.45 * Bump(t, 0.0, 0.36);
  const double swing = Step(t, 0.26, 1.12);
  return {-kPi / 2 + squat - 0.35 * Bump(t, 0.24, 0.5) + kPi / 2 * swing + 0.18 * Bump(t, 0.8, 1.2),
          kPi / 2 - squat - kPi / 2 * Step(t, 0.2, 1.04) + 0.1 * Bump(t, 0.5, 0.9)};
}

using Poses = std::array<std::array<double, 3>, 3>;  // middle link, leg 1, leg 2

Point At(const std::array<double, 3>& pose, Point local) {
  return Point{pose[0], pose[1]} + Turn(pose[2], local);
}

/// The foot's spheres in a leg's frame; leg 1 points along +x, leg 2 along -x.
std::array<Point, 2> Feet(std::size_t leg) {
  const double x = leg == 1 ? kLeg : -kLeg;
  return {Point{x, -kFootSide}, Point{x, kFootSide}};
}

Poses PosesAt(double t) {
  const double pitch = Pitch(t);
  const std::array<double, 2> q = Joints(t);
  Poses poses;
  poses[0] = {0, 0, pitch};
  const Point hinge_1 = Turn(pitch, {kMiddleHalf, 0});
  const Point hinge_2 = Turn(pitch, {-kMiddleHalf, 0});
  poses[1] = {hinge_1.x, hinge_1.z, pitch + q[0]};
  poses[2] = {hinge_2.x, hinge_2.z, pitch + q[1]};
  // The lowest foot is pressed some 1 mm into the ground, softened so that a change of feet is no
  // jump; leg 2 stays put.
  double sum = 0;
  for (std::size_t leg : {1U, 2U}) {
    for (const Point foot : Feet(leg)) sum += std::exp(-At(poses[leg], foot).z / 0.002);
  }
  const double lowest = -0.002 * std::log(sum);
  const Point foot_2 = At(poses[2], {-kLeg, 0});
  for (std::array<double, 3>& pose : poses) {
    pose[0] -= foot_2.x + kMiddleHalf;
    pose[1] -= lowest - kFootRadius + 0.002;
  }
  return poses;
}

Point CentreOf(const Poses& poses, std::size_t link) {
  if (link == 0) return {poses[0][0], poses[0][1]};
  return At(poses[link], {link == 1 ? kLeg / 2 : -kLeg / 2, 0});
}

/// The second derivative by differences over a few milliseconds, which makes it as smooth as a
/// compliant contact would.
template <typename Function>
Point Acceleration(Function f, double t) {
  const double h = 8e-3;
  return (1 / (h * h)) * (f(t + h) - 2 * f(t) + f(t - h));
}

ReportSample SampleAt(double t) {
  ReportSample sample;
  sample.time_s = t;
  const Poses poses = PosesAt(t);
  sample.link_poses.assign(poses.begin(), poses.end());
  sample.root_pitch_rad = Pitch(t);
  const double h = 1e-4;
  for (std::size_t j = 0; j < 2; ++j) {
    sample.joint_positions_rad.push_back(Joints(t)[j]);
    sample.joint_velocities_rad_s.push_back((Joints(t + h)[j] - Joints(t - h)[j]) / (2 * h));
  }

  // Newton's law for the whole robot gives the sum of the contact forces; the lower feet carry more
  // of it.
  const std::array<double, 3> masses = {kMiddleMass, kLegMass, kLegMass};
  std::array<Point, 3> inertial;
  Point total;
  for (std::size_t link = 0; link < 3; ++link) {
    const auto centre = [link](double at) { return CentreOf(PosesAt(at), link); };
    inertial[link] = masses[link] * (Acceleration(centre, t) + Point{0, kGravity});
    total = total + inertial[link];
  }
  total.x = std::clamp(total.x, -0.3 * std::abs(total.z), 0.3 * std::abs(total.z));
  std::array<double, 3> leg_moment{};
  if (total.z > 0.5) {
    double weights = 0;
    for (const bool adding : {false, true}) {
      for (std::size_t leg : {1U, 2U}) {
        for (const Point foot : Feet(leg)) {
          const Point centre = At(poses[leg], foot);
          const double gap = centre.z - kFootRadius;
          if (gap > 0.006) continue;
          const double weight = std::exp(-gap / 0.002);
          if (!adding) {
            weights += weight;
            continue;
          }
          const Point force = (weight / weights) * total;
          const Point point = {centre.x, centre.z - kFootRadius};
          sample.forces.push_back({point.x, point.z, force.x, force.z});
          leg_moment[leg] += Cross(point - Point{poses[leg][0], poses[leg][1]}, force);
        }
      }
    }
  }
  for (std::size_t leg : {1U, 2U}) {
    const Point arm = CentreOf(poses, leg) - Point{poses[leg][0], poses[leg][1]};
    sample.joint_torques_nm.push_back(Cross(arm, inertial[leg]) - leg_moment[leg]);
  }
  return sample;
}

}  // namespace

ReportData SampleMotion() {
  ReportData data;
  data.title = "handstand";
  data.subtitle = "tumbler 0.1.0, robot three_link_tumbler, task handstand.toml, seed 7";
  data.duration_s = kDuration;
  data.settle_s = kSettling;
  data.joint_names = {"leg_1", "leg_2"};
  data.torque_limits_nm = {8, 8};
  data.position_limits_rad = {{{-2.9, 2.9}, {-2.9, 2.9}}};
  const auto bar = [](double x1, double z1, double x2, double z2, double radius) {
    return ReportShape{{{x1, z1}, {x2, z2}}, radius, false};
  };
  const auto ball = [](double x, double z, double radius) {
    return ReportShape{{{x, z}}, radius, true};
  };
  data.links = {
      {"middle",
       {bar(-kMiddleHalf, 0, kMiddleHalf, 0, 0.022), ball(-kMiddleHalf, 0, kEndRadius),
        ball(kMiddleHalf, 0, kEndRadius)}},
      {"leg_1",
       {bar(kLeg, -kFootSide, kLeg, kFootSide, 0.006), bar(0, 0, kLeg - 0.012, 0, 0.014),
        ball(kLeg, -kFootSide, kFootRadius), ball(kLeg, kFootSide, kFootRadius)}},
      {"leg_2",
       {bar(-kLeg, -kFootSide, -kLeg, kFootSide, 0.006), bar(0, 0, -kLeg + 0.012, 0, 0.014),
        ball(-kLeg, -kFootSide, kFootRadius), ball(-kLeg, kFootSide, kFootRadius)}}};
  data.obstacles = {{"ground", {{-1000, 0}, {-1000, -1000}, {1000, -1000}, {1000, 0}}}};
  data.ground_z_m = 0;
  for (int i = 0; i <= std::lround(200 * (kDuration + kSettling)); ++i) {
    data.samples.push_back(SampleAt(i / 200.0));
  }

  // The evaluations of a search over random starts, and of local solves from the best of them.
  std::mt19937_64 random(7);
  std::lognormal_distribution<double> start(-0.6, 1.1);
  std::uniform_real_distribution<double> unit(0, 1);
  int evaluation = 0;
  for (; evaluation < 1500; ++evaluation) {
    const double violation = unit(random) < 0.5 ? 0 : 0.3 * unit(random);
    data.evaluations.push_back({evaluation, 0.05 + start(random), violation, true});
  }
  for (int solve = 0; solve < 4; ++solve) {
    for (int k = 0; k < 70; ++k, ++evaluation) {
      const double decay = std::exp(-0.13 * k);
      data.evaluations.push_back({evaluation,
                                  0.0021 * (solve + 1) + 0.3 * decay * (0.7 + 0.6 * unit(random)),
                                  0.08 * std::exp(-0.33 * k) * unit(random), false});
    }
  }
  data.certificate = {
      {"Gradient against central differences", "4.1e-7, largest relative error through contact"},
      {"Projected gradient", "3.2e-6 (scaled)"},
      {"Position, velocity, acceleration bounds", "proved for all times"},
      {"Largest penetration", "1.9 mm at 0.31 s"},
      {"Error by halving the step", "2.6e-5 rad in the root's pitch"},
      {"Settling", "0.3 s, root pitch within 0.01 rad of its rest"},
      {"Seed", "7"},
      {"Robot and task", "sha256 9d2c41b07be5 and 51f7a3e07c44"},
  };
  return data;
}

}  // namespace tumbler
