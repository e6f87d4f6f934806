#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <stdexcept>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/mit.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "firmware_interface/devices/simulated_mit.h"
#include "runtime/assembly/clock.h"
#include "runtime/record/telemetry.h"
#include "runtime/run/control_loop.h"
#include "tests/support/motions.h"

namespace tumbler::testing {

/// Two rotors behind simulated drives on a simulated bus, with everything of a run but the program.
class LoopBench {
 public:
  explicit LoopBench(const TelemetryConfig& telemetry_config,
                     const RunProcedureConfig& run = Short(), unsigned seed = 60)
      : telemetry(telemetry_config),
        clock([this](std::int64_t time_ns) { plant->AdvanceTo(time_ns); }) {
    std::mt19937 random(seed);
    MotionShape shape;
    shape.settle_s = 0.1;
    primitive = RandomPrimitive<float>(shape, random);
    std::vector<RotorPlant::Rotor> rotors;
    std::vector<Drive*> pointers;
    for (std::size_t i = 0; i < 2; ++i) {
      SimulatedMitConfig config;
      config.mit.command_id = static_cast<std::uint16_t>(i + 1);
      config.mit.reply_id = static_cast<std::uint16_t>(i + 17);
      simulated.push_back(std::make_unique<SimulatedMitDrive>(config));
      bus.Attach(*simulated.back(), SimulatedMitDrive::PortConfig());
      drives.push_back(std::make_unique<MitDrive>(config.mit));
      pointers.push_back(drives.back().get());
      RotorPlant::Rotor rotor;
      rotor.drive = simulated.back().get();
      rotor.position_rad = primitive.joints[i].position.control_points()[0] + 0.05F;
      rotors.push_back(rotor);
      // This feed-forward moves a free rotor along the path. The random one would not.
      std::vector<float> torques(primitive.joints[i].torque.control_points().size(), 0.0F);
      const auto knots = primitive.joints[i].torque.knots();
      Expect(primitive.joints[i].torque.Assign(3, std::vector<float>(knots.begin(), knots.end()),
                                               torques));
    }
    plant = std::make_unique<RotorPlant>(bus, rotors);
    Expect(executor.Configure({}, primitive, pointers));
    procedure = std::make_unique<RunProcedure>(run);
    UseClock(clock, 0);
  }

  /// Uses another clock than the virtual one, which lets `plant` run on.
  void UseClock(Clock& other, std::int64_t start_ns) {
    loop = std::make_unique<ControlLoop>(
        ControlLoop::Parts{executor, host, other, *procedure, mailbox, &feed}, 1'000'000, start_ns);
  }

  template <typename Each>
  void Run(Each each) {
    for (int i = 0; i < 100000 && loop->Step(); ++i) {
      telemetry.Drain();
      each();
    }
    telemetry.Stop();
  }

  Telemetry telemetry;
  TickFeed feed{&telemetry};
  VirtualClock clock;
  SimulatedBus bus;
  SimulatedPort& host = bus.Attach();
  std::vector<std::unique_ptr<SimulatedMitDrive>> simulated;
  std::vector<std::unique_ptr<MitDrive>> drives;
  std::unique_ptr<RotorPlant> plant;
  Primitive<float> primitive;
  Executor executor;
  OperatorMailbox mailbox;
  std::unique_ptr<RunProcedure> procedure;
  std::unique_ptr<ControlLoop> loop;

 private:
  static RunProcedureConfig Short() {
    RunProcedureConfig config;
    config.hold_ticks = 300;
    return config;
  }
  static void Expect(Status status) {
    if (status != Status::kOk) throw std::logic_error(ToString(status));
  }
};

}  // namespace tumbler::testing
