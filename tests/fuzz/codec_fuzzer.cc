// Sends arbitrary frames at arbitrary times to both sides of every drive protocol. The input is a
// series of steps of 16 bytes: an action, and a frame. The numbers of a setpoint come from the same
// bytes.
//
// Besides the errors that sanitizers find, it checks that host frames are valid; that nothing
// beyond a drive's ranges is encoded; that a simulated drive's torque stays within its limit; and
// that a value that was decoded is the same after encoding and decoding it again.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "firmware_interface/can/frame_length.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/make_simulated.h"
#include "tests/support/protocol_side.h"

namespace {

using namespace tumbler;

constexpr std::size_t kStepBytes = 16;
constexpr double kTorqueMax_nm = 18;

void Require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "codec_fuzzer: %s\n", what);
  std::abort();
}

/// The host and the simulated drive of every protocol, each on a bus of its own.
struct World {
  static constexpr std::size_t kCount = DriveProtocols::kCount;

  World() {
    std::size_t i = 0;
    DriveProtocols::ForEach([&](auto protocol) {
      auto config = decltype(protocol)::Example(0);
      config.joint = {-1, 2, 0.3F};
      DriveEntry entry;
      entry.config = config;
      entry.kp_nm_per_rad = 200;
      entry.kd_nm_s_per_rad = 4;
      configs[i] = config;
      Require(bank.Add(config) == Status::kOk, "a configuration is not valid");
      drives[i] = MakeSimulatedDrive(entry);
      ports[i] = &buses[i].Attach();
      drives[i]->AttachTo(buses[i]);
      ++i;
    });
  }

  std::array<DriveConfig, kCount> configs;
  DriveBank bank;
  std::array<SimulatedBus, kCount> buses;
  std::array<SimulatedPort*, kCount> ports{};
  std::array<std::unique_ptr<SimulatedDrive>, kCount> drives;
  std::int64_t now_ns = 0;
  double position_rad = 0;
};

CanFrame FrameOf(const std::uint8_t* step) {
  CanFrame frame;
  frame.remote = (step[3] & 0x40) != 0;
  frame.extended = (step[3] & 0x80) != 0;
  frame.id =
      (std::uint32_t{step[1]} | std::uint32_t{step[2]} << 8) & (frame.extended ? 0xffffU : 0x7ffU);
  frame.size = static_cast<std::uint8_t>((step[3] & 0xf) % 9);
  std::memcpy(frame.data.data(), step + 4, 8);
  return frame;
}

DriveSetpoint SetpointOf(const std::uint8_t* step) {
  DriveSetpoint setpoint;
  std::memcpy(&setpoint.position_rad, step + 4, 4);
  std::memcpy(&setpoint.velocity_rad_s, step + 8, 4);
  std::memcpy(&setpoint.torque_nm, step + 12, 4);
  setpoint.kp_nm_per_rad = (step[3] & 1) != 0 ? 100.0F : 0.0F;
  setpoint.kd_nm_s_per_rad = 2;
  return setpoint;
}

void CheckCodecs(const CanFrame& frame) {
  for (const testing::TestedProtocol& protocol : testing::EveryProtocol()) {
    const char* problem = protocol.side->CodecProblem(frame);
    Require(problem == nullptr, problem);
  }
}

bool IsWithin(float value, const DriveRange& range) {
  const float slack = 1e-5F * (range.max - range.min);
  return value >= range.min - slack && value <= range.max + slack;
}

void EncodeAndCheck(World& world, std::size_t i, DriveRequest request,
                    const DriveSetpoint& setpoint) {
  Drive& host = *world.bank.drives()[i];
  FrameBatch batch;
  const Status status = host.Encode(request, setpoint, batch);
  Require(status == Status::kOk || (request == DriveRequest::kEnable && !setpoint.IsFinite()),
          "a setpoint is refused without a reason");
  Require(!batch.frames().empty(), "a tick does not write its drive");
  for (const CanFrame& frame : batch.frames()) {
    Require(IsValid(frame) && !frame.remote, "a frame of the host is not valid");
    static_cast<void>(world.ports[i]->Send(frame));
  }
  const JointMap& joint = JointOf(world.configs[i]);
  const ShaftRanges ranges = CommandRanges(world.configs[i]);
  const DriveSetpoint encoded = host.encoded_setpoint();
  const bool setpoints = encoded.velocity_rad_s != 0 || encoded.torque_nm != 0;
  if (request != DriveRequest::kEnable || !setpoints) return;  // It may encode the measurement.
  Require(IsWithin(joint.ToDriveVelocity(encoded.velocity_rad_s), ranges.velocity_rad_s),
          "a velocity beyond its range");
  Require(IsWithin(joint.ToDriveTorque(encoded.torque_nm), ranges.torque_nm),
          "a torque beyond its range");
}

void Advance(World& world, std::int64_t time_ns) {
  world.now_ns += time_ns;
  for (std::size_t i = 0; i < World::kCount; ++i) {
    world.buses[i].AdvanceTo(world.now_ns);
    const double torque = world.drives[i]->Step(world.now_ns, world.position_rad, 0.1);
    Require(std::isfinite(torque) && std::abs(world.drives[i]->torque_nm()) <= kTorqueMax_nm,
            "a torque beyond the motor's");
    world.buses[i].AdvanceTo(world.now_ns + 900'000);
  }
  world.now_ns += 900'000;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  World world;
  for (std::size_t at = 0; at + kStepBytes <= size; at += kStepBytes) {
    const std::uint8_t* step = data + at;
    const CanFrame frame = FrameOf(step);
    const std::size_t i = (step[0] >> 4) % (World::kCount + 1);
    if (i == World::kCount) {
      CheckCodecs(frame);
      continue;
    }
    switch (step[0] & 0x7) {
      case 0:
        static_cast<void>(world.bank.drives()[i]->Decode(frame));
        break;
      case 1:
        static_cast<void>(world.ports[i]->Send(frame));
        Advance(world, 200'000);
        break;
      case 2:
        EncodeAndCheck(world, i, DriveRequest::kEnable, SetpointOf(step));
        Advance(world, 100'000);
        break;
      case 3:
        EncodeAndCheck(world, i,
                       (step[3] & 2) != 0 ? DriveRequest::kClearErrors : DriveRequest::kDisable,
                       SetpointOf(step));
        Advance(world, 100'000);
        break;
      case 4:
        Advance(world, std::int64_t{step[4]} * 1'000'000);
        break;
      default: {  // Some ticks of host and drive with each other, so that deep states are reached.
        ReceivedFrame received;
        for (int tick = 0; tick < 1 + step[4] % 64; ++tick) {
          while (world.ports[i]->Receive(received) == Status::kOk) {
            static_cast<void>(world.bank.drives()[i]->Decode(received.frame));
          }
          EncodeAndCheck(world, i,
                         (step[3] & 1) != 0 ? DriveRequest::kEnable : DriveRequest::kDisable,
                         {static_cast<float>(world.position_rad), 0, 0, 100, 2});
          Advance(world, 100'000);
        }
        break;
      }
    }
  }
  return 0;
}
