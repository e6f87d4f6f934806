#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <tumbler/command_t.hpp>

#include "common/sequence.h"
#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// Reads a `command_t` from a datagram, which may hold any bytes: LCM's own reader throws at some
/// of them.
/// @returns false, having changed nothing, unless the bytes are exactly one message.
[[nodiscard]] bool ReadCommand(std::span<const std::uint8_t> bytes, command_t& message);

/// The run that requests are for.
struct CommandAddress {
  std::int64_t run = 0;         ///< `RunDescription::number`
  std::int64_t age_max = 2000;  ///< Ticks since the state that the sender saw.
};

/// A thread that puts the `command_t` messages of channel TUMBLER_COMMAND into a mailbox. Datagrams
/// that are no such message, requests to another run, as when a log is played again, and requests
/// that are too old are counted, and change nothing.
class LcmCommands {
 public:
  /// @param mailbox  must outlive this object.
  /// @param graph    has the branches that the operator may name.
  /// @throws std::runtime_error when LCM cannot use the URL, or nobody answers there.
  LcmCommands(const std::string& url, OperatorMailbox& mailbox, const SequenceGraph<float>& graph,
              const CommandAddress& address);
  ~LcmCommands();
  LcmCommands(const LcmCommands&) = delete;
  LcmCommands& operator=(const LcmCommands&) = delete;

  /// Datagrams of the channel that were no `command_t`, or asked for something that there is not.
  [[nodiscard]] std::int64_t unreadable() const;
  /// Requests to another run, or older than `age_max`.
  [[nodiscard]] std::int64_t refused() const;
  /// To be called after every tick with the number of its record. Only an atomic store.
  void NoteTick(std::int64_t number) noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
