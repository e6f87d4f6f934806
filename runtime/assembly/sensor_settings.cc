#include "runtime/assembly/sensor_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/functions.h"
#include "common/files/program.h"

namespace tumbler {
namespace {

/// The chain of the sensor's link; empty: no primitive has feedback.
std::vector<double> ChainOf(const std::string& link, const SequenceFile& motion) {
  std::vector<double> chain;
  for (std::size_t p = 0; p < motion.primitives.size(); ++p) {
    const PrimitiveFile& file = motion.primitives[p];
    if (!file.primitive.feedback.present()) continue;
    const auto found = std::ranges::find(file.chains, link, &LinkChain::link);
    if (found == file.chains.end()) {
      std::string known;
      for (const LinkChain& other : file.chains) known += (known.empty() ? "" : ", ") + other.link;
      throw Refused(
          fmt::format("the sensor is on link '{}', which the feedback of primitive '{}' does not "
                      "know; allowed: "
                      "{}; correct `link` of [sensor] in the drives file",
                      link, motion.primitive_names[p], known));
    }
    if (!chain.empty() && chain != found->joints) {
      throw Refused(
          fmt::format("primitives do not agree about where link '{}' is on the robot: '{}' "
                      "was made for another one",
                      link, motion.primitive_names[p]));
    }
    chain = found->joints;
  }
  return chain;
}

}  // namespace

SensorSettings SensorSettingsOf(const SensorEntry& entry, const SequenceFile& motion,
                                double rate_hz) {
  SensorSettings settings;
  const double cr = portable::Cos(entry.mount_rpy_rad[0]),
               sr = portable::Sin(entry.mount_rpy_rad[0]);
  const double cp = portable::Cos(entry.mount_rpy_rad[1]),
               sp = portable::Sin(entry.mount_rpy_rad[1]);
  const double cy = portable::Cos(entry.mount_rpy_rad[2]),
               sy = portable::Sin(entry.mount_rpy_rad[2]);
  // Rz(yaw) Ry(pitch) Rx(roll) turns vectors of the sensor into those of the link; its rows are the
  // link's axes in the sensor.
  const std::array<std::array<double, 3>, 3> rows{
      {{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
       {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
       {-sp, cp * sr, cp * cr}}};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) settings.mounting[i][k] = static_cast<float>(rows[i][k]);
  }
  if (!motion.begin_link.empty() && motion.begin_link != entry.link) {
    throw Refused(
        fmt::format("the sensor is on link '{}', and how the robot lies is told by the pitch of "
                    "'{}' (`link` of [begin] in {}): correct one of them",
                    entry.link, motion.begin_link, motion.path));
  }
  const std::vector<double> chain = ChainOf(entry.link, motion);
  for (std::size_t j = 0; j < chain.size(); ++j) settings.chain[j] = static_cast<float>(chain[j]);
  settings.age_ticks_max = std::max(1, static_cast<int>(std::floor(entry.age_max_s * rate_hz)));
  settings.repeats_max =
      entry.frozen_after_s > 0
          ? std::max(1U, static_cast<std::uint32_t>(entry.frozen_after_s * entry.rate_hz))
          : 0;
  settings.tilt_sine_max = static_cast<float>(portable::Sin(entry.tilt_max_rad));
  settings.rate_max_rad_s = static_cast<float>(entry.rate_max_rad_s);
  settings.jump_max_rad = static_cast<float>(entry.jump_max_rad);
  settings.late_max_s = static_cast<float>(entry.late_max_s);
  return settings;
}

}  // namespace tumbler
