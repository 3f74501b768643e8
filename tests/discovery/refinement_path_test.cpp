// SPDX-License-Identifier: MIT
#include <decant/discovery/refinement_path.hpp>

#include <functional>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr Eigen::Index features = 400;

/// In which features vary on their own.
NuisanceSpace independent_features() {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 1);
  const auto draw = [&](Eigen::Index columns) -> Eigen::MatrixXd {
    return Eigen::MatrixXd::NullaryExpr(features, columns, [&] { return normal(random); });
  };
  NuisanceSample sample;
  sample.baseline = draw(4);
  sample.draws = draw(40);
  return NuisanceSpace(sample);
}

/// Without chaos, by a formula: what is seen of a point's numbers.
class Formula {
 public:
  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& numbers)>;

  Formula(const NuisanceSpace& space, Function function) : space_(&space), function_(std::move(function)) {}

  Eigen::VectorXd at(const EffectPoint& point) const { return function_(point.value()); }

  RefinementView around(const EffectPoint& point) const {
    RefinementView view{space_, at(point)};
    view.chaos = Eigen::VectorXd::Zero(point.size());
    for (Eigen::MatrixXd* each : {&view.slope, &view.below, &view.above}) {
      each->setZero(features, point.size());
    }
    for (Eigen::Index k = 0; k < point.size(); ++k) {
      if (!point.is_held(k)) {
        const EffectPoint below = point.with(k, point.value()[k] - point.step(k));
        const EffectPoint above = point.with(k, point.value()[k] + point.step(k));
        view.below.col(k) = at(below);
        view.above.col(k) = at(above);
        view.slope.col(k) = (at(above) - at(below)) / (above.value()[k] - below.value()[k]);
      }
    }
    return view;
  }

 private:
  const NuisanceSpace* space_;
  Function function_;
};

/// What a pull for a while does, by when: the speed that it gives, which friction takes away again.
Eigen::VectorXd speed_of_gust(const Eigen::VectorXd& numbers) {
  Eigen::VectorXd seen(features);
  double speed = 0;
  for (Eigen::Index k = 0; k < features; ++k) {
    const double time = static_cast<double>(k) / features;
    const double pull = time > numbers[1] && time < numbers[2] ? numbers[0] : 0;
    speed += (pull - 5 * speed) / features;
    seen[k] = 100 * speed;
  }
  return seen;
}

Effect gust() {
  Effect effect;
  effect.name = "gust";
  effect.components = {{"", 0, -1.5, 1.5}};
  effect.window = TimeWindow{0.15, 0.55};
  effect.window_tolerance = 0.4;
  return effect;
}

EffectPoint point_of(const Effect& effect, double strength) {
  EffectPoint point;
  point.add(effect, 0, {0, Eigen::VectorXd::Constant(1, strength)});
  return point;
}

constexpr ChanceLevel chance{1, 1.5, 0.1};

}  // namespace

TEST_CASE("refinement path: what acts by a product with its time is found, a step that leads away is taken half back") {
  const NuisanceSpace space = independent_features();
  const Formula formula(space, speed_of_gust);
  const Effect effect = gust();
  EffectPoint hidden = point_of(effect, -1.5).with(1, 0.36).with(2, 0.76);
  RefinementPath path(point_of(effect, -1.1));
  int back = 0;
  for (int round = 0; round < 12 && !path.is_settled(); ++round) {
    const Eigen::VectorXd from = path.point().value();
    const double least = path.least_distance();
    path.step({formula.around(path.point())}, {formula.at(hidden)}, chance);
    if (path.least_distance() == least) {  // half of the way to the nearest point is left
      ++back;
      CHECK((path.point().value() - 0.5 * (from + path.nearest().value())).norm() < 1e-6);
    }
  }
  CHECK(path.nearest().value()[0] == Approx(-1.5).epsilon(0.03));
  CHECK(path.nearest().value()[1] == Approx(0.36).margin(0.01));
  CHECK(path.nearest().value()[2] == Approx(0.76).margin(0.01));
  CAPTURE(back);
  CHECK(back > 0);
}

TEST_CASE("refinement path: a number that does not tell is held, but for as long as strengths move") {
  const NuisanceSpace space = independent_features();
  // the second number does nothing; the first is a strength, and linear
  const Formula formula(space, [](const Eigen::VectorXd& numbers) -> Eigen::VectorXd {
    return Eigen::VectorXd::LinSpaced(features, -10, 10) * numbers[0];
  });
  Effect effect = gust();
  effect.window->until = TimeWindow{}.until;
  RefinementPath far(point_of(effect, 0.75)), near(point_of(effect, 0.98));
  const std::vector<Eigen::VectorXd> recorded{formula.at(point_of(effect, 1))};
  far.step({formula.around(far.point())}, recorded, chance);
  CHECK_FALSE(far.point().is_held(1));
  near.step({formula.around(near.point())}, recorded, chance);
  CHECK(near.point().is_held(1));
  far.step({formula.around(far.point())}, recorded, chance);  // which it has got to
  CHECK(far.point().is_held(1));
}

TEST_CASE("refinement path: within chance no step leads away, and runs that fail end it") {
  const NuisanceSpace space = independent_features();
  const Formula formula(space, speed_of_gust);
  const Effect effect = gust();
  RefinementPath path(point_of(effect, 1));
  const std::vector<Eigen::VectorXd> recorded{formula.at(point_of(effect, 1).with(1, 0.2))};
  path.step({formula.around(path.point())}, recorded, chance);
  // as if the runs at the next point were of another one, no farther off than chance is
  const EffectPoint next = path.point();
  RefinementView off = formula.around(next);
  off.middle = formula.at(point_of(effect, 1).with(1, 0.3));
  const double distance = space.distance(space.standardised_difference(recorded[0] - off.middle));
  const double least = path.least_distance();
  REQUIRE(distance > 1.2 * least);
  RefinementPath same = path;
  path.step({off}, recorded, {1, 1.01 * distance, 0.1});
  CHECK(path.least_distance() == least);
  CHECK((path.point().value() - 0.5 * (next.value() + path.nearest().value())).norm() > 1e-3);
  same.step({off}, recorded, {1, 0.99 * distance, 0.1});
  CHECK((same.point().value() - 0.5 * (next.value() + same.nearest().value())).norm() < 1e-6);

  path.fail();
  CHECK(path.is_settled());
  CHECK(path.views().empty());
  CHECK(path.expected() == std::numeric_limits<double>::infinity());
}
