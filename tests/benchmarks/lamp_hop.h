#pragma once

#include <memory>
#include <string_view>

#include "offline/model/contact_model.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"
#include "tests/support/lamp_contact.h"

namespace tumbler {

/// Finds the hop of the shipped lamp from nothing, with the general contact model or with the one
/// written for the lamp alone. Both solves begin alike; rounding then parts their ways.
class LampHop {
 public:
  LampHop() : problem_(LoadTask(testing::SourcePath("primitives/tasks/lamp_hop.toml")).problem) {
    problem_.search.seed = 4;
  }
  /// So few evaluations that the hop is hardly begun: enough to say what one costs.
  static LampHop Begun() {
    LampHop hop;
    hop.problem_.search.max_samples = 20;
    hop.problem_.search.refine = 1;
    hop.problem_.solver.screen_evaluations = 10;
    hop.problem_.solver.max_evaluations = 25;
    return hop;
  }
  [[nodiscard]] SolveOutcome Find(bool general) const {
    SolveOptions options;
    // Both models are given, so that both solves take the same equal steps.
    options.contact = [this, general]() -> std::unique_ptr<ContactForces<Plane>> {
      const Scene& scene = problem_.scene;
      if (!general) return std::make_unique<LampContact>(scene.contact);
      return std::make_unique<ContactModel<Plane>>(scene.contact, scene.robot.shapes,
                                                   scene.obstacles);
    };
    return Solve(problem_, options);
  }

 private:
  Problem problem_;
};

}  // namespace tumbler
