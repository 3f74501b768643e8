// SPDX-License-Identifier: MIT
// Displacements between silhouettes: against translations, whose transport is known, and against no change at all.

#include <cmath>
#include <random>
#include <vector>

#include <decant/correction/silhouette_transport.hpp>

#include "catch.hpp"

using decant::Index;
using decant::Mask;
using decant::SilhouetteTransport;
using decant::SilhouetteTransportSettings;

namespace {

/// Ellipses at random places, moved by (u, v).
Mask blobs(unsigned seed, double u, double v) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(80, 160), half_axis(8, 30);
  Mask mask = Mask::Zero(240, 240);
  for (int k = 0; k < 4; ++k) {
    const double x = place(random) + u, y = place(random) + v, a = half_axis(random), b = half_axis(random);
    for (Index row = 0; row < mask.rows(); ++row) {
      for (Index column = 0; column < mask.cols(); ++column) {
        const double dx = (static_cast<double>(column) - x) / a, dy = (static_cast<double>(row) - y) / b;
        if (dx * dx + dy * dy < 1) {
          mask(row, column) = decant::mask_liquid;
        }
      }
    }
  }
  return mask;
}

template <class Function>
void for_each_liquid(const Mask& mask, Function&& f) {
  for (Index row = 0; row < mask.rows(); ++row) {
    for (Index column = 0; column < mask.cols(); ++column) {
      if (decant::is_liquid(mask(row, column))) {
        f(Eigen::Vector2d(static_cast<double>(column), static_cast<double>(row)));
      }
    }
  }
}

Eigen::Vector2d mean_displacement(const SilhouetteTransport& transport, const Mask& predicted) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for_each_liquid(predicted, [&](const Eigen::Vector2d& pixel) {
    sum += transport.displacement(pixel);
    ++count;
  });
  return sum / count;
}

}  // namespace

TEST_CASE("silhouette transport: equal silhouettes ask for nothing, whatever their shape") {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Mask mask = blobs(seed, 0, 0);
    for (const auto& [cell, blur] : {std::pair{8.0, 10.0}, {5.0, 7.0}, {4.0, 4.0}}) {
      SilhouetteTransport transport({.cell_px = cell, .blur_px = blur});
      REQUIRE(transport.match(mask, mask));
      for_each_liquid(mask, [&](const Eigen::Vector2d& pixel) {
        // what the iterations have not yet agreed on; a twentieth of a pixel is far below what a mask knows
        REQUIRE(transport.displacement(pixel).norm() < 0.05);
      });
    }
  }
}

TEST_CASE("silhouette transport: a silhouette that moved as a whole is followed by its mean") {
  // With all mass matched, the mean displacement is the difference of the centroids, whatever the plan.
  const Mask before = blobs(7, 0, 0), after = blobs(7, 11, -6);
  SilhouetteTransport transport(
      {.cell_px = 5, .blur_px = 15, .reach_px = 5000, .iterations = 400, .debias_iterations = 200});
  REQUIRE(transport.match(before, after));
  const Eigen::Vector2d mean = mean_displacement(transport, before);
  // interpolation between nodes 5 px apart leaves some tenths
  CHECK(mean.x() == Approx(11).margin(0.3));
  CHECK(mean.y() == Approx(-6).margin(0.3));
}

TEST_CASE("silhouette transport: passes from coarse to fine bring a silhouette to where it was seen") {
  const Mask after = blobs(3, 9, 5);
  Mask now = blobs(3, 0, 0);
  const auto difference = [&] { return (now != after).count(); };
  const auto at_first = difference();
  for (const auto& [cell, blur] : {std::pair{8.0, 10.0}, {5.0, 7.0}, {4.0, 4.0}, {4.0, 4.0}}) {
    SilhouetteTransport transport({.cell_px = cell, .blur_px = blur});
    REQUIRE(transport.match(now, after));
    Mask moved = Mask::Zero(now.rows(), now.cols());
    for_each_liquid(now, [&](const Eigen::Vector2d& pixel) {
      const Eigen::Vector2d to = pixel + transport.displacement(pixel);
      // two pixels wide, so that stretched places have no holes
      for (int dv = 0; dv < 2; ++dv) {
        for (int du = 0; du < 2; ++du) {
          moved(static_cast<Index>(to.y()) + dv, static_cast<Index>(to.x()) + du) = decant::mask_liquid;
        }
      }
    });
    now = moved;
  }
  INFO("differing pixels " << at_first << ", then " << difference());
  CHECK(difference() < at_first / 4);
}

TEST_CASE("silhouette transport: what is out of reach stays, what is missing asks for nothing") {
  Mask left = Mask::Zero(200, 600), right = left;
  left.block(90, 40, 20, 20).setConstant(decant::mask_liquid);
  right.block(90, 400, 20, 20).setConstant(decant::mask_liquid);
  SilhouetteTransport transport;
  REQUIRE(transport.match(left, right));
  CHECK(transport.displacement({50, 100}).norm() < 0.1);
  const Mask empty = Mask::Zero(200, 600);
  CHECK_FALSE(transport.match(left, empty));
  CHECK(transport.displacement({50, 100}) == Eigen::Vector2d::Zero());
  CHECK_FALSE(transport.match(empty, left));
  CHECK_FALSE(transport.match(left, blobs(1, 0, 0)));  // of another size
  REQUIRE(transport.match(left, left));
  CHECK(transport.displacement({500, 100}) == Eigen::Vector2d::Zero());  // nothing was predicted there
  CHECK(transport.displacement({std::nan(""), 100}) == Eigen::Vector2d::Zero());
}

TEST_CASE("silhouette transport: the same as by direct sums over all pairs of pixels, in logarithms") {
  Mask before = Mask::Zero(40, 60), after = before;
  before.block(10, 8, 9, 7).setConstant(decant::mask_liquid);
  before.block(14, 20, 3, 10).setConstant(decant::mask_liquid);
  after.block(12, 13, 8, 9).setConstant(decant::mask_liquid);
  after.block(25, 40, 5, 5).setConstant(decant::mask_liquid);
  const SilhouetteTransportSettings settings{
      .cell_px = 1, .blur_px = 4, .reach_px = 20, .iterations = 30, .debias_iterations = 20};
  SilhouetteTransport transport(settings);
  REQUIRE(transport.match(before, after));

  std::vector<Eigen::Vector2d> from, to;
  for_each_liquid(before, [&](const Eigen::Vector2d& pixel) { from.push_back(pixel); });
  for_each_liquid(after, [&](const Eigen::Vector2d& pixel) { to.push_back(pixel); });
  const double entropy = settings.blur_px * settings.blur_px;
  const double power = settings.reach_px * settings.reach_px / (settings.reach_px * settings.reach_px + entropy);
  const auto log_sum = [&](const Eigen::Vector2d& p, const auto& places, const std::vector<double>& scale) {
    std::vector<double> exponents(places.size());
    double largest = -1e300, sum = 0;
    for (std::size_t k = 0; k < places.size(); ++k) {
      exponents[k] = scale[k] - (p - places[k]).squaredNorm() / entropy;
      largest = std::max(largest, exponents[k]);
    }
    for (const double exponent : exponents) {
      sum += std::exp(exponent - largest);
    }
    return largest + std::log(sum);
  };
  std::vector<double> u(from.size(), 0.0), v(to.size(), 0.0), self(from.size(), 0.0);
  for (int iteration = 0; iteration < settings.iterations; ++iteration) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      u[i] = -power * log_sum(from[i], to, v);
    }
    for (std::size_t j = 0; j < to.size(); ++j) {
      v[j] = -power * log_sum(to[j], from, u);
    }
  }
  for (int iteration = 0; iteration < settings.debias_iterations; ++iteration) {
    std::vector<double> next(self.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      next[i] = 0.5 * (self[i] - power * log_sum(from[i], from, self));
    }
    self = next;
  }
  const auto mean_place = [&](const Eigen::Vector2d& p, const auto& places, const std::vector<double>& scale) {
    const double total = log_sum(p, places, scale);
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (std::size_t k = 0; k < places.size(); ++k) {
      mean += std::exp(scale[k] - (p - places[k]).squaredNorm() / entropy - total) * places[k];
    }
    return mean;
  };
  double longest = 0;
  for (const Eigen::Vector2d& p : from) {
    const double matched = std::min(1.0, std::exp(1 + (1 - power) * log_sum(p, to, v)));
    const Eigen::Vector2d expected = matched * (mean_place(p, to, v) - mean_place(p, from, self));
    INFO(p.transpose() << " moves by " << expected.transpose());
    CHECK((transport.displacement(p) - expected).norm() < 1e-4);  // the kernel's floor moves some by 1e-5
    longest = std::max(longest, expected.norm());
  }
  CHECK(longest > 5);
}

TEST_CASE("silhouette transport: fewer, larger cells still see which way a silhouette went") {
  const Mask before = blobs(5, 0, 0), after = blobs(5, 6, 6);
  SilhouetteTransport coarse({.most_nodes = 120});
  REQUIRE(coarse.match(before, after));
  const Eigen::Vector2d mean = mean_displacement(coarse, before);
  CHECK(mean.x() > 2);
  CHECK(mean.y() > 2);
}

TEST_CASE("silhouette transport: settings are checked") {
  using Settings = SilhouetteTransportSettings;
  CHECK_THROWS_WITH(SilhouetteTransport(Settings{.cell_px = 0.5}), decant_test::contains("cell_px must be >= 1"));
  CHECK_THROWS_WITH(SilhouetteTransport(Settings{.blur_px = std::nan("")}),
                    decant_test::contains("blur_px must be > 0"));
  CHECK_THROWS_WITH(SilhouetteTransport(Settings{.reach_px = 3}), decant_test::contains("reach_px must be > blur_px"));
  CHECK_THROWS_WITH(SilhouetteTransport(Settings{.most_nodes = 2}), decant_test::contains("most_nodes must be 100"));
  CHECK_THROWS_WITH(SilhouetteTransport(Settings{.iterations = 0}), decant_test::contains("iterations must be >= 1"));
}
