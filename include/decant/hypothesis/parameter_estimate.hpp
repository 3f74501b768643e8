// SPDX-License-Identifier: MIT
#pragma once

/// What evaluations of a model here and there say of its parameters: a value with an interval, or that they cannot
/// tell.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/evaluation.hpp>
#include <decant/hypothesis/parameter_axis.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/surrogate.hpp>
#include <decant/hypothesis/value_estimate.hpp>

namespace decant::inline DECANT_TARGET {

/// What is known of one parameter, whatever the others are.
struct ParameterEstimate {
  double value = 0;          ///< median, in the unit of its axis
  double low = 0, high = 0;  ///< interval of the confidence asked for
  /// The end of the range is not told from the most probable value, so the interval begins or ends there, and the
  /// parameter may lie beyond. Both: the evaluations say nothing of it.
  bool at_low = false, at_high = false;
  /// Density by share of the range (see ParameterAxis), for charts.
  std::vector<double> share{}, density{};

  /// Both ends of the interval are the evaluations' doing.
  bool told() const noexcept { return !at_low && !at_high; }
};

struct ParameterEstimateSettings {
  PosteriorSettings posterior{};  ///< what ratios of misfits are worth; "none of these" is not asked
  double confidence = 0.9;        ///< of intervals, in (0, 1)
  int draws = 200;                ///< of surrogates, >= 2
  std::uint32_t seed = 1;         ///< of these
};

namespace detail {

/// Densities over a grid of places that are finer than any evaluations: one for each function that the misfit may be.
class DrawnPosterior {
 public:
  static constexpr std::size_t most_axes = 3;

  /// @param axes number of parameters. @param evaluations with at least two misfits.
  DrawnPosterior(std::size_t axes, const Eigen::MatrixXd& places, const Eigen::VectorXd& nats,
                 const ParameterEstimateSettings& settings)
      : axes_(axes), nodes_(nodes_of(axes)) {
    density_ = -Surrogate(places, nats).draw(nodes_, settings.draws, settings.seed);
    expected_ = density_.rowwise().mean();
    weight_ = Eigen::VectorXd::Ones(nodes_.cols());
    for (Eigen::Index node = 0; node < nodes_.cols(); ++node) {
      for (Eigen::Index axis = 0; axis < nodes_.rows(); ++axis) {
        weight_[node] *= nodes_(axis, node) == 0 || nodes_(axis, node) == 1 ? 0.5 : 1;
      }
    }
    for (Eigen::Index draw = 0; draw < density_.cols(); ++draw) {
      density_.col(draw) = (density_.col(draw).array() - density_.col(draw).maxCoeff()).exp();
      density_.col(draw) /= density_.col(draw).dot(weight_);
    }
  }

  /// Places in columns, the first axis the fastest.
  static Eigen::MatrixXd nodes_of(std::size_t axes) {
    const Eigen::Index side = side_of(axes);
    Eigen::Index count = 1;
    for (std::size_t axis = 0; axis < axes; ++axis) {
      count *= side;
    }
    Eigen::MatrixXd nodes(static_cast<Eigen::Index>(axes), count);
    for (Eigen::Index node = 0; node < count; ++node) {
      Eigen::Index rest = node;
      for (Eigen::Index axis = 0; axis < nodes.rows(); ++axis, rest /= side) {
        nodes(axis, node) = static_cast<double>(rest % side) / static_cast<double>(side - 1);
      }
    }
    return nodes;
  }

  /// Nodes along an axis: as many as matrices of all nodes allow.
  static Eigen::Index side_of(std::size_t axes) { return axes == 1 ? 65 : axes == 2 ? 17 : 7; }

  const Eigen::MatrixXd& nodes() const noexcept { return nodes_; }

  /// The misfit that has the log likelihood which is expected at a node.
  double expected_misfit(Eigen::Index node, const PosteriorSettings& settings) const {
    return settings.least_squared * std::expm1(std::max(0.0, -2 * expected_[node] / settings.independent_errors));
  }

  /// How much the density at each node is in doubt: its standard deviation over draws.
  Eigen::VectorXd doubt() const {
    const Eigen::VectorXd mean = density_.rowwise().mean();
    return ((density_.colwise() - mean).array().square().rowwise().mean()).sqrt();
  }

  /// The share of a parameter's variance that is there because the misfit is not known better, the largest of all
  /// parameters: draws have means and variances of their own, and the variance of their means is its part of the whole.
  double unsettled() const {
    double largest = 0;
    for (Eigen::Index axis = 0; axis < nodes_.rows(); ++axis) {
      const Eigen::VectorXd at = nodes_.row(axis).transpose();
      const Eigen::VectorXd means = density_.transpose() * weight_.cwiseProduct(at);
      const Eigen::VectorXd squares = density_.transpose() * weight_.cwiseProduct(at.cwiseProduct(at));
      const double within = (squares.array() - means.array().square()).mean();
      const double between = (means.array() - means.mean()).square().mean();
      largest = std::max(largest, between / std::max(within + between, 1e-12));
    }
    return largest;
  }

  ParameterEstimate estimate(std::size_t number, const ParameterAxis& axis, double confidence) const {
    const Eigen::Index side = side_of(axes_), row = static_cast<Eigen::Index>(number);
    const Eigen::VectorXd mean = density_.rowwise().mean();
    ParameterEstimate result;
    result.share.resize(static_cast<std::size_t>(side));
    result.density.assign(static_cast<std::size_t>(side), 0);
    for (Eigen::Index node = 0; node < nodes_.cols(); ++node) {
      const double at = nodes_(row, node);
      const auto place = static_cast<std::size_t>(std::lround(at * static_cast<double>(side - 1)));
      result.share[place] = at;
      result.density[place] += mean[node] * weight_[node] / (at == 0 || at == 1 ? 0.5 : 1);
    }
    std::vector<double> log_density;
    double total = 0;
    for (std::size_t k = 0; k < result.density.size(); ++k) {
      log_density.push_back(std::log(result.density[k]));
      total += result.density[k] * (k == 0 || k + 1 == result.density.size() ? 0.5 : 1) / static_cast<double>(side - 1);
    }
    for (double& density : result.density) {
      density /= total;
    }
    const ValueDensity density(result.share, log_density);
    // A normal density falls to so much of its height where its interval ends.
    const double tail = 0.5 * (1 - confidence);
    const double least = std::exp(-0.5 * normal_quantile(tail) * normal_quantile(tail)) *
                         *std::max_element(result.density.begin(), result.density.end());
    result.at_low = result.density.front() >= least;
    result.at_high = result.density.back() >= least;
    const auto between = [&](double from, double to) {
      result.low = axis.at(from);
      result.high = axis.at(to);
    };
    if (result.at_low && result.at_high) {
      between(0, 1);
    } else if (result.at_low) {
      between(0, density.quantile(confidence));
    } else if (result.at_high) {
      between(density.quantile(1 - confidence), 1);
    } else {
      between(density.quantile(tail), density.quantile(1 - tail));
    }
    result.value = axis.at(density.quantile(0.5));
    return result;
  }

 private:
  // By bisection of the distribution function: asked once in a search.
  static double normal_quantile(double share) {
    double low = -10, high = 10;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (0.5 * std::erfc(-middle / std::sqrt(2.0)) < share ? low : high) = middle;
    }
    return low;
  }

  std::size_t axes_;
  Eigen::MatrixXd nodes_;
  Eigen::VectorXd weight_{};    // of nodes in integrals
  Eigen::VectorXd expected_{};  // log likelihood by node [nat]
  Eigen::MatrixXd density_{};   // by node and draw
};

inline void validate(const std::vector<ParameterAxis>& axes, const ParameterEstimateSettings& settings,
                     const std::string& what) {
  expects(!axes.empty() && axes.size() <= DrawnPosterior::most_axes, what + ": axes", "1 to 3", axes.size());
  for (const ParameterAxis& axis : axes) {
    decant::validate(axis);
  }
  expects(settings.confidence > 0 && settings.confidence < 1, what + ": confidence", "in (0, 1)", settings.confidence);
  expects(settings.draws >= 2, what + ": draws", ">= 2", settings.draws);
}

/// Nothing where fewer than two evaluations gave a misfit. Those that failed count as the worst that did not, so that
/// they repel, but say nothing more.
inline std::optional<DrawnPosterior> drawn_posterior(const std::vector<ParameterAxis>& axes,
                                                     const std::vector<Evaluation>& evaluations,
                                                     const ParameterEstimateSettings& settings) {
  const Posterior likelihood(settings.posterior);
  const auto count = static_cast<Eigen::Index>(evaluations.size());
  Eigen::MatrixXd places(static_cast<Eigen::Index>(axes.size()), count);
  Eigen::VectorXd nats(count);
  double worst = -std::numeric_limits<double>::infinity();
  int working = 0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Evaluation& one = evaluations[static_cast<std::size_t>(k)];
    expects(one.point.size() == axes.size(), "ParameterEstimate: values of an evaluation", "one for each axis",
            one.point.size());
    for (Eigen::Index axis = 0; axis < places.rows(); ++axis) {
      const auto number = static_cast<std::size_t>(axis);
      places(axis, k) = axes[number].share_of(one.point[number]);
    }
    nats[k] = -likelihood.log_likelihood(one.misfit());
    if (std::isfinite(nats[k])) {
      worst = std::max(worst, nats[k]);
      ++working;
    }
  }
  if (working < 2) {
    return std::nullopt;
  }
  return DrawnPosterior(axes.size(), places, nats.unaryExpr([&](double x) { return std::isfinite(x) ? x : worst; }),
                        settings);
}

}  // namespace detail

/// What evaluations say of each parameter, whatever the others are: between evaluations the log likelihood
/// (Posterior's, in which ratios of misfits count) may be any of the functions that a Surrogate draws; the density is
/// the mean of theirs. Before anything is seen all places of the range are equally likely.
/// @return one for each axis; nothing where fewer than two evaluations gave a misfit. Throws std::invalid_argument if
/// axes (1 to 3) or settings make no sense.
inline std::vector<ParameterEstimate> estimate_parameters(const std::vector<ParameterAxis>& axes,
                                                          const std::vector<Evaluation>& evaluations,
                                                          const ParameterEstimateSettings& settings = {}) {
  detail::validate(axes, settings, "estimate_parameters");
  std::vector<ParameterEstimate> result;
  if (const auto posterior = detail::drawn_posterior(axes, evaluations, settings)) {
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      result.push_back(posterior->estimate(axis, axes[axis], settings.confidence));
    }
  }
  return result;
}

}  // namespace decant::inline DECANT_TARGET
