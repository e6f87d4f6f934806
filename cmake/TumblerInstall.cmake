# Install and export, so that another project can say find_package(tumbler) and link tumbler::common etc.
include(CMakePackageConfigHelpers)
get_property(tumbler_libraries GLOBAL PROPERTY TUMBLER_LIBRARIES)
install(TARGETS ${tumbler_libraries} tumbler_options EXPORT tumbler-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT tumbler-targets NAMESPACE tumbler:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
configure_package_config_file(cmake/tumbler-config.cmake.in ${CMAKE_BINARY_DIR}/tumbler-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/tumbler-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/tumbler-config.cmake ${CMAKE_BINARY_DIR}/tumbler-config-version.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/tumbler)
foreach(folder common firmware_interface offline runtime)
  install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tumbler FILES_MATCHING PATTERN "*.h")
endforeach()
install(DIRECTORY primitives DESTINATION ${CMAKE_INSTALL_DATADIR}/tumbler)
