#include "runtime/bench/drive_reading.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>

#include "firmware_interface/devices/damiao_registers.h"
#include "firmware_interface/devices/wire.h"
#include "runtime/bench/bench_session.h"

namespace tumbler {
namespace {

/// An object of a CiA 402 drive.
struct ObjectName {
  std::uint16_t index;
  std::uint8_t sub;
  const char* name;
  const char* unit;
  bool is_signed;
  bool is_hex;
};
constexpr std::array kObjects = {
    ObjectName{0x1000, 0, "device type", "", false, true},
    ObjectName{0x1001, 0, "error register", "", false, true},
    ObjectName{0x1018, 1, "vendor", "", false, true},
    ObjectName{0x1018, 2, "product", "", false, true},
    ObjectName{0x1018, 3, "revision", "", false, true},
    ObjectName{0x1016, 1, "consumer heartbeat", "", false, true},
    ObjectName{0x1017, 0, "heartbeat", "ms", false, false},
    ObjectName{0x6007, 0, "reaction to a lost connection", "", true, false},
    ObjectName{0x603f, 0, "error code", "", false, true},
    ObjectName{0x6041, 0, "statusword", "", false, true},
    ObjectName{0x605a, 0, "quick stop option", "", true, false},
    ObjectName{0x6061, 0, "mode", "", true, false},
    ObjectName{0x6064, 0, "position", "increments", true, false},
    ObjectName{0x6065, 0, "following window", "increments", false, false},
    ObjectName{0x606c, 0, "velocity", "units", true, false},
    ObjectName{0x6075, 0, "rated current", "mA", false, false},
    ObjectName{0x6076, 0, "rated torque", "mN m", false, false},
    ObjectName{0x6077, 0, "torque", "thousandths", true, false},
    ObjectName{0x6079, 0, "supply voltage", "mV", false, false},
    ObjectName{0x608f, 1, "encoder increments", "", false, false},
    ObjectName{0x608f, 2, "motor turns", "", false, false},
    ObjectName{0x6091, 1, "gear, motor turns", "", false, false},
    ObjectName{0x6091, 2, "gear, shaft turns", "", false, false},
    ObjectName{0x6502, 0, "supported modes", "", false, true},
};

/// A message of a CANSimple drive: two values of 4 bytes.
struct MessageName {
  std::uint8_t command;
  bool is_float;
  std::array<const char*, 2> names;
  std::array<const char*, 2> units;
};
constexpr std::array kMessages = {
    MessageName{0x00, false, {"version, low bytes", "version, high bytes"}, {"", ""}},
    MessageName{0x03, false, {"active errors", "reason of the last disarm"}, {"", ""}},
    MessageName{0x09, true, {"position", "velocity"}, {"turns", "turns/s"}},
    MessageName{0x14, true, {"current asked for", "current"}, {"A", "A"}},
    MessageName{0x15, true, {"temperature of transistors", "temperature of motor"}, {"C", "C"}},
    MessageName{0x17, true, {"supply voltage", "supply current"}, {"V", "A"}},
    MessageName{0x1c, true, {"torque asked for", "torque"}, {"N m", "N m"}},
};

/// A register of a Damiao drive.
struct RegisterName {
  std::uint8_t number;
  const char* name;
  const char* unit;
  bool is_float;
};
constexpr std::array kRegisters = {
    RegisterName{0, "under-voltage", "V", true},
    RegisterName{1, "torque coefficient", "", true},
    RegisterName{2, "over-temperature", "C", true},
    RegisterName{3, "over-current", "", true},
    RegisterName{kDamiaoReplyId, "identifier of replies", "", false},
    RegisterName{kDamiaoCommandId, "identifier of commands", "", false},
    RegisterName{kDamiaoTimeOut, "time-out", "50 us", false},
    RegisterName{10, "control mode", "", false},
    RegisterName{kDamiaoPositionMax, "largest position", "rad", true},
    RegisterName{kDamiaoVelocityMax, "largest velocity", "rad/s", true},
    RegisterName{kDamiaoTorqueMax, "largest torque", "N m", true},
};

/// Sends a question until `is_answer` takes a frame, a few times. @returns whether it did.
bool AskDrive(BenchWorld& world, const CanFrame& question,
              const std::function<bool(const CanFrame&)>& is_answer) {
  constexpr int kTries = 3;
  constexpr std::int64_t kPatience_ns = 20'000'000;
  constexpr std::int64_t kGlimpse_ns = 1'000'000;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    const Status sent = world.bus().Send(question);
    if (sent != Status::kOk && sent != Status::kWouldBlock)
      throw BenchFault(fmt::format("the bus is lost: {}", ToString(sent)));
    const std::int64_t end_ns = world.clock().now_ns() + kPatience_ns;
    while (world.clock().now_ns() < end_ns) {
      EndWhereAsked();
      world.clock().SleepUntil(world.clock().now_ns() + kGlimpse_ns);
      ReceivedFrame received;
      bool answered = false;
      while (world.bus().Receive(received) == Status::kOk)
        answered = answered || is_answer(received.frame);
      if (answered) return true;
    }
  }
  return false;
}

std::vector<DriveReading> ReadObjects(BenchWorld& world, std::uint8_t node) {
  std::vector<DriveReading> readings;
  for (const ObjectName& object : kObjects) {
    SdoRequest request;
    request.write = false;
    request.index = object.index;
    request.sub = object.sub;
    SdoReply reply;
    const bool answered = AskDrive(world, EncodeSdoRequest(node, request), [&](const CanFrame& f) {
      return DecodeSdoReply(node, f, reply) == Status::kOk && reply.index == object.index &&
             reply.sub == object.sub;
    });
    // A drive that does not answer one question answers none.
    if (!answered && readings.empty()) return readings;
    if (!answered || reply.kind != SdoReply::Kind::kRead) continue;
    double value = reply.value;
    const double span = std::ldexp(1.0, 8 * reply.size);
    if (object.is_signed && value >= span / 2) value -= span;
    readings.push_back({fmt::format("{:04x}h:{:02x} {}", object.index, object.sub, object.name),
                        object.unit, value, object.is_hex});
  }
  return readings;
}

std::vector<DriveReading> ReadMessages(BenchWorld& world, std::uint8_t node) {
  std::vector<DriveReading> readings;
  for (const MessageName& message : kMessages) {
    CanFrame ask;
    ask.id = CanSimpleId(node, static_cast<CanSimpleCommand>(message.command));
    ask.remote = true;
    ask.size = 8;
    CanFrame answer;
    const bool answered = AskDrive(world, ask, [&](const CanFrame& frame) {
      if (frame.id != ask.id || frame.extended || frame.remote || frame.size != 8) return false;
      answer = frame;
      return true;
    });
    if (!answered) continue;
    for (std::size_t i = 0; i < 2; ++i) {
      const std::uint32_t raw = LoadLittle(answer.data, 4 * i, 4);
      const double value =
          message.is_float ? double{std::bit_cast<float>(raw)} : static_cast<double>(raw);
      readings.push_back({message.names[i], message.units[i], value, !message.is_float});
    }
  }
  return readings;
}

std::vector<DriveReading> ReadRegisters(BenchWorld& world, const MitConfig& drive) {
  std::vector<DriveReading> readings;
  for (const RegisterName& name : kRegisters) {
    DamiaoRegister of;
    of.drive = drive.command_id;
    of.number = name.number;
    DamiaoRegister answer;
    const CanFrame ask = EncodeDamiao(kDamiaoRegistersId, of);
    const bool answered = AskDrive(world, ask, [&](const CanFrame& frame) {
      return frame.id == drive.reply_id && DecodeDamiao(frame, answer) &&
             answer.drive == of.drive && answer.number == of.number;
    });
    if (!answered) continue;
    readings.push_back(
        {fmt::format("register {} {}", name.number, name.name), name.unit,
         name.is_float ? double{answer.number_value()} : static_cast<double>(answer.value), false});
  }
  return readings;
}

}  // namespace

std::vector<DriveReading> ReadDrive(BenchWorld& world, const DriveEntry& entry) {
  if (const auto* cia402 = std::get_if<Cia402Config>(&entry.config))
    return ReadObjects(world, cia402->node_id);
  if (const auto* can = std::get_if<CanSimpleConfig>(&entry.config))
    return ReadMessages(world, can->node_id);
  const auto* mit = std::get_if<MitConfig>(&entry.config);
  return mit != nullptr && mit->dialect == MitDialect::kDamiao ? ReadRegisters(world, *mit)
                                                               : std::vector<DriveReading>{};
}

Judgement JudgeReadings(const DriveEntry& entry, const std::vector<DriveReading>& readings) {
  Judgement judgement;
  const auto compare = [&](const std::string& head, double unit, double in_file, const char* key,
                           const char* kind) {
    for (const DriveReading& reading : readings) {
      if (reading.name.compare(0, head.size(), head) != 0) continue;
      judgement.judged.push_back(fmt::format("{}: {} against {}", entry.joint, reading.name, key));
      const double value = unit * reading.value;
      if (std::abs(value - in_file) <= 1e-3 * std::abs(in_file)) continue;
      judgement.findings.push_back(
          {kind, entry.joint,
           fmt::format(
               "the drive of {} holds {} = {:.6g}, and {} of the drives file is {:.6g}: with "
               "the file's, setpoints and replies are off by a factor",
               entry.joint, reading.name, value, key, in_file)});
    }
  };
  if (const auto* mit = std::get_if<MitConfig>(&entry.config)) {
    const auto range = [&](std::uint8_t number, const DriveRange& in_file, const char* key) {
      compare(fmt::format("register {} ", number), 1, double{in_file.max}, key, "other-range");
    };
    range(kDamiaoPositionMax, mit->command.position_rad, "range.position_rad");
    range(kDamiaoVelocityMax, mit->command.velocity_rad_s, "range.velocity_rad_s");
    range(kDamiaoTorqueMax, mit->command.torque_nm, "range.torque_nm");
  } else if (const auto* cia402 = std::get_if<Cia402Config>(&entry.config)) {
    constexpr double kMilli = 1e-3;
    compare("6076h:00 ", kMilli, double{cia402->rated_torque_nm}, "rated_torque_nm",
            "other-constant");
  }
  return judgement;
}

std::string Describe(const DriveReading& reading) {
  const std::string value = reading.is_hex
                                ? fmt::format("0x{:x}", static_cast<std::uint64_t>(reading.value))
                                : fmt::format("{:.6g}", reading.value);
  return fmt::format("{}: {}{}{}", reading.name, value, reading.unit.empty() ? "" : " ",
                     reading.unit);
}

Json ToJson(const std::vector<DriveReading>& readings) {
  Json json = Json::Array();
  for (const DriveReading& reading : readings)
    json.Append({{"name", reading.name}, {"value", reading.value}, {"unit", reading.unit}});
  return json;
}

}  // namespace tumbler
