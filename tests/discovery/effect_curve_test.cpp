// SPDX-License-Identifier: MIT

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/discovery/effect_curve.hpp>

#include "catch.hpp"

using namespace decant;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index curve_features = 400;

struct Features {
  explicit Features(std::uint32_t seed) : random(seed) {}
  MatrixXd noise(Index columns, double deviation = 1) {
    return MatrixXd::NullaryExpr(curve_features, columns, [&] { return deviation * normal(random); });
  }
  std::mt19937 random;
  std::normal_distribution<double> normal{0, 1};
};

/// Features that are nothing but noise where nothing is missing.
NuisanceSpace plain_space(double deviation = 0.3) {
  Features draw(7);
  return NuisanceSpace({VectorXd::Zero(curve_features), draw.noise(24, deviation), {}, {}});
}

/// Of one component.
EffectCurve curve_of(const NuisanceSpace& space, const std::vector<double>& strengths, const MatrixXd& differences,
                     double base = 0, double chaos = 0) {
  std::vector<EffectCurve::Strength> each;
  for (const double strength : strengths) {
    each.push_back(VectorXd::Constant(1, strength));
  }
  return {space, VectorXd::Constant(1, base), each, differences, chaos};
}

VectorXd one(double strength) { return VectorXd::Constant(1, strength); }
VectorXd two(double first, double second) { return Eigen::Vector2d(first, second); }

}  // namespace

TEST_CASE("effect curve: finds the strength by which features changed, from others that were simulated") {
  const NuisanceSpace space = plain_space();
  Features draw(1);
  const VectorXd first = draw.noise(1), second = draw.noise(1);
  // what is simulated is not quite the curve's law: it bends to another side, and grows more and more, or less and less
  for (const double power : {1.0, 0.4, 1.8}) {
    const auto changed = [&](double s) {
      return VectorXd(3 * std::pow(s / 3, power) * first + 0.1 * s * (3 - s) * second);
    };
    const std::vector<double> strengths{1, 1, 3, 3};
    MatrixXd differences(curve_features, 4);
    for (Index k = 0; k < 4; ++k) {
      differences.col(k) = changed(strengths[static_cast<std::size_t>(k)]) + draw.noise(1, 0.1);
    }
    const EffectCurve curve = curve_of(space, strengths, differences);
    CHECK(curve.axes().front().range == std::pair(0.0, 3.0));
    for (const double truth : {0.9, 1.3, 2.2}) {
      const VectorXd seen = space.standardised(space.center() + changed(truth) + draw.noise(1, 0.3));
      const StrengthProfile profile = curve.profile(seen);
      CHECK(profile.best()[0] == Approx(truth).epsilon(0.15).margin(0.05));
      CHECK(profile.without() == Approx(space.distance(seen)));
      CHECK(profile.improvement() == Approx(profile.without() - space.distance(seen - curve.at(profile.best()))));
      CHECK(profile(profile.best()) < 2);
    }
  }
}

TEST_CASE("effect curve: how an effect grows is learnt from simulations, the less the more of them is chaos") {
  const NuisanceSpace space = plain_space();
  Features draw(5);
  const VectorXd way = draw.noise(1);
  const auto growth = [&](double weaker, double size, double chaos) {
    MatrixXd differences(curve_features, 2);
    differences << weaker * size * way, size * way;
    return curve_of(space, {0.35, 1}, differences, 0, chaos).axes().front().law.growth;
  };
  const double energy = space.distance(space.standardised_difference(way));
  // a third of the strength does a fifth, or two thirds, of it
  CHECK(growth(0.35, 1, 0) == 1);
  CHECK(growth(0.2, 1, 0) == Approx(0.35 * 0.8 / (0.65 * 0.2)).epsilon(0.03));
  CHECK(growth(0.65, 1, 0) == Approx(0.35 * 0.35 / (0.65 * 0.65)).epsilon(0.03));
  CHECK(growth(0.2, 1, 0.01 * energy) == Approx(growth(0.2, 1, 0)).epsilon(0.1));
  // what chaos drowns is taken for a straight line
  CHECK(growth(0.2, 0.1, energy) == Approx(1).epsilon(0.1));
  CHECK(growth(0.65, 0.1, energy) == Approx(1).epsilon(0.1));
}

TEST_CASE("effect curve: what chaos makes of weak effects is held back, and strong ones are as they were simulated") {
  const NuisanceSpace space = plain_space();
  Features draw(9);
  const VectorXd way = draw.noise(1, 0.3), bend = draw.noise(1, 0.3);
  const double chaos = space.distance(space.standardised_difference(draw.noise(1, 0.3)));  // of a single run
  const std::vector<double> strengths{0.35, 1};
  // how far the curve is from what the effect does at a strength, by distance
  const auto off = [&](double size, double at, double told) {
    double sum = 0;
    for (int repeat = 0; repeat < 10; ++repeat) {
      MatrixXd differences(curve_features, 2);
      for (Index k = 0; k < 2; ++k) {
        const double s = strengths[static_cast<std::size_t>(k)];
        differences.col(k) = size * (s * way + s * s * bend) + draw.noise(1, 0.3);
      }
      std::vector<EffectCurve::Strength> each{one(0.35), one(1)};
      const EffectCurve curve(space, one(0), each, differences, told);
      sum += space.distance(curve.at(one(at)) - space.standardised_difference(size * (at * way + at * at * bend)));
    }
    return sum / 10;
  };
  // a curve through both runs has all of the weak one's chaos there; a straight line has a third of the strong one's
  CHECK(off(0.5, 0.35, 0) == Approx(chaos).epsilon(0.2));
  CHECK(off(0.5, 0.35, chaos) < 0.3 * chaos);
  // what is bent by much more than chaos stays bent
  CHECK(off(20, 0.35, chaos) < 1.2 * chaos);
  CHECK(off(20, 1, chaos) < 1.2 * chaos);
}

TEST_CASE("effect curve: strengths to both sides of what the model has, and one alone") {
  const NuisanceSpace space = plain_space();
  Features draw(2);
  const VectorXd way = draw.noise(1), bend = draw.noise(1);
  MatrixXd differences(curve_features, 2);
  differences << way + 0.3 * bend, -way + 0.3 * bend;
  const EffectCurve both = curve_of(space, {11, 9}, differences, 10);
  const auto found = [&](const EffectCurve& curve, const VectorXd& change) {
    return curve.profile(space.standardised_difference(change)).best()[0];
  };
  CHECK(found(both, 0.5 * way + 0.075 * bend) == Approx(10.5).epsilon(1e-4));
  CHECK(found(both, -0.5 * way + 0.075 * bend) == Approx(9.5).epsilon(1e-4));
  CHECK(found(both, -3 * way) == Approx(9));  // no further than was simulated
  const EffectCurve up = curve_of(space, {14}, way, 10);
  CHECK(up.axes().front().range == std::pair(10.0, 14.0));
  CHECK(found(up, 0.5 * way) == Approx(12).epsilon(1e-4));
  CHECK(found(up, -way) == 10);  // an effect that only adds
}

TEST_CASE("strength profile: an interval holds what is hardly worse, and pours add up") {
  const NuisanceSpace space = plain_space();
  Features draw(3);
  const VectorXd way = draw.noise(1), other_way = draw.noise(1);
  const EffectCurve curve = curve_of(space, {4}, 4 * way), other = curve_of(space, {4}, 4 * other_way);
  const auto seen = [&](const VectorXd& change) { return space.standardised_difference(change); };
  const StrengthProfile profile = curve.profile(seen(1.5 * way));
  // d grows as (s - 1.5)^2 times the distance of one unit
  const double unit = space.distance(seen(way));
  const auto [from, to] = profile.within(0, 0.25 * unit);
  CHECK(from == Approx(1));
  CHECK(to == Approx(2));
  CHECK(profile.within(0, 100 * unit) == std::pair(0.0, 4.0));

  StrengthProfile both = profile;
  both += other.profile(seen(2.5 * other_way));
  const double other_unit = space.distance(seen(other_way));
  CHECK(both.best()[0] == Approx((1.5 * unit + 2.5 * other_unit) / (unit + other_unit)).epsilon(1e-4));
  CHECK(both.without() == Approx(2.25 * unit + 6.25 * other_unit));
  // each with a law of its own
  MatrixXd slow(curve_features, 2), fast(curve_features, 2);
  slow << 0.5 * way, 4 * way;
  fast << 3 * way, 4 * way;
  const StrengthProfile late = curve_of(space, {1.4, 4}, slow).profile(seen(way));
  const StrengthProfile early = curve_of(space, {1.4, 4}, fast).profile(seen(2 * way));
  StrengthProfile sum = late;
  sum += early;
  for (const double strength : {0.7, 1.4, 3.0}) {
    CHECK(late(one(strength)) != Approx(curve_of(space, {1.4, 4}, fast).profile(seen(way))(one(strength))));
    CHECK(sum(one(strength)) == Approx(late(one(strength)) + early(one(strength))));
  }
  CHECK_THROWS_WITH(both += curve_of(space, {5}, way).profile(seen(way)), decant_test::contains("the same"));
}

TEST_CASE("effect curve: components add up, and each has its own strength and interval") {
  const NuisanceSpace space = plain_space();
  Features draw(4);
  const VectorXd across = draw.noise(1), along = draw.noise(1), bend = draw.noise(1);
  // the second one bends, and both are simulated alone
  MatrixXd differences(curve_features, 4);
  differences << 2 * across, -2 * across, along + 0.5 * bend, -along + 0.5 * bend;
  const EffectCurve curve(space, two(0, 10), {two(2, 10), two(-2, 10), two(0, 11), two(0, 9)}, differences);
  CHECK(curve.axes()[1].range == std::pair(9.0, 11.0));
  const VectorXd change = -0.7 * across + 0.6 * along + 0.36 * 0.5 * bend;
  const StrengthProfile profile = curve.profile(space.standardised_difference(change));
  CHECK(profile.best()[0] == Approx(-0.7).epsilon(1e-3));
  CHECK(profile.best()[1] == Approx(10.6).epsilon(1e-4));
  CHECK(profile(profile.best()) == Approx(0).margin(1e-6));
  CHECK(profile.without() == Approx(space.distance(space.standardised_difference(change))));
  CHECK((curve.at(profile.best()) - space.standardised_difference(change)).norm() < 1e-3);

  // Two that look alike: each alone can be anything as long as their sum fits, which an interval has to say.
  MatrixXd alike(curve_features, 2);
  alike << across, across + 0.01 * along;
  const EffectCurve same(space, two(0, 0), {two(1, 0), two(0, 1)}, alike);
  const StrengthProfile unsure = same.profile(space.standardised_difference(across));
  const double unit = space.distance(space.standardised_difference(across));
  const auto [from, to] = unsure.within(0, 0.1 * unit);
  CHECK(from == Approx(0).margin(1e-6));
  CHECK(to == Approx(1).margin(1e-6));
  const StrengthProfile sure = curve.profile(space.standardised_difference(across));
  const auto [low, high] = sure.within(0, 0.01 * unit);
  CHECK(low == Approx(0.9).epsilon(0.01));
  CHECK(high == Approx(1.1).epsilon(0.01));
}

TEST_CASE("effect curve: simulations are checked") {
  const NuisanceSpace space = plain_space();
  const MatrixXd both = MatrixXd::Ones(curve_features, 2);
  CHECK_THROWS_WITH(curve_of(space, {1}, both), decant_test::contains("one for each simulation"));
  CHECK_THROWS_WITH(curve_of(space, {3, 3}, both, 3), decant_test::contains("other than the base"));
  CHECK_THROWS_WITH(curve_of(space, {1, 2}, MatrixXd::Ones(3, 2)), decant_test::contains("as many as of the space"));
  CHECK_THROWS_WITH(curve_of(space, {1, std::numeric_limits<double>::infinity()}, both),
                    decant_test::contains("strength must be finite"));
  const double no = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(curve_of(space, {1, 2}, no * both), decant_test::contains("features must be finite"));
  CHECK_THROWS_WITH(EffectCurve(space, two(0, 0), {one(1), one(2)}, both),
                    decant_test::contains("a number for each component"));
  CHECK_THROWS_WITH(EffectCurve(space, two(0, 0), {two(1, 0), two(2, 0)}, both),
                    decant_test::contains("other than the base"));
}
