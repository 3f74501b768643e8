// SPDX-License-Identifier: MIT
#pragma once

/// The laws of an Executor (hypothesis/executor.hpp), for shipped ones and for a user's own. Free of any test framework
/// and of whatever connects the processes.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <decant/core/target.hpp>
#include <decant/hypothesis/executor.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Whether two results are of the same bits: NaN equals itself, and 0 differs from -0.
inline bool same_bits(const JobResult& a, const JobResult& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}
inline bool same_bits(const std::vector<JobResult>& a, const std::vector<JobResult>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const JobResult& one, const JobResult& other) { return same_bits(one, other); });
}

/// A result that is easily damaged on its way: numbers that text, rounding and flushing to zero do not keep, as many as
/// the job's place, so that the first is empty; one of each 16 is of `large` numbers.
inline JobResult fragile_result(std::size_t job, std::size_t large = 1000) {
  const double nan_with_load = [] {
    const std::uint64_t bits = 0x7ff800000000beefU;
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }();
  const double hard[]{1.0 / 3,
                      -0.0,
                      std::numeric_limits<double>::denorm_min(),
                      nan_with_load,
                      -std::numeric_limits<double>::infinity(),
                      std::numeric_limits<double>::max()};
  JobResult result(job % 16 == 5 ? large : job);
  for (std::size_t n = 0; n < result.size(); ++n) {
    result[n] = n < std::size(hard) ? hard[n] : std::sqrt(static_cast<double>(job + n));
  }
  return result;
}

/// Tries the laws of an executor, with some jobs that take a millisecond each. All processes call this, as one program;
/// each of them gets what it saw itself, and errors count what went wrong there. @param large see fragile_result.
template <Executor ExecutorType>
std::vector<Law> executor_laws(ExecutorType& executor, std::size_t large = 1000) {
  std::vector<Law> laws;
  const std::size_t processes = executor.processes(), here = executor.process();
  laws.push_back({"number of this process is below that of processes (1 if not)", here < processes ? 0.0 : 1.0, 0});

  // Sums over processes, by the executor itself: job k runs in process k % processes, and says what that one counted.
  const auto over_processes = [&](const std::vector<double>& counted) {
    return executor.run(
        processes, [&](std::size_t) { return counted; }, tell_nobody);
  };

  const std::size_t several = 3 * processes + 1;
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, processes - 1, processes, several, several + 40}) {
    const std::string jobs = std::to_string(count) + " jobs: ";
    std::vector<std::atomic<int>> runs(count), told(count);
    std::atomic<int> elsewhere{0}, telling{0}, together{0}, told_wrong{0};
    const std::vector<JobResult> results = executor.run(
        count,
        [&](std::size_t k) {
          elsewhere += k % processes == here ? 0 : 1;
          ++runs[k];
          return fragile_result(k, large);
        },
        [&](std::size_t k, const JobResult& result) {
          together += telling++ == 0 ? 0 : 1;
          ++told[k];
          told_wrong += same_bits(result, fragile_result(k, large)) ? 0 : 1;
          --telling;
        });
    std::vector<double> counted(runs.begin(), runs.end());
    double not_once = 0, wrong = 0, told_amiss = 0;
    for (std::size_t k = 0; k < count; ++k) {
      told_amiss += std::abs(told[k] - (here == 0 ? 1 : 0));
      wrong += k < results.size() && same_bits(results[k], fragile_result(k, large)) ? 0 : 1;
    }
    const std::vector<JobResult> all = over_processes(counted);
    for (std::size_t k = 0; k < count; ++k) {
      double total = 0;
      for (const JobResult& of_one : all) {
        total += of_one.at(k);
      }
      not_once += total == 1 ? 0 : 1;
    }
    laws.push_back({jobs + "results that are not there",
                    std::abs(static_cast<double>(results.size()) - static_cast<double>(count)), 0});
    laws.push_back({jobs + "results that are not to the bit what the job gave", wrong, 0});
    laws.push_back({jobs + "jobs that did not run exactly once", not_once, 0});
    laws.push_back({jobs + "jobs that ran in another process than k % processes", double(elsewhere), 0});
    laws.push_back({jobs + "jobs told not once in process 0, or elsewhere", told_amiss, 0});
    laws.push_back({jobs + "results told with other bits", double(told_wrong), 0});
    laws.push_back({jobs + "times that several were told at once", double(together), 0});
  }

  // One that throws. Others take long enough for the news to come before all have begun.
  const std::size_t many = 4000, thrower = several;
  const auto throws = [&](auto&& work, auto&& done, const std::string& which, std::size_t owner) {
    double own = 0, said = 0, nothing = 1;
    try {
      static_cast<void>(executor.run(many, work, done));
    } catch (const std::out_of_range& error) {
      nothing = 0;
      own = std::string(error.what()) == "fourteen" ? 1 : 0;
    } catch (const std::runtime_error& error) {
      nothing = 0;
      const std::string text = error.what();
      said = text.find("fourteen") != std::string::npos &&
                     text.find("job " + std::to_string(thrower) + " ") != std::string::npos
                 ? 1
                 : 0;
    } catch (...) {
      nothing = 0;
    }
    laws.push_back({which + ": run did not throw (1 if so)", nothing, 0});
    laws.push_back({which + ": thrown as it was in its process, told as std::runtime_error in others (1 if not)",
                    here == owner ? 1 - own : 1 - said, 0});
  };
  std::atomic<int> begun{0};
  const auto takes_a_while = [&](std::size_t) {
    ++begun;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return JobResult{1};
  };
  throws(
      [&](std::size_t k) {
        if (k == thrower) {
          throw std::out_of_range("fourteen");
        }
        return takes_a_while(k);
      },
      tell_nobody, "a job throws", thrower % processes);
  const auto share = static_cast<double>(many / processes);
  laws.push_back({"a job throws: share of jobs that had begun by the end", double(begun) / share, 0.9});
  begun = 0;
  throws(
      takes_a_while,
      [&](std::size_t k, const JobResult&) {
        if (k == thrower) {
          throw std::out_of_range("fourteen");
        }
      },
      "done throws", 0);
  laws.push_back({"done throws: share of jobs that had begun by the end", double(begun) / share, 0.9});

  const auto after = executor.run(
      several, [&](std::size_t k) { return fragile_result(k); }, tell_nobody);
  double wrong_after = after.size() == several ? 0 : 1;
  for (std::size_t k = 0; k < after.size(); ++k) {
    wrong_after += same_bits(after[k], fragile_result(k)) ? 0 : 1;
  }
  laws.push_back({"wrong results of the run after one that threw", wrong_after, 0});
  return laws;
}

}  // namespace decant::inline DECANT_TARGET::testing
