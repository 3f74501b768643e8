// SPDX-License-Identifier: MIT
#pragma once

/// Which leg of a pipe junction is blocked, and how much of it is open, judged by what runs out of it: the third
/// experiment of Schenck and Fox (2017).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/pipe_blockage.hpp>
#include <decant/hypothesis/marginal.hpp>
#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/recording.hpp>

#include "hypothesis_run.hpp"
#include "junction_legs.hpp"
#include "scouting.hpp"

namespace example {

struct BlockageOptions {
  std::string method = default_method;
  /// Of a leg that is blocked in part, those that are tried, increasing between 0 and 1; 0 and 1 are in any case. What
  /// a leg lets pass that is more than 0.6 open can hardly be told from an open one, so these are denser below.
  std::vector<double> openings{0.2, 0.4, 0.6};
  /// Of two legs that are blocked at once, each of one with each of the other. Both together are none of the
  /// configurations that are asked about, and it is noticed best if it is tried.
  std::vector<double> openings_of_two{0.2, 0.4};
  double confidence = 0.9;
  double particles_across = 5;  ///< of a leg's bore, where tracking.spacing is 0
  double scouts_across = 3;     ///< the same for coarse particles, see ScoutingSettings; 0: no scouting
  TrackingOptions tracking{};
  /// Hypotheses below this share of the best one's are given up, 0: none, nor are there scouts. At ten times as much,
  /// the opening that all frames together favoured was once given up at the beginning of the outflow.
  double least_probability = 1e-4;
  decant::PosteriorSettings posterior{};
  RelocationEvidence relocation{};  ///< by the default method, the only one that relocates
};

struct BlockageResult {
  std::string junction;
  std::vector<JunctionLeg> legs;
  double spacing = 0;  ///< of the particles [m]
  PosteriorCourse course;
  std::vector<std::vector<double>> opening;  ///< by hypothesis and leg, 0 .. 1
  std::vector<double> log_prior;             ///< by hypothesis [nat]
  /// By configuration (none, <leg>, <leg>_partial ..) and frame; of "none of these" at last, with several legs at once.
  std::vector<std::pair<std::string, std::vector<double>>> configurations;
  std::vector<std::optional<decant::ValueEstimate>> leg_opening;  ///< by leg, 0 .. 1; nothing if it failed at once
};

/// How many legs are not wholly open under a hypothesis, and whether one of them is this one.
inline std::size_t blocked_legs(const BlockageResult& result, std::size_t hypothesis) {
  const std::vector<double>& opening = result.opening[hypothesis];
  return static_cast<std::size_t>(std::count_if(opening.begin(), opening.end(), [](double each) { return each < 1; }));
}
inline bool blocks(const BlockageResult& result, std::size_t hypothesis, std::size_t leg) {
  return result.opening[hypothesis][leg] < 1;
}

/// Nobody knows what form a blockage has. A leg that is 40 % open lets pass 24 % of all water where the hole's edges
/// are sharp, and 36 % where they widen nearly to the leg's bore: as much as 8 points of opening either way. So
/// hypotheses are half-way between the two, 31 %, and an opening is known no better than the form is.
inline constexpr double blockage_flare = 0.3;
inline double form_deviation(double opening) noexcept { return std::max(0.03, opening * (1 - opening) / 3); }

/// A leg's opening after a frame, whatever the other legs' are. Nothing where every hypothesis has failed.
inline std::optional<decant::ValueDensity> opening_density(const BlockageResult& result, std::size_t leg,
                                                           std::size_t frame) {
  std::vector<double> of_hypothesis;
  std::map<double, double> log_prior;  // where the other legs are open: all openings of this one are as probable
  for (std::size_t k = 0; k < result.opening.size(); ++k) {
    of_hypothesis.push_back(result.opening[k][leg]);
    if (blocked_legs(result, k) == (blocks(result, k, leg) ? 1 : 0)) {
      log_prior[of_hypothesis.back()] = result.log_prior[k];
    }
  }
  const decant::Marginal marginal = decant::marginal(of_hypothesis, result.course.log_posterior_at(frame));
  std::vector<double> opening, log_density;
  for (std::size_t n = 0; n < marginal.values.size(); ++n) {
    if (const auto prior = log_prior.find(marginal.values[n]); prior != log_prior.end()) {
      opening.push_back(prior->first);
      log_density.push_back(marginal.log_density[n] - prior->second);
    }
  }
  if (std::none_of(log_density.begin(), log_density.end(), [](double each) { return std::isfinite(each); })) {
    return std::nullopt;
  }
  return decant::smeared(decant::ValueDensity(opening, log_density), form_deviation);
}

namespace detail {

/// What may be so: nothing blocked, one leg with each of the openings, two of them.
inline HypothesisSet blockages(const decant::Recording& recording, std::size_t body, const BlockageOptions& options,
                               BlockageResult& result) {
  using namespace decant;
  HypothesisSet set;
  const std::size_t legs = result.legs.size();
  const auto name_of = [&](std::size_t leg, double opening) {
    return result.legs[leg].name + "_" + std::to_string(std::lround(100 * opening));
  };
  const auto add = [&](const std::string& name, const std::vector<std::pair<std::size_t, double>>& blocked,
                       double share) {
    std::vector<double> opening(legs, 1.0);
    for (const auto& [leg, open] : blocked) {
      opening[leg] = open;
    }
    set.names.push_back(name);
    set.log_prior.push_back(std::log(share));
    result.opening.push_back(std::move(opening));
  };
  // Configurations are as probable as each other, whatever the number of openings that one stands for, and so are all
  // pairs of legs together.
  add("none", {}, 1);
  for (std::size_t leg = 0; leg < legs; ++leg) {
    add(name_of(leg, 0), {{leg, 0.0}}, 1);
    for (const double opening : options.openings) {
      add(name_of(leg, opening), {{leg, opening}}, 1 / static_cast<double>(options.openings.size()));
    }
  }
  const double pairs =
      0.5 * static_cast<double>(legs * (legs - 1) * options.openings_of_two.size() * options.openings_of_two.size());
  for (std::size_t one = 0; one < legs; ++one) {
    for (std::size_t two = one + 1; two < legs; ++two) {
      for (const double first : options.openings_of_two) {
        for (const double second : options.openings_of_two) {
          add(name_of(one, first) + "_" + name_of(two, second), {{one, first}, {two, second}}, 1 / pairs);
        }
      }
    }
  }
  set.model = [&recording, &options, &result, body, open = std::map<double, TrackingModel>()](std::size_t k,
                                                                                              double spacing) mutable {
    if (!open.contains(spacing)) {
      TrackingOptions tracking = options.tracking;
      tracking.spacing = spacing;
      open.emplace(spacing, model_of<TrackingParts>(recording, tracking));
    }
    // One body with the junction: walls of several bodies add up where one is behind another's. How long a blockage is
    // hardly matters: from 0.4 to 1 of the leg's width, 0.33 to 0.34 of what the other leg lets pass (40 % open). Its
    // edges do: see blockage_flare.
    TrackingModel model = open.at(spacing);
    TriangleMesh mesh = recording.bodies[body].mesh;
    for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
      if (blocks(result, k, leg)) {
        const PipeSection& section = result.legs[leg].section;
        mesh = joined(mesh, pipe_blockage(section, result.opening[k][leg], 2 * section.radius(), blockage_flare));
      }
    }
    if (blocked_legs(result, k) > 0) {
      model.replace_shape(static_cast<BodyId>(body), std::move(mesh));
    }
    return model;
  };
  // next to each other: they differ in one leg, and none has an opening in between there
  set.neighbours = [&result](std::size_t a, std::size_t b) {
    const auto differ = [&](std::size_t first, std::size_t second) {
      std::vector<std::size_t> in;
      for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
        if (result.opening[first][leg] != result.opening[second][leg]) {
          in.push_back(leg);
        }
      }
      return in;
    };
    const std::vector<std::size_t> in = differ(a, b);
    if (in.size() != 1) {
      return false;
    }
    const auto [low, high] = std::minmax(result.opening[a][in[0]], result.opening[b][in[0]]);
    for (std::size_t k = 0; k < result.opening.size(); ++k) {
      const double opening = result.opening[k][in[0]];
      if (opening > low && opening < high && differ(a, k) == in) {
        return false;
      }
    }
    return true;
  };
  return set;
}

}  // namespace detail

/// @param progress is told the share that is done, 0 .. 1. Throws std::runtime_error for a recording without a
/// junction, std::invalid_argument for options that make no sense.
inline BlockageResult find_blockage(const decant::Recording& recording, const BlockageOptions& options,
                                    const std::function<void(double)>& progress) {
  using namespace decant;
  for (std::size_t k = 0; k < options.openings.size(); ++k) {
    expects(options.openings[k] > (k > 0 ? options.openings[k - 1] : 0.0) && options.openings[k] < 1,
            "find_blockage: openings", "increasing, between 0 and 1", options.openings[k]);
  }
  for (const double opening : options.openings_of_two) {
    expects(opening >= 0 && opening < 1, "find_blockage: openings_of_two", "in [0, 1)", opening);
  }
  expects(options.particles_across > 0, "find_blockage: particles_across", "> 0", options.particles_across);
  BlockageResult result;
  const std::size_t body = junction_of(recording);
  result.junction = recording.bodies[body].name;
  result.legs = junction_legs(recording, body);
  if (result.legs.empty()) {
    throw std::runtime_error(recording.name + ": body '" + recording.bodies[body].name +
                             "': expected a pipe junction with a way in and at least two out that are joined inside");
  }
  TrackingOptions tracking = options.tracking;
  double narrowest = std::numeric_limits<double>::infinity();
  for (const JunctionLeg& leg : result.legs) {
    narrowest = std::min(narrowest, leg.section.radius());
  }
  if (tracking.spacing == 0) {
    tracking.spacing = 2 * narrowest / options.particles_across;
  }
  result.spacing = tracking.spacing;
  const HypothesisSet set = detail::blockages(recording, body, options, result);
  result.log_prior = set.log_prior;
  WeighingSettings settings;
  settings.filter.posterior = options.posterior;
  settings.filter.least_probability = options.least_probability;
  if (options.method == default_method) {
    settings.relocation = options.relocation;
  }
  ScoutingSettings scouting;
  if (options.scouts_across > 0 && options.least_probability > 0) {
    scouting.spacing = 2 * narrowest / options.scouts_across;
  }
  result.course = weigh_scouted(options.method, recording, set, tracking, settings, scouting, progress);

  const std::vector<std::vector<double>> probability = result.course.probability();
  const auto sum_of = [&](const std::string& name, std::vector<double> sum, auto belongs) {
    for (std::size_t k = 0; k < set.size(); ++k) {
      for (std::size_t frame = 0; belongs(k) && frame < sum.size(); ++frame) {
        sum[frame] += probability[k][frame];
      }
    }
    result.configurations.emplace_back(name, std::move(sum));
  };
  const std::vector<double> nothing(result.course.time.size(), 0.0);
  sum_of("none", nothing, [&](std::size_t k) { return blocked_legs(result, k) == 0; });
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    const std::string& name = result.legs[leg].name;
    const auto only = [&result, leg](std::size_t k) { return blocked_legs(result, k) == 1 && blocks(result, k, leg); };
    sum_of(name, nothing, [&](std::size_t k) { return only(k) && result.opening[k][leg] == 0; });
    sum_of(name + "_partial", nothing, [&](std::size_t k) { return only(k) && result.opening[k][leg] > 0; });
  }
  sum_of(PosteriorCourse::none_name, probability.back(), [&](std::size_t k) { return blocked_legs(result, k) > 1; });
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
    nlohmann::json openings;
    for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
      openings[result.legs[leg].name] = result.opening[k][leg];
    }
    json["hypotheses"].push_back({{"name", result.course.names[k]},
                                  {"opening", openings},
                                  {"probability", number_json(last[k])},
                                  {"log_posterior", number_json(log_posterior[k])},
                                  {"squared_misfit", number_json(result.course.evidence[k].before.squared)},
                                  {"measured", number_json(result.course.evidence[k].before.measured)},
                                  {"relocated_ml", number_json(result.course.evidence[k].relocated_ml)}});
  }
  json["frames_run"] = result.course.frames_run;
  json["scouted_frames_run"] = result.course.scouted_frames_run;
  json["followed"] = column_json(result.course.followed);
  return json;
}

}  // namespace example
