// SPDX-License-Identifier: MIT
#pragma once

/// The search for a liquid's parameters in Schenck and Fox 2017: from point to point of a grid, the best one first.

#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/evaluation.hpp>
#include <decant/hypothesis/parameter_axis.hpp>

namespace decant::inline DECANT_TARGET {

struct BestFirstSettings {
  int most_evaluations = 200;  ///< >= 1
  /// So many points are expanded, the best first, after one that is better than all was found, >= 0. With 0 the search
  /// ends in the first local minimum of the grid, as the paper's does.
  int patience = 0;
};

struct BestFirstResult {
  std::vector<Evaluation> evaluations{};  ///< in the order in which they were made
  std::size_t best = 0;                   ///< the lowest misfit; of equals the first
  SearchEnd end = SearchEnd::Budget;      ///< Found: at a minimum of the grid
};

/// Evaluates the grid point nearest to the start, then expands again and again the best point that was not expanded
/// yet: evaluates its neighbours, one step up and down each axis. Ends when nothing that is left to expand is as good
/// as the best point is (points that are equally good, a plateau, are all expanded), or the budget is spent. Points
/// that fail are never expanded. Neighbours are evaluated as one batch, so that they can run side by side.
/// @param start a value for each axis. Throws std::invalid_argument if axes, start or settings make no sense, and what
/// evaluate throws.
template <PointEvaluator Evaluate>
BestFirstResult best_first_search(const std::vector<ParameterAxis>& axes, const std::vector<double>& start,
                                  Evaluate&& evaluate, const BestFirstSettings& settings = {}) {
  expects(!axes.empty(), "best_first_search: axes", "at least one", axes.size());
  for (const ParameterAxis& axis : axes) {
    validate(axis);
  }
  expects(start.size() == axes.size(), "best_first_search: values of the start", "one for each axis", start.size());
  expects(settings.most_evaluations >= 1, "best_first_search: most_evaluations", ">= 1", settings.most_evaluations);
  expects(settings.patience >= 0, "best_first_search: patience", ">= 0", settings.patience);

  using GridPoint = std::vector<int>;
  struct Known {
    std::size_t number;
    bool expanded;
  };
  BestFirstResult search;
  std::map<GridPoint, Known> known;
  std::vector<GridPoint> places;  // of the evaluations
  bool budget_spent = false;      // with points left that should have been evaluated
  const auto evaluate_new = [&](const std::vector<GridPoint>& wanted) {
    std::vector<std::vector<double>> points;
    for (const GridPoint& place : wanted) {
      if (known.contains(place)) {
        continue;
      }
      budget_spent = places.size() >= static_cast<std::size_t>(settings.most_evaluations);
      if (!budget_spent) {
        known[place] = {places.size(), false};
        places.push_back(place);
        std::vector<double>& point = points.emplace_back();
        for (std::size_t axis = 0; axis < axes.size(); ++axis) {
          point.push_back(axes[axis].grid_value(place[axis]));
        }
      }
    }
    if (!points.empty()) {
      detail::add_evaluations(points, evaluate, search.evaluations);
    }
    search.best = detail::best_of(search.evaluations);
  };

  GridPoint first;
  for (std::size_t axis = 0; axis < axes.size(); ++axis) {
    expects(!std::isnan(start[axis]), "best_first_search: start of '" + axes[axis].name + "'", "a number", start[axis]);
    first.push_back(axes[axis].nearest(start[axis]));
  }
  evaluate_new({first});
  int fruitless = 0;
  while (true) {
    Known* next = nullptr;
    double lowest = std::numeric_limits<double>::infinity();
    for (const GridPoint& place : places) {  // in the order of their evaluation: of equals the first
      Known& one = known.at(place);
      if (const double misfit = search.evaluations[one.number].misfit(); !one.expanded && misfit < lowest) {
        next = &one;
        lowest = misfit;
      }
    }
    const double best = search.evaluations[search.best].misfit();
    if (!std::isfinite(best)) {
      search.end = SearchEnd::NothingWorks;
      return search;
    }
    if (budget_spent) {
      search.end = SearchEnd::Budget;
      return search;
    }
    if (next == nullptr || (lowest > best && fruitless >= settings.patience)) {
      search.end = SearchEnd::Found;
      return search;
    }
    next->expanded = true;
    const GridPoint middle = places[next->number];
    std::vector<GridPoint> neighbors;
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      for (const int step : {-1, 1}) {
        GridPoint place = middle;
        place[axis] += step;
        if (place[axis] >= 0 && place[axis] < axes[axis].grid_values) {
          neighbors.push_back(place);
        }
      }
    }
    evaluate_new(neighbors);
    fruitless = search.evaluations[search.best].misfit() < best ? 0 : fruitless + 1;
  }
}

}  // namespace decant::inline DECANT_TARGET
