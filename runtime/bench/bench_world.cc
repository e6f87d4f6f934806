#include "runtime/bench/bench_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "common/files/program.h"
#include "firmware_interface/can/bus_faults_toml.h"
#include "firmware_interface/can/interface_lock.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"

namespace tumbler {
namespace {

class InterfaceBench final : public BenchWorld {
 public:
  InterfaceBench(const std::string& interface, const DrivesConfig* drives, bool driving) {
    const std::string problem = lock_.Take(interface);
    if (!problem.empty()) throw Refused(problem);
    SocketCanBus probe;  // What refuses comes before anything that changes the interface.
    Open(probe, interface, {});
    const std::int64_t bit_rate = probe.link().bit_rate;
    if (drives != nullptr && bit_rate != 0 && bit_rate != drives->bit_rate) {
      throw Refused(
          fmt::format("{} runs at {} bit/s, but the drives file says {}: correct one of them",
                      interface, bit_rate, drives->bit_rate));
    }
    probe.Close();
    SocketCanConfig config;
    config.discard_stale_frames = driving;
    config.in_flight_max = SocketCanConfig::kMaxInFlight;
    Open(bus_, interface, config);
  }
  ~InterfaceBench() override { bus_.DiscardInFlight(); }
  CanBus& bus() override { return bus_; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] BusTrouble trouble() const override {
    return {bus_.statistics().error_frames, bus_.statistics().dropped};
  }

 private:
  static void Open(SocketCanBus& bus, const std::string& interface, const SocketCanConfig& config) {
    const SocketCanBus::OpenResult opened = bus.Open(interface, config);
    if (opened.status != Status::kOk) throw std::runtime_error(opened.message);
  }

  InterfaceLock lock_;
  SocketCanBus bus_;
  MonotonicClock clock_;
};

class SimulatedBench final : public BenchWorld, private SimulatedHands {
 public:
  explicit SimulatedBench(const SimulatedBenchConfig& config)
      : bus_(config.drives.bit_rate), clock_([this](std::int64_t ns) { plant_->AdvanceTo(ns); }) {
    std::vector<RotorPlant::Rotor> rotors;
    std::vector<std::string> nodes;  // in the order in which they are attached
    for (const DriveEntry& entry : config.drives.drives) {
      drives_.push_back(MakeSimulatedDrive(entry));
      drives_.back()->AttachTo(bus_);
      joints_.push_back(entry.joint);
      nodes.push_back(entry.joint);
      RotorPlant::Rotor rotor;
      rotor.drive = drives_.back().get();
      rotor.damping_nm_s_per_rad = kBearing_nm_s_per_rad;
      for (const auto& [joint, angle_rad] : config.positions) {
        if (joint == entry.joint) rotor.position_rad = angle_rad;
      }
      rotors.push_back(rotor);
    }
    SimulatedPortConfig host;
    host.transmit_capacity = 64;
    host_ = &bus_.Attach(host);
    nodes.emplace_back("host");
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
    if (!config.bus_faults.empty()) bus_.SetFaults(LoadBusFaults(config.bus_faults, nodes));
  }
  CanBus& bus() override { return *host_; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] BusTrouble trouble() const override {
    const SimulatedBusStatistics& bus = bus_.statistics();
    return {bus.collisions + bus.unacknowledged + bus.disturbed,
            host_->statistics().dropped_received};
  }
  [[nodiscard]] SimulatedHands* hands() override { return this; }

 private:
  /// Joints with gears come to rest soon when they are let go.
  static constexpr double kBearing_nm_s_per_rad = 0.1;

  [[nodiscard]] const std::vector<std::string>& joints() const override { return joints_; }
  [[nodiscard]] double AngleOf(std::size_t joint) const override {
    return plant_->rotors()[joint].position_rad;
  }
  void Turn(std::size_t joint, double angle_rad) override {
    plant_->rotors()[joint].position_rad = angle_rad;
    plant_->rotors()[joint].velocity_rad_s = 0;
  }

  SimulatedBus bus_;
  std::vector<std::string> joints_;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  std::unique_ptr<RotorPlant> plant_;
  SimulatedPort* host_ = nullptr;
  VirtualClock clock_;
};

}  // namespace

std::unique_ptr<BenchWorld> MakeInterfaceBench(const std::string& interface,
                                               const DrivesConfig* drives, bool driving) {
  return std::make_unique<InterfaceBench>(interface, drives, driving);
}

std::unique_ptr<BenchWorld> MakeSimulatedBench(const SimulatedBenchConfig& config) {
  return std::make_unique<SimulatedBench>(config);
}

}  // namespace tumbler
