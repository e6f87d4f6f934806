#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tumbler {

/// Counts durations in bins of 1 us up to 1 ms, and in one bin beyond. The largest duration is kept
/// exactly. Fixed size, one writer.
class DurationHistogram {
 public:
  static constexpr std::size_t kBins = 1000;  ///< Bin i counts durations in [i, i + 1) us.

  void Add(std::int64_t duration_ns) noexcept {
    const std::int64_t duration = std::max<std::int64_t>(duration_ns, 0);
    const auto bin = static_cast<std::size_t>(duration / 1000);
    ++bins_[std::min(bin, kBins)];
    ++count_;
    max_ns_ = std::max(max_ns_, duration);
  }

  [[nodiscard]] std::int64_t count() const noexcept { return count_; }
  [[nodiscard]] std::int64_t max_ns() const noexcept { return max_ns_; }

  /// The duration below which a share of all durations lies, rounded up to whole microseconds, but
  /// at most the largest one; 0 when nothing was counted.
  /// @param share  0 ... 1, e.g. 0.999.
  [[nodiscard]] std::int64_t PercentileNs(double share) const noexcept {
    const double wanted = share * static_cast<double>(count_);
    std::int64_t below = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      below += bins_[bin];
      if (below > 0 && static_cast<double>(below) >= wanted) {
        return std::min(static_cast<std::int64_t>(bin + 1) * 1000, max_ns_);
      }
    }
    return max_ns_;
  }

  [[nodiscard]] std::span<const std::int64_t> bins() const noexcept { return bins_; }
  /// How many durations were a millisecond or more.
  [[nodiscard]] std::int64_t beyond() const noexcept { return bins_[kBins]; }

 private:
  std::array<std::int64_t, kBins + 1> bins_{};
  std::int64_t count_ = 0;
  std::int64_t max_ns_ = 0;
};

/// Counts the ages of replies: 0 ... 14 ticks, older ones, and replies that never came.
class ReplyAgeHistogram {
 public:
  static constexpr std::size_t kBins = 15;

  /// @param age_ticks  negative: a reply never came.
  void Add(std::int32_t age_ticks) noexcept {
    ++bins_[age_ticks < 0 ? kBins + 1 : std::min(static_cast<std::size_t>(age_ticks), kBins)];
    max_ = std::max(max_, age_ticks);
  }
  /// @param age_ticks  0 ... 15; 15 stands for all older ones too.
  [[nodiscard]] std::int64_t count(std::size_t age_ticks) const noexcept {
    return bins_[age_ticks];
  }
  [[nodiscard]] std::int64_t never() const noexcept { return bins_[kBins + 1]; }
  /// The largest age [ticks]; -1 when no reply was counted.
  [[nodiscard]] std::int32_t max() const noexcept { return max_; }

 private:
  std::array<std::int64_t, kBins + 2> bins_{};
  std::int32_t max_ = -1;
};

}  // namespace tumbler
