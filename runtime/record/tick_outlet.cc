#include "runtime/record/tick_outlet.h"

#include <utility>

namespace tumbler {

TickOutlet::TickOutlet(std::shared_ptr<TickWriter> writer, std::size_t ring_bytes)
    : work_(std::make_shared<Work>(std::move(writer), ring_bytes)) {}

TickOutlet::~TickOutlet() {
  static_cast<void>(Stop([] { return std::chrono::seconds(1); }));
}

void TickOutlet::Work::Drain() {
  std::size_t size = 0;
  while (ring.Pop(message, size)) writer->Take(std::span(message).first(size));
  writer->Drained();
}

void TickOutlet::Work::Run() {
  while (!stop) {
    Drain();
    writer->Idle();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  Drain();
  writer->Finish();
  const std::lock_guard lock(mutex);
  done = true;
  ended.notify_all();
}

void TickOutlet::Start() {
  if (thread_.joinable()) return;
  thread_ = std::thread([work = work_] { work->Run(); });
}

bool TickOutlet::Stop(const Patience& patience) {
  using SteadyClock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kGlance(50);
  constexpr std::chrono::seconds kPatience(10);
  if (stopped_) return true;
  stopped_ = true;
  if (!thread_.joinable()) {
    work_->Drain();
    work_->writer->Finish();
    return true;
  }
  work_->stop = true;
  std::unique_lock lock(work_->mutex);
  std::int64_t progress = -1;
  auto progressed = SteadyClock::now();
  while (!work_->ended.wait_for(lock, kGlance, [this] { return work_->done; })) {
    const std::int64_t now = work_->writer->progress();
    if (now != progress) progressed = SteadyClock::now();
    progress = now;
    if (SteadyClock::now() - progressed < (patience ? patience() : kPatience)) continue;
    thread_.detach();
    return false;
  }
  lock.unlock();
  thread_.join();
  return true;
}

}  // namespace tumbler
