# SPDX-License-Identifier: MIT
# Finds what decant is built on. Nothing is downloaded. Sets decant_has_openmp, decant_has_nanoflann, decant_has_io.

# No version in the call: Eigen's own version file refuses 5.0 where 3.4 is asked for.
find_package(Eigen3 REQUIRED NO_MODULE)
if(Eigen3_VERSION VERSION_LESS 3.4)
  message(FATAL_ERROR "decant: Eigen must be 3.4 or newer, got ${Eigen3_VERSION} in ${Eigen3_DIR}")
endif()

set(decant_has_openmp FALSE)
if(DECANT_WITH_OPENMP)
  find_package(OpenMP QUIET COMPONENTS CXX)
  if(TARGET OpenMP::OpenMP_CXX)
    set(decant_has_openmp TRUE)
  else()
    message(STATUS "decant: no OpenMP for ${CMAKE_CXX_COMPILER_ID}, loops run on one thread")
  endif()
endif()

set(decant_has_nanoflann FALSE)
if(DECANT_WITH_NANOFLANN)
  find_package(nanoflann QUIET)
  if(TARGET nanoflann::nanoflann)
    set(decant_has_nanoflann TRUE)
  else()
    message(STATUS "decant: no nanoflann, neighbor/kd_tree.hpp cannot be used")
  endif()
endif()

set(decant_has_io FALSE)
if(DECANT_WITH_IO)
  find_package(nlohmann_json QUIET)
  find_package(PNG QUIET)
  if(TARGET nlohmann_json::nlohmann_json AND TARGET PNG::PNG)
    set(decant_has_io TRUE)
  else()
    message(STATUS "decant: no nlohmann_json or no PNG, target decant::io is left out")
  endif()
endif()
