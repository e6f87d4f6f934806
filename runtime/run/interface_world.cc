#include "runtime/run/interface_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "firmware_interface/can/interface_lock.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/devices/make_simulated.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/dry_run_bus.h"
#include "runtime/assembly/run_checks.h"

namespace tumbler {
namespace {

/// Opens an interface, and checks that its bit rate, where the kernel knows it, is that of the
/// drives.
void OpenInterface(SocketCanBus& bus, const InterfaceName& name, const DrivesConfig& drives,
                   const SocketCanConfig& config) {
  const SocketCanBus::OpenResult opened = bus.Open(name.interface, config);
  if (opened.status != Status::kOk) throw std::runtime_error(opened.message);
  if (bus.link().bit_rate != 0 && bus.link().bit_rate != drives.bit_rate) {
    throw Refused(fmt::format("{} runs at {} bit/s, but {} says {}: correct one of them",
                              name.interface, bus.link().bit_rate, name.drives_file,
                              drives.bit_rate));
  }
}

class RealWorld final : public World {
 public:
  /// Refuses what can be refused, without touching the bus.
  RealWorld(const InterfaceName& name, const DrivesConfig& drives) : name_(name), drives_(drives) {
    const std::string problem = lock_.Take(name.interface);
    if (!problem.empty()) throw Refused(problem);
    SocketCanBus probe;
    OpenInterface(probe, name, drives, {});
    CheckQueue(name.interface, probe.link(), drives);
    if (probe.link().listen_only) {
      throw Refused(fmt::format(
          "{0} only listens, so that nothing that is sent leaves it: ip link set {0} down; ip link "
          "set {0} type can listen-only off; ip link set {0} up",
          name.interface));
    }
    if (name.pace != 1 && probe.link().bit_rate != 0) {
      throw Refused(fmt::format("{} is a real bus, and real robots know one pace: leave out --pace",
                                name.interface));
    }
  }
  void Open() override {
    SocketCanConfig config;
    config.discard_stale_frames = true;
    config.send_ids = drives_.HostSends();
    config.receive_ids = drives_.HostReceives();
    // An adapter on USB confirms in bunches. Younger frames than this wait for no dead bus.
    constexpr double kBunch_s = 0.008;
    const int ticks = std::max(4, static_cast<int>(std::ceil(kBunch_s * drives_.rate_hz)));
    config.in_flight_max =
        std::clamp(ticks * drives_.HostFramesMax(), 8, SocketCanConfig::kMaxInFlight);
    OpenInterface(bus_, name_, drives_, config);
    if (bus_.link().has_queue && !bus_.can_discard()) {
      fmt::print(stderr,
                 "warning: without CAP_NET_ADMIN, frames that wait when the bus fails cannot be "
                 "discarded; they go out when it comes back\n");
    }
  }
  CanBus& bus() override { return bus_; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] bool real_time() const override { return true; }
  void Observe(const ControlLoop& /*loop*/) override {}
  void Summarize(RunSummary& summary) override {
    bus_.DiscardInFlight();
    summary.interface = {bus_.statistics(), bus_.controller_state(), bus_.in_flight()};
  }

 private:
  InterfaceName name_;
  DrivesConfig drives_;
  InterfaceLock lock_;
  SocketCanBus bus_;
  MonotonicClock clock_;
};

class DryRunWorld final : public World {
 public:
  DryRunWorld(const InterfaceName& name, const DrivesConfig& drives,
              const std::vector<double>& start_rad)
      : clock_([this](std::int64_t time_ns) { bus_->AdvanceTo(time_ns); }) {
    try {
      SocketCanBus probe;
      OpenInterface(probe, name, drives, {});
    } catch (const Refused&) {
      throw;
    } catch (const std::runtime_error& error) {
      fmt::print(stderr, "note: {}; a dry run does without\n", error.what());
    }
    std::vector<DryRunBus::Node> nodes;
    for (std::size_t i = 0; i < drives.drives.size(); ++i) {
      nodes.push_back({MakeSimulatedDrive(drives.drives[i]), start_rad.at(i)});
    }
    bus_ = std::make_unique<DryRunBus>(name.interface, drives.bit_rate, std::move(nodes), stdout);
  }
  CanBus& bus() override { return *bus_; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] bool real_time() const override { return false; }
  void Observe(const ControlLoop& /*loop*/) override {}
  void Summarize(RunSummary& /*summary*/) override {}

 private:
  VirtualClock clock_;
  std::unique_ptr<DryRunBus> bus_;
};

}  // namespace

std::unique_ptr<World> MakeInterfaceWorld(const InterfaceName& name, const DrivesConfig& drives) {
  return std::make_unique<RealWorld>(name, drives);
}

std::unique_ptr<World> MakeDryRunWorld(const InterfaceName& name, const DrivesConfig& drives,
                                       const std::vector<double>& start_rad) {
  return std::make_unique<DryRunWorld>(name, drives, start_rad);
}

}  // namespace tumbler
