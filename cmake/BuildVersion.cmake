# Writes OUT, a source with the commit of the folder SOURCE, and VERSION; only if it changes. It is run in every build.
set(commit unknown)
find_package(Git QUIET)
if(GIT_FOUND)
  # A folder of another project's repository has no commit of its own.
  execute_process(COMMAND ${GIT_EXECUTABLE} rev-parse --show-toplevel WORKING_DIRECTORY ${SOURCE}
                  OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  file(REAL_PATH "${SOURCE}" source)
  if(top STREQUAL source)
    execute_process(COMMAND ${GIT_EXECUTABLE} describe --always --abbrev=12 --exclude=* --dirty=,\ changed
                    WORKING_DIRECTORY ${SOURCE}
                    OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(described)
      set(commit ${described})
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT [[#include "common/files/build_version.h"

namespace tumbler {

std::string BuildVersion() { return "@VERSION@ (commit @commit@)"; }

}  // namespace tumbler
]] @ONLY)
