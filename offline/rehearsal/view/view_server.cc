#include "offline/rehearsal/view/view_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

// Debian's library is built with it, and classes are laid out as it says.
#define CPPHTTPLIB_OPENSSL_SUPPORT
#include <httplib.h>

namespace tumbler {
namespace {

constexpr int kStreamsMax = 8;
constexpr std::size_t kThreads = 2 * kStreamsMax;  // so that streams never keep others waiting
constexpr rlim_t kFilesMax = 90;
constexpr int kPatience_s = 2;

bool IsAddress(const std::string& text) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  return inet_pton(AF_INET, text.c_str(), address.data()) == 1 ||
         inet_pton(AF_INET6, text.c_str(), address.data()) == 1;
}

bool IsLoopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1" || address.starts_with("::ffff:127.");
}

/// An address as it is written before a port.
std::string InUrl(const std::string& address) {
  return address.find(':') == std::string::npos ? address : '[' + address + ']';
}

int PortOf(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return -1;
  if (address.ss_family == AF_INET) return ntohs(reinterpret_cast<sockaddr_in&>(address).sin_port);
  if (address.ss_family == AF_INET6) {
    return ntohs(reinterpret_cast<sockaddr_in6&>(address).sin6_port);
  }
  return -1;
}

/// Limits open files, and with them connections and what they need of memory.
void LimitFiles() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur <= kFilesMax) return;
  limit.rlim_cur = kFilesMax;
  setrlimit(RLIMIT_NOFILE, &limit);
}

void Answer(httplib::Response& response, int status, const std::string& text) {
  response.status = status;
  response.set_content(text + '\n', "text/plain; charset=utf-8");
}

}  // namespace

struct ViewServer::Implementation {
  explicit Implementation(ViewServerConfig config_in) : config(std::move(config_in)) {
    if (!IsAddress(config.bind)) {
      throw std::runtime_error(
          fmt::format("--bind: is '{}', must be an address such as 127.0.0.1", config.bind));
    }
    LimitFiles();
    server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    // The library would let several programs listen at one port.
    server.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    server.set_keep_alive_max_count(1);
    server.set_keep_alive_timeout(kPatience_s);
    server.set_read_timeout(kPatience_s);
    server.set_write_timeout(kPatience_s);
    server.set_payload_max_length(1024);
    server.set_default_headers({{"Cache-Control", "no-store"},
                                {"Referrer-Policy", "no-referrer"},
                                {"X-Content-Type-Options", "nosniff"},
                                {"X-Frame-Options", "DENY"},
                                {"Content-Security-Policy", "frame-ancestors 'none'"},
                                {"Cross-Origin-Resource-Policy", "same-origin"}});
    server.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          if (IsOurs(request)) return httplib::Server::HandlerResponse::Unhandled;
          Answer(response, 403, "refused: not from this machine, or for another address");
          return httplib::Server::HandlerResponse::Handled;
        });
    AddPaths();
    Listen();
  }

  void AddPaths() {
    const std::string root = '/' + config.token + '/';
    server.Get(root, [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(config.page, "text/html; charset=utf-8");
    });
    if (config.feed != nullptr) {
      server.Get(root + "events", [this](const httplib::Request&, httplib::Response& response) {
        Stream(response);
      });
    }
    if (!config.end_motion) return;
    for (const bool disarm : {false, true}) {
      server.Post(root + (disarm ? "disarm" : "stop"),
                  [this, disarm](const httplib::Request& request, httplib::Response& response) {
                    const std::string problem = config.end_motion(disarm, request.body);
                    Answer(response, problem.empty() ? 202 : 409,
                           problem.empty() ? "sent" : problem);
                  });
    }
  }

  void Listen() {
    errno = 0;
    if (config.port == 0) {
      port = server.bind_to_any_port(config.bind);
    } else {
      port = server.bind_to_port(config.bind, config.port) ? config.port : -1;
    }
    if (port <= 0) {
      throw std::runtime_error(
          fmt::format("--port: cannot listen at {}:{}: {}; --port 0 takes one that is free",
                      config.bind, config.port, std::generic_category().message(errno)));
    }
    thread = std::thread([this] { server.listen_after_bind(); });
    while (!server.is_running()) std::this_thread::yield();
  }

  ~Implementation() {
    if (config.feed != nullptr) config.feed->Close();
    server.stop();
    // Nobody waits for clients that say nothing.
    for (int file = 0; file < static_cast<int>(kFilesMax); ++file) {
      if (PortOf(file) == port) shutdown(file, SHUT_RDWR);
    }
    thread.join();
  }

  [[nodiscard]] bool IsOurs(const httplib::Request& request) const {
    if (IsLoopback(config.bind) && !IsLoopback(request.remote_addr)) return false;
    if (request.get_header_value_count("Host") != 1) return false;
    const std::string host = request.get_header_value("Host");
    if (!IsHost(host)) return false;
    for (std::size_t i = 0; i < request.get_header_value_count("Origin"); ++i) {
      if (request.get_header_value("Origin", i) != "http://" + host) return false;
    }
    return true;
  }

  /// Whether a Host means this server. An address cannot be made to mean another machine.
  [[nodiscard]] bool IsHost(const std::string& host) const {
    const std::string end = ':' + std::to_string(port);
    if (!host.ends_with(end)) return false;
    std::string name = host.substr(0, host.size() - end.size());
    if (name == "localhost") return true;
    if (name.starts_with('[') && name.ends_with(']')) name = name.substr(1, name.size() - 2);
    const bool any = config.bind == "0.0.0.0" || config.bind == "::";
    return name == config.bind || (any && IsAddress(name));
  }

  void Stream(httplib::Response& response) {
    if (streams.fetch_add(1) >= kStreamsMax) {
      --streams;
      Answer(response, 503, "too many pages show this run; close one");
      return;
    }
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, seen = std::uint64_t{0}](std::size_t, httplib::DataSink& sink) mutable {
          const auto text = config.feed->Wait(seen);
          if (!text) return false;
          const std::string event = "data: " + *text + "\n\n";
          return sink.write(event.data(), event.size());
        },
        [this](bool) { --streams; });
  }

  ViewServerConfig config;
  httplib::Server server;
  int port = 0;
  std::atomic<int> streams{0};
  std::thread thread;
};

ViewServer::ViewServer(ViewServerConfig config)
    : implementation_(std::make_unique<Implementation>(std::move(config))) {}
ViewServer::~ViewServer() = default;

std::string ViewServer::url() const {
  const ViewServerConfig& config = implementation_->config;
  const bool any = config.bind == "0.0.0.0" || config.bind == "::";
  return fmt::format("http://{}:{}/{}/", any ? "localhost" : InUrl(config.bind),
                     implementation_->port, config.token);
}

}  // namespace tumbler
