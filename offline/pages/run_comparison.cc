#include <algorithm>
#include <cmath>

#include "offline/pages/run_data.h"

namespace tumbler {

std::vector<RunDifference> Compare(const RunData& a, const RunData& b) {
  std::vector<RunDifference> differences;
  if (!a.recorded || !b.recorded || std::abs(a.period_s - b.period_s) > 1e-9) return differences;
  using ReadQuantity = float (*)(const JointRecord&);
  struct Quantity {
    const char* name;
    const char* unit;
    ReadQuantity read;
  };
  const auto quantities = {
      Quantity{"measured position", "rad",
               [](const JointRecord& j) { return j.measured.position_rad; }},
      Quantity{"measured velocity", "rad/s",
               [](const JointRecord& j) { return j.measured.velocity_rad_s; }},
      Quantity{"measured torque", "N·m", [](const JointRecord& j) { return j.measured.torque_nm; }},
      Quantity{"commanded position", "rad",
               [](const JointRecord& j) { return j.limited.position_rad; }}};
  const auto number = [](const RunData& run, std::size_t i) {
    return std::llround(run.ticks[i].time_s / run.period_s);
  };
  for (std::size_t j = 0; j < a.joint_count(); ++j) {
    for (const Quantity& quantity : quantities) {
      RunDifference difference{a.scene.joint_names[j], quantity.name, quantity.unit};
      double squares = 0;
      for (std::size_t i = 0, k = 0; i < a.ticks.size() && k < b.ticks.size();) {
        const auto at_a = number(a, i), at_b = number(b, k);
        if (at_a == at_b && a.ticks[i].time_s >= 0 && a.joint(i, j).reply_age_ticks >= 0 &&
            b.joint(k, j).reply_age_ticks >= 0) {
          const double apart =
              std::abs(double{quantity.read(b.joint(k, j))} - double{quantity.read(a.joint(i, j))});
          if (!std::isnan(apart)) {  // A torque may not have been measured.
            ++difference.ticks;
            squares += apart * apart;
          }
          if (apart > difference.max) {
            difference.max = apart;
            difference.max_at_s = a.ticks[i].time_s;
          }
        }
        if (at_a <= at_b) ++i;
        if (at_b <= at_a) ++k;
      }
      if (difference.ticks > 0) {
        difference.rms = std::sqrt(squares / static_cast<double>(difference.ticks));
      }
      differences.push_back(difference);
    }
  }
  return differences;
}

}  // namespace tumbler
