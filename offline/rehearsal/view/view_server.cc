#include "offline/rehearsal/view/view_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <set>
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
constexpr std::size_t kThreads =
    std::size_t{2} * kStreamsMax;  // Streams never keep others waiting.
constexpr rlim_t kFilesMax = 90;
constexpr std::chrono::milliseconds kPatience(2000);
constexpr std::size_t kRequestMax = 16384;  // bytes, with all headers

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

/// The address and port at one end of a connection.
void EndOf(int (*get)(int, sockaddr*, socklen_t*), int socket, std::string& ip, int& port) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  std::array<char, INET6_ADDRSTRLEN> text{};
  ip.clear();
  port = 0;
  if (get(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return;
  const void* number = nullptr;
  if (address.ss_family == AF_INET) {
    const auto& internet = reinterpret_cast<const sockaddr_in&>(address);
    number = &internet.sin_addr;
    port = ntohs(internet.sin_port);
  } else if (address.ss_family == AF_INET6) {
    const auto& internet = reinterpret_cast<const sockaddr_in6&>(address);
    number = &internet.sin6_addr;
    port = ntohs(internet.sin6_port);
  }
  if (number != nullptr) ip = inet_ntop(address.ss_family, number, text.data(), text.size());
}

/// A connection whose request has to be short and to come soon. The library's own reads as many
/// headers as a client sends.
class Connection final : public httplib::Stream {
 public:
  explicit Connection(int socket) : socket_(socket) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return Wait(POLLOUT, std::chrono::steady_clock::now()); }
  ssize_t read(char* to, size_t size) override {
    if (next_ == end_) {
      if (taken_ == kRequestMax || !Wait(POLLIN, since_)) return -1;
      const size_t most = std::min(buffer_.size(), kRequestMax - taken_);
      const ssize_t count = recv(socket_, buffer_.data(), most, MSG_DONTWAIT);
      if (count <= 0) return count;
      next_ = 0;
      end_ = static_cast<size_t>(count);
      taken_ += end_;
    }
    const size_t count = std::min(size, end_ - next_);
    std::copy_n(buffer_.data() + next_, count, to);
    next_ += count;
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* from, size_t size) override {
    if (!Wait(POLLOUT, std::chrono::steady_clock::now())) return -1;
    return send(socket_, from, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    EndOf(getpeername, socket_, ip, port);
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    EndOf(getsockname, socket_, ip, port);
  }
  socket_t socket() const override { return socket_; }

 private:
  /// Waits until the connection is ready, at most until kPatience after `since`.
  bool Wait(short events, std::chrono::steady_clock::time_point since) const {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        since + kPatience - std::chrono::steady_clock::now());
    pollfd wait{socket_, events, 0};
    if (poll(&wait, 1, static_cast<int>(std::max<long>(left.count(), 0))) <= 0) return false;
    return (wait.revents & events) != 0 && (wait.revents & (POLLERR | POLLHUP | POLLNVAL)) == 0;
  }

  int socket_;
  std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
  std::array<char, 4096> buffer_{};
  size_t next_ = 0, end_ = 0;
  size_t taken_ = 0;
};

/// The library's server, with one request for each connection, and connections that can be cut.
class HttpServer final : public httplib::Server {
 public:
  /// Cuts all connections, and those to come.
  void Cut() {
    const std::lock_guard lock(mutex_);
    cut_ = true;
    for (const int socket : open_) shutdown(socket, SHUT_RDWR);
  }

 private:
  bool process_and_close_socket(socket_t socket) override {
    bool good = false;
    if (Opened(socket)) {
      Connection connection(socket);
      bool closed = false;
      good = process_request(connection, true, closed, nullptr);
    }
    const std::lock_guard lock(mutex_);
    open_.erase(socket);
    shutdown(socket, SHUT_RDWR);
    close(socket);
    return good;
  }
  bool Opened(int socket) {
    const std::lock_guard lock(mutex_);
    if (!cut_) open_.insert(socket);
    return !cut_;
  }

  std::mutex mutex_;
  std::set<int> open_;
  bool cut_ = false;
};

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
    server.Cut();  // Nobody waits for clients that say nothing.
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
  HttpServer server;
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
