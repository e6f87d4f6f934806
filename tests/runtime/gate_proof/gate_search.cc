// Looks for inputs for which a gate breaks a promise, in compiled code.
//
//   gate_search SAMPLES SEED    a line for each of kGates: its index, the promise, the input's
//   bits;
//                               or its index and `none`
//   gate_search INDEX BITS...   the promise that gate INDEX breaks for this input, or `none`

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/runtime/gate_proof/gate_samples.h"

namespace tumbler {

using GateFunction = void(const void*, const void*, const void*, int, void*);
extern GateFunction* const kGates[];  // The last one is null.

namespace {

bool IsFinite(float x) { return x - x == 0; }
float Abs(float x) { return x < 0 ? -x : x; }
float Larger(float a, float b) { return a > b ? a : b; }
float Smaller(float a, float b) { return a < b ? a : b; }

// The promises of the gate, as gate_proof.py has them. nullptr: all are kept.
const char* Broken(const GateInput& in, const unsigned char* bytes) {
  GateOutput out;
  std::memcpy(out.setpoint, bytes, sizeof out.setpoint);
  if (bytes[12] > 1 || bytes[13] > 1) return "flags";
  out.changed = bytes[12] != 0;
  out.non_finite = bytes[13] != 0;
  const auto [min, max, velocity_max, torque_max, position_step, torque_step] = in.limits;
  const auto [position, velocity, torque] = out.setpoint;
  const auto ticks = static_cast<float>(in.ticks);
  const float step = position_step * ticks;
  const float rise = torque_step * ticks;
  const float low = in.previous[0] - step;
  const float high = in.previous[0] + step;
  const float weak = in.previous[2] - rise;
  const float strong = in.previous[2] + rise;
  if (!(IsFinite(position) && (position >= min || position >= in.previous[0]) &&
        (position <= max || position <= in.previous[0])))
    return "position";
  if (!(IsFinite(velocity) && Abs(velocity) <= velocity_max)) return "velocity";
  if (!(IsFinite(torque) && (Abs(torque) <= torque_max || Abs(torque) <= Abs(in.previous[2]))))
    return "torque";
  if (!(position >= low && position <= high)) return "position_step";
  if (!(torque >= weak && torque <= strong)) return "torque_step";
  const bool finite = IsFinite(in.planned[0]) && IsFinite(in.planned[1]) && IsFinite(in.planned[2]);
  const bool same =
      position == in.planned[0] && velocity == in.planned[1] && torque == in.planned[2];
  if (out.changed == same || out.non_finite == finite) return "flags";
  // Whether y is the nearest to x of what limits [a, b] and steps [c, d] allow. The steps go first.
  const auto nearest = [](float x, float y, float a, float b, float c, float d) {
    const float top = Larger(c, Smaller(b, d));
    const float bottom = Smaller(d, Larger(a, c));
    return (!(y < x) || y == top) && (!(y > x) || y == bottom);
  };
  if (finite && !(nearest(in.planned[0], position, min, max, low, high) &&
                  nearest(in.planned[1], velocity, -velocity_max, velocity_max, -velocity_max,
                          velocity_max) &&
                  nearest(in.planned[2], torque, -torque_max, torque_max, weak, strong)))
    return "no_more_than_needed";
  if (!finite && !(position == in.previous[0] && velocity == 0 &&
                   nearest(0, torque, weak, strong, weak, strong)))
    return "hold";
  return nullptr;
}

void Print(const GateInput& in) {
  std::uint32_t bits[13];
  std::memcpy(bits, &in, sizeof bits);
  for (const std::uint32_t word : bits) std::printf(" %08x", word);
}

const char* Try(GateFunction* gate, const GateInput& in) {
  unsigned char bytes[16] = {};
  gate(in.limits, in.planned, in.previous, in.ticks, bytes);
  return Broken(in, bytes);
}

int Main(int count, char** words) {
  if (count == 15) {
    std::uint32_t bits[13];
    for (int i = 0; i < 13; ++i)
      bits[i] = static_cast<std::uint32_t>(std::strtoul(words[i + 2], nullptr, 16));
    GateInput in;
    std::memcpy(&in, bits, sizeof in);
    const char* broken = Try(kGates[std::atoi(words[1])], in);
    std::printf("%s\n", broken != nullptr ? broken : "none");
    return 0;
  }
  const int samples = std::atoi(words[1]);
  for (int gate = 0; kGates[gate] != nullptr; ++gate) {
    GateSamples inputs(std::strtoull(words[2], nullptr, 10));
    const char* broken = nullptr;
    GateInput in;
    for (int i = 0; i < samples && broken == nullptr; ++i) {
      in = inputs.Next(true);
      broken = Try(kGates[gate], in);
    }
    std::printf("%d %s", gate, broken != nullptr ? broken : "none");
    if (broken != nullptr) Print(in);
    std::printf("\n");
  }
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int count, char** words) { return tumbler::Main(count, words); }
