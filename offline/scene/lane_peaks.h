#pragma once

#include <array>
#include <cstddef>

#include "common/core/exponential.h"
#include "common/core/scalar.h"
#include "offline/scene/lane_plan_kernel.h"
#include "offline/scene/lane_steps.h"
#include "offline/scene/vectors.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// The smooth maximum of some lanes' quantity. Every lane gets the bits that SmoothMaximum gives
/// it, whatever the others have.
template <class P, class S, typename LanePeaks<P>::Of kOf>
class LanePeaksRun {
  static constexpr std::size_t kGroup = StepPoints::kGroup;
  static constexpr bool kOfSize = kOf == LanePeaks<P>::Of::kSize;

 public:
  LanePeaksRun(const LanePlan& plan, LanePeaks<P>& peaks, LanesFrom<S> lanes)
      : plan_(plan), peaks_(peaks), lanes_(lanes), largest_(S(0)), sum_(S(0)) {}

  void Run() {
    const S highest = FindSizes();
    lanes_.Put(S(0), peaks_.largest);
    lanes_.Put(S(0), peaks_.sum);
    const S deep = kOfSize ? S(1) : Select(ExponentOf(highest) < S(peaks_.shallow), S(0), S(1));
    if (!Any(S(0) < deep)) return;
    // The largest at a stage is at least so far above what is left out.
    const S least = highest + S(peaks_.negligible / (peaks_.sharpness * (1 / peaks_.unit)));
    for (std::size_t step = 0; step < plan_.steps.size(); ++step) {
      const StepPoints& looks = *peaks_.looks[step];
      const S counts = Select(lanes_(peaks_.sizes[step]) * S(looks.growth) < least, S(0), deep);
      if (Any(S(0) < counts)) Add(step, looks, counts);
    }
    lanes_.Put(largest_, peaks_.largest);
    lanes_.Put(sum_, peaks_.sum);
  }

 private:
  static S SizeOf(const S& value) { return Max(value, -value); }

  [[nodiscard]] S At(std::size_t stage) const {
    return lanes_(peaks_.quantity[stage * peaks_.count + peaks_.which]);
  }

  /// @returns the largest at any stage.
  S FindSizes() {
    S highest(0), at_start(0);
    for (std::size_t step = 0; step < plan_.steps.size(); ++step) {
      S size = SizeOf(At(step * plan_.stages));
      at_start = Max(at_start, size);
      for (std::size_t s = 1; s < plan_.stages; ++s)
        size = Max(size, SizeOf(At(step * plan_.stages + s)));
      highest = Max(highest, size);
      lanes_.Put(size, peaks_.sizes[step]);
    }
    lanes_.Put(at_start, peaks_.at_start);
    return highest;
  }

  /// Of a contact that is so deep, in SmoothDepth.
  [[nodiscard]] S ExponentOf(const S& depth) const {
    return S(peaks_.sharpness) * (depth / S(peaks_.unit) - S(peaks_.least));
  }

  /// What the maximum is of, at a stage.
  [[nodiscard]] S ValueAt(std::size_t stage) const {
    if constexpr (kOfSize) {
      return At(stage) / S(peaks_.unit);
    } else {
      const S exponent = ExponentOf(At(stage));
      const S other = portable::Log1pBelowOne(Power(-SizeOf(exponent)));
      return Select(exponent < S(peaks_.shallow), S(0), Max(exponent, S(0)) + other) /
             S(peaks_.sharpness);
    }
  }

  /// The sizes at a group's points, up to those without weight; 0 in lanes in which the step does
  /// not count.
  void SizesAt(const StepPoints::Group& group, const S& counts, S* size) const {
    for (std::size_t i = 0; i < kGroup; ++i) {
      size[i] = S(0);
      if (!(group.part[i] > 0)) continue;
      S sum(0);
      for (std::size_t s = 0; s < plan_.stages; ++s) sum += S(group.of_stage[s][i]) * value_[s];
      size[i] = Select(S(0) < counts, kOfSize ? SizeOf(sum) : Max(sum, S(0)), S(0));
    }
  }

  /// As SmoothMaximum::Add.
  void Add(std::size_t step, const StepPoints& looks, const S& counts) {
    const S before = largest_, rho(peaks_.sharpness);
    for (std::size_t s = 0; s < plan_.stages; ++s) value_[s] = ValueAt(step * plan_.stages + s);
    S size[kGroup];
    for (const StepPoints::Group& group : looks.groups) {
      SizesAt(group, counts, size);
      for (std::size_t i = 0; i < kGroup; ++i) largest_ = Max(largest_, size[i]);
    }
    sum_ = sum_ * Power(rho * (before - largest_));
    const S top = rho * largest_;
    const S least = Select(S(0) < counts, top + S(peaks_.nothing), S(kBeyondAll));
    const S unit = kOfSize ? S(0) : Power(-top);
    const double share = plan_.steps[step] / kPeakDuration_s;
    for (const StepPoints::Group& group : looks.groups) {
      if (looks.groups.size() > 1) SizesAt(group, counts, size);
      for (std::size_t i = 0; i < kGroup && group.part[i] > 0; ++i) {
        const S exponent = rho * size[i];
        const S term = kOfSize ? Power(exponent - top) : AboveZero(exponent, top, unit);
        sum_ += Select(exponent < least, S(0), S(share * group.part[i]) * term);
      }
    }
  }

  /// exp(exponent - top) - exp(-top).
  static S AboveZero(const S& exponent, const S& top, const S& unit) {
    const auto small = exponent < S(1);
    S term(0);
    if (Any(S(0) < Select(small, S(0), S(1)))) term = Power(exponent - top) - unit;
    // The difference of two numbers near one would be rounding.
    if (Any(small)) term = Select(small, portable::Expm1BelowOne(Min(exponent, S(1))) * unit, term);
    return term;
  }

  /// Of a number that is not positive. What vanishes in any sum may be larger than it is.
  static S Power(const S& exponent) { return portable::ExpBelowZero(Max(exponent, S(kVanishes))); }

  static constexpr double kBeyondAll = 1e300, kVanishes = -700;

  const LanePlan& plan_;
  LanePeaks<P>& peaks_;
  LanesFrom<S> lanes_;
  std::array<S, Tableau::kMaxStages> value_;  // in the present step
  S largest_, sum_;
};

/// Adapts LanePlanKernel::find_peaks.
template <class P, class S>
void FindLanePeaks(const LanePlan& plan, LanePeaks<P>& peaks) {
  using Of = typename LanePeaks<P>::Of;
  for (std::size_t first = 0; first < kLanesOf<P>; first += LanesFrom<S>::kLanes) {
    if (peaks.of == Of::kSize) {
      LanePeaksRun<P, S, Of::kSize>(plan, peaks, LanesFrom<S>(first)).Run();
    } else {
      LanePeaksRun<P, S, Of::kDepth>(plan, peaks, LanesFrom<S>(first)).Run();
    }
  }
}

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
