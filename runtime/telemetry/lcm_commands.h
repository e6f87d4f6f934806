#pragma once

#include <memory>
#include <string>

#include "common/sequence.h"
#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// A thread that puts the `command_t` messages of channel TUMBLER_COMMAND into a mailbox.
class LcmCommands {
 public:
  /// @param mailbox  must outlive this object.
  /// @param graph    has the branches that the operator may name.
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
