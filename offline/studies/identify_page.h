#pragma once

#include <span>
#include <string>
#include <vector>

#include "offline/studies/robot_fit.h"

namespace tumbler {

/// A page about a fit, complete in itself and without scripts: the verdict, a table of every
/// quantity with its interval and the share of the prior that is left, what goes together, the
/// residuals of each record by joint and time, and how well a record that was held out is
/// predicted.
/// @param held_out  residuals of records that were not fitted; empty: none.
std::string IdentifyPage(const FitOutcome& fit, const FitSettings& settings,
                         std::span<const FitResiduals> held_out);

}  // namespace tumbler
