#include "runtime/assembly/doctor.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/capability.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>

#include "firmware_interface/can/socketcan_bus.h"
#include "runtime/assembly/realtime_thread.h"

namespace tumbler {
namespace {

const int kPriority = RealtimeConfig{}.priority;

std::string LineOf(const std::string& path) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  return line;
}

std::int64_t LimitOf(decltype(RLIMIT_RTPRIO) which) {
  rlimit limit{};
  if (getrlimit(which, &limit) != 0) return 0;
  return limit.rlim_cur == RLIM_INFINITY ? -1 : static_cast<std::int64_t>(limit.rlim_cur);
}

/// Whether the process has this capability (linux/capability.h), by /proc/self/status.
bool HasCapability(const std::string& root, unsigned number) {
  std::ifstream stream(root + "proc/self/status");
  for (std::string line; std::getline(stream, line);) {
    constexpr std::string_view kKey = "CapEff:";
    if (!line.starts_with(kKey)) continue;
    return (std::strtoull(line.c_str() + kKey.size(), nullptr, 16) >> number & 1U) != 0;
  }
  return false;
}

std::string Preemption() {
  utsname name{};
  uname(&name);
  const std::string_view version(name.version);
  for (const char* kind : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
    if (version.find(kind) != std::string_view::npos) return kind;
  }
  return "none stated";
}

bool CanOpenForWriting(const std::string& path) {
  const int descriptor = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  close(descriptor);
  return true;
}

class Report {
 public:
  void Add(const char* what, std::string state, bool good, HostFinding::Level otherwise,
           std::string remedy) {
    findings_.push_back({good ? HostFinding::Level::kGood : otherwise, what, std::move(state),
                         good ? std::string() : std::move(remedy)});
  }
  std::vector<HostFinding> Take() { return std::move(findings_); }

 private:
  std::vector<HostFinding> findings_;
};

constexpr auto kAdvice = HostFinding::Level::kAdvice;
constexpr auto kMissing = HostFinding::Level::kMissing;

void JudgeLink(const HostFacts& facts, Report& report) {
  const std::string& name = facts.interface;
  if (!facts.link) {
    report.Add(
        "interface", facts.link_problem, false, kMissing,
        "plug the adapter in and load its driver (`dmesg`, `ip link`); see docs/hardware.md");
    return;
  }
  const CanLink& link = *facts.link;
  report.Add("interface", link.is_can ? name : name + " is no CAN interface", link.is_can, kMissing,
             "name a CAN interface: `ip -details link show type can`");
  if (!link.is_can) return;
  const bool real = link.bit_rate != 0 || link.has_queue;
  report.Add("bit rate",
             link.bit_rate != 0 ? fmt::format("{} bit/s", link.bit_rate)
             : real             ? "not set, or not known to the kernel"
                                : "none: a virtual interface",
             link.bit_rate != 0 || !real, kAdvice,
             fmt::format("ip link set {} type can bitrate 1000000", name));
  report.Add("state", link.up ? "up" : "down", link.up, kMissing,
             fmt::format("ip link set {} up", name));
  report.Add("listen-only", link.listen_only ? "on: nothing can be sent" : "off", !link.listen_only,
             kMissing,
             fmt::format("ip link set {0} down; ip link set {0} type can listen-only off", name));
  if (!real) return;
  report.Add(
      "transmit queue", fmt::format("{} frames", link.queue_frames_max),
      link.queue_frames_max >= 1 && link.queue_frames_max <= SocketCanConfig::kQueueFramesMax,
      kMissing, fmt::format("ip link set {} txqueuelen 10", name));
  report.Add("waiting frames", fmt::format("{}", link.waiting_frames), link.waiting_frames == 0,
             kAdvice,
             fmt::format("somebody sends, or nobody acknowledges; before motors get power: ip link "
                         "set {0} down; ip link set {0} up",
                         name));
  report.Add("bus errors", link.reports_bus_errors ? "reported" : "not reported",
             link.reports_bus_errors, kAdvice,
             fmt::format("where the driver can: ip link set {} type can berr-reporting on", name));
  report.Add(
      "restart after bus-off",
      link.restart_ms == 0 ? "by hand" : fmt::format("after {} ms", link.restart_ms),
      link.restart_ms == 0, kAdvice,
      fmt::format("a bus that comes back by itself is no reason to go on: ip link set {} type "
                  "can restart-ms 0",
                  name));
  report.Add(
      "confirmation", link.confirms_on_the_wire ? "when a frame has left" : "when queued",
      link.confirms_on_the_wire, kAdvice,
      "with this driver (slcan) a dead bus is noticed late; prefer gs_usb, PCAN or mcp251xfd");
  report.Add("discarding stale frames", facts.may_restart_link ? "permitted" : "not permitted",
             facts.may_restart_link, kAdvice,
             "give the program CAP_NET_ADMIN (scripts/host-setup)");
}

}  // namespace

HostFacts GatherHostFacts(const std::string& interface, const std::string& root) {
  HostFacts facts;
  facts.interface = interface;
  const int can = socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  facts.can_in_kernel = can >= 0;
  if (can >= 0) close(can);
  CanLink link;
  const int error = ReadCanLink(interface, link);
  if (error == 0) {
    facts.link = link;
    facts.may_restart_link = MayRestartCanLink(interface);
  } else {
    facts.link_problem = fmt::format("{}: {}", interface, std::generic_category().message(error));
  }
  facts.kernel = Preemption();
  facts.priority_max = HasCapability(root, CAP_SYS_NICE) ? 99 : LimitOf(RLIMIT_RTPRIO);
  if (facts.priority_max < 0) facts.priority_max = 99;
  facts.locked_bytes_max = HasCapability(root, CAP_IPC_LOCK) ? -1 : LimitOf(RLIMIT_MEMLOCK);
  facts.may_keep_awake = CanOpenForWriting(root + "dev/cpu_dma_latency");
  facts.governor = LineOf(root + "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  facts.isolated = LineOf(root + "sys/devices/system/cpu/isolated");
  facts.processors = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  return facts;
}

std::vector<HostFinding> Diagnose(const HostFacts& facts) {
  Report report;
  report.Add("CAN in the kernel", facts.can_in_kernel ? "there" : "not there", facts.can_in_kernel,
             kMissing,
             "modprobe can can_raw, or build the kernel with CONFIG_CAN and CONFIG_CAN_RAW");
  JudgeLink(facts, report);
  report.Add(
      "SCHED_FIFO",
      facts.priority_max == 0 ? "not permitted"
                              : fmt::format("up to priority {}", facts.priority_max),
      facts.priority_max >= kPriority, kMissing,
      fmt::format("`rtprio {}` for this user in /etc/security/limits.d (scripts/host-setup); "
                  "arming without it takes --without-realtime",
                  kPriority));
  report.Add("locked memory",
             facts.locked_bytes_max < 0 ? "any amount"
                                        : fmt::format("{} KiB", facts.locked_bytes_max / 1024),
             facts.locked_bytes_max < 0, kMissing,
             "`memlock unlimited` for this user in /etc/security/limits.d (scripts/host-setup)");
  report.Add("preemption", facts.kernel, facts.kernel == "PREEMPT_RT", kAdvice,
             "a PREEMPT_RT kernel (Debian: linux-image-rt-amd64 or -arm64); compare `tumbler run "
             "--latency-test 60`");
  report.Add("processor sleep", facts.may_keep_awake ? "can be held off" : "cannot be held off",
             facts.may_keep_awake, kAdvice,
             "a udev rule for /dev/cpu_dma_latency (scripts/host-setup)");
  report.Add("governor", facts.governor.empty() ? "no frequency scaling" : facts.governor,
             facts.governor.empty() || facts.governor == "performance", kAdvice,
             "cpupower frequency-set -g performance (scripts/host-setup)");
  report.Add(
      "isolated processors", facts.isolated.empty() ? "none" : facts.isolated,
      !facts.isolated.empty() || facts.processors < 2, kAdvice,
      fmt::format("isolcpus={0} nohz_full={0} rcu_nocbs={0} on the kernel's command line, and "
                  "--cpu {0}",
                  facts.processors - 1));
  return report.Take();
}

std::string Describe(const std::vector<HostFinding>& findings) {
  std::string text;
  int missing = 0, advice = 0;
  for (const HostFinding& finding : findings) {
    const char* mark = finding.level == HostFinding::Level::kGood ? "ok" : "advice";
    if (finding.level == HostFinding::Level::kMissing) mark = "MISSING";
    missing += finding.level == HostFinding::Level::kMissing ? 1 : 0;
    advice += finding.level == HostFinding::Level::kAdvice ? 1 : 0;
    text += fmt::format("{:8} {}: {}\n", mark, finding.what, finding.state);
    if (!finding.remedy.empty()) text += fmt::format("         {}\n", finding.remedy);
  }
  return text + fmt::format("{} missing, {} to improve\n", missing, advice);
}

}  // namespace tumbler
