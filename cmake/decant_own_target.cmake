# SPDX-License-Identifier: MIT
# Settings of decant's own programs, in one place. They are PRIVATE: a consumer never gets them.

# A single-configuration build without a type would be neither fast nor debuggable.
if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Debug, Release, RelWithDebInfo or MinSizeRel" FORCE)
endif()

if(DECANT_NATIVE)
  include(CheckCXXCompilerFlag)
  check_cxx_compiler_flag(-march=native DECANT_COMPILER_KNOWS_NATIVE)
endif()

function(decant_own_target target)
  target_link_libraries(${target} PRIVATE decant::decant decant::io)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion)
  if(DECANT_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # names the line of a concept that a part fails, instead of "is invalid"
    target_compile_options(${target} PRIVATE -fconcepts-diagnostics-depth=3)
  endif()
  if(DECANT_NATIVE AND DECANT_COMPILER_KNOWS_NATIVE)
    target_compile_options(${target} PRIVATE -march=native)
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
      # GCC's own AVX-512 intrinsics look uninitialised to it (GCC bug 105593); the preset `dev` keeps the warning
      target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized -Wno-uninitialized)
    endif()
  endif()
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
endfunction()
