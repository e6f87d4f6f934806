// What rollouts need of a cost's terms.

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "offline/problem/cost_term.h"

namespace tumbler {

double CostTerm::Value(const CostPoint& at) const {
  if (quantity.present()) return quantity.Value(at.q, at.qd, *at.axes);
  if (point.present()) return point.Value(axis(), of_velocity, at.q, at.qd);
  return (of_velocity ? at.qd : at.q)[coordinate()];
}

double CostTerm::Result(const CostPoint& at) const {
  if (quantity.present() && !quantity.IsDefined(at.q, *at.axes))
    return std::numeric_limits<double>::quiet_NaN();
  return quantity.Near(target, Value(at));
}

void CostTerm::AddValueSlopes(double scale, const CostPoint& at, const CostSlopes& slopes) const {
  if (quantity.present()) {
    quantity.AddSlopes(scale, at.q, at.qd, *at.axes, slopes.q, slopes.qd);
  } else if (point.present()) {
    point.AddSlopes(axis(), of_velocity, scale, at.q, at.qd, slopes.q, slopes.qd);
  } else {
    (of_velocity ? slopes.qd : slopes.q)[coordinate()] += scale;
  }
}

std::vector<CostInstant> InstantsOf(std::span<const CostTerm> cost, double duration_s,
                                    double settle_s) {
  const double latest_s = duration_s + settle_s;
  std::vector<double> times;
  for (const CostTerm& term : cost) {
    if (term.when != CostTerm::When::kTime) continue;
    if (!(term.time_s > 0 && term.time_s <= latest_s)) {
      throw std::invalid_argument("a term of the cost is at " + std::to_string(term.time_s) +
                                  " s; allowed: above 0, up to " + std::to_string(latest_s) +
                                  " s, the end of the settle phase");
    }
    times.push_back(term.time_s);
  }
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::vector<CostInstant> instants;
  double before = 0;  // since the start of the phase
  auto time = times.begin();
  for (; time != times.end() && *time < duration_s; before = *time++)
    instants.push_back({CostTerm::When::kTime, *time, false, *time - before});
  instants.push_back({CostTerm::When::kEnd, duration_s, true, duration_s - before});
  before = 0;
  for (; time != times.end(); before = *time++ - duration_s)
    instants.push_back({CostTerm::When::kTime, *time, true, *time - duration_s - before});
  instants.push_back({CostTerm::When::kSettled, latest_s, true, settle_s - before});
  return instants;
}

}  // namespace tumbler
