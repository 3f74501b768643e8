// SPDX-License-Identifier: MIT
#pragma once

/// Saves most of what many hypotheses cost: all of them are followed in coarse particles first, and in fine ones only
/// those that this leaves worth it.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/log_sum.hpp>
#include <decant/io/recording.hpp>

#include "hypothesis_run.hpp"

namespace example {

struct ScoutingSettings {
  double spacing = 0;  ///< of the coarse particles [m]; not above that of fine ones: all are followed in those
  /// Hypotheses below this share of the best one's probability, all frames considered, are not followed in fine
  /// particles, unless they are neighbours of one that is.
  double least_probability = 0.01;
};

/// Hypotheses without their models, which are made as they are needed.
struct HypothesisSet {
  std::vector<std::string> names;
  std::vector<double> log_prior;  ///< see HypothesisFilter [nat]
  std::function<TrackingModel(std::size_t hypothesis, double spacing)> model;
  /// Whether two of them differ so little that coarse particles may take one for the other.
  std::function<bool(std::size_t, std::size_t)> neighbours;

  std::size_t size() const { return names.size(); }
};

namespace detail {

inline std::vector<NamedModel> models_of(const HypothesisSet& set, const std::vector<std::size_t>& chosen,
                                         double spacing) {
  std::vector<NamedModel> models;
  models.reserve(chosen.size());
  for (const std::size_t k : chosen) {
    models.push_back({set.names[k], set.model(k, spacing), set.log_prior[k]});
  }
  return models;
}

inline double log_sum_of(const std::vector<double>& logs) {
  double sum = -std::numeric_limits<double>::infinity();
  for (const double each : logs) {
    sum = decant::log_sum(sum, each);
  }
  return sum;
}

inline double highest_of(const PosteriorCourse& course, const std::vector<std::size_t>& chosen, std::size_t frame) {
  double highest = -std::numeric_limits<double>::infinity();
  for (const std::size_t k : chosen) {
    highest = std::max(highest, course.log_posterior[k][frame]);
  }
  return highest;
}

}  // namespace detail

/// Those that are worth fine particles, in order.
inline std::vector<std::size_t> worth_following(const PosteriorCourse& scouted, const HypothesisSet& set,
                                                double least_probability) {
  const std::vector<double> log_posterior = scouted.last_log_posterior();
  const double highest = *std::max_element(log_posterior.begin(), log_posterior.end());
  const auto probable = [&](std::size_t k) { return log_posterior[k] >= highest + std::log(least_probability); };
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < set.size(); ++k) {
    bool worth = probable(k);
    for (std::size_t other = 0; other < set.size() && !worth; ++other) {
      worth = other != k && probable(other) && set.neighbours(k, other);
    }
    if (worth) {
      chosen.push_back(k);
    }
  }
  return chosen;
}

/// What fine particles say of those that were followed in them, and coarse ones of the others: how far those are behind
/// the best of the former, in each frame by what had been seen until then.
inline PosteriorCourse joined_courses(PosteriorCourse fine, const std::vector<std::size_t>& chosen,
                                      const PosteriorCourse& scouted, const std::vector<double>& log_prior) {
  PosteriorCourse course = scouted;
  course.time = fine.time;
  course.overlays = std::move(fine.overlays);
  course.followed = std::move(fine.followed);
  course.scouted_frames_run = scouted.frames_run;
  course.frames_run = fine.frames_run;
  course.status = fine.status;
  const std::size_t frames = fine.time.size();
  std::vector<double> chosen_priors;
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    course.log_posterior[chosen[n]] = std::move(fine.log_posterior[n]);
    course.evidence[chosen[n]] = fine.evidence[n];
    chosen_priors.push_back(log_prior[chosen[n]]);
  }
  for (std::size_t k = 0; k < course.names.size(); ++k) {
    if (std::find(chosen.begin(), chosen.end(), k) == chosen.end()) {
      course.log_posterior[k].resize(frames);
      for (std::size_t frame = 0; frame < frames; ++frame) {
        course.log_posterior[k][frame] +=
            detail::highest_of(course, chosen, frame) - detail::highest_of(scouted, chosen, frame);
      }
    }
  }
  // "none of these" has its share of all hypotheses, of which the fine run had some
  course.log_none = std::move(fine.log_none);
  const double all = detail::log_sum_of(log_prior), followed = detail::log_sum_of(chosen_priors);
  for (double& log_none : course.log_none) {
    log_none += all - followed;
  }
  return course;
}

/// As weigh_by. @param progress is told the share that is done, 0 .. 1.
inline PosteriorCourse weigh_scouted(const std::string& method, const decant::Recording& recording,
                                     const HypothesisSet& set, const TrackingOptions& options,
                                     const WeighingSettings& settings, const ScoutingSettings& scouting,
                                     const std::function<void(double)>& progress) {
  std::vector<std::size_t> all(set.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto follow = [&](const std::vector<std::size_t>& chosen, double spacing, double from, double to) {
    TrackingOptions own = options;
    own.spacing = spacing;
    own.keep_overlays = options.keep_overlays && spacing == options.spacing;
    return weigh_by(method, recording, detail::models_of(set, chosen, spacing), own, settings,
                    [&](double share) { progress(std::lerp(from, to, share)); });
  };
  if (scouting.spacing <= options.spacing) {
    return follow(all, options.spacing, 0, 1);
  }
  const PosteriorCourse scouted = follow(all, scouting.spacing, 0, 0.25);
  if (scouted.status != "ok" || scouted.time.empty()) {
    return follow(all, options.spacing, 0.25, 1);
  }
  const std::vector<std::size_t> chosen = worth_following(scouted, set, scouting.least_probability);
  PosteriorCourse fine = follow(chosen, options.spacing, 0.25, 1);
  return joined_courses(std::move(fine), chosen, scouted, set.log_prior);
}

}  // namespace example
