// SPDX-License-Identifier: MIT
#pragma once

/// Scalar measurements as evidence: readings of a scale, of a level probe, of anything that gives one number at a time.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/posterior.hpp>

namespace decant::inline DECANT_TARGET {

/// What the readings of one channel are off by although the model is right.
struct ChannelNoise {
  /// Standard deviation of one reading, > 0, in the channel's unit: the sensor's noise, from its data sheet or from
  /// readings at rest. What the model adds to it need not be known, see SeriesMisfit.
  double deviation = 1;
  /// Where deviation is instead that of all that right predictions are off by, the model's share included: the number
  /// of independent readings that it was measured on. 0: deviation is the sensor's alone.
  double measured_on = 0;
  /// How many successive readings are off together, >= 1. Noise of the sensor alone: 1. What a model or a calibration
  /// is off by lasts: seconds or minutes, times the readings per second. readings_per_error() measures it.
  double readings_per_error = 1;
  /// What the channel reads if nothing happens, in its unit: 0 for a scale that was tared, the level before the pour.
  double idle = 0;
};

/// Misfits of one channel's readings, for a source of evidence of its own in a Posterior or a HypothesisFilter:
///   const SeriesMisfit scale({.deviation = 0.002, .readings_per_error = 10});  // [kg]
///   const std::size_t source = filter.add_source(scale.evidence(1));
///   filter.observe(k, scale.misfit(predicted, measured), source);              // the n-th reading, of each hypothesis
///   filter.set_source(source, scale.evidence(n));
///
/// Their unit is the squared deviation of one independent error: a right prediction comes to about one for every
/// readings_per_error readings, whatever their rate. That is what differs from masks, whose unit is a cell and whose
/// share of independent errors is not known: here n, how many there are in all, follows from the number of readings,
/// and least_squared is n as well. Then
///   log p = -(n / 2) log(1 + D / n)
/// is that of normal errors with the sensor's deviation where predictions are as good as the sensor, and that of errors
/// with unknown deviation where they are not: the model's share is integrated out. In between, the variance counts as
/// the sum of both. A deviation of everything, measured on m readings, is worth m readings:
///   log p = -((m + n) / 2) log(1 + D / m),
/// Student's t with m degrees of freedom for a single reading. Channels in different units, or with other errors, are
/// sources of their own.
class SeriesMisfit {
 public:
  /// Throws std::invalid_argument if a number is out of range.
  explicit SeriesMisfit(const ChannelNoise& noise) : noise_(noise) {
    expects(noise.deviation > 0 && std::isfinite(noise.deviation), "SeriesMisfit: deviation", "> 0 and finite",
            noise.deviation);
    expects(noise.readings_per_error >= 1 && std::isfinite(noise.readings_per_error),
            "SeriesMisfit: readings_per_error", ">= 1 and finite", noise.readings_per_error);
    expects(noise.measured_on >= 0 && std::isfinite(noise.measured_on), "SeriesMisfit: measured_on", ">= 0 and finite",
            noise.measured_on);
    expects(std::isfinite(noise.idle), "SeriesMisfit: idle", "finite", noise.idle);
    per_squared_ = 1 / (noise.deviation * noise.deviation * noise.readings_per_error);
  }

  /// Of one reading; a missing one, NaN, says nothing. A prediction that is not finite excludes its hypothesis: where
  /// no liquid is below a level probe, say what it would read then.
  Misfit misfit(double predicted, double measured) const noexcept {
    if (!std::isfinite(measured)) {
      return {};
    }
    const double off = predicted - measured, happened = measured - noise_.idle;
    return {per_squared_ * off * off, per_squared_ * happened * happened};
  }

  /// Of a whole series. Throws std::invalid_argument unless there are as many predictions as readings.
  Misfit misfit(std::span<const double> predicted, std::span<const double> measured) const {
    expects(predicted.size() == measured.size(), "SeriesMisfit: number of predictions", "that of readings",
            predicted.size());
    Misfit sum;
    for (std::size_t k = 0; k < measured.size(); ++k) {
      sum += misfit(predicted[k], measured[k]);
    }
    return sum;
  }

  /// What these misfits are worth when so many readings are in. Where part of what a model is off by lasts for good,
  /// which does not average out, stay at the number of readings in the time that it is trusted for. "None of these" is
  /// off by a third of what happened, a tenth of its square: numbers, unlike masks, are hardly ever off by more.
  EvidenceSettings evidence(double readings) const {
    expects(readings > 0 && std::isfinite(readings), "SeriesMisfit: number of readings", "> 0 and finite", readings);
    const double errors = std::max(1.0, readings / noise_.readings_per_error);
    const double known = noise_.measured_on;
    return {known + errors, known > 0 ? known : errors, 0.1};
  }

  const ChannelNoise& noise() const noexcept { return noise_; }

 private:
  ChannelNoise noise_;
  double per_squared_ = 1;
};

/// How many successive readings are off together, measured on what the best prediction is off by: the integrated
/// autocorrelation time 1 + 2 sum_k rho_k, in readings, summed up to the first lag without correlation (as the initial
/// positive sequence of Geyer, Practical Markov chain Monte Carlo, 1992). About zero, not about the mean: a right model
/// has no offset. Missing readings, NaN, are passed over. Between 1 and the number of readings; 1 if nothing is off.
/// Takes a time that grows with the number of readings times the result.
inline double readings_per_error(std::span<const double> off) noexcept {
  const std::size_t count = off.size();
  const auto mean_product = [&](std::size_t lag) {
    double sum = 0;
    std::size_t pairs = 0, readings = 0;
    for (std::size_t k = 0; k < count; ++k) {
      readings += std::isfinite(off[k]) ? 1 : 0;
      if (k >= lag && std::isfinite(off[k]) && std::isfinite(off[k - lag])) {
        sum += off[k] * off[k - lag];
        ++pairs;
      }
    }
    // few pairs are left at long lags, whose mean would be noise: it counts by their share
    const double share = static_cast<double>(pairs) / static_cast<double>(count - lag);
    return share > 0 ? sum / static_cast<double>(readings) / share : 0.0;
  };
  const double variance = count > 0 ? mean_product(0) : 0;
  if (!(variance > 0)) {
    return 1;
  }
  double time = 1;
  for (std::size_t lag = 1; lag < count; ++lag) {
    const double correlation = mean_product(lag) / variance;
    if (!(correlation > 0)) {
      break;
    }
    time += 2 * correlation;
  }
  return std::min(time, static_cast<double>(count));
}

}  // namespace decant::inline DECANT_TARGET
