#pragma once

#include "runtime/assembly/operator_mailbox.h"

namespace tumbler {

/// The mailbox for the wishes that SIGINT, SIGTERM, SIGHUP and SIGTSTP stand for. Others may put
/// wishes there too.
OperatorMailbox& InterruptMailbox();

/// Catches SIGINT, SIGTERM, SIGHUP and SIGTSTP (Ctrl-Z) from now on: the first one asks to finish,
/// the second to stop, and every further one for torque off. Each of them also asks to end the
/// program afterwards. SIGPIPE is ignored, and so are SIGTTOU and SIGTTIN, which stop a program in
/// the background that uses its terminal. Nobody can catch SIGSTOP: what a run does after one is
/// `Fault::kPaused`.
void CatchInterrupts();

}  // namespace tumbler
