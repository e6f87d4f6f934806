#include "runtime/linux/interrupts.h"

#include <csignal>

namespace tumbler {
namespace {

void OnInterrupt(int /*signal*/) {
  static volatile std::sig_atomic_t count = 0;
  count = count + 1;
  InterruptMailbox().Put(count == 1   ? OperatorCommand::kFinish
                         : count == 2 ? OperatorCommand::kStop
                                      : OperatorCommand::kDisarm);
}

}  // namespace

OperatorMailbox& InterruptMailbox() {
  static OperatorMailbox mailbox;  // A signal handler can only reach what is static.
  return mailbox;
}

void CatchInterrupts() {
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace tumbler
