// The longest period of a drive's loop with which its damping is stable, compared with robots whose
// torques are computed once in a period.

#include "offline/scene/drive_damping.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/core/damping_bound.h"
#include "common/core/index.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/damped_motion.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/twin/damping_notes.h"
#include "tests/support/files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

Problem Handstand(double rotor_inertia_kg_m2) {
  const std::string task = testing::Replaced(
      testing::ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml")),
      "rotor_inertia_kg_m2 = 0.001",
      "rotor_inertia_kg_m2 = " + std::to_string(rotor_inertia_kg_m2));
  return ParseTask(task, "task.toml", testing::ShippedRobot(), "robot.urdf").problem;
}

/// The largest error after so many periods, over the one at the start, of a robot that floats with
/// its joints at these positions, and drives that compute their torques once in a period and hold
/// them. Between two samples the robot moves by the classical Runge-Kutta method.
class SampledRobot {
 public:
  SampledRobot(const Problem& problem, std::vector<double> q, std::vector<double> kd, double kp)
      : tree_(Floating(problem)),
        dynamics_(tree_),
        n_(tree_.dofs.size()),
        kd_(std::move(kd)),
        kp_(kp) {
    for (const ActuatedJoint& joint : problem.joints) dofs_.push_back(Index(joint.dof));
    std::copy(q.begin(), q.end(), rest_.begin());
  }

  double Growth(double period_s, int periods) {
    constexpr double kPush = 1e-4;  // [rad/s]
    constexpr int kParts = 4;
    Numbers q = rest_, v{};
    for (std::size_t j = 0; j < dofs_.size(); ++j) v[dofs_[j]] = kPush * (j % 2 == 0 ? 1 : -0.7);
    double last = 0;
    for (int i = 0; i < periods; ++i) {
      Numbers tau{};
      for (std::size_t j = 0; j < dofs_.size(); ++j)
        tau[dofs_[j]] = kp_ * (rest_[dofs_[j]] - q[dofs_[j]]) - kd_[j] * v[dofs_[j]];
      for (int part = 0; part < kParts; ++part) Step(q, v, tau, period_s / kParts);
      if (i + 20 < periods) continue;
      for (const std::size_t dof : dofs_) last = std::max(last, std::abs(v[dof]));
      if (!(last < 1)) break;
    }
    return last / kPush;
  }

 private:
  using Numbers = std::array<double, Plane::kMaxDofs>;

  static Tree<Plane> Floating(const Problem& problem) {
    Tree<Plane> tree = problem.scene.robot.tree;
    tree.gravity = Plane::Vector::Zero();
    for (Dof<Plane>& dof : tree.dofs) {
      dof.prescribed = false;
      dof.damping_nm_s_per_rad = 0;
    }
    return tree;
  }
  Numbers Accelerations(const Numbers& q, const Numbers& v, Numbers tau) {
    Numbers qdd{};
    dynamics_.SetState({q.data(), n_}, {v.data(), n_});
    dynamics_.Solve({qdd.data(), n_}, {tau.data(), n_});
    return qdd;
  }
  void Step(Numbers& q, Numbers& v, const Numbers& tau, double h) {
    const auto plus = [this](const Numbers& a, double s, const Numbers& b) {
      Numbers sum = a;
      for (std::size_t i = 0; i < n_; ++i) sum[i] += s * b[i];
      return sum;
    };
    const Numbers a1 = Accelerations(q, v, tau), v1 = v;
    const Numbers v2 = plus(v, h / 2, a1), a2 = Accelerations(plus(q, h / 2, v1), v2, tau);
    const Numbers v3 = plus(v, h / 2, a2), a3 = Accelerations(plus(q, h / 2, v2), v3, tau);
    const Numbers v4 = plus(v, h, a3), a4 = Accelerations(plus(q, h, v3), v4, tau);
    for (std::size_t i = 0; i < n_; ++i) {
      q[i] += h / 6 * (v1[i] + 2 * v2[i] + 2 * v3[i] + v4[i]);
      v[i] += h / 6 * (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i]);
    }
  }

  Tree<Plane> tree_;
  HybridDynamics<Plane> dynamics_;
  std::size_t n_;
  std::vector<double> kd_;
  double kp_;
  std::vector<std::size_t> dofs_;
  Numbers rest_{};
};

double RateOf(const Problem& problem, const std::vector<double>& q, const std::vector<double>& kd) {
  std::vector<int> dofs;
  for (const ActuatedJoint& joint : problem.joints) dofs.push_back(joint.dof);
  return DriveDamping(problem.scene, dofs, kd).RateAt(q);
}

TEST(DriveDamping, GrowsJustAboveTheBoundAndDecaysJustBelow) {
  const Problem problem = Handstand(0.001);
  for (const auto& [leg1, leg2] : {std::pair{0.0, 0.0}, {-1.2, 0.7}, {0.4, 2.0}}) {
    const std::vector<double> q = {0.3, 0.5, 0.9, leg1, leg2};
    for (const std::vector<double>& kd :
         {std::vector<double>{5, 5}, std::vector<double>{1, 5}, std::vector<double>{4, 0.5}}) {
      const double bound_s = LongestDampedPeriod(RateOf(problem, q, kd));
      for (const double kp : {0.0, 40.0}) {
        SampledRobot robot(problem, q, kd, kp);
        EXPECT_LT(robot.Growth(0.97 * bound_s, 400), 1) << leg1 << ' ' << kd[0] << ' ' << kp;
        EXPECT_GT(robot.Growth(1.03 * bound_s, 400), 100) << leg1 << ' ' << kd[0] << ' ' << kp;
      }
    }
  }
}

TEST(DriveDamping, OfTheShippedRobotWithStraightLegsHasTheBoundThatWasMeasured) {
  // In MuJoCo and DART, and by hand: 0.83 ms, and 0.43 ms without the rotor.
  const std::vector<double> straight(5);
  EXPECT_NEAR(LongestDampedPeriod(RateOf(Handstand(0.001), straight, {5, 5})), 0.83e-3, 0.01e-3);
  EXPECT_NEAR(LongestDampedPeriod(RateOf(Handstand(0), straight, {5, 5})), 0.43e-3, 0.01e-3);
}

TEST(DriveDamping, DoesNotDependOnWhereTheRootIs) {
  const Problem problem = Handstand(0.001);
  EXPECT_NEAR(RateOf(problem, {0, 0, 0, 0.3, -0.8}, {5, 3}),
              RateOf(problem, {7, -2, 2.1, 0.3, -0.8}, {5, 3}), 1e-6);
}

std::vector<std::string> NotesOf(double kd, double loop_hz, std::optional<std::int64_t> step_ns) {
  const SimulatedMotion motion(LoadMotion(testing::SourcePath("primitives/handstand.toml")));
  DrivesConfig drives = DefaultDrives({"leg1", "leg2"}, 40, kd);
  for (DriveEntry& drive : drives.drives) drive.loop_hz = loop_hz;
  if (!step_ns) return DampingNotes(motion, drives, nullptr);
  TwinConfig twin;
  twin.step_ns = *step_ns;
  return DampingNotes(motion, drives, &twin);
}

TEST(DampingNotes, WarnFromHalfOfTheBoundOn) {
  const std::vector<std::string> slow = NotesOf(5, 1000, 1'000'000);
  ASSERT_EQ(slow.size(), 5U) << "of both drives, of the twin, and of its feet";
  EXPECT_THAT(slow[0], HasSubstr("kd of 5 N m s/rad is stable in drives whose loop takes less"));
  EXPECT_THAT(slow[1], HasSubstr("warning: joint leg1: the drive's own loop takes 1 ms, with which "
                                 "the damping is unstable"));
  EXPECT_THAT(slow[3], HasSubstr("warning: step_s of the twin, which computes the drives' law"));
  EXPECT_THAT(slow[4], HasSubstr("warning: step_s of the twin takes 1 ms, and contact allows 0.8"));
  const std::vector<std::string> near = NotesOf(5, 2000, std::nullopt);
  ASSERT_EQ(near.size(), 3U);
  EXPECT_THAT(near[1], HasSubstr("more than is advised"));
  EXPECT_EQ(NotesOf(5, 20'000, 50'000).size(), 1U);
  EXPECT_EQ(NotesOf(1, 1000, 500'000).size(), 1U) << "less damping bears a slower loop";
}

TEST(DampingNotes, SayOfWhichDrivesTheRateOfTheLoopIsNotKnown) {
  EXPECT_THAT(NotesOf(5, 0, 50'000).front(), HasSubstr("is not known of leg1, leg2"));
  EXPECT_THAT(NotesOf(5, 40'000, 50'000).front(), Not(HasSubstr("not known")));
  EXPECT_THAT(NotesOf(0, 0, 50'000), IsEmpty()) << "there is no damping";
}

}  // namespace
}  // namespace tumbler
