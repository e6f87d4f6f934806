#include "runtime/embedded/playback.h"

#include <bit>

namespace tumbler {
namespace {

/// Writes little-endian numbers one after the other.
class Writer {
 public:
  explicit Writer(std::span<std::uint8_t> out) noexcept : out_(out) {}
  void Add(std::uint32_t value, int bytes) noexcept {
    for (int i = 0; i < bytes; ++i)
      out_[count_++] = static_cast<std::uint8_t>(value >> (8 * static_cast<unsigned>(i)));
  }
  void Add(float value) noexcept { Add(std::bit_cast<std::uint32_t>(value), 4); }
  void Add(const JointSetpoint& setpoint) noexcept {
    Add(setpoint.position_rad);
    Add(setpoint.velocity_rad_s);
    Add(setpoint.torque_nm);
  }
  void Add(const CanFrame& frame) noexcept {
    Add(frame.id, 4);
    Add((frame.extended ? 1U : 0U) | (frame.remote ? 2U : 0U), 1);
    Add(frame.size, 1);
    for (const std::uint8_t byte : frame.data) Add(byte, 1);
  }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

 private:
  std::span<std::uint8_t> out_;
  std::size_t count_ = 0;
};

}  // namespace

std::size_t Pack(const RecordedTick& tick, std::span<std::uint8_t> out) noexcept {
  Writer writer(out);
  writer.Add(static_cast<std::uint8_t>(tick.elapsed), 1);
  writer.Add(static_cast<std::uint8_t>(tick.receive_status), 1);
  writer.Add(static_cast<std::uint8_t>(tick.send_status), 1);
  writer.Add(tick.frame_count, 1);
  for (std::size_t i = 0; i < tick.frame_count; ++i) writer.Add(tick.frames[i].frame);
  return writer.count();
}

int UnpackHeader(std::span<const std::uint8_t> bytes, RecordedTick& tick) noexcept {
  tick.elapsed = static_cast<std::int8_t>(bytes[0]);
  tick.receive_status = static_cast<Status>(bytes[1]);
  tick.send_status = static_cast<Status>(bytes[2]);
  tick.frame_count = bytes[3];
  if (tick.frame_count > RecordedTick::kMaxFrames) return -1;
  return static_cast<int>(tick.frame_count * RecordedTick::kFrameBytes);
}

void UnpackFrames(std::span<const std::uint8_t> bytes, RecordedTick& tick) noexcept {
  for (std::size_t i = 0; i < tick.frame_count; ++i) {
    const auto from = bytes.subspan(i * RecordedTick::kFrameBytes, RecordedTick::kFrameBytes);
    CanFrame& frame = tick.frames[i].frame;
    frame.id = 0;
    for (std::size_t k = 4; k-- > 0;) frame.id = frame.id << 8U | from[k];
    frame.extended = (from[4] & 1U) != 0;
    frame.remote = (from[4] & 2U) != 0;
    frame.size = from[5];
    for (std::size_t k = 0; k < frame.data.size(); ++k) frame.data[k] = from[6 + k];
  }
}

std::size_t Pack(const TickOutput& output, std::span<std::uint8_t> out) noexcept {
  const TickRecord& record = output.record;
  Writer writer(out);
  writer.Add(static_cast<std::uint8_t>(record.state), 1);
  writer.Add(static_cast<std::uint8_t>(record.reaction), 1);
  writer.Add(static_cast<std::uint8_t>(record.node), 1);
  writer.Add(record.faults, 4);
  writer.Add(static_cast<std::uint8_t>(record.command), 1);
  writer.Add(static_cast<std::uint8_t>(record.refusal.refusal), 1);
  writer.Add(record.joint_count, 1);
  for (std::size_t j = 0; j < record.joint_count; ++j) {
    const JointRecord& joint = record.joints[j];
    writer.Add(joint.planned);
    writer.Add(joint.planned_acceleration_rad_s2);
    writer.Add(joint.limited);
    writer.Add(joint.encoded);
    const auto frames = output.frames[j].frames();
    writer.Add(static_cast<std::uint8_t>(frames.size()), 1);
    for (const CanFrame& frame : frames) writer.Add(frame);
  }
  return writer.count();
}

bool Playback::Knows(std::string_view protocol) noexcept {
  bool known = false;
  DriveProtocols::ForEach([&](auto listed) { known = known || decltype(listed)::kId == protocol; });
  return known;
}

Status Playback::Configure(std::string_view protocol, int cycles, int branch,
                           const SequenceGraph<float>& graph,
                           std::span<const Primitive<float>> primitives,
                           bool with_sensor) noexcept {
  if (primitives.empty() || !Knows(protocol)) return Status::kInvalidArgument;
  RunProcedureConfig procedure;
  for (int i = 0; i < primitives[0].joint_count; ++i) {
    DriveConfig drive;
    DriveProtocols::ForEach([&](auto listed) {
      if (decltype(listed)::kId == protocol) drive = decltype(listed)::Example(i);
    });
    const Status status = bank_.Add(drive);
    if (status != Status::kOk) return status;
    procedure.reply_ticks_max = FirstReply_ms(drive);  // A tick is 1 ms.
  }
  procedure_ = RunProcedure(procedure);
  ExecutorConfig config;
  config.cycles = cycles;
  config.branch = branch;
  for (JointConfig& joint : config.joints) {
    joint.kp_nm_per_rad = 40;
    joint.kd_nm_s_per_rad = joint.damping_nm_s_per_rad = 5;
  }
  return executor_.Configure(config, graph, primitives, bank_.drives(),
                             with_sensor ? &pitch_ : nullptr);
}

TickInput Playback::NextInput(const RecordedTick& tick) noexcept {
  tick_ += tick.elapsed;
  TickInput input;
  input.tick = tick_;
  input.received = {tick.frames.data(), tick.frame_count};
  input.receive_status = tick.receive_status;
  input.send_status = tick.send_status;
  input.command = procedure_.Next(output_.record);
  return input;
}

}  // namespace tumbler
