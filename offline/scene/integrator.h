#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/functions.h"
#include "offline/scene/even_steps.h"
#include "offline/scene/tableau.h"

namespace tumbler {

/// The scheme and the steps of an Integrator.
struct StepSettings {
  enum class Scheme {
    /// The classical Runge-Kutta method of order 4, in EvenSteps.
    kFixed,
    /// The 5(4) pair of Dormand and Prince. The errors of all numbers of the state decide how long
    /// a step is.
    kAdaptive,
  };
  Scheme scheme = Scheme::kFixed;
  /// The length of fixed steps, and the longest of adaptive ones. An adaptive step must not jump
  /// over a contact: a foot at 3 m/s crosses a layer of 4 mm in 1.3 ms.
  double step_s = 1e-3;
  /// Adaptive: the largest error of each number z of the state in a step, divided by 1 + |z|.
  double tolerance = 1e-10;
  /// Adaptive: a step of this length is taken whatever its error, and counted as forced.
  double shortest_step_s = 1e-7;
};

/// How many evaluations and steps an integration took.
struct IntegrationStatistics {
  /// Evaluations of the right side, those of rejected steps included.
  std::int64_t evaluations = 0;
  /// Accepted steps.
  std::int64_t steps = 0;
  /// Rejected steps.
  std::int64_t rejected = 0;
  /// Steps of the shortest length that were accepted with an error above the tolerance.
  std::int64_t forced = 0;
  /// Rejected steps after which a kink was looked for.
  std::int64_t kinks = 0;
  /// How often the pieces were asked for on that occasion.
  std::int64_t looks = 0;
};

/// Integrates z' = f(t, z) of many equations, such as states together with their derivatives in
/// every parameter. No heap after construction. Not thread-safe.
///
/// The caller gives Integrate four functions:
///   slope(t, z, out)   writes f(t, z);
///   look()             is called at the start of every step, right after the slope there, so that
///                      whatever the slope has left behind belongs to the start of the step;
///   plausible(z)       says after every accepted step whether to go on. The slopes asked for since
///                      look(), by stage, are those of the step, or of tries that were rejected
///                      before it;
///   pieces(t, z)       names the formulas that f consists of there, as a number: it stays the same
///                      where f is smooth.
///
/// Where the pieces change, f has a kink. A step across one has an error that falls with the square
/// of its length only, so that by its error alone it would become a thousand times shorter, again
/// and again until the kink is behind it. So an adaptive step that is rejected, and that begins and
/// ends on different pieces, is tried again with its end on the first kink in it, and after that
/// the steps are as long as before.
class Integrator {
 public:
  /// @param deciding  so many numbers, the first ones of z, decide which pieces f consists of.
  Integrator(const StepSettings& settings, std::size_t equations, std::size_t deciding);

  /// The state z. The caller sets it before Integrate.
  [[nodiscard]] std::vector<double>& state() { return state_; }
  [[nodiscard]] const std::vector<double>& state() const { return state_; }
  [[nodiscard]] const IntegrationStatistics& statistics() const { return statistics_; }
  void ResetStatistics() { statistics_ = {}; }
  /// The stage of the step, in the scheme's tableau, whose slope is asked for, or was last.
  [[nodiscard]] std::size_t stage() const { return stage_; }
  [[nodiscard]] const Tableau& tableau() const { return tableau_; }
  /// Length of the last step that was accepted; of the first one tried, before that [s].
  [[nodiscard]] double last_step_s() const { return last_step_s_; }

  /// Takes z from `begin` on through a span. @returns false when the state was not plausible.
  template <class Slope, class Look, class Plausible, class Pieces>
  bool Integrate(double begin, double span, Slope&& slope, Look&& look, Plausible&& plausible,
                 Pieces&& pieces) {
    if (span <= 0) return true;
    return settings_.scheme == StepSettings::Scheme::kFixed
               ? IntegrateFixed(begin, span, slope, look, plausible)
               : IntegrateAdaptively(begin, span, slope, look, plausible, pieces);
  }

  /// The same through steps of these lengths, whatever their error. They add up to `span`.
  template <class Slope, class Look, class Plausible>
  bool IntegrateThrough(double begin, double span, std::span<const double> steps_s, Slope&& slope,
                        Look&& look, Plausible&& plausible) {
    double t = begin;
    for (std::size_t i = 0; i < steps_s.size(); ++i) {
      const double h = steps_s[i];
      const double t_end = i + 1 == steps_s.size() ? begin + span : t + h;
      last_step_s_ = h;
      if (i == 0 || !tableau_.first_same_as_last) Evaluate(slope, t, state_, 0);
      look();
      TakeStep(slope, t, h, t_end);
      if (tableau_.first_same_as_last) slopes_[0].swap(slopes_[tableau_.stages - 1]);
      t = t_end;
      state_.swap(next_);
      ++statistics_.steps;
      if (!plausible(state_)) return false;
    }
    return true;
  }

 private:
  template <class Slope, class Look, class Plausible>
  bool IntegrateFixed(double begin, double span, Slope& slope, Look& look, Plausible& plausible) {
    const EvenSteps steps(span, settings_.step_s, 1);
    last_step_s_ = steps.step_s;
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

  template <class Slope, class Look, class Plausible, class Pieces>
  bool IntegrateAdaptively(double begin, double span, Slope& slope, Look& look,
                           Plausible& plausible, Pieces& pieces) {
    const double finish = begin + span;
    double t = begin;
    double h = std::min(settings_.step_s, span);
    last_step_s_ = h;
    Evaluate(slope, t, state_, 0);
    while (t < finish) {
      look();
      double before_kink = 0;  // the length of a step that ends on a kink now; 0: it does not
      int kinks = 0;
      for (;;) {
        // A step that ends just before `finish` would be followed by one as short as rounding.
        const bool last = t + 1.001 * h >= finish;
        if (last) h = finish - t;
        const double t_end = last ? finish : t + h;
        TakeStep(slope, t, h, t_end);
        const double error = StepError(h);
        const double factor =
            std::clamp(0.9 * portable::Power(error, -1 / tableau_.order), 0.2, 5.0);
        const bool shortest = h <= settings_.shortest_step_s;
        if (error <= 1 || shortest) {
          if (error > 1) ++statistics_.forced;
          t = t_end;
          last_step_s_ = h;
          h = std::clamp(std::max(factor * h, before_kink), settings_.shortest_step_s,
                         settings_.step_s);
          break;
        }
        ++statistics_.rejected;
        const double to_kink = kinks < kMostKinks ? FindKink(t, h, t_end, pieces) : 0;
        if (to_kink > 0) {
          ++kinks;
          before_kink = std::max(before_kink, h);
          h = to_kink;
          continue;
        }
        before_kink = 0;
        h = std::max(factor * h, settings_.shortest_step_s);
      }
      state_.swap(next_);
      slopes_[0].swap(slopes_[tableau_.stages - 1]);  // The last stage is the next step's first.
      ++statistics_.steps;
      if (!plausible(state_)) return false;
    }
    return true;
  }

  /// The kink of a step is looked for so many times: the polynomial within the step that crosses it
  /// is not exact, and becomes so as the step ends nearer to it.
  static constexpr int kMostKinks = 3;
  /// A kink is found to this accuracy. What a step misses it by adds a relative error of its square
  /// to derivatives, times what N'' is in 1/s^2, some 1e8.
  static constexpr double kKinkTime_s = 1e-8;

  /// Finds the first kink in the step just tried by bisection. @returns the length of a step that
  /// ends right after it; 0 when there is none, or too near the start of the step.
  template <class Pieces>
  double FindKink(double t, double h, double t_end, Pieces& pieces) {
    const std::uint64_t at_start = pieces(t, state_);
    statistics_.looks += 2;
    if (pieces(t_end, next_) == at_start) return 0;
    ++statistics_.kinks;
    double before = 0;
    double after = h;
    while (after - before > kKinkTime_s) {
      const double middle = 0.5 * (before + after);
      Between(h, middle / h);
      ++statistics_.looks;
      (pieces(t + middle, between_) == at_start ? before : after) = middle;
    }
    return after > 3 * kKinkTime_s ? after + kKinkTime_s : 0;
  }

  /// Writes z at a part of the step just tried to `between_`, of the numbers that decide on pieces.
  void Between(double h, double part);

  template <class Slope>
  void Evaluate(Slope& slope, double t, const std::vector<double>& z, std::size_t stage) {
    ++statistics_.evaluations;
    stage_ = stage;
    slope(t, z, slopes_[stage]);
  }

  /// Evaluates the stages after the first, then computes `next_`.
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

  /// Largest estimated error of the step just taken, as a multiple of the tolerance.
  [[nodiscard]] double StepError(double h) const;

  StepSettings settings_;
  const Tableau& tableau_;
  std::vector<double> state_, stage_state_, next_;
  std::vector<double> between_;
  std::array<std::vector<double>, Tableau::kMaxStages> slopes_;
  IntegrationStatistics statistics_;
  std::size_t stage_ = 0;
  double last_step_s_ = 0;
};

}  // namespace tumbler
