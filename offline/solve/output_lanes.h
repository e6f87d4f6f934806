#pragma once

namespace tumbler {

/// Numbers of several outputs that go back through the steps together, one in each lane, in pairs
/// with which the processor computes at once.
class OutputLanes {
  using Pair [[gnu::vector_size(16)]] = double;

 public:
  static constexpr int kCount = 4;

  OutputLanes() = default;  ///< Its numbers are not set.
  static OutputLanes Zero() { return {Pair{}, Pair{}}; }
  double operator[](int i) const { return i < 2 ? low_[i] : high_[i - 2]; }
  void Add(int i, double value) {
    if (i < 2) {
      low_[i] += value;
    } else {
      high_[i - 2] += value;
    }
  }

  friend OutputLanes operator+(const OutputLanes& a, const OutputLanes& b) {
    return {a.low_ + b.low_, a.high_ + b.high_};
  }
  friend OutputLanes operator*(double k, const OutputLanes& a) { return {k * a.low_, k * a.high_}; }
  OutputLanes& operator+=(const OutputLanes& a) { return *this = *this + a; }

 private:
  OutputLanes(Pair low, Pair high) : low_(low), high_(high) {}
  Pair low_, high_;
};

}  // namespace tumbler
