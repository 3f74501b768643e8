// SPDX-License-Identifier: MIT
#pragma once

/// Checks in programs of several processes: where one finds something wrong, it says so and ends them all, since the
/// others would wait for it for ever.

#include <cstdio>
#include <string>
#include <vector>

#include <mpi.h>

#include <decant/testing/law.hpp>

namespace decant_test {

inline int rank() {
  int number = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &number);
  return number;
}

inline void require(bool holds, const std::string& what) {
  if (!holds) {
    std::fprintf(stderr, "process %d: %s\n", rank(), what.c_str());
    std::fflush(stderr);
    MPI_Abort(MPI_COMM_WORLD, 1);
  }
}

inline void require(const std::vector<decant::testing::Law>& laws) {
  for (const decant::testing::Law& law : laws) {
    require(law.holds(), law.text());
  }
}

/// What the call throws as std::exception, or an empty text.
template <class Call>
std::string thrown_by(Call&& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

}  // namespace decant_test
