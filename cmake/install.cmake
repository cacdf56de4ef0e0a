# Where the library goes for other CMake projects: find_package(helicarm CONFIG), targets helicarm::MODULE.
include(CMakePackageConfigHelpers)
set(helicarm_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/helicarm)

# Headers of tests, and those whose types follow the instruction set, stay here.
set(helicarm_private_header "(_test|/march)\\.h$")

function(helicarm_install_module name)
  set_target_properties(helicarm_${name} PROPERTIES EXPORT_NAME ${name})
  install(TARGETS helicarm_${name} EXPORT helicarm_targets COMPONENT dev)
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR}/src ${CMAKE_CURRENT_SOURCE_DIR})
  install(DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder} COMPONENT dev
          FILES_MATCHING PATTERN "*.h" REGEX "${helicarm_private_header}" EXCLUDE)
  set_property(GLOBAL APPEND PROPERTY helicarm_modules ${name})
endfunction()

install(EXPORT helicarm_targets NAMESPACE helicarm:: DESTINATION ${helicarm_cmake_dir} COMPONENT dev)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/helicarmConfigVersion.cmake COMPATIBILITY SameMinorVersion)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/helicarmConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/helicarmConfig.cmake INSTALL_DESTINATION ${helicarm_cmake_dir})
install(FILES ${PROJECT_BINARY_DIR}/helicarmConfig.cmake ${PROJECT_BINARY_DIR}/helicarmConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindAsio.cmake ${PROJECT_SOURCE_DIR}/cmake/FindOpenCVParts.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindOpenJP2.cmake ${PROJECT_SOURCE_DIR}/cmake/FindRandom123.cmake
        DESTINATION ${helicarm_cmake_dir} COMPONENT dev)
