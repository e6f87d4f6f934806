#include "firmware_interface/devices/cansimple.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/support/codec_check.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

class Watch final : public DriveWatch {
 public:
  Watch(const CanSimpleConfig& can, JointJudge& joint) : DriveWatch(joint), can_(can) {}

  bool Take(const LoggedFrame& logged) override {
    const CanFrame& frame = logged.frame;
    if (frame.id >> 5 != can_.node_id) return false;
    const unsigned command = frame.id & 0x1f;
    switch (command) {
      case 0x01:
      case 0x03:
      case 0x15:
      case 0x1c:
        return true;  // The drive has sent it.
      case 0x09:
        joint().Reply(Position(frame));
        return true;
      case 0x07:
        TakeState(logged);
        break;
      case 0x0b:
        Begin(logged.time_s, false);
        velocity_mode_ = UnsignedField(frame, 0, 4) == 2;
        if (!velocity_mode_ && UnsignedField(frame, 0, 4) != 3) {
          joint().Fail(fmt::format("control mode {}", UnsignedField(frame, 0, 4)));
        }
        break;
      case 0x0c:
        TakePosition(logged);
        break;
      case 0x0d: {
        Begin(logged.time_s, false);
        const bool still =
            std::abs(FloatField(frame, 0)) <= 1e-6 && std::abs(FloatField(frame, 4)) <= 1e-6;
        if (!velocity_mode_ || !still) joint().Fail("a velocity that is not for braking");
        joint().Passive({});
        break;
      }
      case 0x18:
        Begin(logged.time_s, false);
        if (joint().started()) joint().Fail("errors are cleared while it is driven");
        break;
      default:
        joint().Fail(fmt::format("command {:X}", command));
        return true;
    }
    joint().End(logged.time_s);
    return true;
  }

 private:
  void Begin(double time_s, bool torque_off) {
    const bool was_started = joint().started();
    const bool first = joint().Begin(time_s, torque_off, true);
    // The input before it was not meant for starting up, unless that follows soon.
    if (first && has_input_ && !was_started && ++prepared_ticks_ > kPreparedMost)
      joint().FailUnstarted();
  }
  [[nodiscard]] double Position(const CanFrame& frame) {
    return joint().Position(FloatField(frame, 0) * kTwoPi);
  }

  void TakeState(const LoggedFrame& logged) {
    const std::uint32_t state = UnsignedField(logged.frame, 0, 4);
    Begin(logged.time_s, state == 1);
    if (state == 1) {
      joint().Off();
      has_input_ = false;
      prepared_ticks_ = 0;
    } else if (state == 8) {
      if (!has_input_ || velocity_mode_) {
        joint().Fail("closed loop without a position to begin with");
      } else {
        joint().CheckJump(input_rad_);
      }
      // The host's controller may send the frames of a tick in any order.
      if (!joint().started() && prepared_ticks_ == 0)
        joint().Fail("closed loop is asked for in the tick of its first position");
      prepared_ticks_ = 0;
      joint().Start();
    } else {
      joint().Fail(fmt::format("axis state {}", state));
    }
  }

  void TakePosition(const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    Begin(logged.time_s, false);
    DriveOrder order;
    order.position_rad = Position(frame);
    order.velocity_rad_s = joint().Velocity(SignedField(frame, 4, 2) * 0.001 * kTwoPi);
    order.torque_nm = joint().Torque(SignedField(frame, 6, 2) * 0.001);
    has_input_ = true;
    input_rad_ = order.position_rad;
    if (velocity_mode_) joint().Fail("a position in velocity mode");
    // An idle drive only keeps its input, which is judged when closed loop is asked for.
    if (joint().started()) joint().Setpoint(order, logged.time_s);
  }

  static constexpr int kPreparedMost = 2;

  CanSimpleConfig can_;
  bool velocity_mode_ = false;
  int prepared_ticks_ = 0;  // since the first input to an idle drive
  bool has_input_ = false;  // whether there is an input with which closed loop would begin
  double input_rad_ = 0;
};

/// Encodes for node 1. @returns the frame. `value` is then what decoding gives.
template <typename Value>
CanFrame Made(Value& value) {
  const CanFrame frame = EncodeCanSimple(1, value);
  value = {};
  FrameSamples::Expect(DecodeCanSimple(1, frame, value));
  return frame;
}

class CanSimple final : public ProtocolSide {
 public:
  [[nodiscard]] ProtocolNature nature() const override {
    ProtocolNature nature;
    nature.answers = false;
    return nature;
  }
  [[nodiscard]] WireSteps StepsOf(const DriveConfig& /*drive*/) const override {
    return {0, 0.001 * kTwoPi, 0.001};
  }
  [[nodiscard]] std::unique_ptr<DriveWatch> Watch(const DriveConfig& drive,
                                                  JointJudge& joint) const override {
    return std::make_unique<testing::Watch>(Of(drive), joint);
  }

  [[nodiscard]] std::uint32_t PositionId(const DriveConfig& drive) const override {
    return Of(drive).node_id * 32U + 0x09;
  }
  [[nodiscard]] std::uint32_t HeartbeatId(const DriveConfig& drive) const override {
    return Of(drive).node_id * 32U + 0x01;
  }
  [[nodiscard]] std::uint32_t SetpointId(const DriveConfig& drive) const override {
    return Of(drive).node_id * 32U + 0x0c;
  }
  [[nodiscard]] std::uint32_t EnableId(const DriveConfig& drive) const override {
    return Of(drive).node_id * 32U + 0x07;
  }
  [[nodiscard]] CanFrame StrangersCommand(const DriveConfig& drive) const override {
    return EncodeCanSimple(Of(drive).node_id, CanSimpleInputVel{});
  }
  [[nodiscard]] CanFrame TorqueOff(const DriveConfig& drive) const override {
    CanFrame frame;
    frame.id = EnableId(drive);
    frame.size = 8;
    frame.data = {1};
    return frame;
  }
  [[nodiscard]] std::optional<CanFrame> DropOut(const DriveConfig& drive) const override {
    return EncodeCanSimple(Of(drive).node_id, CanSimpleAxisState{kCanSimpleIdle});
  }
  [[nodiscard]] std::optional<CanFrame> NotANumber(const DriveConfig& drive) const override {
    CanSimpleEstimates estimates;
    estimates.position_rev = std::numeric_limits<float>::quiet_NaN();
    return EncodeCanSimple(Of(drive).node_id, estimates);
  }
  void Hasten(DriveConfig& drive) const override {
    std::get<CanSimpleConfig>(drive).messages.temperature_s = 0.01;
  }

  void SpoilSetpoint(CanFrame& frame) const override {
    frame.data[2] = static_cast<std::uint8_t>(frame.data[2] ^ 0x40U);  // a bit of the mantissa
  }
  void SpoilReply(CanFrame& frame) const override { SpoilSetpoint(frame); }
  void SpoilTorque(CanFrame& frame) const override { frame.data[7] = 0x7f; }

  void AddSamples(FrameSamples& samples) const override {
    AddSamplesOfTheDrive(samples);
    const auto number = [&samples](float most) { return samples.Number(-most, most); };
    CanSimpleControllerMode mode{samples.Whole(0, 3), samples.Whole(0, 7)};
    const CanFrame mode_frame = Made(mode);
    samples.Add("SET_CONTROLLER_MODE", mode_frame,
                {{"control", mode.control}, {"input", mode.input}});
    CanSimpleInputVel velocity{number(50), number(9)};
    const CanFrame velocity_frame = Made(velocity);
    samples.Add("SET_INPUT_VEL", velocity_frame,
                {{"velocity", velocity.velocity_rev_s}, {"torque", velocity.torque_nm}});
    CanSimpleInputPos position{number(1e3F), number(40), number(40)};
    const CanFrame position_frame = Made(position);
    samples.Add("SET_INPUT_POS", position_frame,
                {{"position", position.position_rev},
                 {"velocity", position.velocity_rev_s},
                 {"torque", position.torque_nm}});
    CanSimpleAxisState state{samples.Whole(0, 20)};
    const CanFrame state_frame = Made(state);
    samples.Add("SET_AXIS_STATE", state_frame, {{"state", state.state}});
    samples.Add("ESTOP", EncodeCanSimpleEstop(1), {});
    samples.Add("CLEAR_ERRORS", EncodeCanSimpleClearErrors(1), {{"identify", 0}});
  }
  [[nodiscard]] const char* CodecProblem(const CanFrame& frame) const override {
    const auto problem = [&frame](auto value) {
      using Value = decltype(value);
      return RoundTripProblem<Value>(
          frame, [](const CanFrame& f, Value& v) { return DecodeCanSimple(1, f, v); },
          [](const Value& v) { return EncodeCanSimple(1, v); });
    };
    return FirstProblem({problem(CanSimpleHeartbeat{}), problem(CanSimpleErrors{}),
                         problem(CanSimpleAxisState{}), problem(CanSimpleEstimates{}),
                         problem(CanSimpleControllerMode{}), problem(CanSimpleInputPos{}),
                         problem(CanSimpleInputVel{}), problem(CanSimpleTemperature{}),
                         problem(CanSimpleTorques{})});
  }

 private:
  static void AddSamplesOfTheDrive(FrameSamples& samples) {
    const auto number = [&samples](float most) { return samples.Number(-most, most); };
    CanSimpleHeartbeat heartbeat{samples.Word(), samples.Byte(), samples.Byte(),
                                 samples.Whole(0, 1) == 1};
    const CanFrame heartbeat_frame = Made(heartbeat);
    samples.Add("HEARTBEAT", heartbeat_frame,
                {{"error", heartbeat.error},
                 {"state", heartbeat.state},
                 {"procedure_result", heartbeat.procedure_result},
                 {"trajectory_done", heartbeat.trajectory_done ? 1.0 : 0.0}});
    CanSimpleErrors errors{samples.Word(), samples.Word()};
    const CanFrame errors_frame = Made(errors);
    samples.Add("GET_ERROR", errors_frame,
                {{"active", errors.active}, {"disarm_reason", errors.disarm_reason}});
    CanSimpleEstimates estimates{number(1e3F), number(50)};
    const CanFrame estimates_frame = Made(estimates);
    samples.Add("GET_ENCODER_ESTIMATES", estimates_frame,
                {{"position", estimates.position_rev}, {"velocity", estimates.velocity_rev_s}});
    CanSimpleTemperature temperature{samples.Number(-20, 120), samples.Number(-20, 120)};
    const CanFrame temperature_frame = Made(temperature);
    samples.Add("GET_TEMPERATURE", temperature_frame,
                {{"fet", temperature.fet_c}, {"motor", temperature.motor_c}});
    CanSimpleTorques torques{number(9), number(9)};
    const CanFrame torques_frame = Made(torques);
    samples.Add("GET_TORQUES", torques_frame,
                {{"target", torques.target_nm}, {"estimate", torques.estimate_nm}});
  }
  static const CanSimpleConfig& Of(const DriveConfig& drive) {
    return std::get<CanSimpleConfig>(drive);
  }
};

}  // namespace

const ProtocolSide& SideOf(SideTag<CanSimpleProtocol> /*tag*/) {
  static const CanSimple side;
  return side;
}

}  // namespace tumbler::testing
