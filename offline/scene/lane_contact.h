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
  LaneContact(const LaneModel& model, const LaneRobot<S>& robot)
      : model_(model),
        robot_(robot),
        per_width_(S(1) / (robot.d_on - robot.d_off)),
        per_bend_(per_width_ / robot.stiffness),
        per_v_max_(S(1) / robot.v_max) {}

  [[nodiscard]] ContactSmoothing smoothing() const { return model_.smoothing; }
  [[nodiscard]] ContactDamping damping_law() const { return model_.damping_law; }
  [[nodiscard]] const S& k() const { return robot_.stiffness; }
  [[nodiscard]] const S& c() const { return robot_.damping; }

  static constexpr bool MayFade(const S& /*x*/) { return true; }
  [[nodiscard]] S FadingAt(const S& x) const { return Clamp(x * per_width_, S(0), S(1)); }
  static constexpr bool MayBend(const S& /*y*/) { return true; }
  [[nodiscard]] S BendAt(const S& y) const { return Clamp(y * per_bend_, S(0), S(1)); }
  static S Product(const S& x, const S& y, const S& z) { return x * (y * z); }

  /// The force of friction under a normal force, along the slip [m/s].
  [[nodiscard]] S Friction(const S& N, const S& slip) const {
    const bool pulls = damping_law() != ContactDamping::kNoPull;
    return robot_.mu * (pulls ? Max(N, -N) : N) * FrictionShare(slip * per_v_max_);
  }

 private:
  const LaneModel& model_;
  const LaneRobot<S>& robot_;
  S per_width_, per_bend_, per_v_max_;
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
