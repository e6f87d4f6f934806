#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

namespace tumbler {

/// The newest text, for any number of threads that wait for it. Who is slow misses texts; none is
/// kept for him.
class ViewFeed {
 public:
  void Publish(std::string text);
  /// Waits until there is a text newer than number `seen`, which then becomes its number.
  /// @returns null when the feed was closed.
  std::shared_ptr<const std::string> Wait(std::uint64_t& seen);
  /// Ends all waiting, now and later.
  void Close();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<const std::string> text_;
  std::uint64_t number_ = 0;
  bool closed_ = false;
};

}  // namespace tumbler
