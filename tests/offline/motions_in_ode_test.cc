// Shipped motions in the Open Dynamics Engine: another way to simulate a robot, by constraints
// between bodies that each have all their freedom, and other contacts.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "tests/offline/ode_robot.h"
#include "tests/offline/played_motion.h"

namespace tumbler {
namespace {

using testing::OdeGround;
using testing::OdeRobot;
using testing::PlayedMotion;

constexpr const char* kSource = "tests/offline/motions_in_ode_test.cc";
constexpr double kStep_s = 2e-4;
constexpr int kLinks = 3;

/// A kind of ground. Its damping is half the critical one of the robot's mass on it.
struct Ground {
  const char* name;
  double stiffness_n_per_m;  ///< 0: hard.
};
constexpr std::array kGrounds = {Ground{"1e5 N/m", 1e5}, Ground{"1e6 N/m", 1e6},
                                 Ground{"1e7 N/m", 1e7}, Ground{"hard", 0}};
constexpr std::array kFrictions = {0.15, 0.3, 0.6, 0.9};

OdeGround GroundOf(const SimulatedMotion& motion, const Ground& ground, double mu,
                   const testing::RobotFactors& factors = {}) {
  double mass = 0;
  for (const Dof<Plane>& dof : motion.scene().robot.tree.dofs) mass += dof.mass_kg;
  const double damping = std::sqrt(ground.stiffness_n_per_m * mass);
  return {mu * factors.mu, ground.stiffness_n_per_m * factors.stiffness, damping * factors.damping};
}

/// What comes of a motion with a friction on every ground.
std::string OnGrounds(const PlayedMotion& played, double mu) {
  std::vector<std::pair<std::string, std::string>> amiss;
  for (const Ground& ground : kGrounds) {
    OdeRobot robot(played.motion(), played.gains(), GroundOf(played.motion(), ground, mu), {},
                   kStep_s);
    amiss.emplace_back(ground.name, played.Play(robot));
  }
  return testing::CellOf(amiss);
}

std::vector<std::string> Frictions() {
  std::vector<std::string> heads;
  for (const double mu : kFrictions) heads.push_back(fmt::format("mu {}", mu));
  return heads;
}
std::vector<std::string> WithEveryFriction(const PlayedMotion& played) {
  std::vector<std::string> cells;
  for (const double mu : kFrictions) cells.push_back(OnGrounds(played, mu));
  return cells;
}

TEST(MotionsInOde, PlayShippedMotionsAsTheDocumentSays) {
  testing::ExpectDocumented(testing::ShippedMotions(), kSource, "motions in ODE", Frictions(),
                            WithEveryFriction);
}

TEST(MotionsInOde, PlayTenCyclesOfTheGaitsAsTheDocumentSays) {
  testing::ExpectDocumented(testing::ShippedGaits(), kSource, "gaits in ODE", Frictions(),
                            WithEveryFriction);
}

TEST(MotionsInOde, CarryAHundredRobotsAsTheDocumentSays) {
  constexpr std::array kHandstands = {testing::Shipped{"handstand.toml", 1},
                                      testing::Shipped{"handstand_wide.toml", 1}};
  struct Column {
    Ground ground;
    double mu;
  };
  static constexpr std::array kColumns = {Column{kGrounds[0], 0.3}, Column{kGrounds[1], 0.3},
                                          Column{kGrounds[3], 0.3}, Column{kGrounds[0], 0.9}};
  std::vector<std::string> heads;
  for (const Column& column : kColumns)
    heads.push_back(fmt::format("{}, mu {}", column.ground.name, column.mu));
  testing::ExpectDocumented(
      kHandstands, kSource, "robots in ODE", heads, [](const PlayedMotion& played) {
        std::vector<std::string> cells;
        for (const Column& column : kColumns) {
          int stand = 0;
          for (const testing::RobotFactors& factors : testing::AHundredRobots(kLinks)) {
            OdeRobot robot(played.motion(), played.gains(),
                           GroundOf(played.motion(), column.ground, column.mu, factors),
                           factors.masses, kStep_s);
            if (played.Play(robot).empty()) ++stand;
          }
          cells.push_back(fmt::format("{}", stand));
        }
        return cells;
      });
}

// The tables are long work; these are of both kinds of motions, and of both ends of the grounds.
TEST(MotionsInOde, AHandstandAndTheRollEndAsPlannedOnSoftAndOnHardGround) {
  for (const char* file : {"handstand_wide.toml", "roll.toml"}) {
    const PlayedMotion played(file);
    for (const Ground& ground : {kGrounds.front(), kGrounds.back()}) {
      OdeRobot robot(played.motion(), played.gains(), GroundOf(played.motion(), ground, 0.3), {},
                     kStep_s);
      EXPECT_EQ(played.Play(robot), "") << file << " on " << ground.name;
    }
  }
}

/// The shipped robot with all joints free, and random states of it far above the ground.
class RobotInTheAir : public ::testing::Test {
 protected:
  RobotInTheAir()
      : robot_(played_.motion().scene().robot), dynamics_([this] {
          for (Dof<Plane>& dof : robot_.tree.dofs) dof.prescribed = false;
          return robot_.tree;
        }()) {}

  void Draw() {
    for (double& x : q_) x = 2 * any_(random_);
    for (double& x : qd_) x = 5 * any_(random_);
    q_[1] = 3;
    for (double& x : torques_) x = 5 * any_(random_);
  }
  /// What the equations of motion say of a state.
  std::vector<double> Accelerations(const std::vector<double>& q, const std::vector<double>& qd,
                                    const std::vector<double>& torques) {
    std::vector<double> qdd(5), tau = {0, 0, 0, torques[0], torques[1]};
    dynamics_.SetState(q, qd);
    dynamics_.Solve(qdd, tau);
    return qdd;
  }
  OdeRobot InOde(const DriveGains& gains, double step_s) {
    return {played_.motion(), gains, {0.3, 0, 0}, {}, step_s};
  }

  PlayedMotion played_{"handstand.toml"};
  PlanarRobot robot_;
  HybridDynamics<Plane> dynamics_;
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> any_{-1, 1};
  std::vector<double> q_ = std::vector<double>(5), qd_ = std::vector<double>(5),
                      torques_ = std::vector<double>(2);
};

TEST_F(RobotInTheAir, AcceleratesFromRestAsOurDynamicsSay) {
  constexpr double kShort_s = 0.01;
  OdeRobot engine = InOde({0, 0}, kShort_s);
  for (int trial = 0; trial < 200; ++trial) {
    Draw();
    std::ranges::fill(qd_, 0.0);
    engine.Set(q_, qd_);
    engine.Step(torques_);
    const std::vector<double> qdd = Accelerations(q_, qd_, torques_), v = engine.Velocities();
    for (std::size_t i = 2; i < 5; ++i)
      EXPECT_NEAR(v[i] / kShort_s, qdd[i], 1e-9 * (1 + std::abs(qdd[i]))) << i;
  }
}

// The velocity at a step's end meets the constraints of its beginning. What the links' turning adds
// comes with the mending of the next steps, so that the third is looked at.
TEST_F(RobotInTheAir, AcceleratesInMotionAsOurDynamicsSay) {
  constexpr double kShort_s = 1e-5;
  OdeRobot engine = InOde({0, 0}, kShort_s);
  for (int trial = 0; trial < 200; ++trial) {
    Draw();
    engine.Set(q_, qd_);
    for (int step = 0; step < 3; ++step) engine.Step(torques_);
    const std::vector<double> q = engine.Positions(), before = engine.Velocities();
    engine.Step(torques_);
    const std::vector<double> qdd = Accelerations(q, before, torques_), after = engine.Velocities();
    double scale = 1;
    for (const double a : qdd) scale = std::max(scale, std::abs(a));
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR((after[i] - before[i]) / kShort_s, qdd[i], 5e-5 * scale) << i;
  }
}

TEST_F(RobotInTheAir, FallsAndMovesItsLegsAsOurDynamicsSay) {
  constexpr double kFall_s = 0.95;
  constexpr int kSteps = 4750;
  const DriveGains gains{40, 5};
  const std::vector<double> ctrl = {30, -25};
  OdeRobot engine = InOde(gains, kStep_s);
  for (int trial = 0; trial < 5; ++trial) {
    Draw();
    q_[1] = 10;
    engine.Set(q_, qd_);
    for (int step = 0; step < kSteps; ++step) engine.Step(ctrl);
    // The same with the method of Runge and Kutta.
    std::vector<double> q = q_, qd = qd_;
    const auto rates = [&](const std::vector<double>& at, const std::vector<double>& v) {
      std::vector<double> torques(2);
      for (std::size_t j = 0; j < 2; ++j) {
        torques[j] =
            std::clamp(ctrl[j] - gains.kp_nm_per_rad * at[3 + j] - gains.kd_nm_s_per_rad * v[3 + j],
                       -8.0, 8.0);
      }
      return Accelerations(at, v, torques);
    };
    const auto moved = [](const std::vector<double>& from, const std::vector<double>& by,
                          double times) {
      std::vector<double> to = from;
      for (std::size_t i = 0; i < to.size(); ++i) to[i] += times * by[i];
      return to;
    };
    for (int step = 0; step < kSteps; ++step) {
      const std::vector<double> a1 = rates(q, qd), v2 = moved(qd, a1, kStep_s / 2);
      const std::vector<double> a2 = rates(moved(q, qd, kStep_s / 2), v2),
                                v3 = moved(qd, a2, kStep_s / 2);
      const std::vector<double> a3 = rates(moved(q, v2, kStep_s / 2), v3),
                                v4 = moved(qd, a3, kStep_s);
      const std::vector<double> a4 = rates(moved(q, v3, kStep_s), v4);
      for (std::size_t i = 0; i < 5; ++i) {
        q[i] += kStep_s / 6 * (qd[i] + 2 * v2[i] + 2 * v3[i] + v4[i]);
        qd[i] += kStep_s / 6 * (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i]);
      }
    }
    // Of the fall g t h / 2 = 0.9 mm is missing, since the engine moves bodies with the velocity at
    // a step's end.
    const std::vector<double> in_ode = engine.Positions();
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR(in_ode[i], q[i] - (i == 1 ? 0.5 * 9.81 * kFall_s * kStep_s : 0), 4e-4) << i;
  }
}

}  // namespace
}  // namespace tumbler
