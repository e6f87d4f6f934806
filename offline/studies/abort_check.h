#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "offline/studies/abort_study.h"

namespace tumbler {

/// One abort of a check, with the primitive's table and without.
struct CheckedAbort {
  double time_s = 0;
  AbortCause cause = AbortCause::kOperatorStop;
  AbortOutcome with, without;
};

/// How hard the impacts of many aborts are.
struct ImpactFigures {
  double median_m_s = 0, ninetieth_m_s = 0, worst_m_s = 0;
  int rest = 0;  ///< How many robots rest in a pose in which the motion begins or ends.
};
ImpactFigures FiguresOf(const std::vector<CheckedAbort>& aborts, AbortOutcome CheckedAbort::*which);

struct AbortCheckResult {
  std::string name;  ///< Of the primitive.
  AbortStudy study;
  std::vector<CheckedAbort> aborts;

  /// Setpoints outside their limits, in all of them.
  [[nodiscard]] std::int64_t outside_limits() const;
};

/// Aborts the motion of as many robots as the study has, each at a random time by a random cause,
/// late ticks by up to `late_s`, once with the table in the primitive's file and once without: then
/// robots are damped, and brake when the operator stops them. The result does not depend on
/// `threads`. @returns no aborts when it was interrupted.
/// @throws as FindAborts, and Refused when the primitive has no table.
AbortCheckResult CheckAborts(const AbortStudy& study);

std::string ToText(const AbortCheckResult& result);
Json ToJson(const AbortCheckResult& result);

}  // namespace tumbler
