#pragma once

#include <cstdint>

#include "offline/problem/problem.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// When a campaign asks whether motions are as asked: `SolveOptions::accept`.
enum class Asks : std::uint8_t {
  kEarly,  ///< After a few evaluations with the final steps, too.
  kAtEnd,  ///< Of what is solved alone: asking is dear.
};

/// Finds motions without a guess, in stages: samples are drawn and ranked, the best of them
/// screened by a few evaluations, and the best of these solved to their end. The result depends on
/// the problem and its seed alone: threads share the work of a stage, and never decide what comes
/// next.
SolveOutcome RunCampaign(const Problem& problem, const SolveOptions& options,
                         Asks asks = Asks::kEarly);

/// The order of solutions, best first. One that has converged comes before one that has not, unless
/// its cost is more than twice as high.
[[nodiscard]] bool IsBetter(const Solution& a, const Solution& b);

}  // namespace tumbler
