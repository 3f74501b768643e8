// SPDX-License-Identifier: MIT
#pragma once

/// What a function that is dear to evaluate, and noisy, may be between the places where it was.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Gaussian processes with a Matern 5/2 covariance and a length for each axis, plus noise (Rasmussen and Williams,
/// Gaussian Processes for Machine Learning, 2006, section 5.4). The mean and the variance are integrated out under flat
/// priors (Santner, Williams and Notz, The Design and Analysis of Computer Experiments, 2003, section 4.1); lengths and
/// the share of noise are not chosen but weighed by their marginal likelihood: a handful of evaluations fits many of
/// them about as well, and one that is chosen would be too sure.
/// Noise is that of places: simulations are chaotic, but the same one twice gives the same.
class Surrogate {
 public:
  /// @param places a column for each evaluation, coordinates 0 .. 1. @param values finite, at least two. Throws
  /// std::invalid_argument otherwise.
  Surrogate(Eigen::MatrixXd places, const Eigen::VectorXd& values) : places_(std::move(places)) {
    expects(values.size() >= 2 && values.size() == places_.cols(), "Surrogate: number of values",
            "that of places, at least 2", values.size());
    expects(values.allFinite() && places_.allFinite(), "Surrogate: values and places", "finite", "others");
    weigh(values);
  }

  /// Functions that may be, as values at some places (a column each), a function in each column. They are drawn with a
  /// generator of their own: equal arguments give equal draws.
  Eigen::MatrixXd draw(const Eigen::MatrixXd& at, int count, std::uint32_t seed) const {
    Eigen::MatrixXd result(at.cols(), count);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    const double freedom = static_cast<double>(places_.cols() - 1);
    std::gamma_distribution<double> half_chi_squared(0.5 * freedom, 1);
    // each of the candidates that are drawn from costs a factorization
    constexpr int together = 8;
    const int groups = (count + together - 1) / together;
    int column = 0;
    double below = 0;
    for (const Candidate& candidate : candidates_) {
      below += candidate.weight;
      const int end = std::clamp(together * static_cast<int>(std::floor(below * groups + 0.5)), column, count);
      if (end == column) {
        continue;
      }
      const Process process = process_of(candidate);
      Eigen::MatrixXd across = covariance(candidate, at, places_);  // places in columns
      const Eigen::MatrixXd gain = process.factor.solve(across.transpose());
      const Eigen::VectorXd unexplained =
          Eigen::VectorXd::Ones(at.cols()) - gain.transpose() * Eigen::VectorXd::Ones(places_.cols());
      const Eigen::VectorXd mean =
          Eigen::VectorXd::Constant(at.cols(), candidate.mean) + across * process.factor.solve(process.rest);
      Eigen::MatrixXd spread = covariance(candidate, at, at) - across * gain +
                               unexplained * unexplained.transpose() / process.precision_of_mean;
      const Eigen::MatrixXd root = root_of(std::move(spread));
      for (; column < end; ++column) {
        const double deviation = std::sqrt(0.5 * candidate.squares / half_chi_squared(random));
        const Eigen::VectorXd drawn = Eigen::VectorXd::NullaryExpr(at.cols(), [&] { return normal(random); });
        result.col(column) = mean + deviation * (root * drawn);
      }
    }
    return result;
  }

  /// Standard deviation of noise in the values, expected.
  double noise() const noexcept {
    double total = 0;
    for (const Candidate& candidate : candidates_) {
      total += candidate.weight * std::sqrt(candidate.noise * candidate.squares / static_cast<double>(places_.cols()));
    }
    return total;
  }

 private:
  struct Candidate {
    Eigen::VectorXd length;  ///< by axis
    double noise;            ///< variance, as a share of the process'
    double mean = 0;
    double squares = 0;  ///< what is left of the values in units of the process' variance
    double weight = 0;
  };
  struct Process {
    Eigen::LLT<Eigen::MatrixXd> factor;
    Eigen::VectorXd rest;  ///< values less mean
    double precision_of_mean;
  };

  // From a tenth of the range, below which a dozen evaluations would say nothing, to a function that is nearly a
  // parabola; noise from rounding to next to nothing else.
  static constexpr double lengths[] = {0.12, 0.25, 0.5, 1, 2, 4};
  static constexpr double noises[] = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 10};

  static Eigen::MatrixXd covariance(const Candidate& candidate, const Eigen::MatrixXd& rows,
                                    const Eigen::MatrixXd& columns) {
    Eigen::MatrixXd result(rows.cols(), columns.cols());
    for (Eigen::Index column = 0; column < columns.cols(); ++column) {
      for (Eigen::Index row = 0; row < rows.cols(); ++row) {
        const double squared =
            5 * ((rows.col(row) - columns.col(column)).array() / candidate.length.array()).square().sum();
        const double r = std::sqrt(squared);
        result(row, column) = (1 + r + squared / 3) * std::exp(-r);
      }
    }
    return result;
  }

  Eigen::LLT<Eigen::MatrixXd> factor_of(const Candidate& candidate) const {
    Eigen::MatrixXd matrix = covariance(candidate, places_, places_);
    matrix.diagonal().array() += candidate.noise;
    return Eigen::LLT<Eigen::MatrixXd>(matrix);
  }

  Process process_of(const Candidate& candidate) const {
    Process process{factor_of(candidate), values_.array() - candidate.mean, 0};
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(values_.size());
    process.precision_of_mean = ones.dot(process.factor.solve(ones));
    return process;
  }

  // Smooth functions at many places have a covariance that rounding takes below zero.
  static Eigen::MatrixXd root_of(Eigen::MatrixXd covariance) {
    for (double more = 1e-9;; more *= 10) {
      covariance.diagonal().array() += more;
      const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
      if (factor.info() == Eigen::Success || more > 1e-3) {
        return factor.matrixL();
      }
    }
  }

  void weigh(const Eigen::VectorXd& values) {
    values_ = values;
    const Eigen::Index axes = places_.rows();
    const double freedom = static_cast<double>(values.size() - 1);
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(values.size());
    std::vector<std::size_t> which(static_cast<std::size_t>(axes), 0);
    std::vector<double> log_weight;
    double largest = -std::numeric_limits<double>::infinity();
    for (bool more = true; more;) {
      Candidate candidate{Eigen::VectorXd(axes), 0};
      for (Eigen::Index axis = 0; axis < axes; ++axis) {
        candidate.length[axis] = lengths[which[static_cast<std::size_t>(axis)]];
      }
      for (const double noise : noises) {
        candidate.noise = noise;
        const Eigen::LLT<Eigen::MatrixXd> factor = factor_of(candidate);
        if (factor.info() != Eigen::Success) {
          continue;
        }
        const Eigen::VectorXd whitened_ones = factor.solve(ones);
        const double precision = ones.dot(whitened_ones);
        candidate.mean = whitened_ones.dot(values) / precision;
        const Eigen::VectorXd rest = values.array() - candidate.mean;
        // differences of less than a hundred-thousandth are rounding
        candidate.squares = std::max(rest.dot(factor.solve(rest)), 1e-10 * freedom);
        const double log_determinant = 2 * Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
        log_weight.push_back(-0.5 * (log_determinant + std::log(precision) + freedom * std::log(candidate.squares)));
        largest = std::max(largest, log_weight.back());
        candidates_.push_back(candidate);
      }
      more = false;
      for (std::size_t axis = 0; axis < which.size() && !more; ++axis) {
        more = ++which[axis] < std::size(lengths);
        which[axis] = more ? which[axis] : 0;
      }
    }
    double total = 0;
    for (std::size_t k = 0; k < candidates_.size(); ++k) {
      candidates_[k].weight = std::exp(log_weight[k] - largest);
      total += candidates_[k].weight;
    }
    for (Candidate& candidate : candidates_) {
      candidate.weight /= total;
    }
  }

  Eigen::MatrixXd places_;
  Eigen::VectorXd values_{};
  std::vector<Candidate> candidates_{};
};

}  // namespace decant::inline DECANT_TARGET
