#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/xsens_mti.h"
#include "runtime/executor/executor.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/executor/sensor_watch.h"

namespace tumbler {

/// The executor's input of one tick, as a recording holds it.
struct RecordedTick {
  static constexpr std::size_t kMaxFrames = 32;
  static constexpr std::size_t kHeaderBytes = 4;
  static constexpr std::size_t kFrameBytes = 14;
  static constexpr std::size_t kMaxBytes = kHeaderBytes + kMaxFrames * kFrameBytes;

  std::int8_t elapsed = 1;  ///< Ticks since the one before.
  Status receive_status = Status::kOk;
  Status send_status = Status::kOk;
  std::uint8_t frame_count = 0;
  std::array<ReceivedFrame, kMaxFrames> frames;
};

/// Writes a tick as bytes. @param out  has room for kMaxBytes. @returns the bytes written.
std::size_t Pack(const RecordedTick& tick, std::span<std::uint8_t> out) noexcept;
/// Reads the header of a tick, which says how many bytes of frames follow.
/// @returns these bytes, or -1 if there are more frames than a tick holds.
int UnpackHeader(std::span<const std::uint8_t> bytes, RecordedTick& tick) noexcept;
void UnpackFrames(std::span<const std::uint8_t> bytes, RecordedTick& tick) noexcept;

/// The executor's output of one tick as bytes, to be compared: state, reaction, faults, each
/// joint's setpoint as planned, limited and encoded, and its frames. The layout is little-endian:
///
///   state 8 | reaction 8 | node 8 | faults 32 | command 8 | refusal 8 | joints 8
///                                                                        (kPlaybackHeadBytes)
///   of each joint: planned p v t a, limited p v t, encoded p v t (floats)
///                  | frames 8 | their bytes as in RecordedTick
inline constexpr std::size_t kPlaybackHeadBytes = 10;
inline constexpr std::size_t kPlaybackJointBytes = 10 * 4 + 1;
inline constexpr std::size_t kPlaybackMaxBytes =
    kPlaybackHeadBytes +
    kMaxJoints * (kPlaybackJointBytes + FrameBatch::kCapacity * RecordedTick::kFrameBytes);
/// @param out  has room for kPlaybackMaxBytes. @returns the bytes written.
std::size_t Pack(const TickOutput& output, std::span<std::uint8_t> out) noexcept;

/// Plays a motion against a recording of the drives' frames. The same source runs on a
/// microcontroller and on the machine that made the recording, and both have to send the same
/// frames. It is also an example of putting the core together without a heap.
class Playback {
 public:
  /// Whether a protocol has this name (its `kId`).
  [[nodiscard]] static bool Knows(std::string_view protocol) noexcept;

  /// Prepares to play `cycles` cycles and then the branch (see ExecutorConfig). Graph and
  /// primitives have to outlive the playback.
  /// @param protocol  a protocol's name; the drives and their gains are those of its example in
  ///                  primitives/robots/.
  /// @param with_sensor  whether there is the sensor of tumbler_drives_sensor.toml there.
  /// @retval kInvalidArgument  there is no such protocol, or nothing to play.
  Status Configure(std::string_view protocol, int cycles, int branch,
                   const SequenceGraph<float>& graph, std::span<const Primitive<float>> primitives,
                   bool with_sensor = false) noexcept;

  /// The executor's input of the next tick. It refers to the frames in `tick`.
  [[nodiscard]] TickInput NextInput(const RecordedTick& tick) noexcept;
  void Tick(const TickInput& input) noexcept { executor_.Tick(input, output_); }
  [[nodiscard]] const TickOutput& output() const noexcept { return output_; }
  /// Whether the run is over and the drives are disarmed again.
  [[nodiscard]] bool done() const noexcept { return procedure_.done(); }

 private:
  DriveBank bank_;
  XsensMti sensor_;
  SensorWatch pitch_{sensor_, {}};
  Executor executor_;
  RunProcedure procedure_{RunProcedureConfig{}};
  std::int64_t tick_ = 0;
  TickOutput output_{};
};

}  // namespace tumbler
