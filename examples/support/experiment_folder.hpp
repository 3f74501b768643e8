// SPDX-License-Identifier: MIT
#pragma once

/// What experiments on twins share: their recordings and results are kept in a folder, so that nothing is computed
/// twice, and a run that was stopped goes on where it was.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/folder.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/recording_truth.hpp>

#include "result_file.hpp"

namespace example {

/// A recording of an experiment, and how it is made.
struct ExperimentRecording {
  std::string name;  ///< of its folder
  std::uint32_t seed = 0;
  double spacing = 0;      ///< of the reality's particles [m]
  std::size_t frames = 0;  ///< how many it has
  std::function<void(const std::filesystem::path& folder, const std::function<void(double)>& progress)> make{};
};

/// Something to be computed, and what its result depends on beside the program.
struct ExperimentJob {
  std::string key;  ///< of the result and its file
  nlohmann::json settings;
  std::vector<ExperimentRecording> recordings;  ///< that it is computed from
  std::function<nlohmann::json(const std::function<void(double)>& progress)> compute;
};

/// Makes recordings and computes results, or finds both in its folder.
class ExperimentFolder {
 public:
  /// @param threads how many recordings or jobs are in work side by side; 0: one per core. @param again computes
  /// results that are there already anew. Throws std::runtime_error where the folder cannot be written to.
  ExperimentFolder(std::filesystem::path folder, int threads, bool again)
      : folder_(std::move(folder)), threads_(threads), again_(again) {
    decant::detail::make_folder(results_folder());
    const std::filesystem::path probe = results_folder() / "probe.part";
    expect_writable(probe);
    std::filesystem::remove(probe);
  }

  std::filesystem::path recording(const std::string& name) const { return folder_ / name; }

  /// What only a score may look at. Throws std::runtime_error where there is none.
  nlohmann::json truth(const std::string& name) const {
    const std::optional<std::string> text = decant::read_truth(recording(name));
    if (!text) {
      throw std::runtime_error((recording(name) / "recording.json").string() +
                               ": truth is missing, which the scores need");
    }
    return nlohmann::json::parse(*text);
  }

  /// Computes what is not there yet, for which it makes the recordings that are not there yet; afterwards all have a
  /// result(). Results alone are enough to tabulate them. @param one_by_one for jobs that use all threads. Throws
  /// std::runtime_error, one line, where a recording cannot be written or is there and was made otherwise.
  void run(const std::string& label, const std::vector<ExperimentJob>& jobs, bool one_by_one = false) {
    std::vector<const ExperimentJob*> missing;
    for (const ExperimentJob& job : jobs) {
      if (results_.contains(job.key) ||
          std::any_of(missing.begin(), missing.end(), [&](const auto* other) { return other->key == job.key; })) {
        continue;
      }
      ++asked_;
      if (nlohmann::json kept = again_ ? nlohmann::json() : read_kept(job); kept.is_object()) {
        results_[job.key] = std::move(kept);
      } else {
        missing.push_back(&job);
      }
    }
    record(recordings_for(missing));
    TogetherProgress progress(label, missing.size());
    std::mutex guard;
    const int threads = one_by_one ? 1 : threads_;
    decant::parallel_jobs(static_cast<decant::Index>(missing.size()), {threads}, [&](decant::Index number) {
      const auto k = static_cast<std::size_t>(number);
      const ExperimentJob& job = *missing[k];
      nlohmann::json result = job.compute([&](double share) { progress.update(k, share); });
      progress.update(k, 1);  // also where it stopped early
      result["settings"] = job.settings;
      const std::filesystem::path part = results_folder() / (job.key + ".json.part");
      write_result(part, result);
      std::filesystem::rename(part, results_folder() / (job.key + ".json"));
      const std::lock_guard lock(guard);
      results_[job.key] = std::move(result);
    });
    computed_ += missing.size();
  }

  /// Whether a result of the job is there, from this run or an earlier one.
  bool is_computed(const ExperimentJob& job) const { return results_.contains(job.key) || read_kept(job).is_object(); }

  /// Of a job that was run; other keys are an std::out_of_range.
  const nlohmann::json& result(const std::string& key) const { return results_.at(key); }
  const std::map<std::string, nlohmann::json>& results() const { return results_; }
  std::size_t recorded() const { return recorded_; }  ///< recordings that were made
  std::size_t computed() const { return computed_; }  ///< results that were computed, of those asked() for
  std::size_t asked() const { return asked_; }

 private:
  /// One line for many jobs.
  class TogetherProgress {
   public:
    TogetherProgress(const std::string& label, std::size_t jobs)
        : line_(label, static_cast<double>(jobs)), shares_(jobs, 0.0) {}

    void update(std::size_t job, double share) {
      const std::lock_guard lock(guard_);
      done_ += share - shares_[job];
      finished_ += share >= 1 && shares_[job] < 1 ? 1 : 0;
      shares_[job] = share;
      line_.update(done_, std::to_string(finished_) + " of " + std::to_string(shares_.size()) + " done");
    }

   private:
    std::mutex guard_;
    decant::Progress line_;
    std::vector<double> shares_;
    double done_ = 0;
    std::size_t finished_ = 0;
  };

  // Jobs may share recordings.
  static std::vector<ExperimentRecording> recordings_for(const std::vector<const ExperimentJob*>& jobs) {
    std::vector<ExperimentRecording> recordings;
    for (const ExperimentJob* job : jobs) {
      for (const ExperimentRecording& each : job->recordings) {
        if (std::none_of(recordings.begin(), recordings.end(),
                         [&](const auto& other) { return other.name == each.name; })) {
          recordings.push_back(each);
        }
      }
    }
    return recordings;
  }

  void record(const std::vector<ExperimentRecording>& recordings) {
    std::vector<const ExperimentRecording*> missing;
    for (const ExperimentRecording& each : recordings) {
      if (std::filesystem::exists(recording(each.name))) {
        expect_made_as(each);
      } else {
        missing.push_back(&each);
      }
    }
    TogetherProgress progress("recording", missing.size());
    // A folder that is not finished must not pass for a recording, and the recording bears its folder's name.
    const std::filesystem::path unfinished = folder_ / "unfinished";
    decant::parallel_jobs(static_cast<decant::Index>(missing.size()), {threads_}, [&](decant::Index number) {
      const auto k = static_cast<std::size_t>(number);
      const std::filesystem::path part = unfinished / missing[k]->name;
      decant::detail::make_folder(unfinished);
      std::filesystem::remove_all(part);
      missing[k]->make(part, [&](double share) { progress.update(k, share); });
      std::filesystem::rename(part, recording(missing[k]->name));
    });
    std::error_code not_empty;
    std::filesystem::remove(unfinished, not_empty);
    recorded_ += missing.size();
  }

  std::filesystem::path results_folder() const { return folder_ / "results"; }

  /// What an earlier run computed with the job's settings; null where there is none.
  nlohmann::json read_kept(const ExperimentJob& job) const {
    const std::filesystem::path file = results_folder() / (job.key + ".json");
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
      return {};
    }
    nlohmann::json kept =
        nlohmann::json::parse(decant::detail::read_text_file(file, std::size_t{1} << 26), nullptr, false);
    return kept.is_object() && kept.value("settings", nlohmann::json()) == job.settings ? kept : nlohmann::json();
  }

  void expect_made_as(const ExperimentRecording& wanted) const {
    const nlohmann::json there = truth(wanted.name);
    const auto words = [](const std::string& seed, double spacing_mm, std::size_t frames) {
      return "seed " + seed + ", " + decant::detail::number_text(spacing_mm) + " mm, " + std::to_string(frames) +
             " frames";
    };
    const nlohmann::json& volumes = there.at("volume_ml");  // of each container, by frame
    const std::string is = words(there.at("seed").dump(), there.at("spacing_mm").get<double>(),
                                 volumes.empty() ? 0 : volumes.begin()->size());
    const std::string should_be = words(std::to_string(wanted.seed), 1e3 * wanted.spacing, wanted.frames);
    if (is != should_be) {
      decant::detail::refuse_file(recording(wanted.name).string() + ": the recording that is there", should_be, is);
    }
  }

  std::filesystem::path folder_;
  int threads_;
  bool again_;
  std::map<std::string, nlohmann::json> results_;
  std::size_t recorded_ = 0, computed_ = 0, asked_ = 0;
};

}  // namespace example
