#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"

namespace tumbler {

/// The best motion for a shipped task, found from nothing. The parameter is the seed.
class FoundMotion : public ::testing::TestWithParam<int> {
 protected:
  /// Solves a shipped task with the parameter as seed.
  void Find(const std::string& task) {
    problem_ = LoadTask(testing::SourcePath("primitives/tasks/") + task).problem;
    problem_.search.seed = static_cast<std::uint64_t>(GetParam());
    SolveOptions options;
    options.threads = 2;
    // As the program does.
    options.accept = [this](const Solution& solution) {
      return LookAgain(problem_, solution.x).acceptable();
    };
    const SolveOutcome outcome = Solve(problem_, options);
    ASSERT_FALSE(outcome.solutions.empty());
    best_ = outcome.solutions.front();
    ASSERT_TRUE(best_.feasible());
    EXPECT_LT(DifferentiateBeside(problem_, best_.x).check.relative_error(), 1e-4);
  }
  [[nodiscard]] std::string ObstacleOf(const ActiveContact<Plane>& contact) const {
    return TouchedName(problem_.scene, contact);
  }
  Problem problem_;
  Solution best_;
};

}  // namespace tumbler
