# SPDX-License-Identifier: MIT
# Installs decant from SOURCE to PREFIX, as a packager would: no tests, no examples.
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE "${BUILD}" "${PREFIX}")
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${SOURCE}" -B "${BUILD}" -G "${GENERATOR}"
                        "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_INSTALL_PREFIX=${PREFIX}"
                        -DDECANT_BUILD_TESTS=OFF -DDECANT_BUILD_EXAMPLES=OFF -DDECANT_BUILD_BENCHMARKS=OFF
                        -DDECANT_WITH_OPENMP=${OPENMP} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" COMMAND_ERROR_IS_FATAL ANY)

# every header arrives, and nothing else beside them
file(GLOB_RECURSE expected RELATIVE "${SOURCE}/include" "${SOURCE}/include/*")
file(GLOB_RECURSE installed RELATIVE "${PREFIX}/include" "${PREFIX}/include/*")
if(NOT expected STREQUAL installed)
  message(FATAL_ERROR "installed headers differ from the sources:\n${expected}\n${installed}")
endif()
