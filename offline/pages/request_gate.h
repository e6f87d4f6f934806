#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace tumbler {

/// The door of an HTTP server: takes its connections, and hands each of them on when its request
/// has come whole. One thread waits for all of them, so that clients that are slow, or say nothing,
/// keep nobody else waiting: whatever serves requests never reads from a connection.
///
/// At most 64 connections wait for the rest of their request, at most 32 of one address; of more
/// than that the oldest is cut. A client who has something to say does so at once, and is never the
/// oldest for long. One whose request is longer than 16 KiB, or takes longer than 2 s, is cut too.
class RequestGate {
 public:
  /// @param listener  a socket that is bound; it stays the caller's.
  /// @param hand_on   gets a connection and its request, and has to close the former. It is called
  ///                  on the gate's thread, and must not block.
  RequestGate(int listener, std::function<void(int socket, std::string request)> hand_on);
  /// Cuts the connections that still wait.
  ~RequestGate();
  RequestGate(const RequestGate&) = delete;
  RequestGate& operator=(const RequestGate&) = delete;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Whether a request has come whole: its headers, and as much of a body as they say. A body that is
/// longer than a request may be, or comes in chunks, is not waited for, since nobody takes it.
[[nodiscard]] bool IsWhole(std::string_view request);

}  // namespace tumbler
