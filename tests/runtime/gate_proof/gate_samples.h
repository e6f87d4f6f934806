#pragma once

// Inputs of the last gate: any floats, and such as lie on its bounds and beside them.

#include <cstdint>
#include <cstring>

namespace tumbler {

/// The arguments of LimitSetpoint.
struct GateInput {
  float limits[6];  ///< In the order of SafetyLimits.
  float planned[3];
  float previous[3];
  std::int32_t ticks;
};

/// What it returns.
struct GateOutput {
  float setpoint[3];
  bool changed;
  bool non_finite;
};

/// A series of inputs: the same on every machine, from the same seed.
class GateSamples {
 public:
  explicit GateSamples(std::uint64_t seed) noexcept : state_(seed) {}

  /// @param legal  whether the limits are some that MakeSafetyLimits makes, the previous setpoint
  /// is
  ///               finite, and at least one tick has passed. Else all are any floats.
  GateInput Next(bool legal) noexcept {
    GateInput in;
    for (float& x : in.limits) x = legal ? Finite() : Any();
    for (float& x : in.previous) x = legal ? Finite() : Any();
    in.ticks = Below(4) == 0 ? static_cast<std::int32_t>(Bits() & 0x7fffffffU) | 1
                             : static_cast<std::int32_t>(1 + Below(3));
    if (!legal && Below(8) == 0) in.ticks = static_cast<std::int32_t>(Bits());
    if (legal) {
      if (in.limits[0] > in.limits[1]) Swap(in.limits[0], in.limits[1]);
      for (int i = 2; i < 6; ++i) in.limits[i] = in.limits[i] < 0 ? -in.limits[i] : in.limits[i];
      if (Below(4) != 0) in.previous[0] = Between(in.limits[0], in.limits[1]);
      if (Below(4) != 0) in.previous[2] = Between(-in.limits[3], in.limits[3]);
    }
    const auto ticks = static_cast<float>(in.ticks);
    for (int i = 0; i < 3; ++i) {
      const float step = in.limits[i == 0 ? 4 : 5] * ticks;
      const float bounds[] = {in.limits[0],   in.limits[1],          in.limits[2],
                              -in.limits[2],  in.limits[3],          -in.limits[3],
                              in.previous[i], in.previous[i] - step, in.previous[i] + step};
      in.planned[i] = Below(3) == 0 ? Any() : bounds[Below(9)];
      if (Below(3) == 0) in.planned[i] = Beside(in.planned[i]);
      if (legal && Below(2) == 0)
        in.planned[i] = i == 0   ? Between(in.limits[0], in.limits[1])
                        : i == 1 ? Between(-in.limits[2], in.limits[2])
                                 : Between(-in.limits[3], in.limits[3]);
    }
    return in;
  }

 private:
  static void Swap(float& a, float& b) noexcept {
    const float c = a;
    a = b;
    b = c;
  }
  static float Float(std::uint32_t bits) noexcept {
    float x = 0;
    std::memcpy(&x, &bits, sizeof x);
    return x;
  }
  std::uint32_t
  Bits() noexcept {  // Steele, Lea, Flood: Fast splittable pseudorandom number generators.
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15U;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return static_cast<std::uint32_t>(z >> 32U);
  }
  std::uint32_t Below(std::uint32_t count) noexcept { return Bits() % count; }
  static float Beside(float x) noexcept {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    return Float(bits + 1);
  }
  float Any() noexcept {
    constexpr std::uint32_t kSpecial[] = {
        0x00000000U, 0x80000000U, 0x3f800000U, 0xbf800000U, 0x7f800000U, 0xff800000U, 0x7fc00000U,
        0xffc00001U, 0x7f7fffffU, 0xff7fffffU, 0x00000001U, 0x80000001U, 0x00800000U, 0x7fa00000U};
    switch (Below(3)) {
      case 0:
        return Float(kSpecial[Below(14)]);
      case 1:
        return Float(Bits());
      default:
        return Usual();
    }
  }
  // Of the size of an angle.
  float Usual() noexcept { return static_cast<float>(static_cast<std::int32_t>(Bits())) * 1e-9F; }
  float Finite() noexcept {
    float x = Below(8) == 0 ? Any() : Usual();
    while (!(0 * x == 0)) x = Any();
    return x;
  }
  float Between(float low, float high) noexcept {
    const float share = static_cast<float>(Bits() >> 8U) * 0x1p-24F;
    const float x = low + (high - low) * share;
    return x >= low && x <= high ? x : low;
  }

  std::uint64_t state_;
};

}  // namespace tumbler
