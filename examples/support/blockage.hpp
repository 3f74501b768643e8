// SPDX-License-Identifier: MIT
#pragma once

/// Which leg of a pipe junction is blocked, and how much of it is open, judged by what runs out of it: the third
/// experiment of Schenck and Fox (2017).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/pipe_blockage.hpp>
#include <decant/boundary/pipe_openings.hpp>
#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/recording.hpp>

#include "hypothesis_run.hpp"

namespace example {

struct BlockageOptions {
  std::string method = default_method;
  /// Of a leg that is blocked in part, those that are tried, increasing between 0 and 1; 0 and 1 are in any case.
  std::vector<double> openings{0.2, 0.4, 0.6, 0.8};
  double confidence = 0.9;
  double particles_across = 5;  ///< of a leg's bore, where tracking.spacing is 0
  TrackingOptions tracking{};
  /// Hypotheses below this share of the best one's are given up. At ten times as much, the opening that all frames
  /// together favoured was once given up at the beginning of the outflow.
  double least_probability = 1e-4;
  decant::PosteriorSettings posterior{};
};

/// A way out of the junction.
struct JunctionLeg {
  std::string name;             ///< left, right; leg_1, leg_2 .. if there are more than two
  decant::PipeSection section;  ///< where a blockage is tried, in the body's frame
};

struct BlockageResult {
  std::string junction;
  std::vector<JunctionLeg> legs;
  double spacing = 0;  ///< of the particles [m]
  PosteriorCourse course;
  std::vector<std::optional<std::size_t>> leg;  ///< by hypothesis; nothing where no leg is blocked
  std::vector<double> opening;                  ///< by hypothesis, 0 .. 1
  std::vector<double> log_prior;                ///< by hypothesis [nat]
  /// By configuration (none, <leg>, <leg>_partial ..) and frame; of "none of these" at last.
  std::vector<std::pair<std::string, std::vector<double>>> configurations;
  std::vector<std::optional<decant::ValueEstimate>> leg_opening;  ///< by leg, 0 .. 1; nothing if it failed at once
};

/// The junction that is meant: the first body of that role. Throws std::runtime_error if there is none.
inline std::size_t junction_of(const decant::Recording& recording) {
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    if (recording.bodies[body].role == decant::recording::Role::Junction) {
      return body;
    }
  }
  throw std::runtime_error(recording.name + ": no junction: expected a body of the role 'junction'");
}

/// The ways out of a junction: all openings but the highest. Sorted from left to right as the first camera sees them
/// at first, without a camera by x in the world. Throws std::runtime_error where there are fewer than two.
inline std::vector<JunctionLeg> junction_legs(const decant::Recording& recording, std::size_t body) {
  using namespace decant;
  const recording::Body& junction = recording.bodies[body];
  const Pose pose = junction.motion.at(recording.timestamps.front());
  const BoundingVolumeHierarchy surface(junction.mesh);
  std::vector<PipeOpening> openings = find_pipe_openings(surface);
  std::erase_if(openings, [](const PipeOpening& opening) { return opening.passage != 0; });
  if (openings.size() < 3) {
    throw std::runtime_error(recording.name + ": body '" + junction.name + "' has " + std::to_string(openings.size()) +
                             " openings that are joined inside; expected a way in and at least two out");
  }
  const Vector3<double> up = -recording.gravity.normalized();
  const auto height = [&](const PipeOpening& opening) { return up.dot(pose * opening.rim.center); };
  openings.erase(std::max_element(openings.begin(), openings.end(),
                                  [&](const auto& a, const auto& b) { return height(a) < height(b); }));
  const auto place = [&](const PipeOpening& opening) {
    const Vector3<double> x = pose * opening.rim.center;
    if (recording.cameras.empty()) {
      return x.x();
    }
    const Vector3<double> seen = recording.cameras.front().view(0).camera_from_world * x;
    return seen.x() / std::max(seen.z(), 1e-9);
  };
  std::stable_sort(openings.begin(), openings.end(), [&](const auto& a, const auto& b) { return place(a) < place(b); });
  std::vector<JunctionLeg> legs;
  for (const PipeOpening& opening : openings) {
    const double radius = opening.rim.radius();
    // Half-way to where the leg branches, through its corners: how much passes depends on where a leg is blocked, most
    // of all on whether there is pipe behind it, and that is so along most of its way.
    const std::vector<PipeSection> line = center_line(surface, opening.rim, 100 * radius, 0.25 * radius);
    const auto half_way = std::find_if(line.begin(), line.end(), [&](const PipeSection& section) {
      return section.distance >= 0.5 * line.back().distance;
    });
    JunctionLeg leg{"leg_" + std::to_string(legs.size() + 1), *half_way};
    if (openings.size() == 2) {
      leg.name = legs.empty() ? "left" : "right";
    }
    legs.push_back(std::move(leg));
  }
  return legs;
}

namespace detail {

inline double log_of_sum(const std::vector<double>& logs) {
  const double largest =
      logs.empty() ? -std::numeric_limits<double>::infinity() : *std::max_element(logs.begin(), logs.end());
  if (!std::isfinite(largest)) {
    return largest;
  }
  double sum = 0;
  for (const double each : logs) {
    sum += std::exp(each - largest);
  }
  return largest + std::log(sum);
}

}  // namespace detail

/// A leg's opening after a frame, whatever the other legs' are; at most one of them is not wholly open. Nothing where
/// every hypothesis has failed.
inline std::optional<decant::ValueDensity> opening_density(const BlockageResult& result, std::size_t leg,
                                                           std::size_t frame) {
  const std::vector<double> log_posterior = result.course.log_posterior_at(frame);
  std::vector<double> opening, log_density, open;
  for (std::size_t k = 0; k < log_posterior.size(); ++k) {
    const double likelihood = log_posterior[k] - result.log_prior[k];
    if (result.leg[k] == leg) {
      opening.push_back(result.opening[k]);
      log_density.push_back(likelihood);
    } else if (!result.leg[k]) {
      open.push_back(likelihood);
    } else {
      open.push_back(log_posterior[k]);
    }
  }
  opening.push_back(1);
  log_density.push_back(detail::log_of_sum(open));
  if (std::none_of(log_density.begin(), log_density.end(), [](double each) { return std::isfinite(each); })) {
    return std::nullopt;
  }
  return decant::ValueDensity(opening, log_density);
}

/// @param progress is told the share that is done, 0 .. 1. Throws std::runtime_error for a recording without a
/// junction, std::invalid_argument for options that make no sense.
inline BlockageResult find_blockage(const decant::Recording& recording, const BlockageOptions& options,
                                    const std::function<void(double)>& progress) {
  using namespace decant;
  for (std::size_t k = 0; k < options.openings.size(); ++k) {
    expects(options.openings[k] > (k > 0 ? options.openings[k - 1] : 0.0) && options.openings[k] < 1,
            "find_blockage: openings", "increasing, between 0 and 1", options.openings[k]);
  }
  expects(options.particles_across > 0, "find_blockage: particles_across", "> 0", options.particles_across);
  BlockageResult result;
  const std::size_t body = junction_of(recording);
  result.junction = recording.bodies[body].name;
  result.legs = junction_legs(recording, body);
  TrackingOptions tracking = options.tracking;
  if (tracking.spacing == 0) {
    double narrowest = std::numeric_limits<double>::infinity();
    for (const JunctionLeg& leg : result.legs) {
      narrowest = std::min(narrowest, leg.section.radius());
    }
    tracking.spacing = 2 * narrowest / options.particles_across;
  }
  result.spacing = tracking.spacing;
  std::vector<NamedModel> models{{"none", model_of<TrackingParts>(recording, tracking), 0}};
  result.leg.emplace_back();
  result.opening.push_back(1);
  std::vector<double> openings{0};
  openings.insert(openings.end(), options.openings.begin(), options.openings.end());
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    for (const double opening : openings) {
      // configurations are as probable as each other, whatever the number of openings that one stands for
      const double log_prior = opening > 0 ? -std::log(static_cast<double>(options.openings.size())) : 0;
      // One body with the junction: walls of several bodies add up where one is behind another's. How long a blockage
      // is hardly matters: from 0.4 to 1 of the leg's width, 0.33 to 0.34 of what the other leg lets pass (40 % open).
      const PipeSection& section = result.legs[leg].section;
      Recording blocked = recording;
      blocked.bodies[body].mesh =
          joined(recording.bodies[body].mesh, pipe_blockage(section, opening, 2 * section.radius()));
      models.push_back({result.legs[leg].name + "_" + std::to_string(std::lround(100 * opening)),
                        model_of<TrackingParts>(blocked, tracking), log_prior});
      result.leg.emplace_back(leg);
      result.opening.push_back(opening);
    }
  }
  for (const NamedModel& model : models) {
    result.log_prior.push_back(model.log_prior);
  }
  HypothesisFilterSettings settings;
  settings.posterior = options.posterior;
  settings.least_probability = options.least_probability;
  result.course = weigh_by(options.method, recording, models, tracking, settings, progress);

  const std::vector<std::vector<double>> probability = result.course.probability();
  const auto sum_of = [&](const std::string& name, auto belongs) {
    std::vector<double> sum(result.course.time.size(), 0.0);
    for (std::size_t k = 0; k < models.size(); ++k) {
      for (std::size_t frame = 0; belongs(k) && frame < sum.size(); ++frame) {
        sum[frame] += probability[k][frame];
      }
    }
    result.configurations.emplace_back(name, std::move(sum));
  };
  sum_of("none", [&](std::size_t k) { return !result.leg[k]; });
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    const std::string& name = result.legs[leg].name;
    sum_of(name, [&](std::size_t k) { return result.leg[k] == leg && result.opening[k] == 0; });
    sum_of(name + "_partial", [&](std::size_t k) { return result.leg[k] == leg && result.opening[k] > 0; });
  }
  result.configurations.emplace_back(PosteriorCourse::none_name, probability.back());
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    const std::size_t frames = result.course.time.size();
    const auto density = frames > 0 ? opening_density(result, leg, frames - 1) : std::nullopt;
    result.leg_opening.push_back(density ? std::optional(estimate_value(*density, options.confidence)) : std::nullopt);
  }
  return result;
}

/// The most probable configuration after the last frame, "none of these" among them.
inline std::string blockage_answer(const BlockageResult& result) {
  const auto best =
      std::max_element(result.configurations.begin(), result.configurations.end(), [](const auto& a, const auto& b) {
        return !b.second.empty() && (a.second.empty() || a.second.back() < b.second.back());
      });
  return best->second.empty() ? PosteriorCourse::none_name : best->first;
}

/// When the answer had been given with at least this probability for good [s]; nothing if never.
inline std::optional<double> decided_at(const BlockageResult& result, double probability) {
  const std::string answer = blockage_answer(result);
  std::optional<double> since;
  for (const auto& [name, course] : result.configurations) {
    for (std::size_t frame = 0; name == answer && frame < course.size(); ++frame) {
      if (course[frame] < probability) {
        since.reset();
      } else if (!since) {
        since = result.course.time[frame];
      }
    }
  }
  return since;
}

inline nlohmann::json blockage_json(const BlockageResult& result, double confidence) {
  nlohmann::json json;
  json["junction"] = result.junction;
  json["spacing_mm"] = 1e3 * result.spacing;
  json["status"] = result.course.status;
  json["answer"] = blockage_answer(result);
  const std::optional<double> decided = decided_at(result, 0.9);
  json["decided_s"] = decided ? nlohmann::json(*decided) : nlohmann::json();
  json["posterior_over_time"]["time_s"] = column_json(result.course.time);
  for (const auto& [name, course] : result.configurations) {
    json["posterior"][name] = course.empty() ? nlohmann::json() : number_json(course.back());
    json["posterior_over_time"][name] = column_json(course);
  }
  const std::vector<double> last = result.course.last(), log_posterior = result.course.last_log_posterior();
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    if (const auto& opening = result.leg_opening[leg]) {
      json["opening"][result.legs[leg].name] = {
          {"median", opening->median},
          {"interval_" + std::to_string(std::lround(100 * confidence)), {opening->low, opening->high}}};
    }
  }
  for (std::size_t k = 0; k < result.course.names.size(); ++k) {
    json["hypotheses"].push_back(
        {{"name", result.course.names[k]},
         {"opening", result.opening[k]},
         {"leg", result.leg[k] ? nlohmann::json(result.legs[*result.leg[k]].name) : nlohmann::json()},
         {"probability", number_json(last[k])},
         {"log_posterior", number_json(log_posterior[k])},
         {"squared_misfit", number_json(result.course.evidence[k].before.squared)},
         {"measured", number_json(result.course.evidence[k].before.measured)}});
  }
  json["frames_run"] = result.course.frames_run;
  json["followed"] = column_json(result.course.followed);
  return json;
}

}  // namespace example
