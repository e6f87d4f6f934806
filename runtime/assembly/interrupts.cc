#include "runtime/assembly/interrupts.h"

#include <csignal>

namespace tumbler {
namespace {

void OnInterrupt(int /*signal*/) {
  static volatile std::sig_atomic_t count = 0;
  count = count + 1;
  OperatorWish wish;
  wish.request = count == 1   ? OperatorRequest::kFinish
                 : count == 2 ? OperatorRequest::kStop
                              : OperatorRequest::kDisarm;
  wish.quit = true;
  InterruptMailbox().Put(wish);
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
  sigaction(SIGHUP, &action, nullptr);  // The terminal of the run is gone, or its connection.
  // Ctrl-Z would freeze the program while drives let go and the robot falls.
  sigaction(SIGTSTP, &action, nullptr);
  // So would what it says, and what it asks, once it is in the background.
  std::signal(SIGTTOU, SIG_IGN);
  std::signal(SIGTTIN, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);  // A reader of the output that ends must not end the run.
}

}  // namespace tumbler
