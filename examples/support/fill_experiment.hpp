// SPDX-License-Identifier: MIT
#pragma once

/// The second experiment of Schenck and Fox (2017), how much liquid a container held at first, on twins of their pours
/// and on pours of any amount.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/recording_reader.hpp>

#include "experiment_folder.hpp"
#include "fill_estimate.hpp"
#include "pours.hpp"

namespace example {

/// The paper's pours, and as many trials from containers that are empty.
inline std::vector<Pour> level_pours() {
  std::vector<Pour> pours = paper_pours();
  std::uint32_t seed = 12;
  for (const char* container : {"cup", "bottle"}) {
    for (int trial = 0; trial < 2; ++trial) {
      pours.push_back(pour("", container, 0, ++seed));
    }
  }
  return pours;
}

/// Of amounts that are no round level, 5 to 95 % of what the container holds.
inline std::vector<Pour> amount_pours() {
  std::vector<Pour> pours;
  for (std::uint32_t seed = 301; seed <= 328; ++seed) {
    std::mt19937 random(seed);
    const int percent = 5 + static_cast<int>(random() % 91);
    pours.push_back(pour("", (seed / 2) % 2 == 0 ? "cup" : "bottle", percent, seed));
  }
  return pours;
}

struct FillExperimentOptions {
  std::filesystem::path folder;                 ///< of the recordings, with results/ in it
  double model_spacing = 0;                     ///< [m], 0: by the container, see FillOptions
  double reality_spacing = PourTwin{}.spacing;  ///< [m]
  double duration = PourTwin{}.duration;        ///< of each recording [s]
  int grid_step = FillOptions{}.grid_step;
  int threads = 0;     ///< how many jobs run side by side; 0: one per core
  bool again = false;  ///< computes what is there already anew
};

/// Makes recordings and estimates what was in their containers, or finds both in its folder.
class FillExperiment {
 public:
  /// Throws std::runtime_error where the folder cannot be written to.
  explicit FillExperiment(FillExperimentOptions options)
      : options_(std::move(options)), folder_(options_.folder, options_.threads, options_.again) {}

  /// Estimates what is not there yet; see ExperimentFolder::run. @param methods that choose from levels, see
  /// FillOptions.
  void run(const std::vector<Pour>& pours, const std::vector<std::string>& methods) {
    std::vector<ExperimentJob> jobs;
    for (const Pour& each : pours) {
      jobs.push_back({key(each),
                      settings_json(each, methods),
                      {recording_of(each, options_.reality_spacing, options_.duration)},
                      [this, each, methods](const auto& progress) { return compute(each, methods, progress); }});
    }
    folder_.run("estimating", jobs);
  }

  /// Of a pour that was run, as fill_json has it, with the truth beside it; others are an std::out_of_range.
  const nlohmann::json& result(const Pour& pour) const { return folder_.result(key(pour)); }
  const ExperimentFolder& folder() const { return folder_; }

 private:
  static std::string key(const Pour& pour) { return pour.name + ".fill"; }

  // What a result depends on, beside the program.
  nlohmann::json settings_json(const Pour& pour, const std::vector<std::string>& methods) const {
    return {{"recording", pour.name},
            {"methods", methods},
            {"model_spacing_mm", 1e3 * options_.model_spacing},
            {"reality_spacing_mm", 1e3 * options_.reality_spacing},
            {"duration_s", options_.duration},
            {"grid_step", options_.grid_step}};
  }

  nlohmann::json compute(const Pour& pour, const std::vector<std::string>& methods,
                         const std::function<void(double)>& progress) const {
    FillOptions options;
    options.methods = methods;
    options.grid_step = options_.grid_step;
    options.tracking.spacing = options_.model_spacing;
    options.tracking.threads = 1;
    const FillResult result = estimate_fill(decant::read_recording(folder_.recording(pour.name)), options,
                                            [&](const std::string&, double share) { progress(share); });
    nlohmann::json json = fill_json(result, options.confidence);
    json["true_percent"] = std::lround(100 * pour.twin.fill_fraction);
    json["true_ml"] = folder_.truth(pour.name).at("initial_ml");
    return json;
  }

  FillExperimentOptions options_;
  ExperimentFolder folder_;
};

}  // namespace example
