// SPDX-License-Identifier: MIT
#include <decant/hypothesis/surrogate_search.hpp>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include <decant/hypothesis/best_first_search.hpp>

#include "catch.hpp"
#include "parameter_search_cases.hpp"

using decant::ParameterEstimateSettings;
using decant::SearchEnd;
using decant::SurrogateSearchSettings;
using search_cases::Counted;
using search_cases::Function;
using search_cases::Point;
using search_cases::unit_axes;

namespace {

/// Features that a parameter moves along a line, measured with errors, and runs that are off by chaos of their own. The
/// misfit is what a model with such features comes to.
struct LinearModel {
  std::vector<double> slope, error;
  double truth;
  double chaos;  ///< relative deviation of misfits
  std::uint32_t seed;

  LinearModel(double true_place, double width, double relative_chaos, std::uint32_t which)
      : truth(true_place), chaos(relative_chaos), seed(which) {
    std::mt19937 random(which);
    std::normal_distribution<double> normal(0, 1);
    double length = 0;
    for (int k = 0; k < 20; ++k) {
      slope.push_back(normal(random));
      error.push_back(10 * normal(random));
      length += slope.back() * slope.back();
    }
    for (double& each : slope) {
      each *= 10 / (width * std::sqrt(length));  // so that the best fit has this standard deviation
    }
  }

  double operator()(const Point& point) const {
    double squared = 0;
    for (std::size_t k = 0; k < slope.size(); ++k) {
      squared += std::pow(slope[k] * (point[0] - truth) - error[k], 2);
    }
    return squared * std::exp(chaos * search_cases::normal_scatter(point, seed));
  }
};

}  // namespace

TEST_CASE("surrogate search: the posterior is the one that quadrature gives where there is no noise") {
  const auto misfit = [](const Point& x) { return 50 + 2000 * (x[0] - 0.55) * (x[0] - 0.55); };
  Counted counted{misfit};
  SurrogateSearchSettings settings;
  settings.unsettled = 0.002;
  const auto search = decant::surrogate_search(unit_axes(1), counted, settings);
  CHECK(search.end == SearchEnd::Found);
  CHECK(counted.evaluations < 25);
  const decant::Posterior likelihood(settings.estimate.posterior);
  double total = 0, below = 0;
  const auto& estimate = search.parameters.at(0);
  const auto density = [&](double x) { return std::exp(likelihood.log_likelihood(misfit({x}))); };
  for (double x = 5e-5; x < 1; x += 1e-4) {
    total += density(x);
    below += x < estimate.low ? density(x) : 0.0;
  }
  CHECK(below / total == Approx(0.05).margin(0.01));
  CHECK(estimate.value == Approx(0.55).margin(0.005));
  CHECK(0.5 * (estimate.low + estimate.high) == Approx(0.55).margin(0.01));
  CHECK(estimate.told());
}

TEST_CASE("surrogate search: intervals of 90 % hold the truth in 82 to 97 % of noisy cases") {
  int held = 0, told = 0, evaluations = 0;
  std::mt19937 random(77);
  std::uniform_real_distribution<double> place(0.25, 0.75);
  constexpr int cases = 200;
  for (std::uint32_t seed = 0; seed < cases; ++seed) {
    const LinearModel model(place(random), 0.07, 0.05, seed);
    Counted counted{model};
    const auto search = decant::surrogate_search(unit_axes(1), counted);
    REQUIRE(search.parameters.size() == 1);
    const auto& estimate = search.parameters[0];
    held += estimate.low <= model.truth && model.truth <= estimate.high ? 1 : 0;
    told += estimate.told() ? 1 : 0;
    evaluations += static_cast<int>(counted.evaluations);
    CHECK(estimate.low < estimate.value);
    CHECK(estimate.value < estimate.high);
  }
  INFO(held << " of " << cases << " held, " << told << " told, " << evaluations << " evaluations");
  CHECK(held >= 0.82 * cases);
  CHECK(held <= 0.97 * cases);
  CHECK(told >= 0.9 * cases);
  CHECK(evaluations <= 14 * cases);
}

TEST_CASE("surrogate search: what a misfit does not depend on cannot be told") {
  Counted flat{[](const Point& x) { return 200 * std::exp(0.03 * search_cases::normal_scatter(x, 3)); }};
  const auto search = decant::surrogate_search(unit_axes(1), flat);
  const auto& estimate = search.parameters.at(0);
  CHECK_FALSE(estimate.told());
  CHECK(estimate.at_low);
  CHECK(estimate.at_high);
  CHECK(estimate.low == 0);
  CHECK(estimate.high == 1);

  // of two parameters one is told, and the other is not
  Counted half{[](const Point& x) { return 50 + 5000 * (x[0] - 0.4) * (x[0] - 0.4); }};
  const auto two = decant::surrogate_search(unit_axes(2), half);
  CHECK(two.parameters.at(0).told());
  CHECK(two.parameters.at(0).value == Approx(0.4).margin(0.03));
  CHECK(two.parameters.at(1).at_low);
  CHECK(two.parameters.at(1).at_high);
}

TEST_CASE("surrogate search: a threshold gives a bound, and the other end is not told") {
  // as viscosity shows once it is above what the solver has of its own
  const auto below = [](double x) { return 50 + 30 * std::pow(std::log1p(std::exp((x - 0.4) / 0.1)), 2); };
  std::vector<decant::ParameterAxis> axes{{"nu", "m^2/s", 1e-6, 1e-3, decant::AxisScale::Logarithmic, 13}};
  Counted at_most{[&](const Point& nu) { return below(axes[0].share_of(nu[0])); }};
  const auto thin = decant::surrogate_search(axes, at_most).parameters.at(0);
  CHECK(thin.at_low);
  CHECK_FALSE(thin.at_high);
  CHECK_FALSE(thin.told());
  CHECK(thin.low == 1e-6);
  const decant::Posterior likelihood;
  double total = 0, share = 0;
  for (double x = 5e-4; x < 1; x += 1e-3) {
    total += std::exp(likelihood.log_likelihood(below(x)));
  }
  for (double sum = 0; sum < 0.9 * total; share += 1e-3) {
    sum += std::exp(likelihood.log_likelihood(below(share + 5e-4)));
  }
  CHECK(axes[0].share_of(thin.high) == Approx(share).margin(0.03));
  Counted at_least{[&](const Point& nu) { return below(1 - axes[0].share_of(nu[0])); }};
  const auto thick = decant::surrogate_search(axes, at_least).parameters.at(0);
  CHECK(thick.at_high);
  CHECK_FALSE(thick.at_low);
  CHECK(thick.high == 1e-3);
  CHECK(axes[0].share_of(thick.low) == Approx(1 - share).margin(0.03));
}

TEST_CASE("surrogate search: a ridge is wide in each parameter by itself") {
  // the sum of the two is known to 0.02, their difference not at all
  Counted ridge{[](const Point& x) { return 50 + 20000 * std::pow(x[0] + x[1] - 1, 2); }};
  const auto search = decant::surrogate_search(unit_axes(2), ridge);
  for (const auto& estimate : search.parameters) {
    CHECK(estimate.high - estimate.low > 0.7);
  }
}

TEST_CASE("surrogate search: failed evaluations are never best, and do not spoil the rest") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Counted broken{[&](const Point& x) { return x[0] > 0.7 ? nan : 50 + 3000 * (x[0] - 0.3) * (x[0] - 0.3); }};
  const auto search = decant::surrogate_search(unit_axes(1), broken);
  CHECK(search.evaluations[search.best].point[0] == Approx(0.3).margin(0.05));
  CHECK(search.parameters.at(0).told());
  CHECK(search.parameters.at(0).value == Approx(0.3).margin(0.02));

  Counted never{[&](const Point&) { return nan; }};
  const auto nothing = decant::surrogate_search(unit_axes(2), never);
  CHECK(nothing.end == SearchEnd::NothingWorks);
  CHECK(nothing.parameters.empty());
  CHECK(nothing.evaluations.size() == 9);
}

TEST_CASE("surrogate search: keeps its budget, and asks for no place twice") {
  for (const int budget : {5, 6, 12}) {
    Counted noise{[](const Point& x) { return 100 * (1 + search_cases::scatter(x, 9)); }};
    SurrogateSearchSettings settings;
    settings.most_evaluations = budget;
    settings.unsettled = 1e-9;
    settings.batch = 4;
    const auto search = decant::surrogate_search(unit_axes(1), noise, settings);
    CHECK(noise.evaluations == static_cast<std::size_t>(budget));
    CHECK(search.end == SearchEnd::Budget);
    CHECK(search.parameters.size() == 1);
    std::set<Point> all;
    for (const auto& one : search.evaluations) {
      all.insert(one.point);
    }
    CHECK(all.size() == search.evaluations.size());
  }
  // no more places than there are
  Counted noise{[](const Point& x) { return 100 * (1 + search_cases::scatter(x, 9)); }};
  SurrogateSearchSettings endless;
  endless.most_evaluations = 1000;
  endless.unsettled = 1e-12;
  endless.batch = 20;
  endless.estimate.draws = 20;
  CHECK(decant::surrogate_search(unit_axes(1), noise, endless).end == SearchEnd::Budget);
  CHECK(noise.evaluations == 65);
}

TEST_CASE("surrogate search: the same on one, two and four threads, and from a journal without one evaluation") {
  const LinearModel model(0.6, 0.1, 0.1, 12);
  std::map<Point, decant::JobResult> journal;
  std::vector<decant::SurrogateSearchResult> found;
  for (const int threads : {1, 2, 4}) {
    decant::ThreadExecutor executor{{threads}};
    found.push_back(decant::surrogate_search(
        unit_axes(1), decant::evaluate_on(executor, [&](const Point& x) { return decant::JobResult{model(x)}; })));
  }
  for (const auto& one : found.front().evaluations) {
    journal[one.point] = one.result;
  }
  found.push_back(decant::surrogate_search(unit_axes(1), [&](const std::vector<Point>& points) {
    std::vector<decant::JobResult> results;
    for (const Point& point : points) {
      results.push_back(journal.at(point));  // throws for one that is not known
    }
    return results;
  }));
  for (const auto& other : found) {
    REQUIRE(other.evaluations.size() == found.front().evaluations.size());
    CHECK(other.parameters[0].low == found.front().parameters[0].low);
    CHECK(other.parameters[0].value == found.front().parameters[0].value);
    for (std::size_t k = 0; k < other.evaluations.size(); ++k) {
      CHECK(other.evaluations[k].point == found.front().evaluations[k].point);
    }
  }
}

TEST_CASE("surrogate search: nearer to the truth than best-first search where evaluations are noisy") {
  // From the end of a fine grid; 10 % noise on misfits whose minimum is a third of what they are at the start.
  double best_first_error = 0, surrogate_error = 0;
  std::size_t best_first_evaluations = 0, surrogate_evaluations = 0;
  constexpr int cases = 40;
  for (std::uint32_t seed = 0; seed < cases; ++seed) {
    const double truth = 0.5 + 0.3 * search_cases::scatter({}, seed);
    const Function noisy = [=](const Point& at) {
      return (100 + 500 * (at[0] - truth) * (at[0] - truth)) * std::exp(0.1 * search_cases::normal_scatter(at, seed));
    };
    Counted grid{noisy}, sampled{noisy};
    const auto walked = decant::best_first_search(unit_axes(1, 25), {0}, grid);
    best_first_error += std::abs(walked.evaluations[walked.best].point[0] - truth) / cases;
    const auto search = decant::surrogate_search(unit_axes(1), sampled);
    surrogate_error += std::abs(search.parameters[0].value - truth) / cases;
    best_first_evaluations += grid.evaluations;
    surrogate_evaluations += sampled.evaluations;
  }
  INFO("best first: off by " << best_first_error << " with " << best_first_evaluations / cases
                             << " evaluations; surrogate: " << surrogate_error << " with "
                             << surrogate_evaluations / cases);
  CHECK(surrogate_error < 0.5 * best_first_error);
}

TEST_CASE("surrogate search: fewer evaluations than best-first search in a smooth bowl of two parameters") {
  const Function smooth = [](const Point& at) {
    return 50 + 2000 * (std::pow(at[0] - 0.62, 2) + std::pow(at[1] - 0.41, 2));
  };
  Counted grid{smooth}, sampled{smooth};
  const auto walked = decant::best_first_search(unit_axes(2, 13), {0, 0}, grid);
  CHECK(walked.evaluations[walked.best].point[0] == Approx(0.62).margin(0.05));
  const auto search = decant::surrogate_search(unit_axes(2), sampled);
  CHECK(search.parameters[0].value == Approx(0.62).margin(0.02));
  CHECK(search.parameters[1].value == Approx(0.41).margin(0.02));
  CHECK(sampled.evaluations < grid.evaluations);
}

TEST_CASE("surrogate search: what makes no sense is refused") {
  Counted any{[](const Point&) { return 1.0; }};
  const auto refused = [&](auto change) {
    SurrogateSearchSettings settings;
    change(settings);
    CHECK_THROWS_AS(decant::surrogate_search(unit_axes(1), any, settings), std::invalid_argument);
  };
  refused([](auto& settings) { settings.most_evaluations = 4; });
  refused([](auto& settings) { settings.first_evaluations = 2; });
  refused([](auto& settings) { settings.first_evaluations = -5; });
  refused([](auto& settings) { settings.batch = 0; });
  refused([](auto& settings) { settings.unsettled = std::numeric_limits<double>::quiet_NaN(); });
  refused([](auto& settings) { settings.estimate.confidence = 1; });
  refused([](auto& settings) { settings.estimate.draws = 1; });
  refused([](auto& settings) { settings.estimate.posterior.independent_errors = 0; });
  CHECK_THROWS_AS(decant::surrogate_search(unit_axes(4), any), std::invalid_argument);
  CHECK_THROWS_AS(decant::surrogate_search({}, any), std::invalid_argument);
}

TEST_CASE("estimate_parameters: also from what another search has evaluated") {
  Counted bowl{[](const Point& x) { return 50 + 3000 * (x[0] - 0.62) * (x[0] - 0.62); }};
  const auto search = decant::best_first_search(unit_axes(1), {0.4}, bowl);
  const auto estimates = decant::estimate_parameters(unit_axes(1), search.evaluations);
  REQUIRE(estimates.size() == 1);
  CHECK(estimates[0].value == Approx(0.62).margin(0.02));
  CHECK(decant::estimate_parameters(unit_axes(1), {{{0.5}, {1.0}}}).empty());
  CHECK_THROWS_AS(decant::estimate_parameters(unit_axes(2), search.evaluations), std::invalid_argument);
}
