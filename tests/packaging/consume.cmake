# SPDX-License-Identifier: MIT
# Configures, builds and runs the consumer in PROJECT with a C++17 default and looks at what reached its compiler. With
# REFUSED, configuring has to fail with that sentence instead.
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE "${BUILD}")
set(arguments "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DDECANT_SOURCE=${DECANT_SOURCE}" -DCMAKE_CXX_STANDARD=17
              -DCMAKE_EXPORT_COMPILE_COMMANDS=ON -DCMAKE_EXPORT_NO_PACKAGE_REGISTRY=ON
              -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF -DDECANT_WITH_OPENMP=${OPENMP})
if(DEFINED PREFIX)
  list(APPEND arguments "-DCMAKE_PREFIX_PATH=${PREFIX}")
endif()
if(DEFINED WITHOUT)
  list(APPEND arguments -DCMAKE_DISABLE_FIND_PACKAGE_${WITHOUT}=ON)
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${PROJECT}" -B "${BUILD}" -G "${GENERATOR}" ${arguments}
                RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(DEFINED REFUSED)
  string(REGEX REPLACE "[ \n]+" " " line "${output}")  # CMake wraps what it prints
  string(FIND "${line}" "${REFUSED}" found)
  if(result EQUAL 0 OR found EQUAL -1)
    message(FATAL_ERROR "configuring has to fail with '${REFUSED}':\n${output}")
  endif()
  return()
endif()
if(NOT result EQUAL 0)
  message(FATAL_ERROR "configuring failed:\n${output}")
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${BUILD}" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${BUILD}/consumer" COMMAND_ERROR_IS_FATAL ANY)

if(NOT EXISTS "${BUILD}/compile_commands.json")
  return()  # only the Makefile and Ninja generators write it
endif()
file(READ "${BUILD}/compile_commands.json" commands)
string(REGEX MATCHALL "\"command\": \"[^\n]*" lines "${commands}")
if(NOT lines)
  message(FATAL_ERROR "no compiler call found in compile_commands.json")
endif()
foreach(line IN LISTS lines)
  if(NOT line MATCHES "-std=(gnu|c)\\+\\+(20|2a)")
    message(FATAL_ERROR "not compiled as C++20: ${line}")
  endif()
  if(line MATCHES " (-W[^ ]*|-march[^ ]*|-O[^ ]*|-D[^ ]*|-fconcepts[^ ]*)")
    message(FATAL_ERROR "'${CMAKE_MATCH_1}' reaches a consumer: ${line}")
  endif()
  if(OPENMP AND NOT line MATCHES "-fopenmp")
    message(FATAL_ERROR "OpenMP does not reach a consumer: ${line}")
  endif()
endforeach()
