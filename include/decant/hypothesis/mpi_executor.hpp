// SPDX-License-Identifier: MIT
#pragma once

/// Runs jobs in the processes of an MPI program, on one machine or many: the only header that includes mpi.h, and not
/// part of decant.hpp. Link decant::mpi.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <mpi.h>

#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/hypothesis/executor.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// A duplicate of a communicator, so that no message of ours meets one of the user's.
class MpiCommunicator {
 public:
  explicit MpiCommunicator(MPI_Comm original) {
    MPI_Comm_dup(original, &handle_);
    MPI_Comm_set_errhandler(handle_, MPI_ERRORS_ARE_FATAL);  // a lost process ends the program, as is MPI's default
    int number = 0;
    MPI_Comm_size(handle_, &number);
    size_ = static_cast<std::size_t>(number);
    MPI_Comm_rank(handle_, &number);
    rank_ = static_cast<std::size_t>(number);
  }
  ~MpiCommunicator() {
    int finalized = 0;
    MPI_Finalized(&finalized);
    if (finalized == 0) {
      MPI_Comm_free(&handle_);
    }
  }
  MpiCommunicator(const MpiCommunicator&) = delete;
  MpiCommunicator& operator=(const MpiCommunicator&) = delete;

  MPI_Comm handle() const noexcept { return handle_; }
  std::size_t size() const noexcept { return size_; }
  std::size_t rank() const noexcept { return rank_; }

 private:
  MPI_Comm handle_ = MPI_COMM_NULL;
  std::size_t size_ = 1, rank_ = 0;
};

/// Waits for others without taking a core from them, as MPI's own waiting does: jobs take minutes, and processes may
/// be more than cores. Answers that come at once cost no sleep.
class MpiPatience {
 public:
  void pause() {
    if (tries_ < 2000) {
      ++tries_;
      std::this_thread::yield();
    } else {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
  }
  static void wait_for(MPI_Request& request) {
    int arrived = 0;
    for (MpiPatience patience; MPI_Test(&request, &arrived, MPI_STATUS_IGNORE), arrived == 0;) {
      patience.pause();
    }
  }

 private:
  int tries_ = 0;
};

/// One call of MpiExecutor::run in one process. Processes tell process 0 what their jobs came to; process 0 tells them
/// once that no more jobs are to begin, because one failed or all have ended; then it says to all what came of it.
/// finished() and failed() are for any thread, the rest is for the one that speaks MPI.
template <class Done>
class MpiRun {
 public:
  MpiRun(const MpiCommunicator& communicator, std::size_t count, Done& done)
      : communicator_(communicator), done_(done), results_(count) {
    if (!leads()) {
      MPI_Irecv(&stop_, 1, MPI_BYTE, 0, stop_tag, communicator_.handle(), &stop_request_);
    }
  }

  bool stopped() const noexcept { return stopped_; }

  void finished(std::size_t job, JobResult result) {
    const std::lock_guard lock(one_at_a_time_);
    results_[job] = std::move(result);
    if (leads()) {
      done_(job, std::as_const(results_[job]));
    } else {
      news_.push_back({Kind::Result, job, results_[job].size()});
    }
  }

  void failed(std::size_t job, std::exception_ptr exception) {
    const std::lock_guard lock(one_at_a_time_);
    stopped_ = true;
    if (job < own_failure_) {
      own_failure_ = job;
      exception_ = std::move(exception);
    }
    if (leads()) {
      note_failure(job, 0);
    } else {
      news_.push_back({Kind::Failure, job, 0});
    }
  }

  /// Sends what is new, takes what has arrived, and waits for nothing.
  void speak() {
    if (leads()) {
      if (stopped_) {
        stop_others();
      }
      hear_news();
      take_results();
      return;
    }
    std::vector<News> news;
    {
      const std::lock_guard lock(one_at_a_time_);
      news.swap(news_);
    }
    for (const News& item : news) {
      send(item);
    }
    if (int arrived = 0; MPI_Test(&stop_request_, &arrived, MPI_STATUS_IGNORE), arrived != 0) {
      stopped_ = true;
    }
  }

  /// Call when the jobs of this process have ended. Returns the results of all, or throws.
  std::vector<JobResult> conclude() {
    if (leads()) {
      for (MpiPatience patience; speak(), ended_ + 1 < communicator_.size() || !arriving_.empty();) {
        patience.pause();
      }
      stop_others();
    } else {
      speak();
      send({Kind::End, 0, results_.size()});
      MpiPatience::wait_for(stop_request_);
    }
    for (MPI_Request& request : sends_) {
      MpiPatience::wait_for(request);
    }
    std::uint64_t outcome[]{first_failure_, failed_in_, counts_differ_ ? 1U : 0U};
    MPI_Request told = MPI_REQUEST_NULL;
    MPI_Ibcast(outcome, 3, MPI_UINT64_T, 0, communicator_.handle(), &told);
    MpiPatience::wait_for(told);
    if (outcome[2] != 0) {
      throw std::runtime_error("MpiExecutor: processes were given different numbers of jobs");
    }
    if (outcome[0] != nobody) {
      throw_failure(outcome[0], static_cast<std::size_t>(outcome[1]));
    }
    share_results();
    return std::move(results_);
  }

 private:
  enum class Kind : std::uint64_t { Result, Failure, End };
  struct News {
    Kind kind;
    std::uint64_t job;
    std::uint64_t size;  ///< of the result that follows; at the end, the number of jobs
  };
  struct Arriving {
    std::size_t job;
    std::vector<MPI_Request> parts;
  };
  static constexpr int news_tag = 0, result_tag = 1, stop_tag = 2, news_bytes = sizeof(News);
  static constexpr std::uint64_t nobody = std::numeric_limits<std::uint64_t>::max();
  static constexpr std::size_t longest_message = std::size_t{1} << 18;  ///< numbers; MPI counts bytes in an int

  bool leads() const noexcept { return communicator_.rank() == 0; }

  template <class Transfer>
  static void in_parts(JobResult& numbers, Transfer&& transfer) {
    for (std::size_t begin = 0; begin < numbers.size(); begin += longest_message) {
      transfer(numbers.data() + begin, static_cast<int>(std::min(longest_message, numbers.size() - begin)));
    }
  }

  void send(const News& news) {
    sent_news_.push_back(news);
    MPI_Isend(&sent_news_.back(), news_bytes, MPI_BYTE, 0, news_tag, communicator_.handle(), &sends_.emplace_back());
    if (news.kind == Kind::Result) {
      in_parts(results_[news.job], [&](double* begin, int size) {
        MPI_Isend(begin, size, MPI_DOUBLE, 0, result_tag, communicator_.handle(), &sends_.emplace_back());
      });
    }
  }

  void stop_others() {
    if (std::exchange(others_stopped_, true)) {
      return;
    }
    for (std::size_t rank = 1; rank < communicator_.size(); ++rank) {
      MPI_Isend(&stop_, 1, MPI_BYTE, static_cast<int>(rank), stop_tag, communicator_.handle(), &sends_.emplace_back());
    }
  }

  void hear_news() {
    // some MPIs answer first and then look for what has arrived meanwhile: what a probe misses, the next one finds
    for (int misses = 0; misses < 3;) {
      int arrived = 0;
      MPI_Status status;
      MPI_Iprobe(MPI_ANY_SOURCE, news_tag, communicator_.handle(), &arrived, &status);
      if (arrived == 0) {
        ++misses;
        continue;
      }
      misses = 0;
      News news{};
      MPI_Recv(&news, news_bytes, MPI_BYTE, status.MPI_SOURCE, news_tag, communicator_.handle(), MPI_STATUS_IGNORE);
      if (news.kind == Kind::End) {
        ++ended_;
        counts_differ_ = counts_differ_ || news.size != results_.size();
      } else if (news.kind == Kind::Failure) {
        const std::lock_guard lock(one_at_a_time_);
        stopped_ = true;
        note_failure(news.job, static_cast<std::size_t>(status.MPI_SOURCE));
      } else {
        expect_result(news, status.MPI_SOURCE);
      }
    }
  }

  // A long result comes only when its process next speaks MPI, after minutes perhaps: it is not waited for.
  void expect_result(const News& news, int from) {
    const auto job = static_cast<std::size_t>(news.job);
    JobResult& result = job < results_.size() ? results_[job] : unwanted_.emplace_back();
    result.resize(static_cast<std::size_t>(news.size));
    Arriving& arriving = arriving_.emplace_back(Arriving{job, {}});
    in_parts(result, [&](double* begin, int size) {
      MPI_Irecv(begin, size, MPI_DOUBLE, from, result_tag, communicator_.handle(), &arriving.parts.emplace_back());
    });
  }

  void take_results() {
    for (std::size_t k = 0; k < arriving_.size();) {
      Arriving& arriving = arriving_[k];
      int arrived = 0;
      MPI_Testall(static_cast<int>(arriving.parts.size()), arriving.parts.data(), &arrived, MPI_STATUSES_IGNORE);
      if (arrived == 0) {
        ++k;
        continue;
      }
      const std::size_t job = arriving.job;
      arriving_.erase(arriving_.begin() + static_cast<std::ptrdiff_t>(k));
      try {
        const std::lock_guard lock(one_at_a_time_);
        if (job < results_.size()) {
          done_(job, std::as_const(results_[job]));
        }
      } catch (...) {
        failed(job, std::current_exception());
      }
    }
  }

  // in process 0, with the lock held
  void note_failure(std::uint64_t job, std::size_t process) {
    if (job < first_failure_) {
      first_failure_ = job;
      failed_in_ = process;
    }
  }

  [[noreturn]] void throw_failure(std::uint64_t job, std::size_t process) {
    std::string what;
    if (process == communicator_.rank()) {
      try {
        std::rethrow_exception(exception_);
      } catch (const std::exception& error) {
        what = error.what();
      } catch (...) {
        what = "something that is no std::exception";
      }
    }
    const int thrower = static_cast<int>(process);
    std::uint64_t size = what.size();
    MPI_Bcast(&size, 1, MPI_UINT64_T, thrower, communicator_.handle());
    what.resize(static_cast<std::size_t>(size));
    MPI_Bcast(what.data(), static_cast<int>(size), MPI_CHAR, thrower, communicator_.handle());
    if (process == communicator_.rank()) {
      std::rethrow_exception(exception_);
    }
    throw std::runtime_error("job " + std::to_string(job) + " in process " + std::to_string(process) + ": " + what);
  }

  void share_results() {
    std::vector<std::uint64_t> sizes(results_.size());
    std::transform(results_.begin(), results_.end(), sizes.begin(), [](const JobResult& each) { return each.size(); });
    MPI_Bcast(sizes.data(), static_cast<int>(sizes.size()), MPI_UINT64_T, 0, communicator_.handle());
    // few long messages in place of many short ones
    JobResult all;
    if (leads()) {
      for (const JobResult& each : results_) {
        all.insert(all.end(), each.begin(), each.end());
      }
    } else {
      std::uint64_t total = 0;
      for (const std::uint64_t size : sizes) {
        total += size;
      }
      all.resize(static_cast<std::size_t>(total));
    }
    in_parts(all, [&](double* begin, int size) { MPI_Bcast(begin, size, MPI_DOUBLE, 0, communicator_.handle()); });
    if (!leads()) {
      auto next = all.begin();
      for (std::size_t k = 0; k < results_.size(); ++k) {
        const auto end = next + static_cast<std::ptrdiff_t>(sizes[k]);
        results_[k].assign(next, end);
        next = end;
      }
    }
  }

  const MpiCommunicator& communicator_;
  Done& done_;
  std::vector<JobResult> results_;
  std::mutex one_at_a_time_{};
  std::atomic<bool> stopped_{false};

  std::vector<News> news_{};  ///< for process 0, not sent yet
  std::size_t own_failure_ = std::numeric_limits<std::size_t>::max();
  std::exception_ptr exception_{};

  char stop_ = 0;
  MPI_Request stop_request_ = MPI_REQUEST_NULL;
  std::deque<News> sent_news_{};  ///< where MPI reads them until they are gone, as it does results_
  std::deque<MPI_Request> sends_{};

  // in process 0
  bool others_stopped_ = false, counts_differ_ = false;
  std::size_t ended_ = 0;  ///< of the other processes
  std::vector<Arriving> arriving_{};
  std::deque<JobResult> unwanted_{};
  std::uint64_t first_failure_ = nobody;
  std::uint64_t failed_in_ = 0;
};

}  // namespace detail

/// An Executor of all processes of an MPI communicator. Where machines have processors of one kind, results have the
/// same bits as those of ThreadExecutor. MPI is the caller's to initialise, before, and to finalise, after the last
/// copy is gone. Process 0 hears of others' jobs between jobs of its own, a process that waits sleeps, and one that
/// hears that a job failed elsewhere ends what it is at first. The text of what another process threw is
/// "job 3 in process 1: ..."; also what `done` threw ends the run in all processes. What is thrown outside of run is
/// the program's to agree upon: processes wait for each other in run, for ever if need be.
class MpiExecutor {
 public:
  /// Called by all processes of the communicator; copies share one duplicate of it, on which nobody else is heard.
  /// @param threads over which the jobs of a process are shared out: several need MPI_THREAD_FUNNELED at least, and run
  /// is called from the thread that may speak MPI, as it is for jobs that use threads of their own.
  /// Throws std::invalid_argument if MPI does not run, or not with that.
  explicit MpiExecutor(Threads threads = {1}, MPI_Comm communicator = MPI_COMM_WORLD) : threads_(threads) {
    int begun = 0, ended = 0, level = 0;
    MPI_Initialized(&begun);
    MPI_Finalized(&ended);
    expects(begun != 0 && ended == 0, "MpiExecutor: MPI", "initialised and not yet finalised",
            begun == 0 ? "MPI before MPI_Init" : "MPI after MPI_Finalize");
    MPI_Query_thread(&level);
    expects(threads.resolved() == 1 || level >= MPI_THREAD_FUNNELED, "MpiExecutor: threads",
            "1 unless MPI_Init_thread gave MPI_THREAD_FUNNELED", threads.resolved());
    communicator_ = std::make_shared<const detail::MpiCommunicator>(communicator);
  }

  template <class Work, class Done>
  std::vector<JobResult> run(std::size_t count, Work&& work, Done&& done) {
    const std::size_t first = process(), step = processes();
    detail::MpiRun<std::remove_reference_t<Done>> run(*communicator_, count, done);
    const std::thread::id speaker = std::this_thread::get_id();
    const std::size_t own = count > first ? (count - first - 1) / step + 1 : 0;
    parallel_jobs(static_cast<Index>(own), threads_, [&](Index n) {
      const std::size_t k = first + static_cast<std::size_t>(n) * step;
      if (!run.stopped()) {
        try {
          run.finished(k, work(k));
        } catch (...) {
          run.failed(k, std::current_exception());
        }
      }
      if (std::this_thread::get_id() == speaker) {
        run.speak();
      }
    });
    return run.conclude();
  }

  std::size_t processes() const noexcept { return communicator_->size(); }
  std::size_t process() const noexcept { return communicator_->rank(); }

 private:
  Threads threads_;
  std::shared_ptr<const detail::MpiCommunicator> communicator_;
};
static_assert(Executor<MpiExecutor>);

}  // namespace decant::inline DECANT_TARGET
