#include "runtime/record/tick_outlet.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace tumbler {

std::size_t RingBytes(std::size_t joints, double rate_hz) {
  constexpr double kStall_s = 8, kTruths_hz = 200;
  constexpr std::size_t kMax = std::size_t{64} << 20U;  // It may be locked, for each output.
  // As measured, with what a message has before it.
  const auto count = static_cast<double>(joints);
  const double tick_bytes = 170 + 110 * count, truth_bytes = 400 + 80 * count;
  const double bytes = kStall_s * (rate_hz * tick_bytes + kTruths_hz * truth_bytes);
  return std::min(std::bit_ceil(static_cast<std::size_t>(bytes)), kMax);
}

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
