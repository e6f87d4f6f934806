// tumbler drives: simulated drives, each with a rotor, that answer on a SocketCAN interface.

#include <fmt/format.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/program.h"
#include "firmware_interface/can/bus_faults_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drive_server.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(The drives behave as docs/protocols.md says of simulated ones: watchdog, encoder steps, limited torque; each turns a
rotor of its own. On the interface their frames are those of motors on a bench.

Prints, with the time of `candump -L`, when a drive is enabled or disabled, and when its watchdog takes over.
Runs until Ctrl-C. An interface that goes down or away is waited for.

Exit codes:
  0  ended by Ctrl-C
  1  wrong usage, or a file or interface that cannot be used)";

struct Options {
  std::string interface;
  std::string drives;
  std::string bus_faults;
  std::vector<std::string> positions;
  double inertia_kg_m2 = 0.02;
  double friction_nm_s_per_rad = 0.02;
  double torque_max_nm = 18;
};

volatile std::sig_atomic_t stop_wanted = 0;
void OnInterrupt(int /*signal*/) { stop_wanted = 1; }

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

/// The drives on a simulated bus of their own, each with its rotor.
class Bench {
 public:
  Bench(const Options& options, const DrivesConfig& config) : bus_(config.bit_rate) {
    for (const std::string& text : options.positions) CheckNamed(text, config);
    std::vector<RotorPlant::Rotor> rotors;
    for (const DriveEntry& entry : config.drives) {
      SimulatedMotorConfig motor = MotorOf(entry);
      motor.torque_max_nm = options.torque_max_nm;
      drives_.push_back(MakeSimulatedDrive(entry, motor));
      drives_.back()->AttachTo(bus_);
      joints_.push_back(entry.joint);
      RotorPlant::Rotor rotor;
      rotor.drive = drives_.back().get();
      rotor.position_rad = PositionOf(entry.joint, options.positions);
      rotor.inertia_kg_m2 = options.inertia_kg_m2;
      rotor.damping_nm_s_per_rad = options.friction_nm_s_per_rad;
      rotors.push_back(rotor);
    }
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
  }

  SimulatedBus& bus() { return bus_; }
  void AdvanceTo(std::int64_t time_ns) { plant_->AdvanceTo(time_ns); }
  [[nodiscard]] std::vector<ServedDrive> Drives() const {
    std::vector<ServedDrive> served;
    for (std::size_t i = 0; i < drives_.size(); ++i)
      served.push_back({joints_[i], drives_[i].get()});
    return served;
  }

  void Summarise() const {
    for (std::size_t i = 0; i < drives_.size(); ++i) {
      fmt::print("{}: {} frames heard, {} setpoints, watchdog expired {} times, at {:.4f} rad\n",
                 joints_[i], drives_[i]->frames_received(), drives_[i]->setpoints_received(),
                 drives_[i]->watchdog_expiries(), plant_->rotors()[i].position_rad);
    }
    std::fflush(stdout);
  }

 private:
  static void CheckNamed(const std::string& text, const DrivesConfig& config) {
    for (const DriveEntry& entry : config.drives) {
      if (text.rfind(entry.joint + "=", 0) == 0) return;
    }
    throw std::runtime_error(fmt::format("--position {}: names no joint of the drives", text));
  }

  SimulatedBus bus_;
  std::vector<std::string> joints_;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  std::unique_ptr<RotorPlant> plant_;
};

ExitStatus Serve(const Options& options) {
  const DrivesConfig drives = LoadDrives(options.drives);
  Bench bench(options, drives);
  DriveServer server(options.interface, drives, bench.bus(), bench.Drives(),
                     [&bench](std::int64_t time_ns) { bench.AdvanceTo(time_ns); });
  if (!options.bus_faults.empty()) {
    std::vector<std::string> nodes;  // in the order in which they were attached
    for (const DriveEntry& entry : drives.drives) nodes.push_back(entry.joint);
    nodes.emplace_back("host");
    bench.bus().SetFaults(LoadBusFaults(options.bus_faults, nodes));
  }
  fmt::print("{} drives on {}\n", drives.drives.size(), options.interface);
  std::fflush(stdout);
  // While no frame comes, only the watchdogs have to be served.
  constexpr std::int64_t kPatience_ns = 10'000'000;
  while (stop_wanted == 0) server.ServeUntil(server.now_ns() + kPatience_ns);
  bench.Summarise();
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Options options;
  CommandLine line("Simulated motor drives on a SocketCAN interface.", "tumbler drives");
  line.SetFooter(kFooter);
  line.Option("BUS", options.interface, "SocketCAN interface, e.g. vcan0").Required();
  line.Option("DRIVES", options.drives, "drive configuration (TOML)").Required();
  line.Option("--bus-faults", options.bus_faults,
              "what is wrong with the bus between the drives and the interface, and when (TOML)");
  line.Option("--position", options.positions,
              "a joint's angle at the start, JOINT=RAD; may be repeated; 0 without");
  line.Option("--inertia", options.inertia_kg_m2, "of each rotor, at the joint [kg m^2]")
      .Within(1e-4, 100.0)
      .ShowDefault();
  line.Option("--friction", options.friction_nm_s_per_rad, "viscous, at the joint [N m s/rad]")
      .Within(0.0, 100.0)
      .ShowDefault();
  line.Option("--torque-max", options.torque_max_nm, "of each drive, at its shaft [N m]")
      .Within(1e-3, 1e4)
      .ShowDefault();
  line.Parse(argc, argv);
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return Serve(options);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler drives", argc, argv, tumbler::Main);
}
