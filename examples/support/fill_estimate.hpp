// SPDX-License-Identifier: MIT
#pragma once

/// How much liquid was in a container at first, judged by how it was poured out: the second experiment of Schenck and
/// Fox (2017), at a few levels by each method, and as a quantity with an interval.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/recording.hpp>
#include <decant/simulation/fill.hpp>

#include "hypothesis_run.hpp"

namespace example {

struct FillOptions {
  std::vector<int> levels{0, 30, 60, 90};  ///< [% of what the container holds], those that methods choose from
  std::vector<std::string> methods = weighing_methods();
  int grid_step = 10;  ///< [%] of the amounts between which the default method finds one
  double confidence = 0.9;
  double particles_in_full = 6000;  ///< where tracking.spacing is 0
  TrackingOptions tracking{};
  /// Amounts below this share of the best one's are given up; levels are followed to the end.
  double least_probability = 1e-3;
  decant::PosteriorSettings posterior{};
};

struct FillResult {
  std::string container;
  double container_ml = 0;
  double spacing = 0;  ///< of the particles [m]
  std::map<std::string, PosteriorCourse> by_method;
  PosteriorCourse grid;                            ///< of the default method
  std::vector<double> grid_ml;                     ///< its amounts
  std::optional<decant::ValueEstimate> volume_ml;  ///< nothing if the recording could not be followed
};

/// The container that is meant: the one that the recording says liquid starts in, or else the first to be poured from.
inline std::size_t container_of(const decant::Recording& recording) {
  if (recording.liquid.initial) {
    return recording.liquid.initial->body;
  }
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    if (recording.bodies[body].role == decant::recording::Role::Source) {
      return body;
    }
  }
  throw std::runtime_error(recording.name +
                           ": no container: expected a body of the role 'source', or liquid.initial to name one");
}

namespace detail {

inline double capacity_ml(const decant::Recording& recording, std::size_t body) {
  const auto& container = recording.bodies[body];
  const decant::Pose pose = container.motion.at(recording.timestamps.front());
  const decant::Vector3<double> up =
      pose.rotation.conjugate() * decant::Vector3<double>(-recording.gravity.normalized());
  const decant::Cavity cavity(std::make_shared<const decant::BoundingVolumeHierarchy>(container.mesh), up);
  if (cavity.empty()) {
    throw std::runtime_error(recording.name + ": body '" + container.name + "' holds no liquid as it stands at first");
  }
  return 1e6 * cavity.volume();
}

}  // namespace detail

/// What is known of the amount after a frame [ml]; nothing where every amount has failed.
inline std::optional<decant::ValueDensity> amount_density(const FillResult& result, std::size_t frame) {
  const std::vector<double> log_posterior = result.grid.log_posterior_at(frame);
  if (std::none_of(log_posterior.begin(), log_posterior.end(), [](double value) { return std::isfinite(value); })) {
    return std::nullopt;
  }
  return decant::ValueDensity(result.grid_ml, log_posterior);
}

/// @param progress is told what is done, and the share of all, 0 .. 1. Throws std::runtime_error for a recording
/// without a container, std::invalid_argument for options that make no sense.
inline FillResult estimate_fill(const decant::Recording& told, const FillOptions& options,
                                const std::function<void(const std::string&, double)>& progress) {
  using namespace decant;
  FillResult result;
  const std::size_t container = container_of(told);
  result.container = told.bodies[container].name;
  result.container_ml = detail::capacity_ml(told, container);
  // whatever it says of the amount is not used
  Recording recording = told;
  recording.liquid.initial = recording::Initial{container, 0.0, std::nullopt};
  TrackingOptions tracking = options.tracking;
  if (tracking.spacing == 0) {
    tracking.spacing = std::cbrt(1e-6 * result.container_ml / options.particles_in_full);
  }
  result.spacing = tracking.spacing;

  const TrackingModel empty = model_of<TrackingParts>(recording, tracking);
  const std::set<int> levels(options.levels.begin(), options.levels.end());
  std::set<int> grid{100};
  for (int percent = 0; percent < 100; percent += options.grid_step) {
    grid.insert(percent);
  }
  std::set<int> percents = grid;
  percents.insert(levels.begin(), levels.end());
  // filling counts as one simulation that follows the recording, of which there are so many
  const double all = 1 + static_cast<double>(options.methods.size() * levels.size() + grid.size());
  std::map<int, TrackingModel> filled;
  for (const int percent : percents) {
    progress("filling", static_cast<double>(filled.size()) / static_cast<double>(percents.size()) / all);
    TrackingModel& model = filled.emplace(percent, empty).first->second;
    if (percent > 0) {
      fill(model, static_cast<BodyId>(container), FillAmount::fraction(0.01 * percent));
    }
  }
  double done = 1;
  const auto run = [&](const std::string& method, const std::set<int>& chosen, double least_probability) {
    std::vector<NamedModel> models;
    for (const int percent : chosen) {
      models.push_back({std::to_string(percent), filled.at(percent)});
    }
    WeighingSettings settings;
    settings.filter.posterior = options.posterior;
    settings.filter.least_probability = least_probability;
    PosteriorCourse course = weigh_by(method, recording, models, tracking, settings, [&](double share) {
      progress(method, (done + share * static_cast<double>(chosen.size())) / all);
    });
    done += static_cast<double>(chosen.size());
    return course;
  };
  for (const std::string& method : options.methods) {
    result.by_method[method] = run(method, levels, 0);
  }
  for (const int percent : grid) {
    result.grid_ml.push_back(0.01 * percent * result.container_ml);
  }
  result.grid = run(default_method, grid, options.least_probability);
  const std::size_t frames = result.grid.time.size();
  if (const auto density = frames > 0 ? amount_density(result, frames - 1) : std::nullopt) {
    result.volume_ml = estimate_value(*density, options.confidence);
  }
  return result;
}

inline nlohmann::json fill_json(const FillResult& result, double confidence) {
  nlohmann::json json;
  json["container"] = result.container;
  json["container_ml"] = result.container_ml;
  json["spacing_mm"] = 1e3 * result.spacing;
  json["status"] = result.grid.status;
  for (const auto& [name, course] : result.by_method) {
    json["posterior"][name] = posterior_json(course);
    json["posterior_over_time"][name] = course_json(course);
    json["evidence"][name] = evidence_json(course);
    const std::vector<double> as_printed = probability_schenck2017(course);
    for (std::size_t k = 0; k < course.names.size(); ++k) {
      json["posterior_schenck2017"][name][course.names[k]] = number_json(as_printed[k]);
    }
    json["most_probable_percent"][name] =
        course.names.empty() ? nlohmann::json() : nlohmann::json(std::stoi(course.names[course.best()]));
  }
  if (result.volume_ml) {
    json["volume_ml"] = result.volume_ml->median;
    json["interval_" + std::to_string(std::lround(100 * confidence)) + "_ml"] = {result.volume_ml->low,
                                                                                 result.volume_ml->high};
    json["volume_beyond_range"] = result.volume_ml->at_end;
  }
  const std::vector<double> last = result.grid.last(), log_posterior = result.grid.last_log_posterior();
  for (std::size_t k = 0; k < result.grid.names.size(); ++k) {
    json["amounts"].push_back({{"ml", result.grid_ml[k]},
                               {"percent", std::stoi(result.grid.names[k])},
                               {"probability", number_json(last[k])},
                               {"log_posterior", number_json(log_posterior[k])},
                               {"squared_misfit", number_json(result.grid.evidence[k].before.squared)}});
  }
  json["none_of_these"] = number_json(last.back());
  json["followed"] = column_json(result.grid.followed);
  return json;
}

}  // namespace example
