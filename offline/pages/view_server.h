#pragma once

#include <functional>
#include <memory>
#include <string>

#include "offline/pages/view_feed.h"

namespace tumbler {

/// What a server of one page has, and where.
struct ViewServerConfig {
  std::string bind = "127.0.0.1";  ///< Address to listen at.
  int port = 0;                    ///< 0: any that is free.
  std::string token;               ///< Part of every path; others are not found.
  std::string page;                ///< The page itself.
  ViewFeed* feed = nullptr;        ///< What the page shows; null: all is in the page.
  /// Called with the body of `POST /TOKEN/stop` or `/TOKEN/disarm`, and whether it is the latter.
  /// @returns why nothing was sent; empty: it was. None: there are no such paths.
  std::function<std::string(bool disarm, const std::string& body)> end_motion;
};

/// An HTTP server of one page, for a browser on the same machine:
///
///     GET  /TOKEN/         the page
///     GET  /TOKEN/events   the texts of the feed, as server-sent events
///     POST /TOKEN/stop, /TOKEN/disarm
///
/// It answers nothing to a request whose Host is no address that it is bound to or `localhost`
/// (names of others may be made to mean this machine), or whose Origin is another page's. Bound to
/// a loopback address, it answers no other machine. At most 8 streams of events are open at once. A
/// client is cut off whose request is not there in time (RequestGate), or who takes nothing for 2
/// s. Clients that are slow, or many, do not keep the two requests waiting: a request takes a
/// thread only when it is whole, and these two have threads of their own.
class ViewServer {
 public:
  /// Listens from now on.
  /// @throws std::runtime_error  naming address and port, when it cannot listen there.
  explicit ViewServer(ViewServerConfig config);
  /// Cuts all connections.
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// The address of the page.
  [[nodiscard]] std::string url() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
