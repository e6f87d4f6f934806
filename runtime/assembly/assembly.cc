#include "runtime/assembly/assembly.h"

#include <fmt/format.h>

#include <span>
#include <utility>

#include "common/files/program.h"
#include "runtime/assembly/sensor_settings.h"

namespace tumbler {

Assembly::Assembly(RunParts parts)
    : parts_(std::move(parts)),
      bank_(std::make_unique<DriveBank>()),
      executor_(std::make_unique<Executor>()) {
  for (const DriveEntry& entry : parts_.drives.drives) {
    if (bank_->Add(entry.config) != Status::kOk) {
      throw Refused(fmt::format("joint {}: its drive cannot be used as configured", entry.joint));
    }
  }
  if (!parts_.drives.sensor) return;
  sensor_ = parts_.drives.sensor->MakeHost();
  // Whether the sensor's link is known is said before anything is touched.
  (void)SensorSettingsOf(*parts_.drives.sensor, parts_.file, parts_.drives.rate_hz);
}

Status Assembly::Configure(const ExecutorConfig& config) {
  const Sequence<float>& sequence = *parts_.sequence;
  const std::span<const Primitive<float>> primitives(
      sequence.primitives.data(), static_cast<std::size_t>(sequence.primitive_count));
  std::unique_ptr<PitchEstimate> pitch;
  if (sensor_ != nullptr) {
    pitch = std::make_unique<SensorWatch>(
        *sensor_, SensorSettingsOf(*parts_.drives.sensor, parts_.file,
                                   1.0 / static_cast<double>(config.period_s)));
  }
  const Status status =
      executor_->Configure(config, sequence.graph, primitives, bank_->drives(), pitch.get());
  // Else the executor still has what it was configured with before.
  if (status == Status::kOk) pitch_ = std::move(pitch);
  return status;
}

}  // namespace tumbler
