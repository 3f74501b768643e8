// SPDX-License-Identifier: MIT
#pragma once

/// What runs many independent simulations: threads of this process, processes of several machines, whatever a user has.

#include <concepts>
#include <cstddef>
#include <utility>
#include <vector>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// What one job comes to: numbers, which go from process to process, and into a file and back, without losing a bit.
using JobResult = std::vector<double>;

/// Runs jobs that do not depend on each other, several side by side.
/// run(count, work, done): calls work(k), which gives a JobResult, exactly once for each k in [0, count), in any order,
/// and returns all results in the order of k. done(k, result) is told each job as it ends, one at a time, in the
/// process that owns the terminal and the files (process() 0): for progress, and for what must survive a run that is
/// killed. Where work throws, or done, no more jobs begin, and run throws what the lowest k threw, or an
/// std::runtime_error that says so if that was in another process.
/// With several processes() all of them make the same calls with the same counts, as one program; job k is work of
/// process k % processes(), so that what belongs to it may be kept there; run returns all results in each of them.
/// Laws (decant/testing/executor.hpp): each of the above; results do not depend on the executor, to the bit.
template <class E>
concept Executor = requires(E& executor, const E& asked, std::size_t count, JobResult (*work)(std::size_t),
                            void (*done)(std::size_t, const JobResult&)) {
  { executor.run(count, work, done) } -> std::same_as<std::vector<JobResult>>;
  { asked.processes() } -> std::same_as<std::size_t>;
  { asked.process() } -> std::same_as<std::size_t>;
};

/// For Executor::run where nobody needs to be told.
inline constexpr auto tell_nobody = [](std::size_t, const JobResult&) {};

}  // namespace decant::inline DECANT_TARGET
