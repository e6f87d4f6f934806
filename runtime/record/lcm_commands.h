#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <tumbler/command_t.hpp>

#include "common/core/sequence.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/record/request_key.h"

namespace tumbler {

/// Reads a `command_t` from a datagram, which may hold any bytes: LCM's own reader throws at some
/// of them.
/// @returns false, having changed nothing, unless the bytes are exactly one message.
[[nodiscard]] bool ReadCommand(std::span<const std::uint8_t> bytes, command_t& message);

/// The run that requests are for, and which of them it obeys.
struct CommandAddress {
  std::int64_t run = 0;  ///< `RunDescription::number`
  /// Ticks since the state that the sender saw, for requests that may begin or change a motion.
  std::int64_t age_max = 2000;
  std::optional<RequestKey> key;  ///< Without it, those are refused too; none: there is no key.
};

/// A thread that puts the `command_t` messages of channel TUMBLER_COMMAND into a mailbox. Datagrams
/// that are no such message, and requests to another run, as when a log is played again, are
/// counted, and change nothing.
///
/// A request towards rest (finish, stop, disarm) that names the run is obeyed however old the state
/// is that its sender saw, whether it was signed or not, and as often as it comes: who wants the
/// robot to stop may have lost sight of it, or the key. Any other request is refused when that
/// state is too old, or when there is a key and it was not signed with it; and one whose number was
/// there before does nothing. So a message that somebody has recorded is good for nothing.
class LcmCommands {
 public:
  /// @param mailbox  must outlive this object.
  /// @param graph    has the branches that the operator may name.
  /// @param say      gets a sentence about the first request that was refused, on another thread.
  /// @throws std::runtime_error when LCM cannot use the URL, or nobody answers there.
  LcmCommands(const std::string& url, OperatorMailbox& mailbox, const SequenceGraph<float>& graph,
              const CommandAddress& address, std::function<void(const std::string&)> say = {});
  ~LcmCommands();
  LcmCommands(const LcmCommands&) = delete;
  LcmCommands& operator=(const LcmCommands&) = delete;

  /// Datagrams of the channel that were no `command_t`, or asked for something that there is not.
  [[nodiscard]] std::int64_t unreadable() const;
  /// Requests to another run, and those for motion that were too old or not signed.
  [[nodiscard]] std::int64_t refused() const;
  /// To be called after every tick with the number of its record. Only an atomic store.
  void NoteTick(std::int64_t number) noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
