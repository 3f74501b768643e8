// SPDX-License-Identifier: MIT
#pragma once

/// One of several unknowns by itself, whatever the others are.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/log_sum.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// A quantity's values, increasing, and the logarithm of the density at each, as ValueDensity and estimate_value take.
struct Marginal {
  std::vector<double> values{};
  std::vector<double> log_density{};  ///< [nat], up to a constant
};

/// Adds up the probabilities of hypotheses in which a quantity has the same value. The other unknowns have to have the
/// same values beside each of it (a grid): their prior is what their values are and how far apart.
/// @param value of the quantity in each hypothesis. @param log_posterior of each [nat], -infinity for none. Throws
/// std::invalid_argument unless there are as many, at least one, all of them numbers.
inline Marginal marginal(std::span<const double> value, std::span<const double> log_posterior) {
  expects(!value.empty() && value.size() == log_posterior.size(), "marginal: number of log posteriors",
          "that of values, at least 1", log_posterior.size());
  constexpr double never = -std::numeric_limits<double>::infinity();
  std::map<double, double> log_sums;
  for (std::size_t k = 0; k < value.size(); ++k) {
    expects(std::isfinite(value[k]), "marginal: value", "finite", value[k]);
    expects(!std::isnan(log_posterior[k]), "marginal: log posterior", "a number", log_posterior[k]);
    double& sum = log_sums.try_emplace(value[k], never).first->second;
    sum = log_sum(sum, log_posterior[k]);
  }
  Marginal result;
  for (const auto& [of, sum] : log_sums) {
    result.values.push_back(of);
    result.log_density.push_back(sum);
  }
  return result;
}

}  // namespace decant::inline DECANT_TARGET
