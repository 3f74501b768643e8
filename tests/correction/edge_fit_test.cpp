// SPDX-License-Identifier: MIT
// EdgeFit on single discs before straight edges, where the right move is known, and on a block of liquid.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <decant/correction/edge_fit.hpp>
#include <decant/coverage/detail/mask_disagreement.hpp>
#include <decant/tracking/overlap.hpp>

#include "catch.hpp"
#include "correction/seen.hpp"

using decant::Index;
using decant::Vector3;
using decant_test::Eye;
using decant_test::liquid_block;

namespace {

// A disc of 20 px in the middle of the image: half a metre away, a pixel is 1 mm.
constexpr double radius = 0.02, spacing = 0.03;

decant::FluidState<double> one_particle() {
  decant::FluidState<double> fluid;
  fluid.resize(1);
  fluid.position.col(0).setZero();
  fluid.mass[0] = 1e-3;
  return fluid;
}

struct OneDisc {
  decant::FluidState<double> fluid = one_particle();
  Eye<double> eye{decant_test::before_the_block()};

  OneDisc() { eye.drawing = decant::Silhouette<decant::DiscSplat<double>>(decant::DiscSplat<double>(radius)); }

  /// One call, with liquid observed where inside(u, v) in pixels from the middle of the image. Returns the move [px].
  template <class Inside>
  Eigen::Vector2d move(const decant::EdgeFitSettings& settings, Inside inside) {
    for (Index v = 0; v < eye.observed.rows(); ++v) {
      for (Index u = 0; u < eye.observed.cols(); ++u) {
        const bool liquid = inside(static_cast<double>(u) - 99.5, static_cast<double>(v) - 79.5);
        eye.observed(v, u) = liquid ? decant::mask_liquid : std::uint8_t(0);
      }
    }
    const auto views = std::array{eye.predict(fluid)};
    decant::EdgeFit<double> fit(settings);
    fit.correct(fluid, {views, 0, spacing, radius, Vector3<double>(0, 0, -9.81), {1}}, 1.0 / 30);
    CHECK(fluid.velocity.isZero(0));
    CHECK(fluid.position(1, 0) == Approx(0).margin(1e-6));  // never in depth
    return 1e3 * Eigen::Vector2d(fluid.position(0, 0), -fluid.position(2, 0));
  }
};

decant::EdgeFitSettings whole_moves(double push, double pull) {
  decant::EdgeFitSettings settings;
  settings.push = push;
  settings.pull = pull;
  return settings;
}

}  // namespace

TEST_CASE("edge fit: a disc that sticks out by so much is pushed back by so much, at right angles to the edge") {
  for (const double depth : {1.0, 3.0, 8.0}) {
    for (const double angle : {0.0, 0.6, 2.5}) {
      const Eigen::Vector2d out(std::cos(angle), std::sin(angle));
      OneDisc disc;
      const Eigen::Vector2d move =
          disc.move(whole_moves(1, 0), [&](double u, double v) { return out.dot(Eigen::Vector2d(u, v)) < 20 - depth; });
      INFO("depth " << depth << " angle " << angle << " move " << move.transpose());
      CHECK(-out.dot(move) == Approx(depth).margin(0.6));  // pixels are whole
      CHECK(std::abs(out.x() * move.y() - out.y() * move.x()) < 0.3);
    }
  }
}

TEST_CASE("edge fit: a disc that sticks out on both sides stays") {
  OneDisc disc;
  CHECK(disc.move(whole_moves(1, 0), [](double u, double) { return std::abs(u) < 15; }).norm() < 1e-9);
}

TEST_CASE("edge fit: observed pixels that no disc covers pull the disc next to them") {
  OneDisc disc;
  // a bay beyond the disc's rim, from 20 to 22.5 px from its centre: its pixels' distances are 0.5 to 2.5 + 0.5 px
  const Eigen::Vector2d move = disc.move(whole_moves(0, 1), [](double u, double v) {
    return u * u + v * v <= 400 || (u > 0 && std::abs(v) < 3 && u < 22.5);
  });
  CHECK(move.x() == Approx(1.7).margin(0.4));
  CHECK(std::abs(move.y()) < 0.1);
}

TEST_CASE("edge fit: what is beyond its reach, and single pixels, hardly count") {
  OneDisc far, single;
  CHECK(far.move(whole_moves(0, 1),
                 [](double u, double v) { return u * u + v * v <= 400 || (std::abs(v) < 3 && u > 25); })
            .norm() < 1e-9);
  CHECK(single
            .move(whole_moves(0, 1),
                  [](double u, double v) { return u * u + v * v <= 400 || (u > 20 && u < 21 && v > 0 && v < 1); })
            .norm() < 0.45);  // a third of what many such pixels would do
}

TEST_CASE("edge fit: no move is longer than its limit") {
  OneDisc disc;
  auto settings = whole_moves(1, 0);
  settings.longest_in_spacings = 0.05;
  const double move = disc.move(settings, [](double u, double) { return u < 10; }).norm();
  CHECK(move == Approx(1e3 * 0.05 * spacing).epsilon(1e-6));
}

TEMPLATE_TEST_CASE("edge fit: takes away most of what a block's silhouette is off by a pixel", "", float, double) {
  auto fluid = liquid_block<TestType>({0, 0, 0});
  Eye<TestType> eye(decant_test::before_the_block());
  eye.observe(liquid_block<TestType>({0.001, 0, -0.0007}));
  decant::EdgeFit<TestType> fit;
  const auto start = fluid;
  const auto wrong = [&] { return decant::overlap(eye.predicted, eye.observed).differing_px(); };
  eye.predict(fluid);
  const auto before = wrong();
  for (int pass = 0; pass < 4; ++pass) {
    const auto views = std::array{eye.predict(fluid)};
    fit.correct(fluid, decant_test::observation(views, pass), TestType(1.0 / 30));
  }
  eye.predict(fluid);
  INFO(before << " px before, " << wrong() << " px after");
  CHECK(wrong() < before / 3);
  CHECK((fluid.position - start.position).colwise().norm().maxCoeff() < TestType(0.004));
}

TEST_CASE("edge fit: where masks differ is found in any box, and nothing is found where they do not") {
  std::mt19937 random(3);
  const auto between = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  decant::detail::MaskDisagreement disagreement;
  int found = 0, nothing = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int rows = between(1, 60), columns = between(1, 90);
    decant::Mask a = decant::Mask::Zero(rows, columns);
    for (Index k = 0; k < a.size(); ++k) {
      a.data()[k] = static_cast<std::uint8_t>(between(0, 255));
    }
    decant::Mask b = a.unaryExpr([](std::uint8_t value) { return std::uint8_t(value >= 128 ? 255 : 3); });
    for (int k = between(0, 4); k > 0; --k) {
      std::uint8_t& pixel = b(between(0, rows - 1), between(0, columns - 1));
      pixel = decant::is_liquid(pixel) ? 0 : 255;
    }
    disagreement.rebuild(a, b);
    for (int k = 0; k < 20; ++k) {
      const int u = between(0, columns), v = between(0, rows);
      const decant::PixelBox box{u, v, std::min(columns, u + between(0, 20)), std::min(rows, v + between(0, 20))};
      bool differ = false;
      for (int row = box.v_begin; row < box.v_end; ++row) {
        for (int column = box.u_begin; column < box.u_end; ++column) {
          differ = differ || decant::is_liquid(a(row, column)) != decant::is_liquid(b(row, column));
        }
      }
      REQUIRE((!differ || disagreement.any_in(box)));
      found += differ ? 1 : 0;
      nothing += disagreement.any_in(box) ? 0 : 1;
    }
  }
  CHECK(found > 100);
  CHECK(nothing > 1000);
}

TEST_CASE("edge fit: the same moves whatever else is in the image, and whatever was there in the call before") {
  // the block's own edge, and another block beside it that both masks agree about
  auto fluid = liquid_block<double>(Vector3<double>(-0.04, 0, 0));
  Eye<double> eye(decant_test::before_the_block());
  auto seen = fluid;
  seen.position.row(0).array() += 0.002;
  eye.observe(seen);
  decant::EdgeFit<double> fit;
  const auto alone = std::array{eye.predict(fluid)};
  auto expected = fluid;
  REQUIRE(fit.correct(expected, decant_test::observation(alone), 1.0 / 30).moved > 0);

  const auto with_another = [](const decant::FluidState<double>& liquid) {
    const auto other = liquid_block<double>(Vector3<double>(0.04, 0, 0));
    decant::FluidState<double> both;
    both.resize(liquid.size() + other.size());
    both.position << liquid.position, other.position;
    return both;
  };
  auto both = with_another(fluid);
  eye.observe(with_another(seen));
  const auto views = std::array{eye.predict(both)};
  const decant::FluidState<double> before = both;
  CHECK(fit.correct(both, decant_test::observation(views), 1.0 / 30).moved > 0);
  CHECK(both.position.leftCols(fluid.size()) == expected.position);
  CHECK(both.position.rightCols(fluid.size()) == before.position.rightCols(fluid.size()));
}

TEST_CASE("edge fit: settings are checked") {
  CHECK_THROWS_WITH(decant::EdgeFit<>({.push = 1.5}), decant_test::contains("push must be 0 .. 1, got 1.5"));
  CHECK_THROWS_WITH(decant::EdgeFit<>({.pull = std::nan("")}), decant_test::contains("pull must be 0 .. 1"));
  CHECK_THROWS_WITH(decant::EdgeFit<>({.reach_px = 0}), decant_test::contains("reach_px must be > 0, got 0"));
  CHECK_THROWS_WITH(decant::EdgeFit<>({.longest_in_spacings = -1}), decant_test::contains("longest_in_spacings"));
}
