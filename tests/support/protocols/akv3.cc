#include "firmware_interface/devices/akv3.h"

#include <cmath>

#include "tests/support/impedance_side.h"

namespace tumbler::testing {
namespace {

class AkV3Watch final : public ImpedanceWatch {
 public:
  AkV3Watch(const AkV3Config& config, JointJudge& joint) : ImpedanceWatch(joint), config_(config) {}

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
    const ImpedanceRanges& range = config_.range;
    DriveOrder order;
    order.kp_nm_per_rad =
        joint().Gain(ValueOfCode(d(0) << 4 | d(1) >> 4, range.kp_nm_per_rad, 4096));
    order.kd_nm_s_per_rad =
        joint().Gain(ValueOfCode((d(1) & 0xf) << 8 | d(2), range.kd_nm_s_per_rad, 4096));
    order.position_rad = joint().Position(ValueOfCode(d(3) << 8 | d(4), range.position_rad, 65536));
    order.velocity_rad_s =
        joint().Velocity(ValueOfCode(d(5) << 4 | d(6) >> 4, range.velocity_rad_s, 4096));
    order.torque_nm = joint().Torque(ValueOfCode((d(6) & 0xf) << 8 | d(7), range.torque_nm, 4096));
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
      TakeOrder(order, logged.time_s);
    }
    joint().End(logged.time_s);
  }

  AkV3Config config_;
  double reported_rad_ = 1e9;
};

class AkV3 final : public ImpedanceSide<AkV3Config, AkV3Watch> {
 public:
  [[nodiscard]] ProtocolNature nature() const override {
    ProtocolNature nature = ImpedanceSide::nature();
    nature.answers = false;
    return nature;
  }
  [[nodiscard]] WireSteps StepsOf(const DriveConfig& drive) const override {
    WireSteps steps = StepsOfRanges(Of(drive).range, 0);
    steps.reported_rad = 0.1 * std::acos(-1.0) / 180;
    return steps;
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

  void AddSamples(FrameSamples& samples) const override {
    const AkV3Config config;
    AddSetpoint(
        samples, "AKV3_SETPOINT",
        [&config](const ImpedanceCommand& v) { return EncodeAkV3Command(config, v); },
        [&config](const CanFrame& f, ImpedanceCommand& v) {
          return DecodeAkV3Command(config, f, v);
        });
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
    return RoundTripProblem<ImpedanceCommand>(
        frame,
        [&config](const CanFrame& f, ImpedanceCommand& v) {
          return DecodeAkV3Command(config, f, v);
        },
        [&config](const ImpedanceCommand& v) { return EncodeAkV3Command(config, v); });
  }
};

}  // namespace

const ProtocolSide& SideOf(SideTag<AkV3Protocol> /*tag*/) {
  static const AkV3 side;
  return side;
}

}  // namespace tumbler::testing
