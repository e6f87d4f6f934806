#include "runtime/assembly/machine.h"

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

namespace tumbler {
namespace {

std::string FirstLine(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  return line;
}

std::string Kernel() {
  utsname name{};
  uname(&name);
  const std::string_view version(name.version);
  const char* preemption = "preemption not stated";
  // Longer names are tried first, because each contains the next.
  for (const char* kind : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
    if (version.find(kind) != std::string_view::npos) {
      preemption = kind;
      break;
    }
  }
  return fmt::format("{} {} {} ({})", name.sysname, name.release, name.machine, preemption);
}

std::string Cpu() {
  std::ifstream stream("/proc/cpuinfo");
  std::string model = "unknown processor";
  for (std::string line; std::getline(stream, line);) {
    const std::size_t colon = line.find(": ");
    const bool names_it = line.starts_with("model name") || line.starts_with("Model");
    if (names_it && colon != std::string::npos) {
      model = line.substr(colon + 2);
      break;
    }
  }
  return fmt::format("{}, {} online", model, sysconf(_SC_NPROCESSORS_ONLN));
}

std::string Adapter(const std::string& interface) {
  if (interface.empty()) return "none";
  const std::filesystem::path device =
      std::filesystem::path("/sys/class/net") / interface / "device";
  std::error_code error;
  const std::filesystem::path driver = std::filesystem::read_symlink(device / "driver", error);
  if (error) return "virtual";
  // The name of a USB adapter is with its device, one folder above the interface that has the
  // driver.
  const std::string product = FirstLine(device / ".." / "product");
  return driver.filename().string() + (product.empty() ? "" : fmt::format(" ({})", product));
}

}  // namespace

Machine DescribeMachine(const std::string& interface) {
  return {Kernel(), Cpu(), Adapter(interface)};
}

}  // namespace tumbler
