# The tools that tests need besides the project, GoogleTest and a shell, and their Debian packages. (DART is in
# offline/.)

# tumbler_compiles(RESULT COMPILER FLAG...) tells whether a compiler makes a program with a header of the C++ library.
# It tries once, and again when the compiler was not found before.
function(tumbler_compiles result compiler)
  if(NOT ${result} AND ${compiler})
    set(source ${CMAKE_BINARY_DIR}/CMakeFiles/compiles.cc)
    file(WRITE ${source} "#include <array>\nint main() { return std::array<int, 1>{}[0]; }\n")
    execute_process(COMMAND ${${compiler}} ${ARGN} ${source} -o ${CMAKE_BINARY_DIR}/CMakeFiles/compiles
                    RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
    if(status EQUAL 0)
      set(${result} TRUE CACHE INTERNAL "")
    endif()
  endif()
endfunction()

# The Python of Debian, for which its packages are.
find_program(TUMBLER_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH)
tumbler_tool(python FOUND ${TUMBLER_PYTHON} PACKAGES python3)

# Reads .dbc files.
if(TUMBLER_PYTHON AND NOT TUMBLER_HAS_CANMATRIX)
  execute_process(COMMAND ${TUMBLER_PYTHON} -c "import canmatrix" RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
  if(status EQUAL 0)
    set(TUMBLER_HAS_CANMATRIX TRUE CACHE INTERNAL "")
  endif()
endif()
tumbler_tool(canmatrix FOUND ${TUMBLER_HAS_CANMATRIX} PACKAGES python3-canmatrix)

# Compares JSON with its schemas.
if(TUMBLER_PYTHON AND NOT TUMBLER_HAS_JSONSCHEMA)
  execute_process(COMMAND ${TUMBLER_PYTHON} -c "import jsonschema" RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
  if(status EQUAL 0)
    set(TUMBLER_HAS_JSONSCHEMA TRUE CACHE INTERNAL "")
  endif()
endif()
tumbler_tool(jsonschema FOUND ${TUMBLER_HAS_JSONSCHEMA} PACKAGES python3-jsonschema)

# candump, canplayer and log2asc; interfaces and network namespaces.
find_program(TUMBLER_CANDUMP candump)
tumbler_tool(can_utils FOUND ${TUMBLER_CANDUMP} PACKAGES can-utils)
find_program(TUMBLER_IP ip PATHS /usr/sbin /sbin)
tumbler_tool(ip FOUND ${TUMBLER_IP} PACKAGES iproute2)

find_program(TUMBLER_VALGRIND valgrind)
find_program(TUMBLER_DOXYGEN doxygen)
tumbler_tool(doxygen FOUND ${TUMBLER_DOXYGEN} PACKAGES doxygen)

tumbler_tool(valgrind FOUND ${TUMBLER_VALGRIND} PACKAGES valgrind)

# Decide whether formulas about floats hold.
find_program(TUMBLER_Z3 z3)
tumbler_tool(z3 FOUND ${TUMBLER_Z3} PACKAGES z3)
find_program(TUMBLER_CVC5 cvc5)
tumbler_tool(cvc5 FOUND ${TUMBLER_CVC5} PACKAGES cvc5)
# Whose intermediate representation the proofs are of.
find_program(TUMBLER_PROOF_CXX clang++-22)
tumbler_tool(proof_compiler FOUND ${TUMBLER_PROOF_CXX} PACKAGES clang-22)

find_program(TUMBLER_CHROMIUM chromium)
tumbler_tool(browser FOUND ${TUMBLER_CHROMIUM} PACKAGES chromium)

# RealtimeSanitizer comes with clang 20 and later, while the project is built with older compilers.
option(TUMBLER_RTSAN "Check the real-time core with RealtimeSanitizer" ON)
if(TUMBLER_RTSAN)
  find_program(TUMBLER_RTSAN_CXX NAMES clang++-22 clang++-21 clang++-20)
  tumbler_compiles(TUMBLER_HAS_RTSAN TUMBLER_RTSAN_CXX -fsanitize=realtime)
  tumbler_tool(rtsan FOUND ${TUMBLER_HAS_RTSAN} PACKAGES clang-22 libclang-rt-22-dev)
endif()

option(TUMBLER_CORTEX_M "Build the core for Cortex-M4F and M7, or for m4f alone, and run it under QEMU in the tests" ON)
if(TUMBLER_CORTEX_M)
  find_program(TUMBLER_ARM_CXX arm-none-eabi-g++)
  tumbler_compiles(TUMBLER_HAS_ARM_CXX TUMBLER_ARM_CXX --specs=nosys.specs)
  tumbler_tool(arm_compiler FOUND ${TUMBLER_HAS_ARM_CXX}
               PACKAGES gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib)
  find_program(TUMBLER_QEMU_ARM qemu-system-arm)
  tumbler_tool(qemu FOUND ${TUMBLER_QEMU_ARM} PACKAGES qemu-system-arm)
endif()

# Another architecture, for the bits of the elementary functions and of the optimiser.
find_program(TUMBLER_AARCH64_CXX aarch64-linux-gnu-g++)
tumbler_compiles(TUMBLER_HAS_AARCH64_CXX TUMBLER_AARCH64_CXX -static)
tumbler_tool(aarch64_compiler FOUND ${TUMBLER_HAS_AARCH64_CXX} PACKAGES g++-aarch64-linux-gnu)
find_program(TUMBLER_QEMU_AARCH64 NAMES qemu-aarch64 qemu-aarch64-static)
tumbler_tool(qemu_user FOUND ${TUMBLER_QEMU_AARCH64} PACKAGES qemu-user)

# The reference reader of MCAP and what decodes its messages, and a linter of TOML; scripts/setup has npm install them.
find_program(TUMBLER_NODE node)
set(TUMBLER_NODE_MODULES ${PROJECT_SOURCE_DIR}/build/npm/node_modules)
set(TUMBLER_HAS_MCAP_READER FALSE)
if(TUMBLER_NODE AND EXISTS ${TUMBLER_NODE_MODULES}/@mcap/core/package.json)
  set(TUMBLER_HAS_MCAP_READER TRUE)
endif()
set(TUMBLER_TAPLO ${TUMBLER_NODE_MODULES}/.bin/taplo)
set(TUMBLER_HAS_TAPLO FALSE)
if(TUMBLER_NODE AND EXISTS ${TUMBLER_TAPLO})
  set(TUMBLER_HAS_TAPLO TRUE)
endif()
tumbler_tool(taplo FOUND ${TUMBLER_HAS_TAPLO} PACKAGES nodejs npm @taplo/cli)
tumbler_tool(mcap_reader FOUND ${TUMBLER_HAS_MCAP_READER} PACKAGES nodejs npm @mcap/core)
