// SPDX-License-Identifier: MIT

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/silhouette_features.hpp>
#include <decant/discovery/silhouette_series.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

/// Features in every square of 10 px of a picture of 100 x 80 px, for 5 windows of one frame each, of two cameras.
SilhouetteFeatures features_everywhere() {
  SilhouetteSeries wet(100, 80, 10);
  for (int frame = 0; frame < 5; ++frame) {
    wet.add(2 + 0.1 * frame, Mask::Constant(80, 100, mask_liquid));
  }
  SilhouetteFeatureSettings settings;
  settings.pooled_cells = 1;
  settings.window = 0.1;
  return {{wet, wet}, {}, settings};
}

std::size_t feature_at(const SilhouetteFeatures& features, std::size_t camera, int window, int row, int column) {
  for (std::size_t k = 0; k < features.size(); ++k) {
    const SilhouetteFeatures::Place& place = features.place(k);
    if (place.camera == camera && place.window == window && place.row == row && place.column == column) {
      return k;
    }
  }
  FAIL("no such feature");
  return 0;
}

}  // namespace

TEST_CASE("disagreement: what touches in space and time is one, with where it begins") {
  const SilhouetteFeatures features = features_everywhere();
  REQUIRE(features.size() == 2 * 5 * 8 * 10);
  Eigen::VectorXd off = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(features.size()), 2.9);
  const auto set = [&](std::size_t camera, int window, int row, int column, double value) {
    off[static_cast<Eigen::Index>(feature_at(features, camera, window, row, column))] = value;
  };
  // a stream that begins as two squares at the top, and falls; over corners, too
  set(0, 1, 1, 4, 6);
  set(0, 1, 1, 5, 12);
  set(0, 2, 2, 6, 10);
  set(0, 3, 3, 7, 5);
  // what is missing beside it is another one
  set(0, 2, 2, 5, -20);
  // and so is what is two squares, or two windows, away, or another camera's
  set(0, 3, 5, 7, 4.5);
  set(1, 3, 3, 7, 7);
  set(0, 4, 1, 4, 4.1);  // three windows later

  const std::vector<Disagreement> found = find_disagreements(features, off);
  REQUIRE(found.size() == 5);
  CHECK(found[0].weight == Approx(400));
  CHECK(!found[0].unexpected);
  CHECK(found[0].onset_u == Approx(54.5));
  CHECK(found[0].onset_v == Approx(24.5));
  const Disagreement& stream = found[1];
  CHECK(stream.unexpected);
  CHECK(stream.camera == 0);
  CHECK(stream.squares.size() == 4);
  CHECK(stream.weight == Approx(36 + 144 + 100 + 25));
  CHECK(stream.largest == Approx(12));
  CHECK(stream.box == PixelBox{40, 10, 80, 40});
  CHECK(stream.begin == Approx(2.1));
  CHECK(stream.end == Approx(2.3));
  CHECK(stream.onset_u == Approx((6 * 44.5 + 12 * 54.5) / 18));
  CHECK(stream.onset_v == Approx(14.5));
  CHECK(found[2].camera == 1);
  CHECK(found[3].weight == Approx(4.5 * 4.5));
  CHECK(found[4].begin == Approx(2.4));
}

TEST_CASE("disagreement: what begins small belongs to it, and much that is small counts where it touches") {
  const SilhouetteFeatures features = features_everywhere();
  Eigen::VectorXd off = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(features.size()));
  const auto set = [&](int window, int row, int column, double value) {
    off[static_cast<Eigen::Index>(feature_at(features, 0, window, row, column))] = value;
  };
  set(2, 1, 1, 3.1);  // small at first
  set(3, 1, 1, -3.9);
  set(3, 1, 2, 4.1);
  for (const int window : {0, 1, 2}) {  // three do not count
    set(window, 6, 8, 3.9);
  }
  std::vector<Disagreement> found = find_disagreements(features, off);
  REQUIRE(found.size() == 1);
  CHECK(found[0].squares.size() == 2);
  CHECK(found[0].begin == Approx(2.2));
  CHECK(found[0].onset_u == Approx(14.5));
  set(0, 5, 7, 3.01);
  found = find_disagreements(features, off);
  REQUIRE(found.size() == 2);
  CHECK(found[0].squares.size() == 4);
  CHECK(found[0].begin == Approx(2));
  CHECK(found[0].onset_u == Approx((3.9 * 84.5 + 3.01 * 74.5) / 6.91));
  set(0, 5, 7, 2.99);
  CHECK(find_disagreements(features, off).size() == 1);
}

TEST_CASE("disagreement: each keeps its squares, and the earliest is none of a single one") {
  const SilhouetteFeatures features = features_everywhere();
  Eigen::VectorXd off = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(features.size()));
  const auto set = [&](int window, int row, int column, double value) {
    off[static_cast<Eigen::Index>(feature_at(features, 0, window, row, column))] = value;
  };
  set(0, 6, 8, 9);   // alone, and first
  set(1, 2, 2, -5);  // missing
  set(2, 2, 3, -6);
  set(2, 5, 5, 5);
  set(3, 5, 6, 7);
  const std::vector<Disagreement> found = find_disagreements(features, off);
  REQUIRE(found.size() == 3);
  const Disagreement* first = earliest(found);
  REQUIRE(first != nullptr);
  CHECK(!first->unexpected);
  CHECK(first->begin == Approx(2.1));
  REQUIRE(first->squares.size() == 2);
  const bool in_order = first->squares[0].begin < first->squares[1].begin;
  const DisagreeingSquare &begins = first->squares[in_order ? 0 : 1], &ends = first->squares[in_order ? 1 : 0];
  CHECK(begins.box == PixelBox{20, 20, 30, 30});
  CHECK(begins.off == Approx(5));
  CHECK(begins.begin == Approx(2.1));
  CHECK(ends.box == PixelBox{30, 20, 40, 30});
  CHECK(ends.off == Approx(6));
  CHECK(ends.end == Approx(2.2));
  const Disagreement* more = earliest(found, true);
  REQUIRE(more != nullptr);
  CHECK(more->begin == Approx(2.2));
  off.setZero();
  set(0, 6, 8, 9);
  CHECK(earliest(find_disagreements(features, off)) == nullptr);
}

TEST_CASE("disagreement: recordings begin to be off amid all that is too much and too little then") {
  const SilhouetteFeatures features = features_everywhere();
  Eigen::VectorXd off = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(features.size()));
  const auto set = [&](int window, int row, int column, double value) {
    off[static_cast<Eigen::Index>(feature_at(features, 0, window, row, column))] = value;
  };
  set(0, 7, 9, 9);  // a single square is easily chance
  set(1, 2, 2, -6);
  set(1, 3, 2, -6);
  set(1, 2, 6, 6);
  set(2, 2, 7, 20);  // what comes later does not count
  set(3, 6, 1, 20);
  set(3, 6, 2, 20);
  const std::optional<Onset> begins = onset(find_disagreements(features, off));
  REQUIRE(begins);
  CHECK(begins->begin == Approx(2.1));
  CHECK(begins->u == Approx((24.5 + 24.5 + 64.5) / 3));
  CHECK(begins->v == Approx((24.5 + 34.5 + 24.5) / 3));
  off.setZero();
  CHECK(!onset(find_disagreements(features, off)));
}

TEST_CASE("disagreement: nothing beyond the threshold is nothing, and arguments are checked") {
  const SilhouetteFeatures features = features_everywhere();
  const Eigen::VectorXd off = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(features.size()), -3);
  CHECK(find_disagreements(features, off).empty());
  const std::vector<Disagreement> all = find_disagreements(features, off, 2);
  REQUIRE(all.size() == 2);  // all of the picture, of each camera
  CHECK(all[0].squares.size() == 400);
  CHECK_THROWS_WITH(find_disagreements(features, off.head(3)), decant_test::contains("as many as features"));
  CHECK_THROWS_WITH(find_disagreements(features, off, 0), decant_test::contains("threshold must be > 0"));
}
