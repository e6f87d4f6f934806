#include "firmware_interface/devices/mit.h"

#include "tests/support/impedance_side.h"

namespace tumbler::testing {
namespace {

class MitWatch final : public ImpedanceWatch {
 public:
  MitWatch(const MitConfig& mit, JointJudge& joint) : ImpedanceWatch(joint), mit_(mit) {}

  bool Take(const LoggedFrame& logged) override {
    const CanFrame& frame = logged.frame;
    if (frame.id == mit_.reply_id) {
      TakeReply(frame);
      return true;
    }
    if (frame.id != mit_.command_id) return false;
    if (frame.size != 8) {
      joint().Fail("not a command");
      return true;
    }
    bool ones = true;
    for (std::size_t k = 0; k < 7; ++k) ones = ones && frame.data[k] == 0xff;
    const unsigned last = frame.data[7];
    const bool off = ones && last == 0xfd;
    joint().Begin(logged.time_s, off, false);
    if (ones && last == 0xfe) {
      joint().Fail("its zero is set");
    } else if (off) {
      joint().Off();
    } else if (ones && last == 0xfc) {
      if (!joint().started() && !joint().passive_before()) {
        joint().Fail("motor mode without a neutral setpoint before");
      }
      joint().Start();
    } else {
      TakeSetpoint(logged);
    }
    joint().End(logged.time_s);
    return true;
  }

 private:
  void TakeReply(const CanFrame& frame) {
    if (frame.size < 6 || frame.size > 8 || frame.data[0] != (mit_.command_id & 0xff)) {
      if (!joint().bus().rules().spoilt_replies) joint().Fail("not a reply");
      return;
    }
    const unsigned code = unsigned{frame.data[1]} << 8 | frame.data[2];
    joint().Reply(joint().Position(ValueOfCode(code, mit_.reply.position_rad, 65535)));
  }

  void TakeSetpoint(const LoggedFrame& logged) {
    const auto d = [&logged](std::size_t k) { return unsigned{logged.frame.data[k]}; };
    const ImpedanceRanges& ranges = mit_.command;
    DriveOrder order;
    order.position_rad =
        joint().Position(ValueOfCode(d(0) << 8 | d(1), ranges.position_rad, 65535));
    order.velocity_rad_s =
        joint().Velocity(ValueOfCode(d(2) << 4 | d(3) >> 4, ranges.velocity_rad_s, 4095));
    order.kp_nm_per_rad =
        joint().Gain(ValueOfCode((d(3) & 0xf) << 8 | d(4), ranges.kp_nm_per_rad, 4095));
    order.kd_nm_s_per_rad =
        joint().Gain(ValueOfCode(d(5) << 4 | d(6) >> 4, ranges.kd_nm_s_per_rad, 4095));
    order.torque_nm = joint().Torque(ValueOfCode((d(6) & 0xf) << 8 | d(7), ranges.torque_nm, 4095));
    TakeOrder(order, logged.time_s);
  }

  MitConfig mit_;
};

class Mit final : public ImpedanceSide<MitConfig, MitWatch> {
 public:
  [[nodiscard]] WireSteps StepsOf(const DriveConfig& drive) const override {
    return StepsOfRanges(Of(drive).command, 1);
  }

  [[nodiscard]] std::uint32_t PositionId(const DriveConfig& drive) const override {
    return Of(drive).reply_id;
  }
  [[nodiscard]] std::uint32_t SetpointId(const DriveConfig& drive) const override {
    return Of(drive).command_id;
  }
  [[nodiscard]] CanFrame StrangersCommand(const DriveConfig& drive) const override {
    return EncodeMitCommand(Of(drive), {});
  }
  [[nodiscard]] CanFrame TorqueOff(const DriveConfig& drive) const override {
    CanFrame frame;
    frame.id = SetpointId(drive);
    frame.size = 8;
    frame.data = {255, 255, 255, 255, 255, 255, 255, 0xfd};
    return frame;
  }

  void SpoilSetpoint(CanFrame& frame) const override {
    frame.data[0] = static_cast<std::uint8_t>(frame.data[0] ^ 1U);  // 0.1 rad
  }
  void SpoilReply(CanFrame& frame) const override {
    frame.data[1] = static_cast<std::uint8_t>(frame.data[1] ^ 1U);
  }
  void AddSamples(FrameSamples& samples) const override {
    const MitConfig mit;
    AddSetpoint(
        samples, "MIT_COMMAND",
        [&mit](const ImpedanceCommand& v) { return EncodeMitCommand(mit, v); },
        [&mit](const CanFrame& f, ImpedanceCommand& v) { return DecodeMitCommand(mit, f, v); });
    MitReply reply;
    reply.sender = 1;
    reply.position_rad = samples.Number(-12, 12);
    reply.velocity_rad_s = samples.Number(-49, 49);
    reply.torque_nm = samples.Number(-17, 17);
    reply.temperature_c = samples.Number(-100, 120);
    reply.error = static_cast<std::uint8_t>(samples.Whole(0, 6));
    const CanFrame answer = EncodeMitReply(mit, reply);
    FrameSamples::Expect(DecodeMitReply(mit, answer, reply));
    samples.Add("MIT_REPLY", answer,
                {{"sender", reply.sender},
                 {"position", reply.position_rad},
                 {"velocity", reply.velocity_rad_s},
                 {"torque", reply.torque_nm},
                 {"temperature", reply.temperature_c},
                 {"error", reply.error}});
  }
  [[nodiscard]] const char* CodecProblem(const CanFrame& frame) const override {
    const MitConfig mit;
    MitReply reply;
    if (DecodeMitReply(mit, frame, reply) == Status::kOk &&
        !(std::isfinite(reply.position_rad) && std::isfinite(reply.torque_nm))) {
      return "a reply decodes to no number";
    }
    return RoundTripProblem<ImpedanceCommand>(
        frame,
        [&mit](const CanFrame& f, ImpedanceCommand& v) { return DecodeMitCommand(mit, f, v); },
        [&mit](const ImpedanceCommand& v) { return EncodeMitCommand(mit, v); });
  }
};

}  // namespace

const ProtocolSide& SideOf(SideTag<MitProtocol> /*tag*/) {
  static const Mit side;
  return side;
}

}  // namespace tumbler::testing
