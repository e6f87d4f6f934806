#pragma once

#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// The mailbox for the wishes that SIGINT, SIGTERM and SIGHUP stand for. Others may put wishes
/// there too.
OperatorMailbox& InterruptMailbox();

/// Catches SIGINT, SIGTERM and SIGHUP from now on: the first one asks to finish, the second to
/// stop, and every further one for torque off. Each of them also asks to end the program
/// afterwards. SIGPIPE is ignored.
void CatchInterrupts();

}  // namespace tumbler
