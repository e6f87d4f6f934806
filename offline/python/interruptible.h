#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <chrono>
#include <future>
#include <optional>
#include <utility>

namespace tumbler {

/// A function of Python that is told of progress, from any thread. What it raises stops the work.
class ProgressCallback {
 public:
  /// @param function  None: nobody is told.
  explicit ProgressCallback(pybind11::object function) : function_(std::move(function)) {}

  [[nodiscard]] bool wanted() const { return !function_.is_none(); }

  /// Calls the function with the arguments that `arguments()` makes while Python's lock is held.
  /// Returns whether the work is to go on.
  template <typename Arguments>
  bool Call(const Arguments& arguments) {
    const pybind11::gil_scoped_acquire lock;
    if (raised_) return false;
    try {
      return !function_(arguments()).is(pybind11::bool_(false));
    } catch (pybind11::error_already_set& error) {
      raised_ = error;
      return false;
    }
  }

  /// Raises what the function raised, if anything.
  void Rethrow() {
    if (raised_) throw pybind11::error_already_set(*std::exchange(raised_, std::nullopt));
  }

 private:
  pybind11::object function_;
  std::optional<pybind11::error_already_set> raised_;
};

/// Does work in a thread of its own, without Python's lock, while this thread listens for Ctrl-C.
/// @param work  is called with a flag that is set when it is to stop.
/// @returns what it returns. @throws as it does, and error_already_set when it was interrupted.
template <typename Work>
auto Interruptibly(const Work& work) {
  std::atomic<bool> stop = false;
  auto result = std::async(std::launch::async, [&] { return work(stop); });
  constexpr std::chrono::milliseconds kListen{50};
  while (true) {
    {
      const pybind11::gil_scoped_release release;
      if (result.wait_for(kListen) == std::future_status::ready) break;
    }
    if (PyErr_CheckSignals() == 0) continue;
    stop = true;
    const pybind11::error_already_set interrupted;
    {
      const pybind11::gil_scoped_release release;
      result.wait();
    }
    throw pybind11::error_already_set(interrupted);
  }
  return result.get();
}

}  // namespace tumbler
