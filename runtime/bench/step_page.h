#pragma once

#include <string>
#include <vector>

#include "runtime/bench/bench_tests.h"

namespace tumbler {

/// The step response of one joint, for a page.
struct NamedStep {
  std::string name;  ///< e.g. `drive mit 1 (leg1)`
  StepConfig config;
  StepResult result;
};

/// A page with a drawing of each response and its figures. It needs no network and no script.
std::string StepPage(const std::vector<NamedStep>& steps);

}  // namespace tumbler
