// tumbler-drives: simulated drives, each with a rotor, that answer on a SocketCAN interface.

#include <fmt/format.h>
#include <poll.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/make_simulated.h"
#include "firmware_interface/drives/rotor_plant.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(The drives behave as docs/protocols.md says of simulated ones: watchdog, encoder steps, limited torque; each turns a
rotor of its own. On the interface their frames are those of motors on a bench.

Prints, with the time of `candump -L`, when a drive is enabled or disabled, and when its watchdog takes over.
Runs until Ctrl-C. An interface that goes down or away is waited for.)";

/// How finely time passes for the drives: what is printed is exact to this.
constexpr std::int64_t kSlice_ns = 1'000'000;
constexpr std::int64_t kNsPerSecond = 1'000'000'000;

struct Options {
  std::string interface;
  std::string drives;
  std::vector<std::string> positions;
  double inertia_kg_m2 = 0.02;
  double friction_nm_s_per_rad = 0.02;
  double torque_max_nm = 18;
};

volatile std::sig_atomic_t stop_wanted = 0;
void OnInterrupt(int /*signal*/) { stop_wanted = 1; }

std::int64_t Now(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * kNsPerSecond + now.tv_nsec;
}

/// The angle that an option `JOINT=RAD` gives to a joint; zero if none does.
double PositionOf(const std::string& joint, const std::vector<std::string>& positions) {
  double position = 0;
  for (const std::string& text : positions) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || text.substr(0, equals) != joint) continue;
    std::size_t used = 0;
    const std::string number = text.substr(equals + 1);
    try {
      position = std::stod(number, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used == 0 || used != number.size() || !(std::abs(position) <= 1000)) {
      throw std::runtime_error(
          fmt::format("--position {}: allowed is JOINT=RAD with -1000 ... 1000", text));
    }
  }
  return position;
}

/// The drives on a simulated bus of their own, with one port through which frames come and go.
class Bench {
 public:
  Bench(const Options& options, const DrivesConfig& config)
      : bus_(config.bit_rate), gateway_(bus_.Attach(GatewayConfig())) {
    for (const std::string& text : options.positions) CheckNamed(text, config);
    std::vector<RotorPlant::Rotor> rotors;
    for (const DriveEntry& entry : config.drives) {
      SimulatedMotorConfig motor;
      motor.torque_max_nm = options.torque_max_nm;
      drives_.push_back({entry.joint, MakeSimulatedDrive(entry, motor)});
      drives_.back().drive->AttachTo(bus_);
      RotorPlant::Rotor rotor;
      rotor.drive = drives_.back().drive.get();
      rotor.position_rad = PositionOf(entry.joint, options.positions);
      rotor.inertia_kg_m2 = options.inertia_kg_m2;
      rotor.damping_nm_s_per_rad = options.friction_nm_s_per_rad;
      rotors.push_back(rotor);
    }
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
  }

  /// Lets time pass, and tells what happened.
  void AdvanceTo(std::int64_t time_ns) {
    while (now_ns_ < time_ns) {
      now_ns_ = std::min(now_ns_ + kSlice_ns, time_ns);
      plant_->AdvanceTo(now_ns_);
      for (Served& served : drives_) Tell(served);
    }
  }
  SimulatedPort& gateway() { return gateway_; }

  void Summarise() const {
    for (std::size_t i = 0; i < drives_.size(); ++i) {
      fmt::print("{}: {} frames heard, {} setpoints, watchdog expired {} times, at {:.4f} rad\n",
                 drives_[i].joint, drives_[i].drive->frames_received(),
                 drives_[i].drive->setpoints_received(), drives_[i].drive->watchdog_expiries(),
                 plant_->rotors()[i].position_rad);
    }
    std::fflush(stdout);
  }

 private:
  struct Served {
    std::string joint;
    std::unique_ptr<SimulatedDrive> drive;
    bool enabled = false;
    bool limp = false;
  };

  static SimulatedPortConfig GatewayConfig() {
    SimulatedPortConfig config;
    config.transmit_capacity = 256;  // What comes at once has passed another bus already.
    return config;
  }
  static void CheckNamed(const std::string& text, const DrivesConfig& config) {
    for (const DriveEntry& entry : config.drives) {
      if (text.rfind(entry.joint + "=", 0) == 0) return;
    }
    throw std::runtime_error(fmt::format("--position {}: names no joint of the drives", text));
  }
  void Tell(Served& served) const {
    const SimulatedDrive& drive = *served.drive;
    const auto say = [&served](const std::string& what) {
      const std::int64_t now_us = Now(CLOCK_REALTIME) / 1000;
      fmt::print("({}.{:06}) {}: {}\n", now_us / 1'000'000, now_us % 1'000'000, served.joint, what);
      std::fflush(stdout);
    };
    if (drive.enabled() != served.enabled) say(drive.enabled() ? "enabled" : "disabled");
    if (drive.limp() && !served.limp) {
      say(fmt::format("watchdog expired {:.0f} ms after the last setpoint: limp",
                      static_cast<double>(now_ns_ - drive.last_setpoint_ns()) * 1e-6));
    } else if (!drive.limp() && served.limp) {
      say("a setpoint again");
    }
    served.enabled = drive.enabled();
    served.limp = drive.limp();
  }

  SimulatedBus bus_;
  SimulatedPort& gateway_;
  std::vector<Served> drives_;
  std::unique_ptr<RotorPlant> plant_;
  std::int64_t now_ns_ = 0;
};

SocketCanConfig InterfaceConfig(const DrivesConfig& drives) {
  SocketCanConfig config;
  config.send_ids = drives.HostReceives();  // This is the other side.
  config.receive_ids = drives.HostSends();
  config.in_flight_max = SocketCanConfig::kMaxInFlight;
  return config;
}

int Serve(const Options& options) {
  const DrivesConfig drives = LoadDrives(options.drives);
  const SocketCanConfig interface_config = InterfaceConfig(drives);
  Bench bench(options, drives);
  SocketCanBus bus;
  const SocketCanBus::OpenResult opened = bus.Open(options.interface, interface_config);
  if (opened.status != Status::kOk) throw std::runtime_error(opened.message);
  // Frames carry the time at which they came, so that a pause of this program delays answers, but
  // does not starve the drives' watchdogs.
  const std::int64_t start_ns = Now(CLOCK_MONOTONIC);
  fmt::print("{} drives on {}\n", drives.drives.size(), options.interface);
  std::fflush(stdout);
  bool lost = false;
  std::int64_t heard_ns = 0;  // the last frame came
  while (stop_wanted == 0) {
    pollfd wait{bus.descriptor(), POLLIN, 0};
    // Half a millisecond is a frame and its answer; four milliseconds are those of eight drives.
    // After that only the watchdogs are waited for.
    const bool answering = Now(CLOCK_MONOTONIC) - heard_ns < 4'000'000;
    const timespec patience{0, lost ? 50'000'000 : answering ? 500'000 : 10'000'000};
    ppoll(&wait, lost ? 0 : 1, &patience, nullptr);
    ReceivedFrame received;
    Status status = Status::kOk;
    while ((status = bus.Receive(received)) == Status::kOk) {
      heard_ns = Now(CLOCK_MONOTONIC);
      bench.AdvanceTo(received.time_ns - start_ns);
      // Fails when 256 frames wait; a drive would miss them as well.
      static_cast<void>(bench.gateway().Send(received.frame) == Status::kOk);
    }
    bench.AdvanceTo(Now(CLOCK_MONOTONIC) - start_ns);
    while (bench.gateway().Receive(received) == Status::kOk) {
      static_cast<void>(bus.Send(received.frame) == Status::kOk);  // Lost, as on a dead bus.
    }
    const bool down = status != Status::kWouldBlock;
    if (down != lost) {
      fmt::print("{} {}\n", options.interface, down ? "is lost" : "is back");
      std::fflush(stdout);
    }
    lost = down;
    if (bus.last_errno() == ENODEV || bus.descriptor() < 0) {
      // Another interface may have come under the name; if not, it is asked again.
      static_cast<void>(bus.Open(options.interface, interface_config));
    }
  }
  bench.Summarise();
  return 0;
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Simulated motor drives on a SocketCAN interface.", "tumbler-drives");
  app.footer(kFooter);
  app.add_option("BUS", options.interface, "SocketCAN interface, e.g. vcan0")->required();
  app.add_option("DRIVES", options.drives, "drive configuration (TOML)")->required();
  app.add_option("--position", options.positions,
                 "a joint's angle at the start, JOINT=RAD; may be repeated; 0 without");
  app.add_option("--inertia", options.inertia_kg_m2, "of each rotor, at the joint [kg m^2]")
      ->check(CLI::Range(1e-4, 100.0))
      ->capture_default_str();
  app.add_option("--friction", options.friction_nm_s_per_rad, "viscous, at the joint [N m s/rad]")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--torque-max", options.torque_max_nm, "of each drive, at its shaft [N m]")
      ->check(CLI::Range(1e-3, 1e4))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return 1;
  }
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  try {
    return Serve(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "tumbler-drives: {}\n", error.what());
    return 1;
  }
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::Main(argc, argv); }
