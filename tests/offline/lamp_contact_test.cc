// Compares the general contact model, on the hopping lamp, with one written for the lamp alone.

#include "tests/support/lamp_contact.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/minima.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"
#include "tests/support/random_robot.h"

namespace tumbler {
namespace {

Problem LampProblem() {
  return LoadTask(testing::SourcePath("primitives/tasks/lamp_hop.toml")).problem;
}

/// The outputs of hybrid dynamics with contact, and all their derivatives.
struct Outputs {
  std::vector<double> values;
  std::vector<double> derivatives;
  std::vector<ActiveContact<Plane>> contacts;
};

Outputs Evaluate(const Problem& problem, ContactForces<Plane>& contact, const DynamicsState& s) {
  HybridDynamics<Plane> dynamics(problem.scene.robot.tree);
  std::vector<double> qdd = s.qdd, tau(s.tau.size());
  dynamics.SetState(s.q, s.qd);
  contact.Apply(dynamics);
  dynamics.Solve(qdd, tau);
  contact.Differentiate(dynamics);
  DynamicsDerivatives<Plane> derivatives;
  dynamics.Differentiate(derivatives);
  Outputs out;
  out.values = qdd;
  out.values.insert(out.values.end(), tau.begin(), tau.end());
  for (const auto* block : {&derivatives.q, &derivatives.qd}) {
    for (std::size_t i = 0; i < qdd.size(); ++i) {
      for (std::size_t k = 0; k < qdd.size(); ++k) out.derivatives.push_back((*block)[i][k]);
    }
  }
  for (const ActiveContact<Plane>& active : contact.active()) {
    out.contacts.push_back(active);
    std::vector<double> slopes(qdd.size());
    contact.AddDepthSlopes(dynamics, active, 2, slopes);
    out.derivatives.insert(out.derivatives.end(), slopes.begin(), slopes.end());
  }
  std::vector<double> by_q(qdd.size()), by_qd(qdd.size());
  contact.AddLoadedSlipSlopes(dynamics, 2, by_q, by_qd);
  out.values.push_back(contact.LoadedSlip());
  out.derivatives.insert(out.derivatives.end(), by_q.begin(), by_q.end());
  out.derivatives.insert(out.derivatives.end(), by_qd.begin(), by_qd.end());
  return out;
}

/// The largest difference, divided by the largest number.
double Difference(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double difference = 0, size = 1;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = std::max(difference, std::abs(a[i] - b[i]));
    size = std::max(size, std::abs(b[i]));
  }
  return difference / size;
}

TEST(LampContact, AndTheGeneralModelGiveTheSameMotionAndDerivatives) {
  const Problem problem = LampProblem();
  ContactModel<Plane> general(problem.scene.contact, problem.scene.robot.shapes,
                              problem.scene.obstacles);
  LampContact specific(problem.scene.contact);
  std::mt19937_64 random(7);
  std::set<std::size_t> counts;
  int sticking = 0, sliding = 0, pulling = 0, fading = 0, head = 0;
  for (int i = 0; i < 3000; ++i) {
    DynamicsState s = RandomState(random, 5, 0.1);
    if (i % 3 != 0) s.q[2] = Uniform(random, -0.1, 0.1);  // else any pitch, even on its head
    const Plane::Vector up(0, 1);
    HybridDynamics<Plane> dynamics(problem.scene.robot.tree);
    s.q[1] = 0;
    dynamics.SetState(s.q, s.qd);
    double lowest = 1;
    for (const ContactShape<Plane>& shape : problem.scene.robot.shapes) {
      const Plane::Vector centre =
          dynamics.position(shape.body) + dynamics.rotation(shape.body) * shape.shape.centre;
      lowest = std::min(lowest, up.dot(centre) - shape.shape.radius_m);
    }
    s.q[1] = Uniform(random, -0.003, 0.024) - lowest;  // sometimes just above the layer
    if (i % 2 == 0) {
      for (double& v : s.qd) v *= 0.02;
    }
    const Outputs a = Evaluate(problem, general, s);
    const Outputs b = Evaluate(problem, specific, s);
    ASSERT_EQ(a.contacts.size(), b.contacts.size());
    for (std::size_t k = 0; k < a.contacts.size(); ++k) {
      EXPECT_EQ(a.contacts[k].shape, b.contacts[k].shape);
      EXPECT_NEAR(a.contacts[k].depth_m, b.contacts[k].depth_m, 1e-15);
      EXPECT_LT((a.contacts[k].force - b.contacts[k].force).norm(), 1e-10);
      EXPECT_LT((a.contacts[k].point - b.contacts[k].point).norm(), 1e-15);
      const Plane::Vector force = a.contacts[k].force;
      const double used = std::abs(force.x()) / (problem.scene.contact.mu * force.y());
      pulling += force.y() == 0;
      sticking += used < 0.99;
      sliding += used > 0.99999;
      fading +=
          a.contacts[k].depth_m < problem.scene.contact.d_on_m - problem.scene.contact.d_off_m;
      head += a.contacts[k].shape == 2;
    }
    counts.insert(a.contacts.size());
    EXPECT_LT(Difference(a.values, b.values), 1e-12);
    EXPECT_LT(Difference(a.derivatives, b.derivatives), 1e-10);
  }
  EXPECT_THAT(std::vector<int>({sticking, sliding, pulling, fading, head}),
              ::testing::Each(::testing::Gt(20)))
      << "every branch of the law is taken";
  EXPECT_TRUE(counts.contains(0) && counts.contains(1) && counts.contains(2));
}

/// Solves the shipped task with one of the models.
SolveOutcome Hop(Problem problem, std::uint64_t seed, bool specific) {
  problem.search.seed = seed;
  SolveOptions options;
  options.threads = 2;
  options.contact = [&problem, specific]() -> std::unique_ptr<ContactForces<Plane>> {
    const Scene& scene = problem.scene;
    if (specific) return std::make_unique<LampContact>(scene.contact);
    return std::make_unique<ContactModel<Plane>>(scene.contact, scene.robot.shapes,
                                                 scene.obstacles);
  };
  return Solve(problem, options);
}

class EitherContactModel : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(LampContact, EitherContactModel, ::testing::Range(1, 11));

// With the seeds 3 and 8 rounding, which a search amplifies, leads the two into different valleys:
// each is a hop all the same.
bool EndInOneValley(std::uint64_t seed) { return seed != 3 && seed != 8; }

TEST_P(EitherContactModel, LeadsToTheSameHop) {
  const auto seed = static_cast<std::uint64_t>(GetParam());
  const Problem problem = LampProblem();
  const SolveOutcome general = Hop(problem, seed, false);
  const SolveOutcome specific = Hop(problem, seed, true);
  const Solution &a = general.solutions.front(), &b = specific.solutions.front();
  for (const Solution* solution : {&a, &b}) {
    ASSERT_TRUE(solution->feasible());
    EXPECT_EQ(solution->end, SolveEnd::kConverged);
    EXPECT_LT(solution->rollout.cost, 0.1) << "150 mm further, and upright";
  }
  if (!EndInOneValley(seed)) return;
  ASSERT_EQ(a.x.size(), b.x.size());
  for (std::size_t k = 0; k < a.x.size(); ++k) EXPECT_NEAR(a.x[k], b.x[k], 3e-3) << k;
  EXPECT_NEAR(a.rollout.cost, b.rollout.cost, 1e-5 * a.rollout.cost);
  // The two ways differ, as rounding grows along them, but they are about as long.
  EXPECT_NEAR(static_cast<double>(general.evaluations) / static_cast<double>(specific.evaluations),
              1, 0.2);
}

TEST(LampContact, CannotBeJoinedWithTheForwardGradient) {
  Problem problem = LampProblem();
  problem.solver.gradient = SolverSettings::Gradient::kForward;
  EXPECT_THROW(Rollout(problem, 1e-3, std::make_unique<LampContact>(problem.scene.contact)),
               std::invalid_argument);
}

}  // namespace
}  // namespace tumbler
