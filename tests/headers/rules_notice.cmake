# SPDX-License-Identifier: MIT
# Runs RULES over headers that break one rule each: every one of them has to be named.
cmake_minimum_required(VERSION 3.22)

set(start "// SPDX-License-Identifier: MIT\n#pragma once\n")
function(try name content must_fail)
  file(REMOVE_RECURSE "${SCRATCH}")
  file(WRITE "${SCRATCH}/decant/${name}" "${content}")
  execute_process(COMMAND "${CMAKE_COMMAND}" "-DINCLUDE=${SCRATCH}" -P "${RULES}"
                  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(must_fail AND (result EQUAL 0 OR NOT output MATCHES "decant/${name}:"))
    message(SEND_ERROR "not noticed in ${name}:\n${content}\n${output}")
  elseif(NOT must_fail AND NOT result EQUAL 0)
    message(SEND_ERROR "refused without a reason, ${name}:\n${content}\n${output}")
  endif()
endfunction()

foreach(line IN ITEMS "#include <iostream>" "#include <fstream>" "inline void f() { std::printf(\"\"), 0 }"
        "#include <png.h>" "#include <decant/io/scene.hpp>" "#include <nanoflann.hpp>" "#include <omp.h>"
        "#include <mpi.h>" "#include <decant/hypothesis/mpi_executor.hpp>"
        "#pragma omp parallel for" "using namespace std" "#define SQUARE(x) x" "#define DECANT_SQUARE(x) x"
        "inline Eigen::Vector3d f();" "std::vector<int> f();" "double f(double x) { return std::sqrt(x), }"
        "namespace decant {" "namespace decant::detail {" "namespace decant::inline DECANT_TARGET {")
  try(core/part.hpp "${start}${line}\n" TRUE)
endforeach()
try(core/part.hpp "#include <vector>\n" TRUE)
try(version.hpp "${start}#define VERSION 1\n" TRUE)
try(core/part.hpp "${start}// not <iostream>\n#include <vector> // no #include <omp.h>\n" FALSE)
try(core/part.hpp "${start}#include <decant/core/target.hpp>\nnamespace decant::inline DECANT_TARGET {}\n" FALSE)
try(core/part.hpp "${start}#include <decant/core/target.hpp>\nnamespace decant::DECANT_TARGET {\n" TRUE)
try(io/part.hpp "${start}#include <fstream>\n" FALSE)
try(version.hpp "${start}#define DECANT_VERSION 1\n" FALSE)
try(neighbor/kd_tree.hpp "${start}#include <nanoflann.hpp>\n" FALSE)
try(hypothesis/mpi_executor.hpp "${start}#include <mpi.h>\n" FALSE)
try(core/part.hpp "${start}#include <vector>\nstd::vector<int> f()\n" FALSE)
try(core/part.hpp "${start}#include <decant/core/types.hpp>\nEigen::Vector3d f()\n" FALSE)
try(core/parallel.hpp "${start}#include <omp.h>\n" FALSE)
