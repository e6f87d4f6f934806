#include "runtime/assembly/operator_voice.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace tumbler {

struct OperatorVoice::State {
  State(int descriptor_in, std::size_t lines_max_in)
      : descriptor(descriptor_in), lines_max(lines_max_in) {}

  const int descriptor;
  const std::size_t lines_max;
  std::mutex mutex;  // guards the rest; nobody who has it waits for anything
  std::condition_variable changed;
  std::deque<std::string> lines;
  std::size_t lost = 0;
  std::int64_t taken = 0;  // bytes
  bool writing = false;
  bool over = false;
  bool given_up = false;  // Somebody waited for long enough.
  bool failed = false;

  void Run() {
    std::unique_lock lock(mutex);
    while (true) {
      changed.wait(lock, [this] { return over || !lines.empty() || lost > 0; });
      if (lines.empty() && lost == 0) return;
      std::string text;
      if (lines.empty()) {
        text = fmt::format("({} messages were left out)\n", std::exchange(lost, 0));
      } else {
        text = std::move(lines.front());
        lines.pop_front();
      }
      writing = true;
      lock.unlock();
      const bool good = Write(text);
      lock.lock();
      writing = false;
      failed = failed || !good;
      changed.notify_all();
    }
  }

  bool Write(const std::string& text) {
    std::size_t written = 0;
    while (written < text.size()) {
      const ssize_t count = write(descriptor, text.data() + written, text.size() - written);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return false;
      written += static_cast<std::size_t>(count);
      const std::lock_guard lock(mutex);
      taken += count;
    }
    return true;
  }
};

OperatorVoice::OperatorVoice(int descriptor, std::size_t lines_max)
    : state_(std::make_shared<State>(descriptor, lines_max)) {
  std::thread([state = state_] { state->Run(); }).detach();
}

OperatorVoice::~OperatorVoice() {
  bool wait = false;
  {
    const std::lock_guard lock(state_->mutex);
    wait = !state_->given_up;
  }
  if (wait) static_cast<void>(Await(std::chrono::seconds(1)));
  const std::lock_guard lock(state_->mutex);
  state_->over = true;
  state_->lines.clear();
  state_->lost = 0;
  state_->changed.notify_all();
}

void OperatorVoice::Say(const std::string& text) noexcept {
  const std::lock_guard lock(state_->mutex);
  // Lines that come after those that were left out would hide that they were.
  if (state_->lost > 0 || state_->lines.size() >= state_->lines_max) {
    ++state_->lost;
    return;
  }
  try {
    state_->lines.push_back(text + '\n');
  } catch (const std::exception&) {
    ++state_->lost;  // There is no memory for it.
  }
  state_->changed.notify_all();
}

bool OperatorVoice::Await(std::chrono::milliseconds patience) {
  std::unique_lock lock(state_->mutex);
  const auto silent = [this] {
    return state_->lines.empty() && state_->lost == 0 && !state_->writing;
  };
  std::int64_t taken = state_->taken;
  while (!state_->changed.wait_for(lock, patience, silent)) {
    if (state_->taken == taken) {
      state_->given_up = true;
      return false;
    }
    taken = state_->taken;
  }
  state_->given_up = false;
  return true;
}

bool OperatorVoice::failed() const {
  const std::lock_guard lock(state_->mutex);
  return state_->failed;
}

}  // namespace tumbler
