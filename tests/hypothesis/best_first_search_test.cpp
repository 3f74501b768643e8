// SPDX-License-Identifier: MIT
#include <decant/hypothesis/best_first_search.hpp>

#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

#include "catch.hpp"
#include "parameter_search_cases.hpp"

using decant::BestFirstResult;
using decant::BestFirstSettings;
using decant::SearchEnd;
using search_cases::Counted;
using search_cases::Point;
using search_cases::unit_axes;

namespace {

const double not_a_number = std::numeric_limits<double>::quiet_NaN();

double squared_distance(const Point& x, const Point& from) {
  double total = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    total += (x[k] - from[k]) * (x[k] - from[k]);
  }
  return total;
}

const Point& best_point(const BestFirstResult& search) { return search.evaluations[search.best].point; }

}  // namespace

TEST_CASE("best-first search: walks to the minimum of a bowl and evaluates its neighbours, nothing else") {
  Counted bowl{[](const Point& x) { return 1 + squared_distance(x, {0.7}); }};
  const auto search = decant::best_first_search(unit_axes(1), {0.2}, bowl);
  CHECK(search.end == SearchEnd::Found);
  CHECK(best_point(search)[0] == Approx(0.7));
  CHECK(search.evaluations[search.best].misfit() == Approx(1));
  // 0.1 .. 0.8: 0.2, its neighbours 0.1 and 0.3, then one more for each step until 0.7 has been expanded
  std::vector<double> order;
  for (const auto& one : search.evaluations) {
    order.push_back(std::round(10 * one.point[0]));
  }
  CHECK(order == std::vector<double>{2, 1, 3, 4, 5, 6, 7, 8});
  CHECK(bowl.sizes == std::vector<std::size_t>{1, 2, 1, 1, 1, 1, 1});
}

TEST_CASE("best-first search: the minimum of the grid in two dimensions, from a corner") {
  Counted bowl{[](const Point& x) { return squared_distance(x, {0.42, 0.58}); }};
  const auto search = decant::best_first_search(unit_axes(2), {0, 1}, bowl);
  CHECK(search.end == SearchEnd::Found);
  CHECK(best_point(search)[0] == Approx(0.4));
  CHECK(best_point(search)[1] == Approx(0.6));
  std::set<Point> all;
  for (const auto& one : search.evaluations) {
    all.insert(one.point);
  }
  CHECK(all.size() == search.evaluations.size());  // none twice
  CHECK(all.size() < 60);                          // of 121
}

TEST_CASE("best-first search: follows a bent valley") {
  // Rosenbrock's function; the valley is along y = x^2, and steps along axes have to cross its sides
  const auto valley = [](const Point& at) {
    const double x = 4 * at[0] - 2, y = 4 * at[1] - 1;
    return 1 + (1 - x) * (1 - x) + 10 * (y - x * x) * (y - x * x);
  };
  Counted counted{valley};
  BestFirstSettings patient;
  patient.patience = 25;
  const auto search = decant::best_first_search(unit_axes(2, 41), {0.25, 0.5}, counted, patient);
  CHECK(best_point(search)[0] == Approx(0.75));  // x = 1, y = 1
  CHECK(best_point(search)[1] == Approx(0.5));
  CHECK(search.evaluations.size() < 41 * 41 / 2);
  // without patience it may only end where no neighbour is better
  Counted again{valley};
  const auto at_once = decant::best_first_search(unit_axes(2, 41), {0.25, 0.5}, again);
  REQUIRE(at_once.end == SearchEnd::Found);
  const Point end = best_point(at_once);
  for (const double step : {-0.025, 0.025}) {
    CHECK(valley({end[0] + step, end[1]}) > valley(end));
    CHECK(valley({end[0], end[1] + step}) > valley(end));
  }
}

TEST_CASE("best-first search: patience leads out of a dent that noise made") {
  const auto dented = [](const Point& x) { return std::abs(x[0] - 0.3) < 0.01 ? 4 : 10 * std::abs(x[0] - 0.9); };
  Counted hasty{dented}, patient{dented};
  CHECK(best_point(decant::best_first_search(unit_axes(1), {0.1}, hasty))[0] == Approx(0.3));
  BestFirstSettings settings;
  settings.patience = 3;
  const auto search = decant::best_first_search(unit_axes(1), {0.1}, patient, settings);
  CHECK(best_point(search)[0] == Approx(0.9));
  CHECK(search.end == SearchEnd::Found);
}

TEST_CASE("best-first search: a plateau is crossed, and of equals the first is best") {
  Counted plateau{[](const Point& x) { return x[0] > 0.75 ? 1.0 : 2.0; }};
  const auto search = decant::best_first_search(unit_axes(1), {0.1}, plateau);
  CHECK(search.end == SearchEnd::Found);
  CHECK(best_point(search)[0] == Approx(0.8));
  CHECK(search.evaluations.size() == 11);

  Counted flat{[](const Point&) { return 3.0; }};
  const auto everywhere = decant::best_first_search(unit_axes(2, 4), {0.4, 0.4}, flat);
  CHECK(everywhere.evaluations.size() == 16);
  CHECK(everywhere.best == 0);
  CHECK(everywhere.end == SearchEnd::Found);
}

TEST_CASE("best-first search: what failed is neither chosen nor expanded") {
  for (const double failed : {not_a_number, std::numeric_limits<double>::infinity(), -1.0}) {
    Counted holed{[&](const Point& x) {
      const bool hole = std::abs(x[0] - 0.5) < 0.01 && x[1] < 0.85;
      return hole ? failed : squared_distance(x, {0.8, 0.2});
    }};
    // a wall with a gap at its upper end: through that, with enough patience
    BestFirstSettings settings;
    settings.patience = 40;
    const auto search = decant::best_first_search(unit_axes(2), {0.2, 0.2}, holed, settings);
    CHECK(best_point(search)[0] == Approx(0.8));
    CHECK(best_point(search)[1] == Approx(0.2));
    Counted hasty = holed;
    const auto stuck = decant::best_first_search(unit_axes(2), {0.2, 0.2}, hasty);
    CHECK(best_point(stuck)[0] == Approx(0.4));
  }
  Counted never{[](const Point&) { return not_a_number; }};
  const auto search = decant::best_first_search(unit_axes(2), {0.2, 0.2}, never);
  CHECK(search.end == SearchEnd::NothingWorks);
  CHECK(search.evaluations.size() == 1);
  const auto empty = decant::best_first_search(unit_axes(1), {0.2}, [](const std::vector<Point>& points) {
    return std::vector<decant::JobResult>(points.size());
  });
  CHECK(empty.end == SearchEnd::NothingWorks);
}

TEST_CASE("best-first search: spends no more than its budget") {
  for (const int budget : {1, 2, 5, 6, 7}) {
    Counted bowl{[](const Point& x) { return squared_distance(x, {0.9, 0.9}); }};
    BestFirstSettings settings;
    settings.most_evaluations = budget;
    const auto search = decant::best_first_search(unit_axes(2), {0.1, 0.1}, bowl, settings);
    CHECK(search.evaluations.size() == static_cast<std::size_t>(budget));
    CHECK(bowl.evaluations == static_cast<std::size_t>(budget));
    CHECK(search.end == SearchEnd::Budget);
  }
}

TEST_CASE("best-first search: the same on one, two and four threads, and from a journal without one evaluation") {
  const auto bumpy = [](const Point& x) {
    return decant::JobResult{squared_distance(x, {0.6, 0.3}) * (1 + 0.3 * search_cases::scatter(x, 5)), x[0]};
  };
  std::map<Point, decant::JobResult> journal;
  std::vector<BestFirstResult> found;
  for (const int threads : {1, 2, 4}) {
    decant::ThreadExecutor executor{{threads}};
    found.push_back(decant::best_first_search(unit_axes(2, 21), {0, 1}, decant::evaluate_on(executor, bumpy)));
  }
  for (const auto& one : found.front().evaluations) {
    journal[one.point] = one.result;
  }
  found.push_back(decant::best_first_search(unit_axes(2, 21), {0, 1}, [&](const std::vector<Point>& points) {
    std::vector<decant::JobResult> results;
    for (const Point& point : points) {
      results.push_back(journal.at(point));  // throws for one that is not known
    }
    return results;
  }));
  for (const auto& other : found) {
    REQUIRE(other.evaluations.size() == found.front().evaluations.size());
    CHECK(other.best == found.front().best);
    for (std::size_t k = 0; k < other.evaluations.size(); ++k) {
      CHECK(other.evaluations[k].point == found.front().evaluations[k].point);
      CHECK(other.evaluations[k].result == found.front().evaluations[k].result);
    }
  }
}

TEST_CASE("best-first search: what makes no sense is refused") {
  Counted any{[](const Point&) { return 1.0; }};
  BestFirstSettings none, impatient;
  none.most_evaluations = 0;
  impatient.patience = -1;
  CHECK_THROWS_AS(decant::best_first_search({}, {}, any), std::invalid_argument);
  CHECK_THROWS_AS(decant::best_first_search(unit_axes(2), {0.1}, any), std::invalid_argument);
  CHECK_THROWS_AS(decant::best_first_search(unit_axes(1), {not_a_number}, any), std::invalid_argument);
  CHECK_THROWS_AS(decant::best_first_search(unit_axes(1, 1), {0.1}, any), std::invalid_argument);
  CHECK_THROWS_AS(decant::best_first_search(unit_axes(1), {0.1}, any, none), std::invalid_argument);
  CHECK_THROWS_AS(decant::best_first_search(unit_axes(1), {0.1}, any, impatient), std::invalid_argument);
  CHECK(any.evaluations == 0);
}
