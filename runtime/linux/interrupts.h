#pragma once

#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// Where SIGINT and SIGTERM are put once they are caught; others may put wishes there too.
OperatorMailbox& InterruptMailbox();

/// From now on the first SIGINT or SIGTERM asks to finish, the second to stop, and every further
/// one for torque off; each of them to end the program afterwards.
void CatchInterrupts();

}  // namespace tumbler
