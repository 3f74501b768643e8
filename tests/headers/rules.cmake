# SPDX-License-Identifier: MIT
# What a reader may rely on in every header under INCLUDE, checked by text:
# - only io/ opens files or prints; only core/parallel.hpp speaks OpenMP; only neighbor/kd_tree.hpp includes nanoflann;
#   only hypothesis/mpi_executor.hpp speaks MPI, and no other header includes it;
# - #pragma once, an SPDX line, no `using namespace`, no macros but DECANT_*;
# - all of decant is in the inline namespace DECANT_TARGET, whose name core/target.hpp finds;
# - what Eigen brings along is included where it is used: Eigen, by itself or through a header of decant, and those
#   headers of the standard library that are told by a name.
cmake_minimum_required(VERSION 3.22)

file(GLOB_RECURSE headers RELATIVE "${INCLUDE}" "${INCLUDE}/*.hpp")
if(NOT headers)
  message(FATAL_ERROR "no headers under '${INCLUDE}'")
endif()

# <header>=<names in std:: that it alone gives>
set(standard_headers
    "algorithm=(min|max|clamp|sort|fill|copy|transform|any_of|all_of|find_if|lower_bound|upper_bound)" "array=array"
    "bit=bit_cast" "cmath=(abs|sqrt|exp|log|pow|sin|cos|floor|ceil|lround|isfinite|hypot)" "cstdint=u?int(8|16|32|64)_t"
    "functional=function" "limits=numeric_limits" "map=map" "memory=(unique|shared)_ptr" "numeric=(accumulate|iota)"
    "optional=optional" "set=set" "span=span" "string=(string|to_string)" "string_view=string_view" "tuple=tuple"
    "variant=variant" "vector=vector")

set(complaints "")
function(forbid header text pattern reason)
  if(text MATCHES "${pattern}")
    string(STRIP "${CMAKE_MATCH_0}" found)
    set(complaints "${complaints}\n  ${header}: '${found}': ${reason}" PARENT_SCOPE)
  endif()
endfunction()

foreach(header IN LISTS headers)
  file(READ "${INCLUDE}/${header}" text)
  if(NOT text MATCHES "^// SPDX-License-Identifier: MIT\n#pragma once\n")
    string(APPEND complaints "\n  ${header}: begins with the SPDX line and #pragma once")
  endif()
  string(REGEX REPLACE "//[^\n]*" "" text "${text}")  # comments may name what code may not
  if(NOT header MATCHES "^decant/io/")
    forbid(${header} "${text}" "# *include *<(iostream|fstream|filesystem|cstdio|stdio.h|print)>"
           "only headers in io/ open files or print")
    forbid(${header} "${text}" "(^|[^a-z_])(f?printf|fopen|getenv|std::c(out|err|log))[^a-z_]"
           "only headers in io/ open files or print")
    forbid(${header} "${text}" "# *include *<(nlohmann/[a-z.]*|png.h|decant/io/[a-z_./]*)>"
           "only headers in io/ need what decant::io brings")
  endif()
  if(NOT header STREQUAL "decant/core/parallel.hpp")
    forbid(${header} "${text}" "# *pragma +omp +(parallel|for|task)[^\n]*|# *include *<omp.h>"
           "OpenMP stays behind core/parallel.hpp")
  endif()
  if(NOT header STREQUAL "decant/neighbor/kd_tree.hpp")
    forbid(${header} "${text}" "# *include *[<\"]nanoflann[^\n]*" "nanoflann stays behind neighbor/kd_tree.hpp")
  endif()
  if(NOT header STREQUAL "decant/hypothesis/mpi_executor.hpp")
    forbid(${header} "${text}" "# *include *[<\"](mpi|decant/hypothesis/mpi_executor)\\.h[^\n]*"
           "MPI stays behind hypothesis/mpi_executor.hpp")
  endif()
  if(text MATCHES "Eigen::" AND NOT text MATCHES "# *include *<(Eigen|decant)/")
    string(APPEND complaints "\n  ${header}: Eigen without #include <Eigen/...>")
  endif()
  foreach(standard_header IN LISTS standard_headers)
    string(REGEX MATCH "^([a-z_]+)=(.*)$" _ "${standard_header}")
    set(needed "${CMAKE_MATCH_1}")
    if(NOT text MATCHES "# *include *<${needed}>" AND text MATCHES "std::${CMAKE_MATCH_2}[^a-z_0-9]")
      string(APPEND complaints "\n  ${header}: '${CMAKE_MATCH_0}' without #include <${needed}>")
    endif()
  endforeach()
  forbid(${header} "${text}" "\n *using +namespace[^\n]*" "a header must not open a namespace for its readers")
  if(NOT header STREQUAL "decant/core/target.hpp")
    forbid(${header} "${text}" "\nnamespace +decant(::[a-zA-Z_:]*)? *{" "write namespace decant::inline DECANT_TARGET")
  endif()
  if(text MATCHES "DECANT_TARGET" AND NOT text MATCHES "# *include *<decant/core/target.hpp>|# *define +DECANT_TARGET")
    string(APPEND complaints "\n  ${header}: DECANT_TARGET without #include <decant/core/target.hpp>")
  endif()
  if(header MATCHES "^decant/(version|core/parallel|core/target)\\.hpp$")
    forbid(${header} "${text}" "# *define +([^D]|D[^E]|DE[^C])[^\n]*" "macros begin with DECANT_")
  else()
    forbid(${header} "${text}" "# *define +[^\n]*" "macros stand in version.hpp, core/parallel.hpp and core/target.hpp only")
  endif()
endforeach()

if(complaints)
  message(FATAL_ERROR "headers that break a rule:${complaints}")
endif()
