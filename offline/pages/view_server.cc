#include "offline/pages/view_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

// Debian's library is built with it, and classes are laid out as it says.
#define CPPHTTPLIB_OPENSSL_SUPPORT
#include <httplib.h>

#include "offline/pages/request_gate.h"

namespace tumbler {
namespace {

constexpr int kStreamsMax = 8;
constexpr std::size_t kReadThreads =
    std::size_t{2} * kStreamsMax;  // Streams never keep others waiting.
constexpr std::size_t kAskThreads = 2;
constexpr std::chrono::milliseconds kPatience(2000);

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

/// A connection whose request has come. Nothing more is read from it.
class Connection final : public httplib::Stream {
 public:
  Connection(int socket, std::string_view request) : socket_(socket), request_(request) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return Wait(POLLOUT); }
  ssize_t read(char* to, size_t size) override {
    if (request_.empty()) return -1;
    const size_t count = request_.copy(to, size);
    request_.remove_prefix(count);
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* from, size_t size) override {
    if (!Wait(POLLOUT)) return -1;
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
  /// Waits until the connection is ready, at most for kPatience.
  bool Wait(short events) const {
    pollfd wait{socket_, events, 0};
    if (poll(&wait, 1, static_cast<int>(kPatience.count())) <= 0) return false;
    return (wait.revents & events) != 0 && (wait.revents & (POLLERR | POLLHUP | POLLNVAL)) == 0;
  }

  int socket_;
  std::string_view request_;
};

/// The library's server, for requests that were taken elsewhere: one for each connection, which can
/// be cut.
class HttpServer final : public httplib::Server {
 public:
  /// The socket that is bound. The library takes it for a sign that it is served.
  [[nodiscard]] int listener() const { return svr_sock_; }

  /// Answers a request, and closes its connection.
  void Serve(int socket, const std::string& request) {
    if (Opened(socket)) {
      Connection connection(socket, request);
      bool closed = false;
      static_cast<void>(process_request(connection, true, closed, nullptr));
    }
    const std::lock_guard lock(mutex_);
    open_.erase(socket);
    shutdown(socket, SHUT_RDWR);
    close(socket);
  }
  /// Cuts all connections, and those to come.
  void Cut() {
    const std::lock_guard lock(mutex_);
    cut_ = true;
    for (const int socket : open_) shutdown(socket, SHUT_RDWR);
  }
  /// Leaves the port to others.
  void Leave() {
    const int socket = svr_sock_.exchange(INVALID_SOCKET);
    if (socket != INVALID_SOCKET) close(socket);
  }

 private:
  bool Opened(int socket) {
    const std::lock_guard lock(mutex_);
    if (!cut_) open_.insert(socket);
    return !cut_;
  }

  std::mutex mutex_;
  std::set<int> open_;
  bool cut_ = false;
};

/// Threads that serve requests. Of those that wait for a thread there are not many; a connection of
/// one more is closed.
class Servants {
 public:
  Servants(HttpServer& server, std::size_t threads) : server_(server) {
    for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { Work(); });
  }
  ~Servants() {
    {
      const std::lock_guard lock(mutex_);
      over_ = true;
      for (const auto& [socket, request] : waiting_) close(socket);
      waiting_.clear();
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }
  Servants(const Servants&) = delete;
  Servants& operator=(const Servants&) = delete;

  void Take(int socket, std::string request) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kWaitingMax) {
      close(socket);
      return;
    }
    waiting_.emplace_back(socket, std::move(request));
    changed_.notify_one();
  }

 private:
  static constexpr std::size_t kWaitingMax = 32;

  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return over_ || !waiting_.empty(); });
      if (over_) return;
      const auto [socket, request] = std::move(waiting_.front());
      waiting_.pop_front();
      lock.unlock();
      server_.Serve(socket, request);
      lock.lock();
    }
  }

  HttpServer& server_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::pair<int, std::string>> waiting_;
  bool over_ = false;
  std::vector<std::thread> threads_;
};

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
    gate.emplace(server.listener(), [this](int socket, std::string request) {
      // What ends a motion has threads of its own: who reads the page slowly is not in its way.
      (request.starts_with("POST ") ? asking : reading).Take(socket, std::move(request));
    });
  }

  ~Implementation() {
    gate.reset();
    if (config.feed != nullptr) config.feed->Close();
    server.Cut();  // Nobody waits for clients that take nothing.
    server.Leave();
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
  Servants reading{server, kReadThreads};
  Servants asking{server, kAskThreads};
  std::optional<RequestGate> gate;
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
