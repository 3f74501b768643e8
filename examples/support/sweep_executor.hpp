// SPDX-License-Identifier: MIT
#pragma once

/// What a tool's sweep runs on: the threads of its process or, in a tool that is linked with decant::mpi and defines
/// DECANT_EXAMPLE_MPI, the processes that mpirun started. Those all make the same calls; the first one speaks.

#include <cstddef>
#include <cstdio>

#include <decant/hypothesis/executor.hpp>

#ifdef DECANT_EXAMPLE_MPI
#include <decant/hypothesis/mpi_executor.hpp>
#else
#include <decant/hypothesis/thread_executor.hpp>
#endif

namespace example {

#ifdef DECANT_EXAMPLE_MPI

using SweepExecutor = decant::MpiExecutor;

/// MPI, for as long as it lives: at the beginning of main, so that nothing of MPI outlives it.
class SweepSession {
 public:
  SweepSession() {
    int level = 0, process = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &level);
    MPI_Comm_rank(MPI_COMM_WORLD, &process);
    if (process > 0 && std::freopen("/dev/null", "w", stdout) == nullptr) {
      std::fclose(stdout);  // what they would say, the first one says
    }
  }
  ~SweepSession() { MPI_Finalize(); }
  SweepSession(const SweepSession&) = delete;
  SweepSession& operator=(const SweepSession&) = delete;
};

/// @param threads of each process; 0: one, as mpirun starts a process for each core.
inline SweepExecutor sweep_executor(int threads) { return SweepExecutor({threads == 0 ? 1 : threads}); }

#else

using SweepExecutor = decant::ThreadExecutor;

struct SweepSession {
  SweepSession() {}  // not trivial, so that it is not unused
};

/// @param threads 0: one for each core.
inline SweepExecutor sweep_executor(int threads) { return SweepExecutor{{threads}}; }

#endif

/// Calls f in the first process alone, such as to write a file; the others wait. What it throws is thrown in all.
template <class Function>
void in_first_process(SweepExecutor& executor, Function&& f) {
  executor.run(
      1,
      [&](std::size_t) {
        f();
        return decant::JobResult{};
      },
      decant::tell_nobody);
}

}  // namespace example
