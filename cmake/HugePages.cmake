# g++ takes hundreds of megabytes for a source with matrices, page by page. In huge pages it compiles in four fifths to
# nine tenths of the time, to the same bytes. Where the kernel gives them to those who ask, a small library asks for the
# compiler, and its allocator is told to. Clang was seen to gain nothing.
option(TUMBLER_HUGE_PAGES "Let g++ have its memory in huge pages where Linux gives them when asked" ON)

set(huge_pages_mode "")
if(EXISTS /sys/kernel/mm/transparent_hugepage/enabled)
  file(READ /sys/kernel/mm/transparent_hugepage/enabled huge_pages_mode)
endif()
# The loader takes a path with a space or colon for two.
if(TUMBLER_HUGE_PAGES AND huge_pages_mode MATCHES "\\[madvise\\]" AND CMAKE_CXX_COMPILER_ID STREQUAL GNU
   AND CMAKE_HOST_SYSTEM_PROCESSOR STREQUAL x86_64 AND NOT CMAKE_CROSSCOMPILING
   AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER AND NOT CMAKE_BINARY_DIR MATCHES "[ :\"$`\\]")
  set(huge_pages ${CMAKE_BINARY_DIR}/CMakeFiles/huge_pages)
  execute_process(
    COMMAND ${CMAKE_C_COMPILER} -O2 -shared -fPIC ${CMAKE_CURRENT_LIST_DIR}/huge_pages.c -o ${huge_pages}.so
    RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
  if(status EQUAL 0)
    file(CONFIGURE OUTPUT ${huge_pages}.sh @ONLY CONTENT [[#!/bin/sh
LD_PRELOAD="@huge_pages@.so${LD_PRELOAD:+:$LD_PRELOAD}" \
GLIBC_TUNABLES="glibc.malloc.hugetlb=1${GLIBC_TUNABLES:+:$GLIBC_TUNABLES}" exec "$@"
]])
    file(CHMOD ${huge_pages}.sh PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${huge_pages}.sh)
  endif()
endif()
