// SPDX-License-Identifier: MIT
// MpiExecutor in as many processes as mpirun starts: the laws of executors, the same bits as from threads, and what is
// only so with several processes. Ends with status 0 if all of it holds in all of them.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <decant/hypothesis/mpi_executor.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/testing/executor.hpp>

#include "require.hpp"

using decant::JobResult;
using decant::MpiExecutor;
using decant_test::require;

namespace {

void sleep_ms(int duration) { std::this_thread::sleep_for(std::chrono::milliseconds(duration)); }

void laws(int threads) {
  MpiExecutor executor({threads});
  require(executor.process() == static_cast<std::size_t>(decant_test::rank()), "process() is the rank");
  require(decant::testing::executor_laws(executor, 1'000'000));
}

void same_bits_as_threads() {
  MpiExecutor processes;
  decant::ThreadExecutor threads{{2}};
  const auto work = [](std::size_t k) { return decant::testing::fragile_result(k, 12'345); };
  const auto one = processes.run(50, work, decant::tell_nobody), other = threads.run(50, work, decant::tell_nobody);
  require(decant::testing::same_bits(one, other), "results have the bits that threads give");
}

/// Copies, and executors beside each other, do not mistake each other's messages.
void several_at_once() {
  MpiExecutor one;
  MpiExecutor copy = one, other;
  for (int round = 0; round < 50; ++round) {
    for (MpiExecutor* executor : {&one, &copy, &other}) {
      const auto results = executor->run(
          3, [&](std::size_t k) { return JobResult{double(k) + round}; }, decant::tell_nobody);
      for (std::size_t k = 0; k < results.size(); ++k) {
        require(results[k] == JobResult{double(k) + round}, "results are of this round");
      }
    }
  }
}

/// Process 0 hears of others' jobs while it has jobs of its own, not only at the end.
void told_in_time() {
  MpiExecutor executor;
  const std::size_t step = executor.processes();
  std::vector<std::size_t> order;
  static_cast<void>(executor.run(
      10 * step,
      [&](std::size_t k) {
        sleep_ms(k % step == 0 ? 40 : 1);
        return JobResult{};
      },
      [&](std::size_t k, const JobResult&) { order.push_back(k); }));
  if (executor.process() == 0 && step > 1) {
    const auto last_own = std::find(order.begin(), order.end(), 9 * step);
    const auto others_before = std::count_if(order.begin(), last_own, [&](std::size_t k) { return k % step != 0; });
    require(others_before > 0, "process 0 was told of others' jobs before its own had ended");
  }
}

/// A long result does not keep process 0 from its own jobs, while the process that sends it is in its next.
void long_results_are_not_waited_for() {
  MpiExecutor executor;
  const std::size_t step = executor.processes();
  if (step == 1) {
    return;
  }
  const auto start = std::chrono::steady_clock::now();
  const auto ms = [&] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  };
  double own_ended = 0;
  static_cast<void>(executor.run(
      2 * step,
      [&](std::size_t k) {
        if (k % step == 1) {
          sleep_ms(k == 1 ? 1 : 2000);
          return JobResult(2'000'000, 1.5);
        }
        sleep_ms(k == 0 ? 400 : 20);
        if (k == step) {
          own_ended = ms();
        }
        return JobResult{};
      },
      decant::tell_nobody));
  require(executor.process() != 0 || own_ended < 1500, "process 0 waited for another's result between its jobs");
}

/// Of several that throw, it is the first by number, whichever came first in time.
void lowest_job_is_thrown() {
  MpiExecutor executor;
  if (executor.processes() == 1) {
    return;
  }
  const auto throw_both = [&] {
    static_cast<void>(executor.run(
        100,
        [](std::size_t k) -> JobResult {
          if (k == 0) {
            sleep_ms(100);
          }
          if (k < 2) {
            throw std::out_of_range("thrown by " + std::to_string(k));
          }
          return {};
        },
        decant::tell_nobody));
  };
  const std::string text = decant_test::thrown_by(throw_both);
  require(text == (executor.process() == 0 ? "thrown by 0" : "job 0 in process 0: thrown by 0"), "got: " + text);
}

/// The same for jobs of one process that run side by side. @param first whether it is also the first in time.
void lowest_job_of_a_process_is_thrown(bool first) {
  if (decant::Threads{2}.resolved() == 1) {
    return;  // without OpenMP
  }
  MpiExecutor executor({2});
  const std::size_t step = executor.processes();
  std::atomic<int> begun{0};
  const auto throw_both = [&] {
    static_cast<void>(executor.run(
        2 * step,
        [&](std::size_t k) -> JobResult {
          if (k % step != 0) {
            return {};
          }
          ++begun;
          for (int wait = 0; begun < 2 && wait < 5000; ++wait) {
            sleep_ms(1);
          }
          sleep_ms((k == 0) == first ? 0 : 50);
          throw std::out_of_range("thrown by " + std::to_string(k));
        },
        decant::tell_nobody));
  };
  const std::string text = decant_test::thrown_by(throw_both);
  require(text == (executor.process() == 0 ? "thrown by 0" : "job 0 in process 0: thrown by 0"), "got: " + text);
}

void what_is_no_exception() {
  MpiExecutor executor;
  const std::size_t last = executor.processes() - 1;
  bool thrown_as_it_was = false;
  std::string text;
  try {
    static_cast<void>(executor.run(
        last + 1, [&](std::size_t k) { return k == last ? throw 7 : JobResult{}; }, decant::tell_nobody));
  } catch (int seven) {
    thrown_as_it_was = seven == 7;
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  require(executor.process() == last ? thrown_as_it_was
                                     : text.find("something that is no std::exception") != std::string::npos,
          "what is no std::exception is thrown as it was, and told: " + text);
}

void different_counts() {
  MpiExecutor executor;
  if (executor.processes() == 1) {
    return;
  }
  const std::size_t own = executor.process() == 0 ? 3 : 9;
  const auto call = [&] {
    static_cast<void>(executor.run(
        own, [](std::size_t) { return JobResult(5, 1.0); }, decant::tell_nobody));
  };
  require(decant_test::thrown_by(call).find("different numbers of jobs") != std::string::npos,
          "different counts are refused");
  const auto after = executor.run(
      4, [](std::size_t k) { return JobResult(k, 2.0); }, decant::tell_nobody);
  require(after[3] == JobResult(3, 2.0), "and the next run is right");
}

/// Some of the processes, on a communicator of their own.
void part_of_the_world() {
  const int rank = decant_test::rank();
  MPI_Comm half = MPI_COMM_NULL;
  MPI_Comm_split(MPI_COMM_WORLD, rank % 2, -rank, &half);
  {
    MpiExecutor executor({1}, half);
    int world = 0;
    MPI_Comm_size(MPI_COMM_WORLD, &world);
    require(executor.processes() == static_cast<std::size_t>((world + 1 - rank % 2) / 2), "half of the processes");
    const auto results = executor.run(
        5, [&](std::size_t) { return JobResult{double(rank)}; }, decant::tell_nobody);
    for (const JobResult& each : results) {
      require(static_cast<int>(each.at(0)) % 2 == rank % 2, "results are of this half");
    }
  }
  MPI_Comm_free(&half);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string before = decant_test::thrown_by([] { const MpiExecutor early; });
  int level = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
  require(before.find("MPI must be initialised") != std::string::npos, "refused before MPI_Init: " + before);
  require(level >= MPI_THREAD_FUNNELED, "MPI_THREAD_FUNNELED");
  laws(1);
  laws(2);
  same_bits_as_threads();
  several_at_once();
  told_in_time();
  long_results_are_not_waited_for();
  lowest_job_is_thrown();
  lowest_job_of_a_process_is_thrown(true);
  lowest_job_of_a_process_is_thrown(false);
  what_is_no_exception();
  different_counts();
  part_of_the_world();
  std::optional<MpiExecutor> outlives{std::in_place};
  MPI_Finalize();
  outlives.reset();
  return 0;
}
