#pragma once

#include <string>

namespace tumbler {

/// Version and commit of the sources that this was built from: `0.1.0 (commit 0123456789ab)`, with
/// `, changed` where files differed from the commit. Where the sources are in no repository of
/// their own: `0.1.0 (commit unknown)`.
std::string BuildVersion();

}  // namespace tumbler
