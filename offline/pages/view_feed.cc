#include "offline/pages/view_feed.h"

#include <utility>

namespace tumbler {

void ViewFeed::Publish(std::string text) {
  auto shared = std::make_shared<const std::string>(std::move(text));
  {
    const std::lock_guard lock(mutex_);
    text_ = std::move(shared);
    ++number_;
  }
  changed_.notify_all();
}

std::shared_ptr<const std::string> ViewFeed::Wait(std::uint64_t& seen) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return closed_ || number_ > seen; });
  if (closed_) return nullptr;
  seen = number_;
  return text_;
}

void ViewFeed::Close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
}

}  // namespace tumbler
