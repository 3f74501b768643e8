// SPDX-License-Identifier: MIT
// What a function may be between noisy evaluations, against the function that they are of.

#include <decant/hypothesis/surrogate.hpp>

#include <cmath>
#include <limits>
#include <random>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr int places = 40;

double wave(double x) { return std::sin(4 * x); }

Eigen::MatrixXd even_places() { return Eigen::RowVectorXd::LinSpaced(places, 0, 1); }

/// With independent errors of that standard deviation.
Eigen::VectorXd evaluated(double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::VectorXd(
      even_places().transpose().unaryExpr([&](double x) { return wave(x) + deviation * normal(random); }));
}

double root_mean_square(const Eigen::VectorXd& values) { return std::sqrt(values.squaredNorm() / places); }

}  // namespace

TEST_CASE("surrogate: noise is told from what the function does") {
  constexpr double deviation = 0.2;
  const Eigen::VectorXd truth = evaluated(0, 1);
  double noise = 0, off = 0, inside = 0;
  constexpr int cases = 12, draws = 400;
  for (int k = 0; k < cases; ++k) {
    const Eigen::VectorXd values = evaluated(deviation, static_cast<unsigned>(100 + k));
    const Surrogate surrogate(even_places(), values);
    noise += surrogate.noise() / cases;
    const Eigen::MatrixXd drawn = surrogate.draw(even_places(), draws, 7);
    const Eigen::VectorXd mean = drawn.rowwise().mean();
    off += root_mean_square(mean - truth) / cases;
    const Eigen::VectorXd spread = ((drawn.colwise() - mean).rowwise().squaredNorm() / draws).cwiseSqrt();
    inside +=
        static_cast<double>(((mean - truth).cwiseAbs().array() < 1.645 * spread.array()).count()) / places / cases;
  }
  CHECK(noise == Approx(deviation).epsilon(0.15));
  // half a wave has about four degrees of freedom: errors go down by sqrt(4 / 40)
  CHECK(off < 0.5 * deviation);
  // what is drawn is the function, without the noise, and as far off as it says
  CHECK(inside > 0.8);
  CHECK(inside < 0.99);
}

TEST_CASE("surrogate: goes through values without noise, and is unsure between them") {
  const Eigen::VectorXd truth = evaluated(0, 1);
  const Surrogate surrogate(even_places(), truth);
  CHECK(surrogate.noise() < 0.01);
  const Eigen::MatrixXd drawn = surrogate.draw(even_places(), 50, 3);
  CHECK((drawn.colwise() - truth).cwiseAbs().maxCoeff() < 0.02);

  const Eigen::MatrixXd near_and_far = (Eigen::RowVectorXd(6) << 0, 0.1, 0.2, 0.3, 0.4, 1).finished();
  const Surrogate scarce(near_and_far, near_and_far.transpose().unaryExpr(&wave));
  const auto spread_at = [&](double x) {
    const Eigen::MatrixXd values = scarce.draw(Eigen::MatrixXd::Constant(1, 1, x), 2000, 3);
    return (values.array() - values.mean()).abs().mean();
  };
  CHECK(spread_at(0.7) > 3 * spread_at(0.15));
}

TEST_CASE("surrogate: values that make no sense are refused") {
  const Eigen::MatrixXd two = Eigen::RowVector2d(0, 1);
  CHECK_THROWS_WITH(Surrogate(two, Eigen::VectorXd::Ones(3)), Catch::Contains("number of values"));
  CHECK_THROWS_WITH(Surrogate(two.leftCols(1), Eigen::VectorXd::Ones(1)), Catch::Contains("at least 2"));
  CHECK_THROWS_WITH(Surrogate(two, Eigen::Vector2d(1, std::numeric_limits<double>::quiet_NaN())),
                    Catch::Contains("finite"));
}
