#include "firmware_interface/drives/akv3.h"

#include <cmath>

#include "tests/support/codec_check.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {
namespace {

double Value(unsigned code, const DriveRange& range, double steps) {
  return static_cast<double>(range.min) + code * static_cast<double>(range.max - range.min) / steps;
}

class Watch final : public DriveWatch {
 public:
  Watch(const AkV3Config& config, JointJudge& joint) : DriveWatch(joint), config_(config) {}

  [[nodiscard]] bool extended() const override { return true; }

  bool Take(const LoggedFrame& logged) override {
    const CanFrame& frame = logged.frame;
    if ((frame.id & 0xff) != config_.node_id) return false;
    if (frame.id >> 8 == 0x29) {
      TakeReport(frame);
      return true;
    }
    if (frame.id >> 8 != 0x08) return false;
    if (frame.size != 8) {
      joint().Fail("not a setpoint");
      return true;
    }
    TakeSetpoint(logged);
    return true;
  }

 private:
  void TakeReport(const CanFrame& frame) {
    if (frame.size != 8) {
      if (!joint().bus().rules().spoilt_replies) joint().Fail("not a report");
      return;
    }
    const auto code = static_cast<std::int16_t>(frame.data[0] << 8 | frame.data[1]);
    reported_rad_ = joint().Position(code * 0.1 * std::acos(-1.0) / 180);
    joint().Reply(reported_rad_);
  }

  void TakeSetpoint(const LoggedFrame& logged) {
    const auto d = [&logged](std::size_t k) { return unsigned{logged.frame.data[k]}; };
    const AkV3Ranges& range = config_.range;
    DriveOrder order;
    order.kp_nm_per_rad = joint().Gain(Value(d(0) << 4 | d(1) >> 4, range.kp_nm_per_rad, 4096));
    order.kd_nm_s_per_rad =
        joint().Gain(Value((d(1) & 0xf) << 8 | d(2), range.kd_nm_s_per_rad, 4096));
    order.position_rad = joint().Position(Value(d(3) << 8 | d(4), range.position_rad, 65536));
    order.velocity_rad_s =
        joint().Velocity(Value(d(5) << 4 | d(6) >> 4, range.velocity_rad_s, 4096));
    order.torque_nm = joint().Torque(Value((d(6) & 0xf) << 8 | d(7), range.torque_nm, 4096));
    const bool off =
        order.kp_nm_per_rad == 0 && order.kd_nm_s_per_rad == 0 && d(6) % 16 == 8 && d(7) == 0;
    joint().Begin(logged.time_s, off, false);
    if (off) {
      joint().Off();
    } else {
      const WireSteps& steps = joint().steps();
      // The torque comes on where the drive reported to stand, and nowhere else.
      const bool holds = std::abs(order.position_rad - reported_rad_) <= steps.position_rad &&
                         std::abs(order.velocity_rad_s) <= steps.velocity_rad_s &&
                         std::abs(order.torque_nm) <= steps.torque_nm;
      if (holds) joint().Start();
      const bool drives =
          order.kp_nm_per_rad > 0 || std::abs(order.torque_nm) > steps.torque_nm ||
          (order.kd_nm_s_per_rad > 0 && std::abs(order.velocity_rad_s) > steps.velocity_rad_s);
      if (drives) {
        joint().Setpoint(order, logged.time_s);
      } else {
        joint().Passive(order);
      }
    }
    joint().End(logged.time_s);
  }

  AkV3Config config_;
  double reported_rad_ = 1e9;
};

class AkV3 final : public ProtocolSide {
 public:
  [[nodiscard]] ProtocolNature nature() const override {
    ProtocolNature nature;
    nature.carries_gains = true;
    nature.clears_errors = false;
    nature.latches_watchdog = false;
    nature.follows_in_error = true;
    return nature;
  }
  [[nodiscard]] WireSteps StepsOf(const DriveConfig& drive) const override {
    const AkV3Ranges& range = Of(drive).range;
    const auto step = [](const DriveRange& of, int bits) {
      return static_cast<double>(of.max - of.min) / (1 << bits);
    };
    WireSteps steps{step(range.position_rad, 16), step(range.velocity_rad_s, 12),
                    step(range.torque_nm, 12)};
    steps.reported_rad = 0.1 * std::acos(-1.0) / 180;
    return steps;
  }
  [[nodiscard]] std::unique_ptr<DriveWatch> Watch(const DriveConfig& drive,
                                                  JointJudge& joint) const override {
    return std::make_unique<testing::Watch>(Of(drive), joint);
  }

  [[nodiscard]] std::uint32_t PositionId(const DriveConfig& drive) const override {
    return 0x2900U | Of(drive).node_id;
  }
  [[nodiscard]] std::uint32_t SetpointId(const DriveConfig& drive) const override {
    return 0x800U | Of(drive).node_id;
  }
  [[nodiscard]] CanFrame StrangersCommand(const DriveConfig& drive) const override {
    return EncodeAkV3Command(Of(drive), {});
  }
  [[nodiscard]] CanFrame TorqueOff(const DriveConfig& drive) const override {
    CanFrame frame;
    frame.id = SetpointId(drive);
    frame.extended = true;
    frame.size = 8;
    frame.data = {0, 0, 0, 0x80, 0, 0x80, 0x08, 0};
    return frame;
  }

  void SpoilSetpoint(CanFrame& frame) const override {
    frame.data[3] = static_cast<std::uint8_t>(frame.data[3] ^ 1U);  // 0.1 rad
  }
  void SpoilReply(CanFrame& frame) const override {
    frame.data[1] = static_cast<std::uint8_t>(frame.data[1] ^ 0x40U);  // 6.4 degrees
  }
  void SpoilTorque(CanFrame& frame) const override {
    frame.data[6] = static_cast<std::uint8_t>(frame.data[6] | 0x0fU);
  }

  void AddSamples(FrameSamples& samples) const override {
    const AkV3Config config;
    AkV3Command command{samples.Number(-14, 14), samples.Number(-70, 70), samples.Number(0, 520),
                        samples.Number(0, 5.2F), samples.Number(-19, 19)};
    const CanFrame sent = EncodeAkV3Command(config, command);
    FrameSamples::Expect(DecodeAkV3Command(config, sent, command));
    samples.Add("AKV3_SETPOINT", sent,
                {{"kp", command.kp_nm_per_rad},
                 {"kd", command.kd_nm_s_per_rad},
                 {"position", command.position_rad},
                 {"velocity", command.velocity_rad_s},
                 {"torque", command.torque_nm}});
    AkV3Status status;
    status.position = static_cast<std::int16_t>(samples.Whole(0, 0xffff));
    status.speed = static_cast<std::int16_t>(samples.Whole(0, 0xffff));
    status.current = static_cast<std::int16_t>(samples.Whole(0, 0xffff));
    status.temperature = static_cast<std::int8_t>(samples.Byte());
    status.error = static_cast<std::uint8_t>(samples.Whole(0, 7));
    const CanFrame report = EncodeAkV3Status(config, status);
    FrameSamples::Expect(DecodeAkV3Status(config, report, status));
    samples.Add("AKV3_REPORT", report,
                {{"position", 0.1 * status.position},
                 {"speed", 10.0 * status.speed},
                 {"current", 0.01 * status.current},
                 {"temperature", status.temperature},
                 {"error", status.error}});
  }
  [[nodiscard]] const char* CodecProblem(const CanFrame& frame) const override {
    const AkV3Config config;
    AkV3Status status;
    if (DecodeAkV3Status(config, frame, status) == Status::kOk &&
        EncodeAkV3Status(config, status) != frame) {
      return "a report is not the same after decoding and encoding";
    }
    return RoundTripProblem<AkV3Command>(
        frame,
        [&config](const CanFrame& f, AkV3Command& v) { return DecodeAkV3Command(config, f, v); },
        [&config](const AkV3Command& v) { return EncodeAkV3Command(config, v); });
  }

 private:
  static const AkV3Config& Of(const DriveConfig& drive) { return std::get<AkV3Config>(drive); }
};

}  // namespace

const ProtocolSide& SideOf(SideTag<AkV3Protocol> /*tag*/) {
  static const AkV3 side;
  return side;
}

}  // namespace tumbler::testing
