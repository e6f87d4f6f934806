# Install and export, so that another project can say find_package(tumbler) and link tumbler::common etc.
include(CMakePackageConfigHelpers)
get_property(tumbler_libraries GLOBAL PROPERTY TUMBLER_LIBRARIES)
install(TARGETS ${tumbler_libraries} tumbler_options EXPORT tumbler-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT tumbler-targets NAMESPACE tumbler:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
get_property(tumbler_uses_mpi GLOBAL PROPERTY TUMBLER_USES_MPI SET)
configure_package_config_file(cmake/tumbler-config.cmake.in ${CMAKE_BINARY_DIR}/tumbler-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/tumbler-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/tumbler-config.cmake ${CMAKE_BINARY_DIR}/tumbler-config-version.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
set(tumbler_header_folders common firmware_interface runtime)
if(TUMBLER_BUILD_OFFLINE)
  list(APPEND tumbler_header_folders offline)
endif()
foreach(folder ${tumbler_header_folders})
  install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tumbler FILES_MATCHING PATTERN "*.h")
endforeach()
# Robots and tasks, and the message types for programs that listen to the telemetry.
install(DIRECTORY primitives DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler)
install(DIRECTORY firmware_interface/dbc DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler)
install(DIRECTORY runtime/lcm DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler FILES_MATCHING PATTERN "*.lcm")
