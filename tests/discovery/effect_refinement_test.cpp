// SPDX-License-Identifier: MIT
#include <decant/discovery/effect_refinement.hpp>

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/discovery/missing_effect_result.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

Effect named(const char* name, std::vector<EffectComponent> components) {
  Effect effect;
  effect.name = name;
  effect.components = std::move(components);
  return effect;
}

Eigen::VectorXd numbers(std::initializer_list<double> values) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), result.begin());
  return result;
}

/// Matrices of normally distributed numbers.
class NormalMatrices {
 public:
  explicit NormalMatrices(std::uint32_t seed) : random_(seed) {}
  Eigen::MatrixXd operator()(Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal_(random_); });
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_{0, 1};
};

/// In which 400 features vary on their own.
NuisanceSpace independent_features(NormalMatrices& draw) {
  NuisanceSample sample;
  sample.baseline = draw(400, 4);
  sample.draws = draw(400, 40);
  return NuisanceSpace(sample);
}

}  // namespace

TEST_CASE("effect point: strengths, places and times of several effects are one vector") {
  const Effect drag = named("drag", {{"", 0, 0, 4}});
  Effect tap = named("tap", {{"", 0, 0, 40}});
  tap.place = Vector3<double>(0.1, 0.2, 0.3);
  tap.place_tolerance = 0.04;
  tap.window = TimeWindow{.from = 1};
  tap.window_tolerance = 0.5;
  Effect gust = named("gust", {{"x", 0, -1, 1}, {"y", 0, -1, 1}});
  gust.window = TimeWindow{0.5, 1.5};
  gust.window_tolerance = 0.2;

  EffectPoint point;
  point.add(drag, 7, {7, numbers({1.5})});
  point.add(tap, 3, {3, numbers({20}), Vector3<double>(0.11, 0.2, 0.3), TimeWindow{.from = 0.9}});
  point.add(gust, 5, {5, numbers({0.4, -0.3})});
  REQUIRE(point.effects() == 3);
  CHECK(point.value() == numbers({1.5, 20, 0.11, 0.2, 0.3, 0.9, 0.4, -0.3, 0.5, 1.5}));
  CHECK(point.strength_of(2) == std::pair<Eigen::Index, Eigen::Index>{6, 2});

  // to where sums' last digits do not matter, also beyond what is looked through
  const auto nudged = [&](double by) {
    EffectPoint result;
    result.add(tap, 3, {3, numbers({20 + by}), Vector3<double>(0.9 + by, 0.2, 0.3), TimeWindow{.from = 0.9 - by}});
    return result.rounded().value();
  };
  CHECK(nudged(1e-13) == nudged(0));
  CHECK((nudged(0) - numbers({20, 0.9, 0.2, 0.3, 0.9})).cwiseAbs().maxCoeff() < 1e-5);
  CHECK(nudged(1e-3) != nudged(0));

  // what is asked for is what comes back
  const EffectPoint other = point.with(5, 1.2).with(9, 1.65).with(3, 0.23);
  const AppliedEffect of_tap = other.applied(1), of_gust = other.applied(2);
  CHECK(of_tap.effect == 3);
  CHECK(of_tap.place->isApprox(Vector3<double>(0.11, 0.23, 0.3)));
  CHECK(of_tap.window->from == 1.2);
  CHECK(of_tap.window->until == TimeWindow{}.until);
  CHECK(of_gust.strength == numbers({0.4, -0.3}));
  CHECK_FALSE(of_gust.place);
  CHECK(of_gust.window->from == 0.5);
  CHECK(of_gust.window->until == 1.65);
  CHECK_FALSE(other.applied(0).window);
  CHECK(other.run(11).effects.size() == 3);

  // and stays in its range: half as strong again, and as far off as it may be
  CHECK(point.with(0, 9).value()[0] == 6);
  CHECK(point.with(2, 0).value()[2] == Approx(0.06));
  CHECK(point.with(5, 9).value()[5] == Approx(1.5));
  CHECK(point.with(8, 0).value()[8] == Approx(0.3));
  CHECK(point.with(9, 9).value()[9] == Approx(1.7));
  CHECK(point.step(2) == Approx(0.016));
  CHECK(point.step(5) == Approx(0.2));
  CHECK(point.step(9) == Approx(0.08));

  // places as a whole
  CHECK(point.with_place(1, {0.12, 0.21, 0.9}).value().segment(2, 3).isApprox(numbers({0.12, 0.21, 0.34})));
  CHECK_THROWS_WITH(point.with_place(0, {0, 0, 0}), decant_test::contains("place"));

  // steps of places and times are halved, and what is held is not tried any more; strengths keep theirs
  EffectPoint finer = point;
  const double of_strength = point.step(1);
  finer.refine(2);
  finer.refine(9);
  finer.refine(9);
  finer.hold(4);
  CHECK(finer.step(2) == Approx(0.008));
  CHECK(finer.step(3) == Approx(0.016));
  CHECK(finer.step(9) == Approx(0.02));
  CHECK(finer.step(4) == 0);
  CHECK(finer.step(1) == of_strength);
  CHECK(finer.is_held(4));
  CHECK(point.moving() == 10);
  CHECK(finer.moving() == 9);
  CHECK(finer.with(4, 0.31).is_held(4));
  CHECK(finer.is_where_or_when(4));
  CHECK(finer.is_where_or_when(8));
  CHECK_FALSE(finer.is_where_or_when(1));
  CHECK_FALSE(finer.is_where_or_when(7));
}

TEST_CASE("effect point: a jet's speed is looked for from rest on") {
  Effect hole = named("hole", {{"", 0, 0, 40}});
  hole.place = Vector3<double>(0, 0, 0.02);
  hole.place_tolerance = 0.03;
  hole.fastest = 1.2;
  EffectPoint at_rest, jet;
  at_rest.add(hole, 4, {4, numbers({20})});
  CHECK(at_rest.value() == numbers({20, 0, 0, 0.02, 0}));
  AppliedEffect guess{4, numbers({20})};
  guess.speed = 0.6;
  jet.add(hole, 4, guess);
  CHECK(jet.applied(0).speed == 0.6);
  CHECK(jet.with(4, 0.9).run(1).effects[0].speed == 0.9);
  CHECK(jet.with(4, -1).value()[4] == 0);
  CHECK(jet.with(4, 2).value()[4] == 1.2);
  CHECK(jet.step(4) == Approx(0.24));
  CHECK(jet.is_where_or_when(4));
  jet.refine(4);
  CHECK(jet.step(4) == Approx(0.12));
  CHECK_FALSE(EffectPoint(at_rest).applied(0).window);

  hole.speed = 2;
  CHECK_THROWS_WITH(validate(hole), decant_test::contains("speed"));
}

TEST_CASE("effect point: a beat is looked for around the one to begin with, and what is steady has none") {
  Effect air = named("air", {{"", 0, 0, 8}});
  air.window = TimeWindow{};
  air.window_tolerance = 0.08;
  EffectPoint steady, beating;
  steady.add(air, 2, {2, numbers({4})});
  CHECK(steady.size() == 1);
  CHECK_FALSE(steady.applied(0).window);
  beating.add(air, 2, {2, numbers({4}), {}, TimeWindow{1.2, 1.45}});
  CHECK(beating.value() == numbers({4, 1.2, 1.45}));
  CHECK(beating.range(1).first == Approx(1.12));
  CHECK(beating.range(2).second == Approx(1.53));
  CHECK(beating.step(1) == Approx(0.032));
  CHECK(beating.with(1, 1.3).applied(0).window->from == Approx(1.28));
}

TEST_CASE("effect: beats are of one that has a window, and begin before they end") {
  Effect air = named("air", {{"", 0, 0, 8}});
  air.beats = {{1, 1.25}};
  CHECK_THROWS_WITH(validate(air), decant_test::contains("'air': beats must be"));
  air.window = TimeWindow{};
  CHECK_NOTHROW(validate(air));
  air.beats.push_back({1.5, 1.5});
  CHECK_THROWS_WITH(validate(air), decant_test::contains("beginning before their end"));
}

TEST_CASE("effect point: what is not looked for is no number of it") {
  Effect leak = named("leak", {{"", 0, 0, 40}});
  leak.place = Vector3<double>(0, 0, 0);  // without a tolerance
  leak.window = TimeWindow{0, 1};
  EffectPoint point;
  point.add(leak, 0, {0, numbers({10})});
  CHECK(point.size() == 1);
  CHECK_FALSE(point.applied(0).place);
  CHECK_FALSE(point.applied(0).window);
  CHECK_THROWS_WITH(point.add(leak, 0, {0, numbers({1, 2})}), decant_test::contains("each component"));
  // an end only
  leak.window_tolerance = 0.3;
  leak.window->from = -std::numeric_limits<double>::infinity();
  EffectPoint ends;
  ends.add(leak, 0, {0, numbers({10})});
  CHECK(ends.value() == numbers({10, 1}));
  CHECK(ends.range(1).second == Approx(1.3));
  CHECK(ends.applied(0).window->until == 1);
}

TEST_CASE("refined effect: one that may be tolerated does not stand out") {
  Effect pan = named("body_pose", {{"x", 0, -10, 10, 1}, {"y", 0, -10, 10, 1}});
  const auto stands_out = [&](double x, double y, double deviation) {
    RefinedEffect found;
    found.strength = numbers({x, y});
    found.deviation = numbers({deviation, deviation});
    return is_beyond_tolerance(found, pan);
  };
  CHECK(stands_out(0.5, -3, 1));  // -4.6 .. -1.4
  CHECK_FALSE(stands_out(0.5, -3, 1.3));
  CHECK(stands_out(3, 0, 1));
  CHECK_FALSE(stands_out(0.9, -0.9, 0.01));
  CHECK_FALSE(stands_out(5, 5, std::numeric_limits<double>::quiet_NaN()));
  for (EffectComponent& each : pan.components) {
    each.base = 2;
  }
  CHECK_FALSE(stands_out(3, 1, 0.1));
  CHECK(stands_out(2, -3, 1));
}

TEST_CASE("refinement: one step finds what is linear, in several recordings together") {
  const Effect drag = named("drag", {{"", 0, 0, 4}}), pull = named("pull", {{"", 0, -1, 1}});
  EffectPoint point;
  point.add(drag, 0, {0, numbers({1})});
  point.add(pull, 1, {1, numbers({0.2})});
  NormalMatrices draw(3);
  std::vector<NuisanceSpace> spaces;
  std::vector<RefinementView> views;
  std::vector<Eigen::VectorXd> features;
  const Eigen::VectorXd truth = numbers({1.4, 0.1});
  for (int recording = 0; recording < 2; ++recording) {
    NuisanceSample sample;
    sample.baseline = 0.1 * draw(40, 4);
    sample.draws = 0.1 * draw(40, 12);
    spaces.emplace_back(sample);
  }
  for (const NuisanceSpace& space : spaces) {
    RefinementView view{&space, draw(40, 1), draw(40, 2)};
    features.push_back(view.middle + view.slope * (truth - point.value()));
    views.push_back(view);
  }
  const Eigen::VectorXd found = point.value() + refinement(point, views, features);
  // a hundredth of the curvature holds it where it is
  CHECK((found - truth).cwiseAbs().maxCoeff() < 0.02 * (truth - point.value()).cwiseAbs().maxCoeff());
  // no farther than four steps at once
  features[0] += views[0].slope * numbers({100, 0});
  features[1] += views[1].slope * numbers({100, 0});
  CHECK(refinement(point, views, features)[0] == Approx(4 * point.step(0)));
}

TEST_CASE("refinement: chaos in slopes makes steps shorter, unless it is taken off") {
  const Effect drag = named("drag", {{"", 0, 0, 4}});
  EffectPoint point;
  point.add(drag, 0, {0, numbers({1})}, numbers({0.5}));
  NormalMatrices draw(11);
  const NuisanceSpace space = independent_features(draw);
  // a slope that is half effect and half chaos, of each of which the size is known
  const Eigen::VectorXd slope = draw(400, 1);
  const double chaos = space.distance(space.standardised_difference(draw(400, 1)));
  const double move = 0.4;
  double as_it_is = 0, without_chaos = 0;
  constexpr int repeats = 200;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    RefinementView view{&space, draw(400, 1), slope + draw(400, 1)};
    const Eigen::VectorXd seen = view.middle + slope * move;
    view.chaos = numbers({chaos});
    as_it_is += refinement(point, {view}, {seen})[0] / repeats;
    without_chaos += refinement(point, {view}, {seen}, true)[0] / repeats;
  }
  CHECK(as_it_is == Approx(0.5 * move).epsilon(0.1));
  CHECK(without_chaos == Approx(move).epsilon(0.1));
}

TEST_CASE("refinement: a place that changes no more than chaos does stays where it is") {
  Effect tap = named("tap", {{"", 0, 0, 40}});
  tap.place = Vector3<double>(0, 0, 0);
  tap.place_tolerance = 0.04;
  EffectPoint point;
  point.add(tap, 0, {0, numbers({20})});
  NormalMatrices draw(13);
  const NuisanceSpace space = independent_features(draw);
  // x tells, y is chaos alone, z says as little; something is off that is of none of them
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(400, 4);
  slope.col(0) = 0.1 * draw(400, 1);
  slope.col(1) = 400 * draw(400, 1);
  const double chaos = space.distance(space.standardised_difference(100 * draw(400, 1)));
  for (int repeat = 0; repeat < 20; ++repeat) {
    RefinementView view{&space, draw(400, 1), slope};
    view.slope.rightCols(3) += 100 * draw(400, 3);
    view.chaos = numbers({0, chaos, chaos, chaos});
    CHECK(tells({view}, 1));
    CHECK_FALSE(tells({view}, 2));
    const Eigen::VectorXd move = refinement(point, {view}, {view.middle + slope.col(1) * 0.01 + 4 * draw(400, 1)});
    CHECK(move[1] == Approx(0.01).margin(0.003));
    CHECK(move[2] == 0);
    CHECK(move[3] == 0);
  }
}

TEST_CASE("refinement: of two effects that do nearly the same, their sum is told where each is not") {
  const Effect drag = named("drag", {{"", 0, 0, 4}}), other = named("other", {{"", 0, 0, 4}});
  EffectPoint point;
  point.add(drag, 0, {0, numbers({1})}, numbers({0.5}));
  point.add(other, 1, {1, numbers({1})}, numbers({0.5}));
  NormalMatrices draw(12);
  const NuisanceSpace space = independent_features(draw);
  Eigen::MatrixXd slope = draw(400, 2);
  slope.col(1) = slope.col(0) + 0.1 * slope.col(1);
  const double chaos = space.distance(space.standardised_difference(draw(400, 1)));
  double sum = 0, largest = 0;
  constexpr int repeats = 200;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    RefinementView view{&space, draw(400, 1), slope + draw(400, 2)};
    view.chaos = numbers({chaos, chaos});
    const Eigen::VectorXd move = refinement(point, {view}, {view.middle + slope * numbers({0.2, 0.2})}, true);
    sum += move.sum() / repeats;
    largest = std::max(largest, move.cwiseAbs().maxCoeff());
  }
  CHECK(sum == Approx(0.4).epsilon(0.1));
  CHECK(largest < 0.5);  // without any bound on what is taken off, far beyond
}

TEST_CASE("effect point: what is faint is tried farther off") {
  const Effect drag = named("drag", {{"", 0, 0, 4}});
  EffectPoint point;
  point.add(drag, 0, {0, numbers({1})}, numbers({1.5}));
  CHECK(point.step(0) == Approx(1.5));
  CHECK(point.with(0, 6).step(0) == Approx(1.8));  // three tenths of the strength
  CHECK_THROWS_WITH(point.add(drag, 0, {0, numbers({1})}, numbers({1, 2})), decant_test::contains("least steps"));
}
