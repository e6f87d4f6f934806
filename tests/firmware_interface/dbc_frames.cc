// Writes frames of every kind that the codecs make, from random values, and what the codecs read
// from them: `DBC MESSAGE IDENTIFIER HEX signal=value ...`, a frame a line.
// tests/firmware_interface/dbc_check.py holds the .dbc files against it.

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <limits>
#include <random>
#include <utility>

#include "firmware_interface/drives/cansimple.h"
#include "firmware_interface/drives/cia402.h"
#include "firmware_interface/drives/mit.h"
#include "firmware_interface/drives/wire.h"

namespace tumbler {
namespace {

using Signals = std::initializer_list<std::pair<const char*, double>>;

void Write(const char* dbc, const char* message, const CanFrame& frame, Signals signals) {
  std::printf("%s %s %u ", dbc, message, frame.id);
  for (std::size_t i = 0; i < frame.size; ++i) std::printf("%02x", frame.data[i]);
  if (frame.size == 0) std::printf("-");
  for (const auto& [name, value] : signals) std::printf(" %s=%.17g", name, value);
  std::printf("\n");
}

class Frames {
 public:
  void Mit() {
    const MitConfig mit;
    MitCommand command{Number(-14, 14), Number(-55, 55), Number(0, 520), Number(0, 5.2F),
                       Number(-19, 19)};
    const CanFrame sent = EncodeMitCommand(mit, command);
    Expect(DecodeMitCommand(mit, sent, command));
    Write("mit_mini_cheetah", "MIT_COMMAND", sent,
          {{"position", command.position_rad},
           {"velocity", command.velocity_rad_s},
           {"kp", command.kp_nm_per_rad},
           {"kd", command.kd_nm_s_per_rad},
           {"torque", command.torque_nm}});
    MitReply reply;
    reply.sender = 1;
    reply.position_rad = Number(-12, 12);
    reply.velocity_rad_s = Number(-49, 49);
    reply.torque_nm = Number(-17, 17);
    reply.temperature_c = Number(-100, 120);
    reply.error = static_cast<std::uint8_t>(Whole(0, 6));
    const CanFrame answer = EncodeMitReply(mit, reply);
    Expect(DecodeMitReply(mit, answer, reply));
    Write("mit_mini_cheetah", "MIT_REPLY", answer,
          {{"sender", reply.sender},
           {"position", reply.position_rad},
           {"velocity", reply.velocity_rad_s},
           {"torque", reply.torque_nm},
           {"temperature", reply.temperature_c},
           {"error", reply.error}});
  }

  void CanSimple() {
    const char* dbc = "odrive_cansimple";
    CanSimpleHeartbeat heartbeat{Word(), Byte(), Byte(), Whole(0, 1) == 1};
    Made(dbc, "HEARTBEAT", heartbeat, [](const auto& v) {
      return std::array<std::pair<const char*, double>, 4>{
          {{"error", v.error},
           {"state", v.state},
           {"procedure_result", v.procedure_result},
           {"trajectory_done", v.trajectory_done ? 1.0 : 0.0}}};
    });
    Two(dbc, "GET_ERROR", CanSimpleErrors{Word(), Word()}, "active", &CanSimpleErrors::active,
        "disarm_reason", &CanSimpleErrors::disarm_reason);
    Two(dbc, "GET_ENCODER_ESTIMATES", CanSimpleEstimates{Number(-1e3F, 1e3F), Number(-50, 50)},
        "position", &CanSimpleEstimates::position_rev, "velocity",
        &CanSimpleEstimates::velocity_rev_s);
    Two(dbc, "SET_CONTROLLER_MODE", CanSimpleControllerMode{Whole(0, 3), Whole(0, 7)}, "control",
        &CanSimpleControllerMode::control, "input", &CanSimpleControllerMode::input);
    Two(dbc, "SET_INPUT_VEL", CanSimpleInputVel{Number(-50, 50), Number(-9, 9)}, "velocity",
        &CanSimpleInputVel::velocity_rev_s, "torque", &CanSimpleInputVel::torque_nm);
    Two(dbc, "GET_TEMPERATURE", CanSimpleTemperature{Number(-20, 120), Number(-20, 120)}, "fet",
        &CanSimpleTemperature::fet_c, "motor", &CanSimpleTemperature::motor_c);
    Two(dbc, "GET_TORQUES", CanSimpleTorques{Number(-9, 9), Number(-9, 9)}, "target",
        &CanSimpleTorques::target_nm, "estimate", &CanSimpleTorques::estimate_nm);
    Made(dbc, "SET_INPUT_POS",
         CanSimpleInputPos{Number(-1e3F, 1e3F), Number(-40, 40), Number(-40, 40)},
         [](const auto& v) {
           return std::array<std::pair<const char*, double>, 3>{{{"position", v.position_rev},
                                                                 {"velocity", v.velocity_rev_s},
                                                                 {"torque", v.torque_nm}}};
         });
    Made(dbc, "SET_AXIS_STATE", CanSimpleAxisState{Whole(0, 20)}, [](const auto& v) {
      return std::array<std::pair<const char*, double>, 1>{{{"state", v.state}}};
    });
    Write(dbc, "ESTOP", EncodeCanSimpleEstop(1), {});
    Write(dbc, "CLEAR_ERRORS", EncodeCanSimpleClearErrors(1), {{"identify", 0}});
  }

  void Cia402() {
    const char* dbc = "cia402_csp";
    Write(dbc, "NMT", EncodeNmt(NmtCommand::kStart, 1), {{"command", 1}, {"node", 1}});
    Write(dbc, "NMT", EncodeNmt(NmtCommand::kPreOperational, 0), {{"command", 128}, {"node", 0}});
    Write(dbc, "SYNC", EncodeSync(), {});
    Write(dbc, "HEARTBEAT", EncodeNodeState(1, NmtState::kPreOperational), {{"state", 127}});
    Write(dbc, "HOST_HEARTBEAT", EncodeNodeState(127, NmtState::kOperational), {{"state", 5}});
    const CanOpenEmergency emergency{static_cast<std::uint16_t>(Whole(0, 65535)), Byte(), {}};
    Write(dbc, "EMCY", EncodeEmergency(1, emergency),
          {{"code", emergency.code}, {"error_register", emergency.error_register}});
    const Cia402Command command{static_cast<std::uint16_t>(Whole(0, 255)), Signed()};
    Write(dbc, "RPDO1", EncodeCia402(1, command),
          {{"controlword", command.controlword}, {"target", command.position}});
    const auto torque = static_cast<std::int16_t>(Signed());
    const Cia402FeedForward feed_forward{Signed(), torque};
    // The torque counts thousandths, the file shows per cent.
    Write(dbc, "RPDO2", EncodeCia402(1, feed_forward),
          {{"velocity_offset", feed_forward.velocity}, {"torque_offset", torque / 10.0}});
    const Cia402Status status{static_cast<std::uint16_t>(Whole(0, 65535)), Signed()};
    Write(dbc, "TPDO1", EncodeCia402(1, status),
          {{"statusword", status.statusword}, {"position", status.position}});
    const Cia402Motion motion{Signed(), torque};
    Write(dbc, "TPDO2", EncodeCia402(1, motion),
          {{"velocity", motion.velocity}, {"torque", torque / 10.0}});
    const SdoRequest request{true, static_cast<std::uint16_t>(Whole(0, 65535)), Byte(), 4, Word()};
    Write(dbc, "SDO_REQUEST", EncodeSdoRequest(1, request),
          {{"specifier", 0x23},
           {"index", request.index},
           {"sub", request.sub},
           {"value", request.value}});
    const SdoReply abort{SdoReply::Kind::kAborted, request.index, request.sub, 0, Word()};
    Write(
        dbc, "SDO_REPLY", EncodeSdoReply(1, abort),
        {{"specifier", 0x80}, {"index", abort.index}, {"sub", abort.sub}, {"value", abort.value}});
  }

 private:
  static void Expect(Status status) {
    if (status != Status::kOk) std::abort();
  }
  /// Encodes for node 1, and writes what decoding gives.
  template <typename Value, typename Name>
  static void Made(const char* dbc, const char* message, Value value, Name name) {
    const CanFrame frame = EncodeCanSimple(1, value);
    Value read;
    Expect(DecodeCanSimple(1, frame, read));
    std::printf("%s %s %u ", dbc, message, frame.id);
    for (std::size_t i = 0; i < frame.size; ++i) std::printf("%02x", frame.data[i]);
    for (const auto& [signal, number] : name(read)) std::printf(" %s=%.17g", signal, number);
    std::printf("\n");
  }
  template <typename Value, typename A, typename B>
  static void Two(const char* dbc, const char* message, const Value& value, const char* first,
                  A Value::*a, const char* second, B Value::*b) {
    Made(dbc, message, value, [&](const Value& v) {
      return std::array<std::pair<const char*, double>, 2>{
          {{first, static_cast<double>(v.*a)}, {second, static_cast<double>(v.*b)}}};
    });
  }

  float Number(float min, float max) {
    return std::uniform_real_distribution<float>(min, max)(random_);
  }
  std::uint32_t Whole(std::uint32_t min, std::uint32_t max) {
    return std::uniform_int_distribution<std::uint32_t>(min, max)(random_);
  }
  std::uint32_t Word() { return Whole(0, std::numeric_limits<std::uint32_t>::max()); }
  std::uint8_t Byte() { return static_cast<std::uint8_t>(Whole(0, 255)); }
  std::int32_t Signed() { return static_cast<std::int32_t>(Word()); }

  std::mt19937 random_{11};
};

}  // namespace
}  // namespace tumbler

int main() {
  tumbler::Frames frames;
  for (int i = 0; i < 200; ++i) {
    frames.Mit();
    frames.CanSimple();
    frames.Cia402();
  }
}
