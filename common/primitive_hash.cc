#include "common/primitive_hash.h"

#include <fmt/format.h>

#include <bit>
#include <cstdint>
#include <span>

namespace tumbler {
namespace {

class Fnv1a64 {
 public:
  void Bytes(std::string_view bytes) {
    for (const char byte : bytes) {
      state_ = (state_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
    }
  }
  void Word(std::uint64_t word) {
    for (int shift = 0; shift < 64; shift += 8) {
      state_ = (state_ ^ ((word >> shift) & 0xffU)) * 0x100000001b3ULL;
    }
  }
  void Number(double value) { Word(std::bit_cast<std::uint64_t>(value)); }
  void Numbers(std::span<const double> values) {
    Word(values.size());
    for (const double value : values) Number(value);
  }
  // The length goes first, so that no two lists of texts give the same bytes.
  void Text(std::string_view text) {
    Word(text.size());
    Bytes(text);
  }
  [[nodiscard]] std::string ToText() const { return fmt::format("fnv1a64:{:016x}", state_); }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ULL;
};

}  // namespace

std::string HashOfText(std::string_view text) {
  Fnv1a64 hash;
  hash.Bytes(text);
  return hash.ToText();
}

std::string HashOfCoefficients(const Primitive<double>& primitive) {
  Fnv1a64 hash;
  hash.Text(primitive.name.view());
  hash.Number(primitive.duration_s);
  hash.Number(primitive.settle_s);
  hash.Number(primitive.entry_tolerance_rad);
  hash.Number(primitive.following_tolerance_rad);
  hash.Word(static_cast<std::uint64_t>(primitive.joint_count));
  for (const JointMotion<double>& motion : primitive.motions()) {
    hash.Text(motion.name.view());
    hash.Number(motion.limits.position_min_rad);
    hash.Number(motion.limits.position_max_rad);
    hash.Number(motion.limits.velocity_max_rad_s);
    hash.Number(motion.limits.acceleration_max_rad_s2);
    hash.Number(motion.limits.torque_max_nm);
    for (const JointMotion<double>::Spline* spline : {&motion.position, &motion.torque}) {
      hash.Word(static_cast<std::uint64_t>(spline->degree()));
      hash.Numbers(spline->knots());
      hash.Numbers(spline->control_points());
    }
  }
  return hash.ToText();
}

}  // namespace tumbler
