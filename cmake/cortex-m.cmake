# The toolchain for a bare Cortex-M with a floating-point unit: Debian's gcc-arm-none-eabi. The presets cortex-m4f and
# cortex-m7 set TUMBLER_CORTEX_M.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # Nothing links without a start-up and a linker script.
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TUMBLER_CORTEX_M)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

if(TUMBLER_CORTEX_M STREQUAL "m4f")
  set(cortex_m_flags "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16")
elseif(TUMBLER_CORTEX_M STREQUAL "m7")
  set(cortex_m_flags "-mcpu=cortex-m7 -mfpu=fpv5-d16")
else()
  message(FATAL_ERROR "TUMBLER_CORTEX_M is '${TUMBLER_CORTEX_M}': m4f (Cortex-M4F) or m7 (Cortex-M7) is needed")
endif()
string(APPEND cortex_m_flags " -mthumb -mfloat-abi=hard -ffunction-sections -fdata-sections")
# The compiler writes the call graph and the stack of each function beside every object (*.ci).
string(APPEND cortex_m_flags " -fcallgraph-info=su")
set(CMAKE_CXX_COMPILER_LAUNCHER "" CACHE STRING "None: a compiler cache gives objects back without their call graphs" FORCE)
set(CMAKE_C_FLAGS_INIT "${cortex_m_flags}")
set(CMAKE_CXX_FLAGS_INIT "${cortex_m_flags} -fno-exceptions -fno-rtti -fno-threadsafe-statics")
