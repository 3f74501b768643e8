// SPDX-License-Identifier: MIT
// A journaled sweep of 20 jobs in as many processes as mpirun starts: journal FILE KILL EXPECTED. Job KILL kills its
// process, 99 none. Ends with status 0 if EXPECTED jobs ran, and all results are right in all processes.

#include <chrono>
#include <csignal>
#include <cstddef>
#include <string>
#include <thread>
#include <vector>

#include <decant/hypothesis/mpi_executor.hpp>
#include <decant/io/journal.hpp>
#include <decant/testing/executor.hpp>

#include "require.hpp"

using decant::JobResult;
using decant_test::require;

namespace {

void sweep(const std::string& path, std::size_t kill_in, std::size_t expected) {
  decant::MpiExecutor executor;
  decant::Journal journal(executor, path, "settings");
  require(executor.process() == 0 || journal.size() == 0, "only process 0 reads the file");
  std::vector<std::string> keys;
  for (int k = 0; k < 20; ++k) {
    keys.push_back("job " + std::to_string(k));
  }
  double ran = 0;
  std::size_t told = 0;
  const auto results = decant::run_journaled(
      executor, journal, keys,
      [&](std::size_t k) {
        if (k == kill_in) {
          std::raise(SIGKILL);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        ++ran;
        return decant::testing::fragile_result(k);
      },
      [&](std::size_t, const JobResult&) { ++told; });
  require(results.size() == keys.size(), "as many results as keys");
  for (std::size_t k = 0; k < keys.size(); ++k) {
    require(decant::testing::same_bits(results[k], decant::testing::fragile_result(k)), "result of " + keys[k]);
  }
  require(told == (executor.process() == 0 ? expected : 0), "told of " + std::to_string(told));
  double total = 0;
  for (const JobResult& each : executor.run(
           executor.processes(), [&](std::size_t) { return JobResult{ran}; }, decant::tell_nobody)) {
    total += each.at(0);
  }
  require(total == static_cast<double>(expected), std::to_string(total) + " jobs ran");
}

/// What process 0 finds wrong with a file is an error in all of them, and nobody waits for ever.
void wrong_fingerprint(const std::string& path) {
  decant::MpiExecutor executor;
  const std::string text = decant_test::thrown_by([&] { const decant::Journal journal(executor, path, "others"); });
  require(text.find(path + ": fingerprint must be \"others\", got \"settings\"") != std::string::npos, text);
  require((text.find("job 0 in process 0: ") == 0) == (executor.process() != 0), text);
}

}  // namespace

int main(int argc, char** argv) {
  int level = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
  require(argc == 4, "FILE KILL EXPECTED");
  sweep(argv[1], std::stoul(argv[2]), std::stoul(argv[3]));
  wrong_fingerprint(argv[1]);
  MPI_Finalize();
  return 0;
}
