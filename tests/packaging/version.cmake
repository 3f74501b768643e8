# SPDX-License-Identifier: MIT
# Everything that states the version says the same.
cmake_minimum_required(VERSION 3.22)

function(state place file pattern)
  file(READ "${SOURCE}/${file}" text)
  if(NOT text MATCHES "${pattern}")
    message(SEND_ERROR "no version found in ${file} (${place})")
  elseif(NOT CMAKE_MATCH_1 STREQUAL VERSION)
    message(SEND_ERROR "${file} (${place}) says ${CMAKE_MATCH_1}, the CMake project ${VERSION}")
  endif()
endfunction()

if(NOT VERSION MATCHES "^[0-9]+\\.[0-9]+\\.[0-9]+$")
  message(FATAL_ERROR "the CMake project's version must have three numbers, got '${VERSION}'")
endif()
state("DECANT_VERSION" include/decant/version.hpp "#define DECANT_VERSION \"([^\"]*)\"")
state("package" package.xml "<version>([^<]*)</version>")
state("port" vcpkg.json "\"version\": *\"([^\"]*)\"")

file(READ "${SOURCE}/include/decant/version.hpp" header)
set(numbers "")
foreach(part IN ITEMS MAJOR MINOR PATCH)
  string(REGEX MATCH "#define DECANT_VERSION_${part} ([0-9]+)\n" _ "${header}")
  list(APPEND numbers "${CMAKE_MATCH_1}")
endforeach()
list(JOIN numbers . joined)
if(NOT joined STREQUAL VERSION)
  message(SEND_ERROR "version.hpp's single numbers make ${joined}, the CMake project is ${VERSION}")
endif()

# consumers that ask for a version ask for the current one
string(REGEX MATCH "^[0-9]+\\.[0-9]+" minor "${VERSION}")
foreach(file IN ITEMS examples/consumer/CMakeLists.txt tests/packaging/with_io/CMakeLists.txt
        tests/packaging/with_mpi/CMakeLists.txt)
  file(READ "${SOURCE}/${file}" text)
  if(NOT text MATCHES "find_package\\(decant ${minor} REQUIRED")
    message(SEND_ERROR "${file} does not ask for decant ${minor}")
  endif()
endforeach()
