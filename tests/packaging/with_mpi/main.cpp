// SPDX-License-Identifier: MIT
// Without MPI_Init, so that it needs no mpirun: an executor refuses to begin.

#include <cstddef>
#include <cstring>
#include <stdexcept>

#include <decant/hypothesis/mpi_executor.hpp>

int main() {
  try {
    decant::MpiExecutor executor;
    const auto work = [](std::size_t) { return decant::JobResult(); };
    return static_cast<int>(executor.run(1, work, decant::tell_nobody).size());
  } catch (const std::invalid_argument& error) {
    return std::strstr(error.what(), "MPI must be initialised") != nullptr ? 0 : 1;
  }
}
