// SPDX-License-Identifier: MIT

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <decant/core/image.hpp>
#include <decant/discovery/silhouette_features.hpp>
#include <decant/discovery/silhouette_series.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr int width = 75, height = 42;  // no multiple of any cell

Mask random_mask(std::mt19937& random, double share) {
  Mask mask = Mask::Zero(height, width);
  std::bernoulli_distribution liquid(share);
  for (Index row = 0; row < height; ++row) {
    for (Index column = 20; column < 60; ++column) {  // dry at both sides
      mask(row, column) = liquid(random) ? mask_liquid : std::uint8_t{0};
    }
  }
  return mask;
}

struct Film {
  std::vector<Mask> masks{};
  std::vector<double> time{};
  std::vector<bool> seen{};

  SilhouetteSeries series(int cell_px) const {
    SilhouetteSeries result(width, height, cell_px);
    for (std::size_t frame = 0; frame < masks.size(); ++frame) {
      if (seen[frame]) {
        result.add(time[frame], masks[frame]);
      } else {
        result.add_unseen(time[frame]);
      }
    }
    return result;
  }
};

Film film(std::uint32_t seed, double share, const std::vector<std::size_t>& unseen = {}) {
  std::mt19937 random(seed);
  Film made;
  for (std::size_t frame = 0; frame < 9; ++frame) {
    made.masks.push_back(random_mask(random, share));
    made.time.push_back(0.5 + static_cast<double>(frame) / 15);
    made.seen.push_back(std::find(unseen.begin(), unseen.end(), frame) == unseen.end());
  }
  return made;
}

/// Share of liquid pixels of a box that may reach beyond the image, over some frames.
double share_of(const Film& made, const PixelBox& box, const std::vector<std::size_t>& frames) {
  double liquid = 0;
  for (const std::size_t frame : frames) {
    for (int v = box.v_begin; v < std::min(box.v_end, height); ++v) {
      for (int u = box.u_begin; u < std::min(box.u_end, width); ++u) {
        liquid += made.masks[frame](v, u) == mask_liquid ? 1 : 0;
      }
    }
  }
  return liquid / static_cast<double>(frames.size());
}

}  // namespace

TEST_CASE("silhouette features: shares of squares over windows of time") {
  const Film recording = film(1, 0.3, {2, 4, 5}), simulation = film(2, 0.5);
  const std::vector<SilhouetteFeatures::Series> simulations{{simulation.series(5)}};
  SilhouetteFeatureSettings settings;
  settings.window = 2 / 15.0;
  const SilhouetteFeatures features({recording.series(5)}, simulations, settings);
  const Eigen::VectorXd own = features.of({recording.series(5)}), other = features.of(simulations[0]);
  REQUIRE(features.size() > 0);
  REQUIRE(own.size() == static_cast<Eigen::Index>(features.size()));
  // two frames in a window, except that 2, 4 and 5 were not seen: windows 0, 1 (frame 3 alone), 3 and 4 (frame 8)
  const std::vector<std::vector<std::size_t>> frames{{0, 1}, {3}, {}, {6, 7}, {8}};
  std::vector<int> in_window(5, 0);
  for (std::size_t k = 0; k < features.size(); ++k) {
    const SilhouetteFeatures::Place& place = features.place(k);
    ++in_window[static_cast<std::size_t>(place.window)];
    const auto& of = frames[static_cast<std::size_t>(place.window)];
    REQUIRE(!of.empty());
    CHECK(place.box == PixelBox{place.column * 10, place.row * 10, place.column * 10 + 10, place.row * 10 + 10});
    CHECK(place.begin == Approx(recording.time[of.front()]));
    CHECK(place.end == Approx(recording.time[of.back()]));
    const auto which = static_cast<Eigen::Index>(k);
    // bytes: half of 1 / 255 off at most. Cells at the border have fewer pixels and count as whole ones.
    const bool inside = place.box.u_end <= width && place.box.v_end <= height;
    if (inside) {
      CHECK(own[which] == Approx(share_of(recording, place.box, of) / 100).margin(0.5 / 255));
      CHECK(other[which] == Approx(share_of(simulation, place.box, of) / 100).margin(0.5 / 255));
    }
  }
  // liquid is in columns 20 .. 59 of the picture, the rest has no features
  CHECK(in_window == std::vector<int>{20, 20, 0, 20, 20});
}

TEST_CASE("silhouette features: a square that is wet in one simulation alone counts in all") {
  Film dry = film(3, 0), wet = dry;
  wet.masks[4].block(0, 30, 10, 10) = mask_liquid;
  const std::vector<SilhouetteFeatures::Series> none,
      simulations{{wet.series(10), wet.series(10)}, {dry.series(10), dry.series(10)}};
  CHECK(SilhouetteFeatures({dry.series(10)}, none).size() == 0);
  const SilhouetteFeatures features({dry.series(10), dry.series(10)}, simulations);
  REQUIRE(features.size() == 2);
  CHECK(features.place(1).camera == 1);
  CHECK(features.of({dry.series(10), dry.series(10)}).isZero());
  CHECK(features.of({wet.series(10), dry.series(10)})[0] == Approx(0.125));  // a quarter of the square in half the time
  CHECK(features.of({wet.series(10), dry.series(10)})[1] == 0);
}

TEST_CASE(
    "silhouette features: which of them another recording of the same frames has seen, and which recordings fit") {
  const Film own = film(7, 0.5, {4, 5}), other = film(8, 0.5, {0, 3, 4});
  SilhouetteFeatureSettings settings;
  settings.window = 2 / 15.0;
  const std::vector<SilhouetteFeatures::Series> none;
  const SilhouetteFeatures features({own.series(5)}, none, settings);
  const std::vector<bool> seen = features.seen_in({other.series(5)});
  REQUIRE(seen.size() == features.size());
  // windows of frames 0 and 1, 2 and 3, 6 and 7, 8: of 4 and 5 there is none
  for (std::size_t k = 0; k < seen.size(); ++k) {
    CHECK(seen[k] == (features.place(k).window > 1));
  }
  CHECK(features.fit({other.series(5)}));
  CHECK(!features.fit({other.series(6)}));
  CHECK(!features.fit({other.series(5), other.series(5)}));
  Film longer = other;
  longer.masks.push_back(other.masks.back());
  longer.time.push_back(2);
  longer.seen.push_back(true);
  CHECK(!features.fit({longer.series(5)}));
}

TEST_CASE("silhouette series: numbers and back") {
  const SilhouetteSeries series = film(4, 0.4, {3}).series(7), empty = film(5, 0, {3}).series(7);
  CHECK(series.rows() == 6);
  CHECK(series.columns() == 11);
  CHECK(!series.seen(3));
  const std::vector<double> numbers = series.numbers();
  const SilhouetteSeries back = empty.with_numbers(numbers);
  CHECK(back.numbers() == numbers);
  CHECK(back.time(8) == series.time(8));
  // what is dry is counted, in nine frames of 6 x 11 cells
  CHECK(empty.numbers() == std::vector<double>{-594});
  CHECK(numbers.size() < 400);
  for (std::size_t frame = 0; frame < 9; ++frame) {
    for (Eigen::Index row = 0; row < 6; ++row) {
      for (Eigen::Index column = 0; column < 11; ++column) {
        REQUIRE(back.share(frame, row, column) == series.share(frame, row, column));
      }
    }
  }
  CHECK_THROWS_WITH(empty.with_numbers(std::vector<double>(3)), decant_test::contains("as many as of the series"));
  CHECK_THROWS_WITH(empty.with_numbers(std::vector<double>{-500, 256}), decant_test::contains("a byte"));
  CHECK_THROWS_WITH(empty.with_numbers(std::vector<double>{-595}), decant_test::contains("a byte"));
  CHECK_THROWS_WITH(empty.with_numbers(std::vector<double>{-594, 1}), decant_test::contains("a byte"));
  CHECK_THROWS_WITH(empty.with_numbers(std::vector<double>{0.5}), decant_test::contains("a byte"));
}

TEST_CASE("silhouette features: series and settings are checked") {
  const Film made = film(6, 0.4);
  const SilhouetteFeatures::Series own{made.series(5)};
  const std::vector<SilhouetteFeatures::Series> none, other_cells{{made.series(6)}};
  CHECK_THROWS_WITH(SilhouetteFeatures(own, other_cells), decant_test::contains("those of the recording"));
  CHECK_THROWS_WITH(SilhouetteFeatures(own, none).of({}), decant_test::contains("cameras"));
  SilhouetteFeatureSettings settings;
  settings.pooled_cells = 0;
  CHECK_THROWS_WITH(SilhouetteFeatures(own, none, settings), decant_test::contains("pooled_cells must be >= 1"));
  settings = {};
  settings.window = 0;
  CHECK_THROWS_WITH(SilhouetteFeatures(own, none, settings), decant_test::contains("window [s] must be > 0"));
  settings = {};
  settings.least_share = -1;
  CHECK_THROWS_WITH(SilhouetteFeatures(own, none, settings), decant_test::contains("least_share must be >= 0"));
  CHECK_THROWS_WITH(SilhouetteSeries(0, 5), decant_test::contains("must be >= 1"));
  CHECK_THROWS_WITH(SilhouetteSeries(5, 5, 0), decant_test::contains("must be >= 1"));
  SilhouetteSeries series(width, height);
  series.add(1, made.masks[0]);
  CHECK_THROWS_WITH(series.add(1, made.masks[0]), decant_test::contains("increasing"));
  CHECK_THROWS_WITH(series.add(2, Mask::Zero(3, 3)), decant_test::contains("that of the image"));
}
