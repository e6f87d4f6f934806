#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_world.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/protocol_side.h"

namespace tumbler {

inline std::string Example(const testing::ExampleDrives& example) {
  return testing::ReadFile(testing::SourcePath(example.file));
}

/// Simulated drives with rotors. Every frame that is sent can be looked at, or kept back.
class RigWorld final : public BenchWorld, private CanBus {
 public:
  explicit RigWorld(const DrivesConfig& drives)
      : bus_(drives.bit_rate), clock_([this](std::int64_t ns) {
          plant_->AdvanceTo(ns);
          if (each_tick) each_tick();
        }) {
    std::vector<RotorPlant::Rotor> rotors;
    for (const DriveEntry& entry : drives.drives) {
      simulated.push_back(MakeSimulatedDrive(entry));
      simulated.back()->AttachTo(bus_);
      RotorPlant::Rotor rotor;
      rotor.drive = simulated.back().get();
      rotor.damping_nm_s_per_rad = 0.1;
      rotors.push_back(rotor);
    }
    SimulatedPortConfig host;
    host.transmit_capacity = 64;
    host_ = &bus_.Attach(host);
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
  }
  CanBus& bus() override { return *this; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] BusTrouble trouble() const override { return {}; }

  [[nodiscard]] bool AnyEnabled() const {
    bool any = false;
    for (const auto& drive : simulated) any = any || drive->enabled();
    return any;
  }
  RotorPlant::Rotor& rotor(std::size_t i) { return plant_->rotors()[i]; }
  SimulatedBus& wire() { return bus_; }

  std::vector<std::unique_ptr<SimulatedDrive>> simulated;
  std::vector<CanFrame> sent;
  std::function<void()> each_tick;
  /// Changes a received frame; may be empty.
  std::function<void(CanFrame&)> on_receive;

 private:
  Status Send(const CanFrame& frame) noexcept override {
    sent.push_back(frame);
    return host_->Send(frame);
  }
  Status Receive(ReceivedFrame& received) noexcept override {
    const Status status = host_->Receive(received);
    if (status == Status::kOk && on_receive) on_receive(received.frame);
    return status;
  }

  SimulatedBus bus_;
  std::unique_ptr<RotorPlant> plant_;
  SimulatedPort* host_ = nullptr;
  VirtualClock clock_;
};

class BenchOf : public ::testing::TestWithParam<testing::ExampleDrives> {
 protected:
  BenchOf() : drives_(ParseDrives(Example(GetParam()), "example")), world_(drives_) {}

  [[nodiscard]] const testing::ProtocolSide& side() const {
    return testing::SideOf(drives_.drives[0].config);
  }
  /// Whether a drive's silence is judged by its torque, because it does not say that it let go.
  [[nodiscard]] bool IsPushed() const { return side().HeartbeatId(drives_.drives[0].config) == 0; }
  /// The positions that frames to the drive ask for, in order.
  [[nodiscard]] std::vector<double> Asked(std::size_t drive) const {
    std::vector<double> asked;
    DriveProtocols::With(drives_.drives[drive].config, [&](auto protocol, const auto& config) {
      double shaft_rad = 0;
      for (const CanFrame& frame : world_.sent) {
        if (decltype(protocol)::CommandedPosition(config, frame, shaft_rad))
          asked.push_back(shaft_rad);
      }
      return 0;
    });
    return asked;
  }

  DrivesConfig drives_;
  RigWorld world_;
};

}  // namespace tumbler
