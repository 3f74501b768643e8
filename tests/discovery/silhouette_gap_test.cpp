// SPDX-License-Identifier: MIT

#include <vector>

#include <decant/core/image.hpp>
#include <decant/discovery/silhouette_gap.hpp>
#include <decant/discovery/silhouette_series.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

/// Frames of 60 x 50 px with a block of 10 x 20 px each, whose left upper corner is given; negative: not seen.
std::vector<SilhouetteSeries> blocks(const std::vector<int>& left, int top = 20) {
  SilhouetteSeries series(60, 50, 10);
  double time = 0;
  for (const int u : left) {
    if (u < 0) {
      series.add_unseen(time);
    } else {
      Mask mask = Mask::Zero(50, 60);
      mask.block(top, u, 20, 10) = mask_liquid;
      series.add(time, mask);
    }
    time += 0.1;
  }
  return {series};
}

}  // namespace

TEST_CASE("silhouette gap: overlap, frame by frame, of frames that were seen") {
  const auto recording = blocks({10, 10, -1, 10});
  CHECK(overlap_gap(recording, recording) == Approx(0).margin(1e-6));
  CHECK(overlap_gap(recording, blocks({40, 40, 40, 40})) == Approx(1));
  // by half a cell: the block's own cells have half each, as have those beside them: 1 / 3 overlaps. The same
  // elsewhere.
  CHECK(overlap_gap(recording, blocks({15, 10, 40, 10})) == Approx(2 / 3.0 / 3).epsilon(0.01));
  CHECK(overlap_gap(blocks({-1, -1}), blocks({10, 10})) == 0);  // nothing was seen
  SilhouetteSeries dry(60, 50, 10);
  dry.add(0, Mask::Zero(50, 60));
  const std::vector<SilhouetteSeries> both{dry};
  CHECK(overlap_gap(both, both, 0) == 0);
  CHECK(blurred_gap(both, both) == 0);
}

TEST_CASE("silhouette gap: blurred, what is near is half right") {
  const auto recording = blocks({20, 20, -1});
  CHECK(blurred_gap(recording, recording) == Approx(0).margin(1e-6));
  // one cell aside: rows of 1 2 1 and, moved, 0 1 2 1, differ by 1 1 1 1 of 8
  CHECK(blurred_gap(recording, blocks({30, 30, 0})) == Approx(0.5));
  CHECK(blurred_gap(recording, blocks({20, 30, 0})) == Approx(0.25));
  CHECK(blurred_gap(recording, blocks({50, 50, 0})) > 0.99);
  // what flows out of the picture: the block at the border lost a quarter of its blurred sum
  CHECK(blurred_gap(blocks({0}), blocks({30})) == Approx(1));
}

TEST_CASE("silhouette gap: films of other sizes or lengths are refused") {
  const auto recording = blocks({10, 10});
  CHECK_THROWS_WITH(overlap_gap(recording, blocks({10})), decant_test::contains("those of the recording"));
  CHECK_THROWS_WITH(blurred_gap(recording, {}), decant_test::contains("cameras"));
  SilhouetteSeries coarse(60, 50, 20);
  coarse.add(0, Mask::Zero(50, 60));
  coarse.add(1, Mask::Zero(50, 60));
  const std::vector<SilhouetteSeries> other{coarse};
  CHECK_THROWS_WITH(overlap_gap(recording, other), decant_test::contains("frames and cells"));
}
