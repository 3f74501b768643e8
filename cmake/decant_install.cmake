# SPDX-License-Identifier: MIT
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

target_include_directories(decant INTERFACE "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/decant" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.hpp")

set(decant_config_dir "${CMAKE_INSTALL_DATADIR}/decant/cmake")
install(TARGETS decant EXPORT decant-targets)
install(EXPORT decant-targets NAMESPACE decant:: DESTINATION "${decant_config_dir}")

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/decant-config.cmake.in" decant-config.cmake
                              INSTALL_DESTINATION "${decant_config_dir}")
# before 1.0 a minor version may break its callers; headers only, so it fits any architecture
write_basic_package_version_file(decant-config-version.cmake COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/decant-config.cmake" "${CMAKE_CURRENT_BINARY_DIR}/decant-config-version.cmake"
        DESTINATION "${decant_config_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/package.xml" "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/decant")
