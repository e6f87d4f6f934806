#pragma once

#include "common/core/index.h"

namespace tumbler {

/// Numbers of several outputs that go back through the steps together, one in each lane, in pairs
/// with which the processor computes at once.
template <int kLanes>
class OutputLanes {
  using Pair [[gnu::vector_size(16)]] = double;
  static_assert(kLanes % 2 == 0);

 public:
  static constexpr int kCount = kLanes;

  OutputLanes() = default;  ///< Its numbers are not set.
  static OutputLanes Zero() {
    OutputLanes zero;
    zero.pairs_.fill(Pair{});
    return zero;
  }
  double operator[](int i) const { return pairs_[i / 2][i % 2]; }
  void Add(int i, double value) { pairs_[i / 2][i % 2] += value; }

  friend OutputLanes operator+(OutputLanes a, const OutputLanes& b) { return a += b; }
  friend OutputLanes operator*(double k, OutputLanes a) {
    for (Pair& pair : a.pairs_) pair *= k;
    return a;
  }
  OutputLanes& operator+=(const OutputLanes& a) {
    for (int i = 0; i < kLanes / 2; ++i) pairs_[i] += a.pairs_[i];
    return *this;
  }

 private:
  IntArray<Pair, kLanes / 2> pairs_;
};

}  // namespace tumbler
