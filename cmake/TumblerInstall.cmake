# Install and export, so that another project can say find_package(tumbler) and link tumbler::common etc. There are
# components, which CPack makes packages of: what runs, what other projects are compiled with, and the Python module
# where it is built.
include(CMakePackageConfigHelpers)
get_property(tumbler_libraries GLOBAL PROPERTY TUMBLER_LIBRARIES)
install(TARGETS ${tumbler_libraries} tumbler_options EXPORT tumbler-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(EXPORT tumbler-targets NAMESPACE tumbler:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler
        COMPONENT development)
get_property(tumbler_uses_mpi GLOBAL PROPERTY TUMBLER_USES_MPI SET)
get_property(tumbler_uses_assimp GLOBAL PROPERTY TUMBLER_USES_ASSIMP SET)
configure_package_config_file(cmake/tumbler-config.cmake.in ${CMAKE_BINARY_DIR}/tumbler-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/tumbler-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/tumbler-config.cmake ${CMAKE_BINARY_DIR}/tumbler-config-version.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler COMPONENT development)
set(tumbler_header_folders common firmware_interface runtime)
if(TUMBLER_BUILD_OFFLINE)
  list(APPEND tumbler_header_folders offline)
endif()
foreach(folder ${tumbler_header_folders})
  install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tumbler COMPONENT development
          FILES_MATCHING PATTERN "*.h")
endforeach()
install(FILES ${TUMBLER_MADE_HEADERS}/common/core/capacity.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tumbler/common/core COMPONENT development)
# Robots and tasks, and the message types for programs that listen to the telemetry.
install(DIRECTORY primitives DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler COMPONENT programs)
install(DIRECTORY docs/schemas DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler COMPONENT programs)
install(DIRECTORY firmware_interface/devices/dbc DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler COMPONENT programs)
install(DIRECTORY runtime/record/lcm DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler COMPONENT programs
        FILES_MATCHING PATTERN "*.lcm")

# Each program prints its manual page; the completion for bash is that of `tumbler`, which asks the others when it is
# used. Instrumented programs are not installed.
get_property(tumbler_programs GLOBAL PROPERTY TUMBLER_PROGRAMS)
find_program(TUMBLER_GZIP gzip)
set(share ${CMAKE_BINARY_DIR}/share)
if(TUMBLER_GZIP AND NOT TUMBLER_SANITIZE AND NOT TUMBLER_BUILD_FUZZERS)
  file(MAKE_DIRECTORY ${share}/man1 ${share}/completions)
  set(pages)
  foreach(program tumbler ${tumbler_programs})
    add_custom_command(OUTPUT ${share}/man1/${program}.1.gz
      COMMAND $<TARGET_FILE:${program}> --man-page | ${TUMBLER_GZIP} -9 -n > ${share}/man1/${program}.1.gz
      DEPENDS ${program})
    list(APPEND pages ${share}/man1/${program}.1.gz)
  endforeach()
  add_custom_command(OUTPUT ${share}/completions/tumbler
    COMMAND $<TARGET_FILE:tumbler> --bash-completion > ${share}/completions/tumbler DEPENDS tumbler)
  set(manual_pages ${pages})
  list(APPEND pages ${share}/completions/tumbler)
  add_custom_target(tumbler_pages ALL DEPENDS ${pages})
  # Each by its name: the folders of a build that is older than a program's name have more.
  install(FILES ${manual_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
  install(FILES ${share}/completions/tumbler DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
          COMPONENT programs)
endif()

# Packages for Debian: `scripts/package` makes them, of this target. Tests are no part of it.
add_custom_target(tumbler_packaged DEPENDS ${tumbler_libraries})
if(TARGET tumbler_pages)
  add_dependencies(tumbler_packaged tumbler_pages)
endif()
if(TARGET tumbler_python)
  add_dependencies(tumbler_packaged tumbler_python)
endif()
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT programs)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libtumbler-dev RENAME copyright COMPONENT development)
install(FILES ${CMAKE_BINARY_DIR}/tumbler.spdx.json DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT programs OPTIONAL)
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL programs development)
if(TARGET tumbler_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "The Tumbler authors <tumbler@localhost>")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME tumbler)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION science)
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION
    "Motions of a tumbling robot, found and played\n The optimiser that finds contact-rich motions, the executor that plays them on motor drives over CAN, the simulated robot, and tools for records and robustness.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libtumbler-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
# What cmake/tumbler-config.cmake.in looks for.
set(tumbler_dev_packages libfmt-dev libtomlplusplus-dev zlib1g-dev liblcm-dev libsodium-dev)
if(TUMBLER_BUILD_OFFLINE)
  list(APPEND tumbler_dev_packages libeigen3-dev libnlopt-dev libnlopt-cxx-dev libtinyxml-dev
       libcpp-httplib-dev)
  if(tumbler_uses_mpi)
    list(APPEND tumbler_dev_packages libopenmpi-dev)
  endif()
  if(tumbler_uses_assimp)
    list(APPEND tumbler_dev_packages libassimp-dev)
  endif()
endif()
list(JOIN tumbler_dev_packages ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "Motions of a tumbling robot, libraries and headers\n For programs that load motions, drive motors or simulate the robot with Tumbler's libraries: find_package(tumbler) in CMake.")
# The module is compiled for one version of Python.
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-tumbler)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
    "Motions of a tumbling robot, in Python\n Finds, evaluates and checks motions, plays them in simulation and on robots that are not the model, and reads flight records, with NumPy's arrays.")
include(CPack)
