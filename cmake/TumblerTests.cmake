# The functions that compile and register tests, or leave them out when a tool is missing. tests/support has the code
# that tests share.
include(GoogleTest)

option(TUMBLER_REQUIRE_ALL_TESTS "Stop where a tool of a test is missing, instead of leaving the test out" OFF)

# tumbler_tool(browser FOUND ${TUMBLER_CHROMIUM} PACKAGES chromium) declares a tool that tests can NEED. It is installed
# if FOUND has a true value; otherwise the packages bring it.
function(tumbler_tool name)
  cmake_parse_arguments(ARG "" "" "FOUND;PACKAGES" ${ARGN})
  set(missing "")
  if(NOT ARG_FOUND)
    string(JOIN " " missing ${ARG_PACKAGES})
  endif()
  set_property(GLOBAL PROPERTY TUMBLER_MISSING_${name} "${missing}")
endfunction()

# tumbler_left_out(left_out report_browser_test browser) tells whether one of the tools is missing. If so, CTest's list
# has a skipped test of this name, which names the packages that it needs.
function(tumbler_left_out result name)
  set(packages)
  foreach(tool ${ARGN})
    get_property(missing GLOBAL PROPERTY TUMBLER_MISSING_${tool})
    if(missing)
      list(APPEND packages ${missing})
    endif()
  endforeach()
  if(packages)
    string(JOIN " " packages ${packages})
    string(REPLACE " " ", " packages "${packages}")
    add_test(NAME "${name} left out, needs ${packages}" COMMAND ${CMAKE_COMMAND} -E echo "left out, needs ${packages}")
    set_tests_properties("${name} left out, needs ${packages}" PROPERTIES SKIP_REGULAR_EXPRESSION "left out")
    set_property(GLOBAL APPEND PROPERTY TUMBLER_LEFT_OUT "${name} (${packages})")
    set(${result} TRUE PARENT_SCOPE)
  else()
    set(${result} FALSE PARENT_SCOPE)
  endif()
endfunction()

# Reports which tests were left out, after all of them were declared.
function(tumbler_report_left_out)
  get_property(left_out GLOBAL PROPERTY TUMBLER_LEFT_OUT)
  if(left_out)
    list(JOIN left_out "\n   " tests)
    if(TUMBLER_REQUIRE_ALL_TESTS)
      message(FATAL_ERROR "These tests lack packages; scripts/setup installs them:\n   ${tests}")
    endif()
    message(STATUS "Tests left out for want of packages, which scripts/setup installs:\n   ${tests}")
  endif()
endfunction()

# tumbler_test_program(dbc_frames SOURCES ... LINK ...) builds a program into tests/, NAME.cc of the current folder
# unless it has SOURCES. It is not optimised, because it is compiled more often than it is run: what it calls is.
# BUSY: it computes for so long itself, or in templates that it makes of the project's headers, that it is optimised.
function(tumbler_test_program name)
  cmake_parse_arguments(ARG "BUSY" "" "SOURCES;LINK" ${ARGN})
  set(kind test)
  if(ARG_BUSY)
    set(kind busy_test)
  endif()
  if(NOT ARG_SOURCES)
    set(ARG_SOURCES ${name}.cc)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  target_link_libraries(${name} PRIVATE ${ARG_LINK} tumbler_test_support tumbler_${kind}_optimisation tumbler_warnings)
endfunction()

# tumbler_googletest(live_lcm_test LINK ...) does the same with GoogleTest and its main. OWN_HEADERS: a library brings
# flags that do not fit the headers that are parsed once for all tests.
function(tumbler_googletest name)
  cmake_parse_arguments(ARG "OWN_HEADERS;BUSY" "" "SOURCES;LINK" ${ARGN})
  set(kind test)
  set(busy)
  if(ARG_BUSY)
    set(kind busy_test)
    set(busy BUSY)
  endif()
  tumbler_test_program(${name} ${busy}
    SOURCES ${ARG_SOURCES} LINK ${ARG_LINK} GTest::gtest GTest::gmock GTest::gtest_main)
  if(TARGET tumbler_${kind}_headers AND NOT ARG_OWN_HEADERS)
    target_precompile_headers(${name} REUSE_FROM tumbler_${kind}_headers)
  endif()
endfunction()

# tumbler_label(solver_test longer EXPRESSION...) gives a label to the tests of a program whose names match one of the
# expressions. Which tests there are is known once the program is built, so CTest does it when it reads them. An
# expression that no test matches is an error.
function(tumbler_label name label)
  get_property(suites GLOBAL PROPERTY TUMBLER_TOGETHER_${name})
  get_property(all_have GLOBAL PROPERTY TUMBLER_LABELS_${name})
  set(expressions "")
  foreach(expression ${ARGN})
    string(APPEND expressions "\n    [==[${expression}]==]")
  endforeach()
  set(script ${CMAKE_CURRENT_BINARY_DIR}/${name}_${label}.cmake)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/label_tests.cmake.in ${script} @ONLY)
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${script})
endfunction()

# tumbler_test(bspline_test LINK tumbler::common ...) does the same, and registers each of its cases with CTest.
# PROGRAMS are the project's programs that it runs, NEEDS the tools without which it is left out. SECONDS is about how
# long its longest case takes, where that is long: such tests begin first, or all would wait for them in the end.
# TOGETHER: suites whose cases share what takes long to make; each is registered as one test.
# LONGER: the tests that only go on for longer on paths that another test takes, too; their label is `longer`.
# UNSANITIZED: what takes longer with sanitizers than it tells there; the label is `unsanitized`. Both are expressions
# for names.
function(tumbler_test name)
  cmake_parse_arguments(ARG "OWN_HEADERS;BUSY" "SECONDS"
                        "SOURCES;LINK;LABELS;PROGRAMS;NEEDS;TOGETHER;LONGER;UNSANITIZED" ${ARGN})
  if(NOT ARG_SECONDS)
    set(ARG_SECONDS 0)
  endif()
  tumbler_left_out(left_out ${name} ${ARG_NEEDS})
  if(left_out)
    return()
  endif()
  set(kind)
  if(ARG_OWN_HEADERS)
    list(APPEND kind OWN_HEADERS)
  endif()
  if(ARG_BUSY)
    list(APPEND kind BUSY)
  endif()
  tumbler_googletest(${name} ${kind} SOURCES ${ARG_SOURCES} LINK ${ARG_LINK})
  if(ARG_PROGRAMS)
    add_dependencies(${name} ${ARG_PROGRAMS})
  endif()
  set(filter)
  if(ARG_TOGETHER)
    list(TRANSFORM ARG_TOGETHER APPEND ".*" OUTPUT_VARIABLE together)
    list(JOIN together ":" together)
    set(filter TEST_FILTER "-${together}")
  endif()
  gtest_discover_tests(${name} ${filter}
    PROPERTIES TIMEOUT 300 COST ${ARG_SECONDS} LABELS "${ARG_LABELS}" DISCOVERY_TIMEOUT 60)
  set_property(GLOBAL PROPERTY TUMBLER_TOGETHER_${name} "${ARG_TOGETHER}")
  set_property(GLOBAL PROPERTY TUMBLER_LABELS_${name} "${ARG_LABELS}")
  foreach(label LONGER UNSANITIZED)
    if(ARG_${label})
      string(TOLOWER ${label} label_name)
      tumbler_label(${name} ${label_name} ${ARG_${label}})
    endif()
  endforeach()
  foreach(suite ${ARG_TOGETHER})
    set(labels ${ARG_LABELS})
    foreach(label LONGER UNSANITIZED)
      foreach(expression ${ARG_${label}})
        if(suite MATCHES "${expression}")
          string(TOLOWER ${label} label_name)
          list(APPEND labels ${label_name})
        endif()
      endforeach()
    endforeach()
    add_test(NAME ${suite} COMMAND ${name} --gtest_brief=1 --gtest_filter=${suite}.*)
    set_tests_properties(${suite} PROPERTIES TIMEOUT 300 COST ${ARG_SECONDS} LABELS "${labels}")
  endforeach()
endfunction()
