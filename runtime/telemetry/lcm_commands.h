#pragma once

#include <memory>
#include <string>

#include "common/sequence.h"
#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// Takes `command_t` messages from channel TUMBLER_COMMAND into a mailbox, in a thread of its own.
class LcmCommands {
 public:
  /// @param mailbox  must outlive this object.
  /// @param graph    whose branches the operator may name.
  /// @throws std::runtime_error when LCM cannot use the URL.
  LcmCommands(const std::string& url, OperatorMailbox& mailbox, const SequenceGraph<float>& graph);
  ~LcmCommands();
  LcmCommands(const LcmCommands&) = delete;
  LcmCommands& operator=(const LcmCommands&) = delete;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
