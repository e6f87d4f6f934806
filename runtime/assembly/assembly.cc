#include "runtime/assembly/assembly.h"

#include <fmt/format.h>

#include <span>
#include <utility>

#include "runtime/assembly/run_checks.h"

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
}

Status Assembly::Configure(const ExecutorConfig& config) {
  const Sequence<float>& sequence = *parts_.sequence;
  const std::span<const Primitive<float>> primitives(
      sequence.primitives.data(), static_cast<std::size_t>(sequence.primitive_count));
  return executor_->Configure(config, sequence.graph, primitives, bank_->drives());
}

}  // namespace tumbler
