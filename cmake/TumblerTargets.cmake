# Options for every target of the project, and the functions that declare targets.

# Warnings are errors for our own code only; they are never exported.
add_library(tumbler_warnings INTERFACE)
target_compile_options(tumbler_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror)

# In a unity build every source of ours is an included file to the compiler, whose types might then be another file's too.
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  target_compile_options(tumbler_warnings INTERFACE -Wno-subobject-linkage)
endif()

# -ffp-contract=off: a fused multiply-add rounds once instead of twice, so its use would make results
# depend on the processor and the compiler; setpoints and primitives are to be bit-identical everywhere.
add_library(tumbler_options INTERFACE)
target_compile_features(tumbler_options INTERFACE cxx_std_20)
# -fno-semantic-interposition: our libraries are position independent, and without it no exported function would be
# inlined, not even into its neighbours, in case another library replaces it at run time.
target_compile_options(tumbler_options INTERFACE -ffp-contract=off)
if(NOT TUMBLER_FREESTANDING)
  target_compile_options(tumbler_options INTERFACE -fno-semantic-interposition)
endif()
# How many joints a motion may have is a number in a header that is made here, and installed with the others. So all
# that includes a header of this build has the same one, with whatever flags it is compiled.
set(TUMBLER_MADE_HEADERS ${PROJECT_BINARY_DIR}/made)
configure_file(${PROJECT_SOURCE_DIR}/common/core/capacity.h.in ${TUMBLER_MADE_HEADERS}/common/core/capacity.h @ONLY)
target_include_directories(tumbler_options INTERFACE $<BUILD_INTERFACE:${TUMBLER_MADE_HEADERS}>)
if(TUMBLER_SANITIZE)
  target_compile_options(tumbler_options INTERFACE -fsanitize=${TUMBLER_SANITIZE}
                         -fno-omit-frame-pointer -fno-sanitize-recover=all)
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
    target_compile_options(tumbler_options INTERFACE
                           -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/sanitizer_ignored.txt)
  endif()
  target_link_options(tumbler_options INTERFACE -fsanitize=${TUMBLER_SANITIZE})
endif()

if(TUMBLER_BUILD_FUZZERS)
  target_compile_options(tumbler_options INTERFACE -fsanitize=fuzzer-no-link)
endif()

# What runs once a command, for a moment, is compiled to less speed in less time: files, command lines, pages; so is what
# spends its time in the loops of other libraries.
add_library(tumbler_brief_work INTERFACE)
if(NOT TUMBLER_FREESTANDING)
  target_compile_options(tumbler_brief_work INTERFACE $<$<CONFIG:Release>:-O1>)
endif()

# What most sources of a part include is parsed once for all of them. Of matrices this would save nothing: most of their
# time is spent on templates that each source needs of its own. g++ 12 compiles what uses such headers with the
# optimisation that they were read with, so they are for BRIEF_WORK alone. Sources include all that they use
# nevertheless; clang-tidy reads them without this.
option(TUMBLER_PRECOMPILE_HEADERS "Parse the headers that most sources include once for all of them" ON)
function(tumbler_precompiled_headers name)
  cmake_parse_arguments(ARG "" "" "LINK;HEADERS" ${ARGN})
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc "")  # A target needs a source.
  add_library(tumbler_${name} OBJECT ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)
  set_target_properties(tumbler_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(tumbler_${name} PRIVATE tumbler_options tumbler_warnings ${ARG_LINK} tumbler_brief_work)
  target_precompile_headers(tumbler_${name} PRIVATE ${ARG_HEADERS})
endfunction()

# tumbler_library(common SOURCES a.cc ... LINK Eigen3::Eigen ...) declares tumbler_common, alias tumbler::common.
# BRIEF_WORK: none of it is a loop of its own that anybody waits for, or part of the control loop.
# HEADERS: a name given to tumbler_precompiled_headers; only with BRIEF_WORK.
function(tumbler_library name)
  cmake_parse_arguments(ARG "BRIEF_WORK" "HEADERS" "SOURCES;LINK;LINK_PRIVATE" ${ARGN})
  add_library(tumbler_${name} STATIC ${ARG_SOURCES})
  add_library(tumbler::${name} ALIAS tumbler_${name})
  set_target_properties(tumbler_${name} PROPERTIES EXPORT_NAME ${name})
  if(NOT TUMBLER_FREESTANDING)
    set_target_properties(tumbler_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  endif()
  target_include_directories(tumbler_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/tumbler>)
  target_link_libraries(tumbler_${name} PUBLIC tumbler_options ${ARG_LINK}
                        PRIVATE $<BUILD_INTERFACE:tumbler_warnings> ${ARG_LINK_PRIVATE})
  if(ARG_BRIEF_WORK)
    target_link_libraries(tumbler_${name} PRIVATE $<BUILD_INTERFACE:tumbler_brief_work>)
  endif()
  if(ARG_HEADERS AND NOT ARG_BRIEF_WORK)
    message(FATAL_ERROR "tumbler_${name}: HEADERS would change its optimisation; they are for BRIEF_WORK")
  endif()
  if(ARG_HEADERS AND TUMBLER_PRECOMPILE_HEADERS)
    target_precompile_headers(tumbler_${name} REUSE_FROM tumbler_${ARG_HEADERS})
  endif()
  set_property(GLOBAL APPEND PROPERTY TUMBLER_LIBRARIES tumbler_${name})
endfunction()

# clang-tidy looks through all headers again for each command. Where nothing but it reads the commands (preset tidy), it
# finds the sources of a program among those of the first library that the program links, one program for each library.
option(TUMBLER_JOIN_PROGRAMS "Count programs' sources as those of their libraries; not to be built" OFF)
function(tumbler_join_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  list(GET ARG_LINK 0 library)
  get_target_property(library ${library} ALIASED_TARGET)
  get_target_property(joined ${library} TUMBLER_JOINED)
  if(NOT joined)
    set_target_properties(${library} PROPERTIES TUMBLER_JOINED TRUE)
    list(TRANSFORM ARG_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
    target_sources(${library} PRIVATE ${ARG_SOURCES})
    set(joined_source ${CMAKE_BINARY_DIR}/joined.cc)
    file(WRITE ${joined_source} "")
    set_target_properties(${name} PROPERTIES SOURCES ${joined_source})
  endif()
endfunction()

# tumbler_executable(tumbler run SOURCES ... LINK ...) declares the program of a command: libexec/tumbler/run, which
# bin/tumbler starts.
function(tumbler_executable name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  string(REPLACE "tumbler-" "" command ${name})
  set_target_properties(${name} PROPERTIES
    OUTPUT_NAME ${command} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/libexec/tumbler)
  add_dependencies(${name} tumbler)
  target_link_libraries(${name} PRIVATE ${ARG_LINK} tumbler_warnings tumbler_brief_work)
  if(TUMBLER_PRECOMPILE_HEADERS)
    target_precompile_headers(${name} REUSE_FROM tumbler_program_headers)
  endif()
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/tumbler COMPONENT programs)
  set_property(GLOBAL APPEND PROPERTY TUMBLER_PROGRAMS ${name})
  if(TUMBLER_JOIN_PROGRAMS)
    tumbler_join_library(${name} SOURCES ${ARG_SOURCES} LINK ${ARG_LINK})
  endif()
endfunction()
