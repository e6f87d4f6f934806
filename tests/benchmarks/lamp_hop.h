#pragma once

#include <memory>
#include <string_view>

#include "offline/problem/task_toml.h"
#include "offline/solver/solver.h"
#include "tests/support/files.h"
#include "tests/support/lamp_contact.h"

namespace tumbler {

/// Finds the hop of the shipped lamp from nothing, with the general contact model or with the one
/// written for the lamp alone. With this seed both take the same way, within rounding.
class LampHop {
 public:
  LampHop() : problem_(LoadTask(testing::SourcePath("primitives/tasks/lamp_hop.toml")).problem) {
    problem_.search.seed = 4;
  }
  [[nodiscard]] SolveOutcome Find(bool general) const {
    SolveOptions options;
    if (!general)
      options.contact = [this] { return std::make_unique<LampContact>(problem_.scene.contact); };
    return Solve(problem_, options);
  }

 private:
  Problem problem_;
};

}  // namespace tumbler
