// SPDX-License-Identifier: MIT

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include <Eigen/Dense>

#include <decant/discovery/nuisance_space.hpp>

#include "catch.hpp"

using namespace decant;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Features that vary together in two directions, and each by itself.
struct World {
  explicit World(Index features, std::uint32_t seed) : random(seed) {
    mean = noise(features, 1);
    common = noise(features, 2);
  }
  MatrixXd noise(Index rows, Index columns) {
    return MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
  }
  MatrixXd draws(Index count, double own = 0.2) {
    return (common * noise(2, count) + own * noise(mean.size(), count)).colwise() + mean;
  }
  NuisanceSample sample(Index count) { return {mean, draws(count), MatrixXd(mean.size(), 0), {}}; }

  std::mt19937 random;
  std::normal_distribution<double> normal{0, 1};
  VectorXd mean;
  MatrixXd common;
};

/// The covariance as it is written down, inverted as a whole.
double distance_by_definition(const NuisanceSample& sample, const NuisanceSettings& settings, const VectorXd& y) {
  const Index p = sample.draws.rows(), n = sample.draws.cols();
  const VectorXd center = 0.5 * sample.baseline.rowwise().mean() + 0.5 * sample.draws.rowwise().mean();
  VectorXd deviation(p);
  for (Index j = 0; j < p; ++j) {
    double squares = 0;
    for (Index i = 0; i < n; ++i) {
      squares += std::pow(sample.draws(j, i) - center[j], 2);
    }
    deviation[j] = std::sqrt(squares / static_cast<double>(n) + settings.floor * settings.floor);
  }
  const MatrixXd z = deviation.cwiseInverse().asDiagonal() * (sample.draws.colwise() - center);
  const Eigen::JacobiSVD<MatrixXd> svd(z, Eigen::ComputeThinU);
  VectorXd lambda = svd.singularValues().array().square() / static_cast<double>(n);
  const Index kept = std::min<Index>(settings.directions, n / 4);
  const double rho = (lambda.sum() - lambda.head(kept).sum()) / static_cast<double>(p - kept) * static_cast<double>(n) /
                     static_cast<double>(n - kept);
  MatrixXd sigma = rho * MatrixXd::Identity(p, p);
  for (Index k = 0; k < kept; ++k) {
    sigma += std::max(0.0, lambda[k] - rho) * svd.matrixU().col(k) * svd.matrixU().col(k).transpose();
  }
  for (Index m = 0; m < sample.templates.cols(); ++m) {
    const VectorXd w = settings.template_deviation * sample.templates.col(m).cwiseQuotient(deviation);
    sigma += w * w.transpose();
  }
  const VectorXd a = (y - center).cwiseQuotient(deviation);
  return a.dot(sigma.ldlt().solve(a)) / static_cast<double>(p);
}

}  // namespace

TEST_CASE("nuisance space: distances are those of the covariance as it is written down") {
  World world(40, 1);
  NuisanceSample sample = world.sample(24);
  sample.templates = world.noise(40, 3);
  sample.templates.col(2) = sample.templates.col(1) + 1e-3 * sample.templates.col(0);  // nearly alike
  for (const int directions : {0, 2, 5}) {
    for (const double deviation : {0.0, 1.0, 10.0}) {
      NuisanceSettings settings;
      settings.directions = directions;
      settings.template_deviation = deviation;
      const NuisanceSpace space(sample, settings);
      for (const VectorXd& y :
           {VectorXd(sample.draws.col(3)), VectorXd(world.noise(40, 1)), VectorXd(sample.baseline.col(0))}) {
        CHECK(space.distance(space.standardised(y)) == Approx(distance_by_definition(sample, settings, y)));
      }
      const VectorXd a = space.standardised(world.noise(40, 1)), b = space.standardised(world.noise(40, 1));
      CHECK(space.distance(a + b) == Approx(space.distance(a) + space.distance(b) + 2 * space.inner(a, b)));
      CHECK(space.standardised(space.center() + b).isApprox(space.standardised_difference(b)));
    }
  }
}

TEST_CASE("nuisance space: draws that it was not made of are about 1 away, whatever they have in common") {
  World world(1000, 2);
  const NuisanceSample sample = world.sample(24);
  double left_out = 0, among = 0;
  for (Index draw = 0; draw < 24; ++draw) {
    const NuisanceSpace rest(sample.without_draw(draw)), all(sample);
    left_out += rest.distance(rest.standardised(sample.draws.col(draw))) / 24;
    among += all.distance(all.standardised(sample.draws.col(draw))) / 24;
  }
  CHECK(left_out > 0.8);
  CHECK(left_out < 1.5);
  CHECK(among < left_out);
  // ten times as far along what varies anyway is little, a hundredth of that elsewhere is much
  const NuisanceSpace space(sample);
  const VectorXd along = 3 * world.common.col(0), elsewhere = world.noise(1000, 1);
  CHECK(space.distance(space.standardised(world.mean + along)) < 1.5);
  CHECK(space.distance(space.standardised(world.mean + elsewhere)) > 3);
}

TEST_CASE("nuisance space: an error of measurement that has a template is no distance") {
  World world(300, 3);
  NuisanceSample sample = world.sample(20);
  const VectorXd shift = world.noise(300, 1), seen = world.draws(1).col(0) + 2 * shift;
  const NuisanceSpace without(sample);
  sample.templates = shift;
  const NuisanceSpace with(sample);
  CHECK(without.distance(without.standardised(seen)) > 5);
  CHECK(with.distance(with.standardised(seen)) < 1.5);
}

TEST_CASE("nuisance space: what reality always does differently is learnt from references") {
  World world(300, 4);
  NuisanceSample sample = world.sample(20);
  const VectorXd always = 3 * world.noise(300, 1);  // a solver is no liquid
  const auto reality = [&] { return VectorXd(world.draws(1).col(0) + always); };
  const VectorXd seen = reality(), effect = world.noise(300, 1);
  const NuisanceSpace without(sample);
  sample.references.resize(300, 3);
  for (Index k = 0; k < 3; ++k) {
    sample.references.col(k) = reality() - world.mean;
  }
  const NuisanceSpace with(sample);
  CHECK(without.distance(without.standardised(seen)) > 20);
  double others = 0;
  for (int k = 0; k < 20; ++k) {
    others += with.distance(with.standardised(with.as_modelled(reality()))) / 20;
  }
  CHECK(others < 2);  // 4 / 3, as the mean of three references is off too, and what is not known of common directions
  CHECK(with.distance(with.standardised(with.as_modelled(seen + 6 * effect))) > 2);
  CHECK((with.as_modelled(world.mean + always) - world.mean).norm() < 0.5 * always.norm());
  CHECK(with.center().isApprox(without.center()));
  // half of it may not carry over to another pour
  CHECK(with.distance(with.standardised(with.as_modelled(world.draws(1).col(0) + 0.5 * always))) < 2);
  // unless less is known to: all of it is then 20 deviations in a single direction, of as many as there are features
  const VectorXd none = world.draws(1).col(0);
  sample.reference_error = 0.05;
  const NuisanceSpace surer(sample);
  CHECK(surer.as_modelled(none).isApprox(with.as_modelled(none)));
  CHECK(surer.distance(surer.standardised(surer.as_modelled(none))) >
        with.distance(with.standardised(with.as_modelled(none))) + 0.6 * 20 * 20 / 300);
  sample.reference_error = 0.5;
  // without the first reference: as if there had been two
  NuisanceSample two = sample;
  two.references = sample.references.rightCols(2);
  const NuisanceSpace rest(sample.without_reference(0));
  CHECK(rest.as_modelled(seen).isApprox(NuisanceSpace(two).as_modelled(seen)));
  CHECK(!rest.as_modelled(seen).isApprox(with.as_modelled(seen)));
}

TEST_CASE("nuisance space: what differs between references is no effect") {
  World world(300, 6);
  NuisanceSample sample = world.sample(20);
  const VectorXd sometimes = 2 * world.noise(300, 1);
  sample.references.resize(300, 3);
  for (Index k = 0; k < 3; ++k) {
    sample.references.col(k) = world.draws(1).col(0) + static_cast<double>(k - 1) * sometimes - world.mean;
  }
  const NuisanceSpace space(sample);
  CHECK(space.distance(space.standardised(world.mean + sometimes)) < 2);
  CHECK(space.distance(space.standardised(world.mean + 2 * world.noise(300, 1))) > 10);
}

TEST_CASE("nuisance space: samples and settings are checked") {
  World world(10, 5);
  const auto refuses = [&](auto&& change, const char* words) {
    NuisanceSample sample = world.sample(8);
    NuisanceSettings settings;
    change(sample, settings);
    CHECK_THROWS_WITH(NuisanceSpace(sample, settings), decant_test::contains(words));
  };
  refuses([](auto&, auto& settings) { settings.floor = 0; }, "floor must be > 0");
  refuses([](auto&, auto& settings) { settings.directions = -1; }, "directions must be >= 0");
  refuses([](auto& sample, auto&) { sample.reference_error = 2; }, "reference_error must be 0 .. 1");
  refuses([](auto&, auto& settings) { settings.template_deviation = -1; }, "template_deviation must be >= 0");
  refuses([](auto& sample, auto&) { sample.draws.resize(10, 3); }, "draws must be at least 4");
  refuses([](auto& sample, auto&) { sample.baseline.resize(10, 0); }, "at least one simulation");
  refuses([](auto& sample, auto&) { sample.templates.setZero(9, 1); }, "as many as of the draws");
  refuses([](auto& sample, auto&) { sample.draws(0, 0) = std::numeric_limits<double>::quiet_NaN(); }, "finite");
  // features that never differ: no division by zero
  NuisanceSample still{MatrixXd::Ones(10, 1), MatrixXd::Ones(10, 8), {}, {}};
  const NuisanceSpace space(still);
  CHECK(space.distance(space.standardised(VectorXd::Ones(10))) == 0);
  CHECK(std::isfinite(space.distance(space.standardised(VectorXd::Zero(10)))));
}
