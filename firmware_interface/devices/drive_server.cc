#include "firmware_interface/devices/drive_server.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <utility>

namespace tumbler {
namespace {

/// Steps in which time passes for the drives. The times of messages are exact to this.
constexpr std::int64_t kSlice_ns = 1'000'000;
constexpr std::int64_t kNsPerSecond = 1'000'000'000;
/// What the bus does not foretell, as that a drive reports by its own clock, is looked for so often
/// for as long after a frame.
constexpr std::int64_t kLook_ns = 500'000;
constexpr std::int64_t kLooking_ns = 4'000'000;
/// It sleeps for so long at least [ns of the clock]: waking takes time, too.
constexpr std::int64_t kLeastWait_ns = 50'000;
constexpr std::int64_t kLostWait_ns = 50'000'000;  // of the clock

std::int64_t Now(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * kNsPerSecond + now.tv_nsec;
}

}  // namespace

SimulatedPortConfig DriveServer::GatewayConfig() {
  SimulatedPortConfig config;
  config.transmit_capacity = 256;  // Frames that come together have passed another bus already.
  return config;
}

SocketCanConfig DriveServer::InterfaceConfig(const DrivesConfig& drives) {
  SocketCanConfig config;
  config.send_ids = drives.HostReceives();  // The server is the other side: what the host hears.
  config.receive_ids = drives.HostSends();
  config.in_flight_max = SocketCanConfig::kMaxInFlight;
  return config;
}

DriveServer::DriveServer(const std::string& interface, const DrivesConfig& config,
                         SimulatedBus& bus, std::vector<ServedDrive> drives,
                         std::function<void(std::int64_t)> advance, double pace)
    : interface_(interface),
      interface_config_(InterfaceConfig(config)),
      drives_bus_(bus),
      gateway_(bus.Attach(GatewayConfig())),
      advance_(std::move(advance)),
      pace_(pace) {
  for (ServedDrive& drive : drives) drives_.push_back({std::move(drive)});
  const SocketCanBus::OpenResult opened = bus_.Open(interface_, interface_config_);
  if (opened.status != Status::kOk) throw std::runtime_error(opened.message);
  start_ns_ = Now(CLOCK_MONOTONIC);
}

std::int64_t DriveServer::TimeAt(std::int64_t monotonic_ns) const {
  return std::llround(pace_ * static_cast<double>(monotonic_ns - start_ns_));
}
std::int64_t DriveServer::now_ns() const { return TimeAt(Now(CLOCK_MONOTONIC)); }

void DriveServer::Say(std::string_view what) {
  const std::int64_t now_us = Now(CLOCK_REALTIME) / 1000;
  fmt::print("({}.{:06}) {}\n", now_us / 1'000'000, now_us % 1'000'000, what);
  std::fflush(stdout);
}

void DriveServer::Tell(Watched& watched) const {
  const SimulatedDrive& drive = *watched.served.drive;
  const std::string& joint = watched.served.joint;
  if (drive.enabled() != watched.enabled)
    Say(fmt::format("{}: {}", joint, drive.enabled() ? "enabled" : "disabled"));
  if (drive.limp() && !watched.limp) {
    Say(fmt::format("{}: watchdog expired {:.0f} ms after the last setpoint: limp", joint,
                    static_cast<double>(reached_ns_ - drive.last_setpoint_ns()) * 1e-6));
  } else if (!drive.limp() && watched.limp) {
    Say(fmt::format("{}: a setpoint again", joint));
  }
  watched.enabled = drive.enabled();
  watched.limp = drive.limp();
}

void DriveServer::AdvanceTo(std::int64_t time_ns) {
  while (reached_ns_ < time_ns) {
    reached_ns_ = std::min(reached_ns_ + kSlice_ns, time_ns);
    advance_(reached_ns_);
    for (Watched& watched : drives_) Tell(watched);
  }
}

void DriveServer::ServeUntil(std::int64_t time_ns) {
  const std::int64_t now = now_ns();
  // It wakes up where a frame ends on the drives' bus, so that an answer goes out when its last
  // bit does: by the host's time stamps of answers a record tells when setpoints came.
  std::int64_t wake = std::min(time_ns, drives_bus_.NextFrameEnd());
  if (now - heard_ns_ < kLooking_ns) wake = std::min(wake, now + kLook_ns);
  const auto clock_ns = [this](std::int64_t drives_ns) {
    return std::llround(static_cast<double>(drives_ns) / pace_);
  };
  std::int64_t wait_ns = std::clamp<std::int64_t>(clock_ns(wake - now), 0, kNsPerSecond - 1);
  if (wait_ns > 0)
    wait_ns = std::max(wait_ns, std::min<std::int64_t>(kLeastWait_ns, clock_ns(time_ns - now)));
  if (lost_) wait_ns = kLostWait_ns;
  pollfd wait{bus_.descriptor(), POLLIN, 0};
  const timespec patience{0, static_cast<decltype(timespec::tv_nsec)>(wait_ns)};
  ppoll(&wait, lost_ ? 0 : 1, &patience, nullptr);
  // What has come until then is read before time passes for the drives, however long the server
  // stands still in between.
  const std::int64_t reached = now_ns();
  ReceivedFrame received;
  Status status = Status::kOk;
  while ((status = bus_.Receive(received)) == Status::kOk) {
    heard_ns_ = now_ns();
    AdvanceTo(TimeAt(received.time_ns));
    // This fails when 256 frames wait. A drive would miss the frame as well.
    static_cast<void>(gateway_.Send(received.frame) == Status::kOk);
  }
  AdvanceTo(reached);
  while (gateway_.Receive(received) == Status::kOk) {
    static_cast<void>(bus_.Send(received.frame) == Status::kOk);  // On failure the frame is lost.
  }
  const bool down = status != Status::kWouldBlock;
  if (down != lost_) {
    fmt::print("{} {}\n", interface_, down ? "is lost" : "is back");
    std::fflush(stdout);
  }
  lost_ = down;
  if (bus_.last_errno() == ENODEV || bus_.descriptor() < 0) {
    // Another interface may have come under the name. If not, the next turn asks again.
    static_cast<void>(bus_.Open(interface_, interface_config_));
  }
}

}  // namespace tumbler
