#include "firmware_interface/devices/cia402.h"

#include <fmt/format.h>

#include <numbers>

#include "tests/support/codec_check.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

class Watch final : public DriveWatch {
 public:
  Watch(const Cia402Config& node, JointJudge& joint) : DriveWatch(joint), node_(node) {}

  // SYNC and the host's heartbeat.
  bool TakeCommon(const LoggedFrame& logged) override {
    if (logged.frame.id == 0x80) {
      joint().bus().OpenTick("SYNC", logged.time_s, joint().order().kind == DriveOrder::Kind::kOff);
      return true;
    }
    return logged.frame.id == 0x700U + node_.host_id;
  }

  bool Take(const LoggedFrame& logged) override {
    const CanFrame& frame = logged.frame;
    const bool nmt = frame.id == 0 && frame.data[1] == node_.node_id;
    if (!nmt && (frame.id & 0x7f) != node_.node_id) return false;
    switch (nmt ? 0 : frame.id & ~0x7fU) {
      case 0x080:
      case 0x280:
      case 0x580:
      case 0x700:
        return true;  // The drive has sent it.
      case 0x180:
        joint().Reply(Position(frame));
        return true;
      case 0x000:
      case 0x600:
        joint().Begin(logged.time_s, false, true);
        if (joint().started()) joint().Fail("set up while it is driven");
        break;
      case 0x200:
        TakeCommand(logged);
        break;
      case 0x300:
        TakeFeedForward(logged);
        break;
      default:
        joint().Fail(fmt::format("identifier {:X}", frame.id));
        return true;
    }
    joint().End(logged.time_s);
    return true;
  }

 private:
  [[nodiscard]] double Position(const CanFrame& frame) {
    return joint().Position(SignedField(frame, 2, 4) * kTwoPi /
                            static_cast<double>(node_.position_units_per_turn));
  }

  void TakeCommand(const LoggedFrame& logged) {
    const std::uint32_t word = UnsignedField(logged.frame, 0, 2);
    const bool on = word == 0x0f, brakes = word == 0x02;
    joint().Begin(logged.time_s, !on && !brakes, true);
    DriveOrder order;
    order.position_rad = Position(logged.frame);
    takes_feed_forward_ = on;
    if (on) {
      if (!joint().started()) {
        if (!switched_on_) joint().FailUnstarted();
        joint().Start();
      }
      // The feed-forward is that of the tick before, unless the second frame changes it.
      order.velocity_rad_s = joint().order().velocity_rad_s;
      order.torque_nm = joint().last_torque_nm();
      joint().Setpoint(order, logged.time_s);
    } else if (brakes) {
      joint().Passive(order);
    } else if (word == 0x00 || word == 0x06 || word == 0x07 || word == 0x80) {
      joint().Off();
      switched_on_ = word == 0x07;
    } else {
      joint().Fail(fmt::format("controlword {:X}", word));
    }
  }

  void TakeFeedForward(const LoggedFrame& logged) {
    const CanFrame& frame = logged.frame;
    const bool first = joint().Begin(logged.time_s, false, true);
    const double velocity_rad_s = joint().Velocity(
        SignedField(frame, 0, 4) * kTwoPi / static_cast<double>(node_.velocity_units_per_turn_s));
    const double torque_nm = joint().Torque(SignedField(frame, 4, 2) * 0.001 *
                                            static_cast<double>(node_.rated_torque_nm));
    if (!first && takes_feed_forward_) {
      joint().FeedForward(velocity_rad_s, torque_nm);
    } else if (torque_nm != 0 || velocity_rad_s != 0) {
      joint().Fail("feed-forward without a setpoint");
    }
  }

  Cia402Config node_;
  bool switched_on_ = false;         // whether the last controlword was the one before operation
  bool takes_feed_forward_ = false;  // whether the last controlword was that of operation
};

class Cia402 final : public ProtocolSide {
 public:
  [[nodiscard]] ProtocolNature nature() const override {
    ProtocolNature nature;
    nature.says_temperature = false;
    nature.error = 0x5530;
    return nature;
  }
  [[nodiscard]] WireSteps StepsOf(const DriveConfig& drive) const override {
    const Cia402Config& node = Of(drive);
    return {kTwoPi / static_cast<double>(node.position_units_per_turn),
            kTwoPi / static_cast<double>(node.velocity_units_per_turn_s),
            0.001 * static_cast<double>(node.rated_torque_nm)};
  }
  [[nodiscard]] std::unique_ptr<DriveWatch> Watch(const DriveConfig& drive,
                                                  JointJudge& joint) const override {
    return std::make_unique<testing::Watch>(Of(drive), joint);
  }

  [[nodiscard]] std::uint32_t PositionId(const DriveConfig& drive) const override {
    return 0x180U + Of(drive).node_id;
  }
  [[nodiscard]] std::uint32_t HeartbeatId(const DriveConfig& drive) const override {
    return 0x700U + Of(drive).node_id;
  }
  [[nodiscard]] std::uint32_t SetpointId(const DriveConfig& drive) const override {
    return 0x200U + Of(drive).node_id;
  }
  [[nodiscard]] std::uint32_t TorqueId(const DriveConfig& drive) const override {
    return 0x300U + Of(drive).node_id;
  }
  [[nodiscard]] std::uint32_t EnableId(const DriveConfig& drive) const override {
    return SetpointId(drive);
  }
  [[nodiscard]] CanFrame StrangersCommand(const DriveConfig& drive) const override {
    return EncodeCia402(Of(drive).node_id, Cia402FeedForward{});
  }
  [[nodiscard]] CanFrame TorqueOff(const DriveConfig& drive) const override {
    CanFrame frame;
    frame.id = SetpointId(drive);
    frame.size = 6;
    return frame;
  }
  [[nodiscard]] std::optional<CanFrame> DropOut(const DriveConfig& drive) const override {
    return EncodeNmt(NmtCommand::kPreOperational, Of(drive).node_id);
  }
  void Hasten(DriveConfig& drive) const override {
    std::get<Cia402Config>(drive).heartbeat_ms = 10;
  }

  void SpoilSetpoint(CanFrame& frame) const override {
    frame.data[3] = static_cast<std::uint8_t>(frame.data[3] ^ 0x10U);  // 4096 of 65536 a turn
  }
  void SpoilReply(CanFrame& frame) const override { SpoilSetpoint(frame); }
  void SpoilTorque(CanFrame& frame) const override { frame.data[5] = 0x7f; }

  void AddSamples(FrameSamples& samples) const override {
    AddSamplesOfCanOpen(samples);
    const Cia402Command command{static_cast<std::uint16_t>(samples.Whole(0, 255)),
                                samples.Signed()};
    samples.Add("RPDO1", EncodeCia402(1, command),
                {{"controlword", command.controlword}, {"target", command.position}});
    const auto torque = static_cast<std::int16_t>(samples.Signed());
    const Cia402FeedForward feed_forward{samples.Signed(), torque};
    // The torque counts thousandths, but the file shows per cent.
    samples.Add("RPDO2", EncodeCia402(1, feed_forward),
                {{"velocity_offset", feed_forward.velocity}, {"torque_offset", torque / 10.0}});
    const Cia402Status status{static_cast<std::uint16_t>(samples.Whole(0, 65535)),
                              samples.Signed()};
    samples.Add("TPDO1", EncodeCia402(1, status),
                {{"statusword", status.statusword}, {"position", status.position}});
    const Cia402Motion motion{samples.Signed(), torque};
    samples.Add("TPDO2", EncodeCia402(1, motion),
                {{"velocity", motion.velocity}, {"torque", torque / 10.0}});
  }
  [[nodiscard]] const char* CodecProblem(const CanFrame& frame) const override {
    const auto problem = [&frame](auto value) {
      using Value = decltype(value);
      return RoundTripProblem<Value>(
          frame, [](const CanFrame& f, Value& v) { return DecodeCia402(1, f, v); },
          [](const Value& v) { return EncodeCia402(1, v); });
    };
    return FirstProblem(
        {problem(Cia402Command{}), problem(Cia402FeedForward{}), problem(Cia402Status{}),
         problem(Cia402Motion{}),
         RoundTripProblem<SdoRequest>(
             frame, [](const CanFrame& f, SdoRequest& v) { return DecodeSdoRequest(1, f, v); },
             [](const SdoRequest& v) { return EncodeSdoRequest(1, v); }),
         RoundTripProblem<SdoReply>(
             frame, [](const CanFrame& f, SdoReply& v) { return DecodeSdoReply(1, f, v); },
             [](const SdoReply& v) { return EncodeSdoReply(1, v); }),
         RoundTripProblem<CanOpenEmergency>(
             frame, [](const CanFrame& f, CanOpenEmergency& v) { return DecodeEmergency(1, f, v); },
             [](const CanOpenEmergency& v) { return EncodeEmergency(1, v); }),
         RoundTripProblem<NmtState>(
             frame, [](const CanFrame& f, NmtState& v) { return DecodeNodeState(1, f, v); },
             [](const NmtState& v) { return EncodeNodeState(1, v); })});
  }

 private:
  static void AddSamplesOfCanOpen(FrameSamples& samples) {
    samples.Add("NMT", EncodeNmt(NmtCommand::kStart, 1), {{"command", 1}, {"node", 1}});
    samples.Add("NMT", EncodeNmt(NmtCommand::kPreOperational, 0), {{"command", 128}, {"node", 0}});
    samples.Add("SYNC", EncodeSync(), {});
    samples.Add("HEARTBEAT", EncodeNodeState(1, NmtState::kPreOperational), {{"state", 127}});
    samples.Add("HOST_HEARTBEAT", EncodeNodeState(127, NmtState::kOperational), {{"state", 5}});
    const CanOpenEmergency emergency{
        static_cast<std::uint16_t>(samples.Whole(0, 65535)), samples.Byte(), {}};
    samples.Add("EMCY", EncodeEmergency(1, emergency),
                {{"code", emergency.code}, {"error_register", emergency.error_register}});
    const SdoRequest request{true, static_cast<std::uint16_t>(samples.Whole(0, 65535)),
                             samples.Byte(), 4, samples.Word()};
    samples.Add("SDO_REQUEST", EncodeSdoRequest(1, request),
                {{"specifier", 0x23},
                 {"index", request.index},
                 {"sub", request.sub},
                 {"value", request.value}});
    const SdoReply abort{SdoReply::Kind::kAborted, request.index, request.sub, 0, samples.Word()};
    samples.Add(
        "SDO_REPLY", EncodeSdoReply(1, abort),
        {{"specifier", 0x80}, {"index", abort.index}, {"sub", abort.sub}, {"value", abort.value}});
  }
  static const Cia402Config& Of(const DriveConfig& drive) { return std::get<Cia402Config>(drive); }
};

}  // namespace

const ProtocolSide& SideOf(SideTag<Cia402Protocol> /*tag*/) {
  static const Cia402 side;
  return side;
}

}  // namespace tumbler::testing
