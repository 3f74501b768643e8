// SPDX-License-Identifier: MIT
#pragma once

/// Hypotheses about a model of scalar series, weighed by a whole recording of such series.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/executor.hpp>
#include <decant/hypothesis/marginal.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/series_misfit.hpp>
#include <decant/hypothesis/series_model.hpp>

namespace decant::inline DECANT_TARGET {

/// One channel of a recording.
struct MeasuredChannel {
  std::vector<double> values{};  ///< one for each time, NaN where a reading is missing
  ChannelNoise noise{};          ///< readings_per_error 0: to be found from what the best prediction is off by
};

struct SeriesFitSettings {
  double none_prior = 0.05;  ///< of "none of these", see PosteriorSettings
  /// By hypothesis, up to a constant [nat]; empty: all are as probable beforehand.
  std::vector<double> log_prior{};
};

/// Hypotheses, what they predicted, and what that is worth.
struct SeriesFit {
  std::vector<std::vector<double>> hypotheses{};
  std::vector<double> log_prior{};  ///< by hypothesis [nat]
  /// By hypothesis and channel.
  std::vector<std::vector<std::vector<double>>> predicted{};
  std::vector<ChannelNoise> noise{};  ///< by channel, as it was used
  Posterior posterior{};              ///< each channel is a source

  const std::vector<std::vector<double>>& best() const { return predicted.at(posterior.best()); }

  /// One of the parameters by itself, for ValueDensity and estimate_value. Throws std::invalid_argument for one that
  /// not all hypotheses have.
  Marginal marginal_of(std::size_t parameter) const {
    std::vector<double> value, log_posterior;
    for (std::size_t k = 0; k < hypotheses.size(); ++k) {
      expects(parameter < hypotheses[k].size(), "SeriesFit: parameter", "one that each hypothesis has", parameter);
      value.push_back(hypotheses[k][parameter]);
      log_posterior.push_back(posterior.log_posterior(k));
    }
    return marginal(value, log_posterior);
  }
};

namespace detail {

inline std::vector<SeriesMisfit> series_misfits(const std::vector<ChannelNoise>& noise) {
  std::vector<SeriesMisfit> misfits;
  for (const ChannelNoise& of : noise) {
    misfits.emplace_back(of);
  }
  return misfits;
}

inline double readings_in(const MeasuredChannel& channel) {
  return static_cast<double>(
      std::count_if(channel.values.begin(), channel.values.end(), [](double value) { return std::isfinite(value); }));
}

inline Posterior weigh_series(const SeriesFit& fit, std::span<const MeasuredChannel> measured, double none_prior) {
  const std::vector<SeriesMisfit> misfits = series_misfits(fit.noise);
  const auto evidence = [&](std::size_t channel) { return misfits[channel].evidence(readings_in(measured[channel])); };
  const EvidenceSettings first = evidence(0);
  Posterior posterior({first.independent_errors, first.least_squared, first.hopeless_share, none_prior});
  for (std::size_t channel = 1; channel < measured.size(); ++channel) {
    posterior.add_source(evidence(channel));
  }
  for (std::size_t hypothesis = 0; hypothesis < fit.predicted.size(); ++hypothesis) {
    posterior.add(fit.log_prior[hypothesis]);
    for (std::size_t channel = 0; channel < measured.size(); ++channel) {
      const std::vector<double>& predicted = fit.predicted[hypothesis][channel];
      posterior.observe(hypothesis, misfits[channel].misfit(predicted, measured[channel].values), channel);
    }
  }
  return posterior;
}

}  // namespace detail

/// Weighs hypotheses by recorded channels: predictions are jobs of the executor, the rest
/// takes next to no time. For readings that come one by one, feed a Posterior with SeriesMisfit.
/// @param hypotheses parameters of the model. @param times of the readings [s], increasing. @param measured in the
/// order of the model's channels.
/// Throws std::invalid_argument if there is nothing to weigh or by, if numbers of channels or readings disagree, or if
/// no hypothesis could be predicted and errors were to be found; and whatever the model throws.
template <SeriesModel Model, Executor E>
SeriesFit fit_series(const Model& model, std::vector<std::vector<double>> hypotheses, std::span<const double> times,
                     std::span<const MeasuredChannel> measured, E&& executor, const SeriesFitSettings& settings = {}) {
  expects(!hypotheses.empty(), "fit_series: number of hypotheses", "at least 1", 0);
  expects(settings.log_prior.empty() || settings.log_prior.size() == hypotheses.size(), "fit_series: number of priors",
          "that of hypotheses", settings.log_prior.size());
  expects(!measured.empty(), "fit_series: number of channels", "at least 1", 0);
  SeriesFit fit;
  fit.hypotheses = std::move(hypotheses);
  fit.log_prior = settings.log_prior.empty() ? std::vector<double>(fit.hypotheses.size(), 0.0) : settings.log_prior;
  for (std::size_t channel = 0; channel < measured.size(); ++channel) {
    const std::string name = "fit_series: channel " + std::to_string(channel) + ": number of ";
    expects(measured[channel].values.size() == times.size(), name + "values", "that of times",
            measured[channel].values.size());
    expects(detail::readings_in(measured[channel]) > 0, name + "readings", "at least 1", 0);
    fit.noise.push_back(measured[channel].noise);
  }
  const std::size_t channels = measured.size();
  const std::vector<JobResult> results = executor.run(
      fit.hypotheses.size(),
      [&](std::size_t k) {
        const std::vector<std::vector<double>> predicted = model.predict(fit.hypotheses[k], times);
        expects(predicted.size() == channels, "fit_series: number of predicted channels", "that of measured ones",
                predicted.size());
        JobResult flat;
        for (const std::vector<double>& channel : predicted) {
          expects(channel.size() == times.size(), "fit_series: number of predictions of a channel", "that of times",
                  channel.size());
          flat.insert(flat.end(), channel.begin(), channel.end());
        }
        return flat;
      },
      tell_nobody);
  for (const JobResult& flat : results) {
    auto& predicted = fit.predicted.emplace_back();
    for (std::size_t channel = 0; channel < channels; ++channel) {
      const auto begin = flat.begin() + static_cast<std::ptrdiff_t>(channel * times.size());
      predicted.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(times.size()));
    }
  }
  const auto asked = [](const ChannelNoise& noise) { return noise.readings_per_error == 0; };
  if (std::any_of(fit.noise.begin(), fit.noise.end(), asked)) {
    std::vector<ChannelNoise> given = fit.noise;
    for (ChannelNoise& noise : fit.noise) {
      noise.readings_per_error = asked(noise) ? 1 : noise.readings_per_error;
    }
    const Posterior first = detail::weigh_series(fit, measured, settings.none_prior);
    expects(!first.excluded(first.best()), "fit_series: hypotheses that could be predicted", "at least 1", 0);
    for (std::size_t channel = 0; channel < channels; ++channel) {
      if (asked(given[channel])) {
        std::vector<double> off = fit.predicted[first.best()][channel];
        for (std::size_t k = 0; k < off.size(); ++k) {
          off[k] -= measured[channel].values[k];
        }
        fit.noise[channel].readings_per_error = readings_per_error(off);
      }
    }
  }
  fit.posterior = detail::weigh_series(fit, measured, settings.none_prior);
  return fit;
}

}  // namespace decant::inline DECANT_TARGET
