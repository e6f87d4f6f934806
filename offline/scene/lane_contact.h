#pragma once

#include "offline/model/contact_law.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/vectors.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// The numbers of a contact law in lanes, each its own robot's: what OneContact (contact_law.h) is
/// for one robot. Quotients are products with inverses, which are made once, and every formula
/// holds everywhere, since what it depends on is clamped.
template <class S>
class LaneContact {
 public:
  /// @param model, robot  LaneModel and LaneRobot, or those in space.
  /// @param lanes         those of the robots that S has.
  template <class Model, class Robot>
  LaneContact(const Model& model, const Robot& robot, LanesFrom<S> lanes)
      : smoothing_(model.smoothing),
        damping_law_(model.damping_law),
        k_(lanes(robot.stiffness)),
        c_(lanes(robot.damping)),
        mu_(lanes(robot.mu)),
        d_on_(lanes(robot.d_on)),
        per_d_on_(S(1) / d_on_),
        per_width_(S(1) / (d_on_ - lanes(robot.d_off))),
        per_bend_(per_width_ / k_),
        per_v_max_(S(1) / lanes(robot.v_max)) {}

  [[nodiscard]] ContactSmoothing smoothing() const { return smoothing_; }
  [[nodiscard]] ContactDamping damping_law() const { return damping_law_; }
  [[nodiscard]] const S& k() const { return k_; }
  [[nodiscard]] const S& c() const { return c_; }
  [[nodiscard]] const S& d_on() const { return d_on_; }
  [[nodiscard]] const S& per_d_on() const { return per_d_on_; }

  static constexpr bool MayFade(const S& /*x*/) { return true; }
  [[nodiscard]] S FadingAt(const S& x) const { return Clamp(x * per_width_, S(0), S(1)); }
  static constexpr bool MayBend(const S& /*y*/) { return true; }
  [[nodiscard]] S BendAt(const S& y) const { return Clamp(y * per_bend_, S(0), S(1)); }
  static S Product(const S& x, const S& y, const S& z) { return x * (y * z); }

  /// The force of friction under a normal force, along the slip [m/s].
  [[nodiscard]] S Friction(const S& N, const S& slip) const {
    return mu_ * Size(N) * FrictionShare(slip * per_v_max_);
  }
  /// The same as a vector is against the slip's: mu Size(N) SlipGain(s2) for a unit of it.
  [[nodiscard]] const S& mu() const { return mu_; }
  [[nodiscard]] S Size(const S& N) const {
    return damping_law() != ContactDamping::kNoPull ? Max(N, -N) : N;
  }
  /// gamma of a slip over the slip [s/m], from its square [m^2/s^2].
  [[nodiscard]] S SlipGain(const S& s2) const {
    const S square = s2 * (per_v_max_ * per_v_max_);
    const auto full = S(1) < square;
    return per_v_max_ *
           Select(full, S(1) / Sqrt(Select(full, square, S(1))), FrictionPerSlip(square));
  }

 private:
  ContactSmoothing smoothing_;
  ContactDamping damping_law_;
  S k_, c_, mu_, d_on_, per_d_on_, per_width_, per_bend_, per_v_max_;
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
