// SPDX-License-Identifier: MIT
#pragma once

/// The third experiment of Schenck and Fox (2017) on twins of their pipe junction: which leg is blocked, how much of
/// one is open, and whether it is noticed that neither is so.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/recording_reader.hpp>

#include "blockage.hpp"
#include "experiment_folder.hpp"
#include "junction_twin.hpp"

namespace example {

/// A recording of the experiment: its folder's name, how it is made, and what is to be answered.
struct JunctionCase {
  std::string name;
  JunctionTwin twin;
  std::string answer;  ///< a configuration as find_blockage has it
};

namespace detail {

inline JunctionCase junction_case(const std::string& name, double left, double right, double leak, std::uint32_t seed) {
  JunctionTwin twin;
  twin.left_opening = left;
  twin.right_opening = right;
  twin.leak = leak;
  twin.seed = seed;
  const auto of_leg = [](const std::string& leg, double opening) { return opening > 0 ? leg + "_partial" : leg; };
  std::string answer = "none";
  if (leak > 0 || (left < 1 && right < 1)) {
    answer = PosteriorCourse::none_name;
  } else if (left < 1) {
    answer = of_leg("left", left);
  } else if (right < 1) {
    answer = of_leg("right", right);
  }
  return {name, twin, answer};
}

}  // namespace detail

/// The paper's five configurations, four trials each. A leg that is blocked in part is 25 to 55 % open.
inline std::vector<JunctionCase> junction_configurations() {
  std::vector<JunctionCase> cases;
  std::uint32_t seed = 0;
  for (const char* configuration : {"none", "left", "right", "left_partial", "right_partial"}) {
    for (int trial = 1; trial <= 4; ++trial) {
      ++seed;
      std::mt19937 random(1009 * seed + 11);
      const double opening = 0.01 * (25 + static_cast<double>(random() % 31));
      const std::string name = configuration;
      const double blocked = name.ends_with("partial") ? opening : 0;
      cases.push_back(detail::junction_case("pipe_" + name + "_" + std::to_string(trial),
                                            name.starts_with("left") ? blocked : 1.0,
                                            name.starts_with("right") ? blocked : 1.0, 0, seed));
    }
  }
  return cases;
}

/// One leg 10, 20, .. 90 % open.
inline std::vector<JunctionCase> junction_openings() {
  std::vector<JunctionCase> cases;
  for (int tenth = 1; tenth <= 9; ++tenth) {
    const bool left = tenth % 2 == 1;
    const std::string name = "pipe_" + std::string(left ? "left" : "right") + "_" + std::to_string(10 * tenth);
    const double opening = 0.1 * tenth;
    cases.push_back(detail::junction_case(name, left ? opening : 1.0, left ? 1.0 : opening, 0,
                                          static_cast<std::uint32_t>(40 + tenth)));
  }
  return cases;
}

/// What is none of the five configurations: both legs blocked in part, or a hole in one.
inline std::vector<JunctionCase> junction_others() {
  return {detail::junction_case("pipe_both_30_30", 0.3, 0.3, 0, 61),
          detail::junction_case("pipe_both_20_40", 0.2, 0.4, 0, 62),
          detail::junction_case("pipe_leak_30", 1, 1, 0.3, 63), detail::junction_case("pipe_leak_50", 1, 1, 0.5, 64)};
}

/// When a share of all that a recording says flows in has done so [s].
inline double poured_at(const decant::Recording& recording, double share) {
  const auto& flow = recording.liquid.inlet->flow;
  const auto volume = [&](std::size_t k) {
    return 0.5 * (flow[k].second + flow[k + 1].second) * (flow[k + 1].first - flow[k].first);
  };
  double total = 0;
  for (std::size_t k = 0; k + 1 < flow.size(); ++k) {
    total += volume(k);
  }
  double sum = 0;
  for (std::size_t k = 0; k + 1 < flow.size(); ++k) {
    if (sum + volume(k) >= share * total) {
      return std::lerp(flow[k].first, flow[k + 1].first, (share * total - sum) / volume(k));
    }
    sum += volume(k);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

struct JunctionExperimentOptions {
  std::filesystem::path folder;                                    ///< of the recordings, with results/ in it
  double model_spacing = 0;                                        ///< [m], 0: by the junction, see BlockageOptions
  double reality_spacing = JunctionTwin{}.spacing;                 ///< [m]
  double duration = JunctionTwin{}.duration;                       ///< of each recording [s]
  double least_probability = BlockageOptions{}.least_probability;  ///< 0: no hypothesis is given up
  int threads = 0;                                                 ///< how many jobs run side by side; 0: one per core
  bool again = false;                                              ///< computes what is there already anew
};

/// Makes recordings of junctions and finds what blocks them, or finds both in its folder.
class JunctionExperiment {
 public:
  /// Throws std::runtime_error where the folder cannot be written to.
  explicit JunctionExperiment(JunctionExperimentOptions options)
      : options_(std::move(options)), folder_(options_.folder, options_.threads, options_.again) {}

  /// Finds what blocks them, where that is not there yet, by each method; see ExperimentFolder::run.
  void run(const std::vector<JunctionCase>& cases, const std::vector<std::string>& methods) {
    std::vector<ExperimentJob> jobs;
    for (const std::string& method : methods) {
      for (const JunctionCase& each : cases) {
        jobs.push_back({key(each, method),
                        settings_json(each, method),
                        {recording_of(each)},
                        [this, each, method](const auto& progress) { return compute(each, method, progress); }});
      }
    }
    folder_.run("finding blockages", jobs);
  }

  /// Of a case that was run by that method, as blockage_json has it, with the truth beside it; others are an
  /// std::out_of_range.
  const nlohmann::json& result(const JunctionCase& of, const std::string& method) const {
    return folder_.result(key(of, method));
  }
  const ExperimentFolder& folder() const { return folder_; }

 private:
  static std::string key(const JunctionCase& of, const std::string& method) { return of.name + "." + method; }

  ExperimentRecording recording_of(const JunctionCase& of) const {
    JunctionTwin twin = of.twin;
    twin.threads = 1;  // recordings are made side by side
    twin.spacing = options_.reality_spacing;
    twin.duration = options_.duration;
    const auto frames = static_cast<std::size_t>(std::lround(twin.duration * twin.frames_per_second));
    return {of.name, twin.seed, twin.spacing, frames,
            [twin](const auto& folder, const auto& progress) { record_junction(twin, folder, progress); }};
  }

  // What a result depends on, beside the program.
  nlohmann::json settings_json(const JunctionCase& of, const std::string& method) const {
    return {{"recording", of.name},
            {"method", method},
            {"model_spacing_mm", 1e3 * options_.model_spacing},
            {"reality_spacing_mm", 1e3 * options_.reality_spacing},
            {"duration_s", options_.duration},
            {"least_probability", options_.least_probability}};
  }

  nlohmann::json compute(const JunctionCase& of, const std::string& method,
                         const std::function<void(double)>& progress) const {
    BlockageOptions options;
    options.method = method;
    options.least_probability = options_.least_probability;
    options.tracking.spacing = options_.model_spacing;
    options.tracking.threads = 1;
    const decant::Recording recording = decant::read_recording(folder_.recording(of.name));
    nlohmann::json json = blockage_json(find_blockage(recording, options, progress), options.confidence);
    json["truth"] = folder_.truth(of.name);
    json["right_answer"] = of.answer;
    json["third_poured_s"] = poured_at(recording, 1.0 / 3);
    return json;
  }

  JunctionExperimentOptions options_;
  ExperimentFolder folder_;
};

}  // namespace example
