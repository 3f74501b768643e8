// SPDX-License-Identifier: MIT
#pragma once

/// A search for parameters where evaluations are dear and noisy: it asks where the answer depends on it most, and ends
/// when the answer does not.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/evaluation.hpp>
#include <decant/hypothesis/parameter_axis.hpp>
#include <decant/hypothesis/parameter_estimate.hpp>

namespace decant::inline DECANT_TARGET {

struct SurrogateSearchSettings {
  ParameterEstimateSettings estimate{};
  int most_evaluations = 40;  ///< >= first_evaluations
  int first_evaluations = 0;  ///< spread over the range before anything is known, >= 3; 0: 4 for each axis and one
  int batch = 2;              ///< evaluations asked for at a time, >= 1; with more, some are in vain
  /// It ends when what is not known of the misfit makes up less than this share of each parameter's variance, > 0.
  double unsettled = 0.1;
};

struct SurrogateSearchResult {
  std::vector<Evaluation> evaluations{};  ///< in the order in which they were made
  std::size_t best = 0;                   ///< the lowest misfit; of equals the first. Noise has a part in it
  /// One for each axis, see estimate_parameters; none if nothing works.
  std::vector<ParameterEstimate> parameters{};
  double unsettled = 1;  ///< the share that is left, see the settings
  SearchEnd end = SearchEnd::Budget;
};

namespace detail {

/// Places that are spread evenly over each axis, both ends included, and over the space: of the lattices
/// (k, k g, k g^2 ..) modulo the count the one whose nearest places are farthest apart.
inline Eigen::MatrixXd spread_places(Eigen::Index axes, Eigen::Index count) {
  const auto lattice = [&](Eigen::Index generator) {
    Eigen::MatrixXd places(axes, count);
    for (Eigen::Index k = 0; k < count; ++k) {
      Eigen::Index place = k;
      for (Eigen::Index axis = 0; axis < axes; ++axis, place = place * generator % count) {
        places(axis, k) = static_cast<double>(place) / static_cast<double>(count - 1);
      }
    }
    return places;
  };
  Eigen::MatrixXd best = lattice(1);
  double farthest = 0;
  for (Eigen::Index generator = 1; generator < count; ++generator) {
    if (std::gcd(generator, count) != 1) {
      continue;
    }
    const Eigen::MatrixXd places = lattice(generator);
    double nearest = 1e300;
    for (Eigen::Index a = 0; a < count; ++a) {
      for (Eigen::Index b = a + 1; b < count; ++b) {
        nearest = std::min(nearest, (places.col(a) - places.col(b)).squaredNorm());
      }
    }
    if (nearest > farthest) {
      best = places;
      farthest = nearest;
    }
  }
  return best;
}

}  // namespace detail

/// Evaluates places that are spread over the ranges, then again and again those where the posterior density is most in
/// doubt, given all functions that the misfit may be (Surrogate): there an evaluation changes the answer most.
/// (Expected improvement, the usual choice, looks for the lowest misfit and leaves the ends of the intervals open; cf.
/// Jarvenpaa et al. 2021, "Parallel Gaussian process surrogate Bayesian inference with noisy likelihood evaluations",
/// Bayesian Analysis 16.) For the later places of a batch, the earlier ones count as evaluated with what is expected of
/// them. No place is evaluated twice. Throws std::invalid_argument if axes (1 to 3) or settings make no sense, and what
/// evaluate throws.
template <PointEvaluator Evaluate>
SurrogateSearchResult surrogate_search(const std::vector<ParameterAxis>& axes, Evaluate&& evaluate,
                                       const SurrogateSearchSettings& settings = {}) {
  detail::validate(axes, settings.estimate, "surrogate_search");
  const int first = settings.first_evaluations > 0 ? settings.first_evaluations : 4 * static_cast<int>(axes.size()) + 1;
  expects(first >= 3 && settings.first_evaluations >= 0, "surrogate_search: first_evaluations", "0 or >= 3",
          settings.first_evaluations);
  expects(settings.most_evaluations >= first, "surrogate_search: most_evaluations",
          "at least first_evaluations, " + std::to_string(first), settings.most_evaluations);
  expects(settings.batch >= 1, "surrogate_search: batch", ">= 1", settings.batch);
  expects(settings.unsettled > 0, "surrogate_search: unsettled", "> 0", settings.unsettled);

  const Eigen::MatrixXd nodes = detail::DrawnPosterior::nodes_of(axes.size());
  const auto side = static_cast<double>(detail::DrawnPosterior::side_of(axes.size()) - 1);
  std::vector<bool> taken(static_cast<std::size_t>(nodes.cols()), false);
  const auto point_of = [&](Eigen::Index node) {
    std::vector<double> point;
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      point.push_back(axes[axis].at(nodes(static_cast<Eigen::Index>(axis), node)));
    }
    return point;
  };

  SurrogateSearchResult search;
  std::vector<std::vector<double>> points;
  const Eigen::MatrixXd spread = detail::spread_places(nodes.rows(), first);
  for (Eigen::Index k = 0; k < spread.cols(); ++k) {
    Eigen::Index node = 0, stride = 1;
    for (Eigen::Index axis = 0; axis < nodes.rows(); ++axis, stride *= static_cast<Eigen::Index>(side) + 1) {
      node += stride * static_cast<Eigen::Index>(std::lround(spread(axis, k) * side));
    }
    if (!taken[static_cast<std::size_t>(node)]) {  // more places than nodes
      taken[static_cast<std::size_t>(node)] = true;
      points.push_back(point_of(node));
    }
  }
  while (true) {
    detail::add_evaluations(points, evaluate, search.evaluations);
    points.clear();
    search.best = detail::best_of(search.evaluations);
    const auto posterior = detail::drawn_posterior(axes, search.evaluations, settings.estimate);
    if (!posterior) {
      search.end = SearchEnd::NothingWorks;
      return search;
    }
    search.unsettled = posterior->unsettled();
    const std::size_t left = static_cast<std::size_t>(settings.most_evaluations) - search.evaluations.size();
    const auto free = static_cast<std::size_t>(std::count(taken.begin(), taken.end(), false));
    const std::size_t wanted = std::min({static_cast<std::size_t>(settings.batch), left, free});
    if (search.unsettled < settings.unsettled || wanted == 0) {
      search.end = search.unsettled < settings.unsettled ? SearchEnd::Found : SearchEnd::Budget;
      for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        search.parameters.push_back(posterior->estimate(axis, axes[axis], settings.estimate.confidence));
      }
      return search;
    }
    std::vector<Evaluation> believed = search.evaluations;
    for (auto now = posterior; points.size() < wanted;) {
      const Eigen::VectorXd doubt = now->doubt();
      Eigen::Index next = -1;
      for (Eigen::Index node = 0; node < nodes.cols(); ++node) {
        if (!taken[static_cast<std::size_t>(node)] && (next < 0 || doubt[node] > doubt[next])) {
          next = node;
        }
      }
      taken[static_cast<std::size_t>(next)] = true;
      points.push_back(point_of(next));
      if (points.size() < wanted) {
        believed.push_back({points.back(), {now->expected_misfit(next, settings.estimate.posterior)}});
        now = detail::drawn_posterior(axes, believed, settings.estimate);
      }
    }
  }
}

}  // namespace decant::inline DECANT_TARGET
