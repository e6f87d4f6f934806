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

/// A thread that puts the `command_t` messages of channel TUMBLER_COMMAND into a mailbox. Datagrams
/// that are no such message are counted, and change nothing.
class LcmCommands {
 public:
  /// @param mailbox  must outlive this object.
  /// @param graph    has the branches that the operator may name.
  /// @throws std::runtime_error when LCM cannot use the URL, or nobody answers there.
  LcmCommands(const std::string& url, OperatorMailbox& mailbox, const SequenceGraph<float>& graph);
  ~LcmCommands();
  LcmCommands(const LcmCommands&) = delete;
  LcmCommands& operator=(const LcmCommands&) = delete;

  /// Datagrams of the channel that were no `command_t`, or asked for something that there is not.
  [[nodiscard]] std::int64_t unreadable() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
