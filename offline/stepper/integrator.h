#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "offline/stepper/even_steps.h"
#include "offline/stepper/tableau.h"

namespace tumbler {

/// How an Integrator goes through time.
struct StepSettings {
  enum class Scheme {
    kFixed,     ///< The classical Runge-Kutta method of order 4, in EvenSteps.
    kAdaptive,  ///< Dormand and Prince's 5(4) pair; the error of each number of the state decides
                ///< how long a step is.
  };
  Scheme scheme = Scheme::kFixed;
  double step_s = 1e-3;  ///< The fixed step; the longest of the adaptive ones, which must not
                         ///< jump over a contact: a foot at 3 m/s crosses a 4 mm layer in 1.3 ms.
  double tolerance = 1e-10;       ///< Adaptive: of each of the equations, relative to 1 + its size.
  double shortest_step_s = 1e-7;  ///< Adaptive: taken whatever the error, and counted.
};

/// What an integration took.
struct IntegrationStatistics {
  std::int64_t evaluations = 0;  ///< Of the right side, rejected steps included.
  std::int64_t steps = 0;        ///< Accepted.
  std::int64_t rejected = 0;
  std::int64_t forced = 0;  ///< At the shortest step, with an error above the tolerance.
};

/// Integrates z' = f(t, z) of many equations, such as states together with their derivatives in
/// every parameter. No heap after construction. Not thread-safe.
///
/// What is integrated is given to Integrate:
///   slope(t, z, out)   writes f(t, z);
///   look()             is called at the start of every step, right after its slope there: what
///                      that has left behind is of the start;
///   plausible(z)       says of every accepted step whether to go on.
class Integrator {
 public:
  Integrator(const StepSettings& settings, std::size_t equations);

  /// z; whoever integrates sets it first.
  [[nodiscard]] std::vector<double>& state() { return state_; }
  [[nodiscard]] const std::vector<double>& state() const { return state_; }
  [[nodiscard]] const IntegrationStatistics& statistics() const { return statistics_; }
  void ResetStatistics() { statistics_ = {}; }

  /// Takes z from `begin` on through a span in which f is smooth. @returns false when the state
  /// was not plausible.
  template <class Slope, class Look, class Plausible>
  bool Integrate(double begin, double span, Slope&& slope, Look&& look, Plausible&& plausible) {
    if (span <= 0) return true;
    return settings_.scheme == StepSettings::Scheme::kFixed
               ? IntegrateFixed(begin, span, slope, look, plausible)
               : IntegrateAdaptively(begin, span, slope, look, plausible);
  }

 private:
  template <class Slope, class Look, class Plausible>
  bool IntegrateFixed(double begin, double span, Slope& slope, Look& look, Plausible& plausible) {
    const EvenSteps steps(span, settings_.step_s, 1);
    for (int step = 0; step < steps.count; ++step) {
      const double t = begin + step * steps.step_s;
      Evaluate(slope, t, state_, 0);
      look();
      TakeStep(slope, t, steps.step_s, begin + (step + 1) * steps.step_s);
      state_.swap(next_);
      ++statistics_.steps;
      if (!plausible(state_)) return false;
    }
    return true;
  }

  template <class Slope, class Look, class Plausible>
  bool IntegrateAdaptively(double begin, double span, Slope& slope, Look& look,
                           Plausible& plausible) {
    const double finish = begin + span;
    double t = begin;
    double h = std::min(settings_.step_s, span);
    Evaluate(slope, t, state_, 0);
    while (t < finish) {
      look();
      for (;;) {
        // A last step that leaves a crumb would be followed by one of rounding's length.
        const bool last = t + 1.001 * h >= finish;
        if (last) h = finish - t;
        const double t_end = last ? finish : t + h;
        TakeStep(slope, t, h, t_end);
        const double error = StepError(h);
        const double factor = std::clamp(0.9 * std::pow(error, -1 / tableau_.order), 0.2, 5.0);
        const bool shortest = h <= settings_.shortest_step_s;
        if (error <= 1 || shortest) {
          if (error > 1) ++statistics_.forced;
          t = t_end;
          h = std::clamp(factor * h, settings_.shortest_step_s, settings_.step_s);
          break;
        }
        ++statistics_.rejected;
        h = std::max(factor * h, settings_.shortest_step_s);
      }
      state_.swap(next_);
      slopes_[0].swap(slopes_[tableau_.stages - 1]);  // The first of the next is the last of this.
      ++statistics_.steps;
      if (!plausible(state_)) return false;
    }
    return true;
  }

  template <class Slope>
  void Evaluate(Slope& slope, double t, const std::vector<double>& z, std::size_t stage) {
    ++statistics_.evaluations;
    slope(t, z, slopes_[stage]);
  }

  /// Stages after the first, then `next_`.
  template <class Slope>
  void TakeStep(Slope& slope, double t, double h, double t_end) {
    for (std::size_t s = 1; s < tableau_.stages; ++s) {
      Combine(h, tableau_.a[s], s, stage_state_);
      const double c = tableau_.c[s];
      Evaluate(slope, c == 1 ? t_end : t + c * h, stage_state_, s);
    }
    Combine(h, tableau_.b, tableau_.stages, next_);
  }

  /// z + h sum_k w_k slopes_k over the first `count` stages.
  void Combine(double h, const Tableau::Row& w, std::size_t count, std::vector<double>& out) const;

  /// Largest estimated error of the step just taken, in tolerances.
  [[nodiscard]] double StepError(double h) const;

  StepSettings settings_;
  const Tableau& tableau_;
  std::vector<double> state_, stage_state_, next_;
  std::array<std::vector<double>, Tableau::kMaxStages> slopes_;
  IntegrationStatistics statistics_;
};

}  // namespace tumbler
