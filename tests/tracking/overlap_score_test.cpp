// SPDX-License-Identifier: MIT
#include <decant/tracking/overlap_score.hpp>

#include <cmath>
#include <cstdint>
#include <limits>

#include "catch.hpp"

namespace {

using decant::Overlap;
using decant::OverlapScore;
using decant::RecordingsScore;

Overlap frame(std::int64_t predicted, std::int64_t observed, std::int64_t both) {
  return {.compared_px = 307200, .predicted_px = predicted, .observed_px = observed, .both_px = both};
}

}  // namespace

TEST_CASE("Overlap score: mean over frames and pooled over pixels") {
  OverlapScore score;
  score.add(frame(1000, 1000, 1000));  // 1
  score.add(frame(200, 200, 100));     // 1/3
  score.add(frame(0, 400, 0));         // 0
  CHECK(score.frames() == 3);
  CHECK(score.mean_over_frames() == Approx((1 + 1.0 / 3) / 3));
  CHECK(score.pooled_over_pixels() == Approx(1100.0 / 1700));
  CHECK(score.pixels().compared_px == 3 * 307200);
}

TEST_CASE("Overlap score: frames without liquid count neither for nor against") {
  OverlapScore before, score;
  before.add(frame(900, 900, 600));
  score.add(frame(900, 900, 600));
  for (int k = 0; k < 100; ++k) {
    score.add(frame(0, 0, 0));
  }
  CHECK(score.mean_over_frames() == before.mean_over_frames());
  CHECK(score.pooled_over_pixels() == before.pooled_over_pixels());
  CHECK(score.frames() == 1);
  CHECK(score.frames_left_out() == 100);
}

TEST_CASE("Overlap score: small frames are left out of the mean, not of the pool") {
  OverlapScore score;
  score.add(frame(149, 149, 149));
  CHECK(score.frames() == 0);
  CHECK(std::isnan(score.mean_over_frames()));
  score.add(frame(150, 0, 0));  // liquid that nobody sees
  CHECK(score.frames() == 1);
  CHECK(score.mean_over_frames() == 0);
  CHECK(score.frames_left_out() == 1);
  CHECK(score.pooled_over_pixels() == Approx(149.0 / 299));

  OverlapScore each({.least_union_px = 1});
  each.add(frame(1, 1, 1));
  each.add(frame(0, 0, 0));
  CHECK(each.frames() == 1);
  CHECK(each.mean_over_frames() == 1);
  OverlapScore large({.least_union_px = 1000});
  large.add(frame(600, 600, 201));
  large.add(frame(600, 600, 200));
  CHECK(large.frames() == 1);
  CHECK(large.frames_left_out() == 1);
}

TEST_CASE("Overlap score: what cannot be compared is counted, not scored") {
  OverlapScore score;
  score.add(frame(500, 500, 500));
  score.add({.comparable = false});
  score.add({});  // nothing seen
  CHECK(score.frames() == 1);
  CHECK(score.frames_not_comparable() == 2);
  CHECK(score.mean_over_frames() == 1);
  CHECK(score.pooled_over_pixels() == 1);
  score.reset();
  CHECK(score.frames() == 0);
  CHECK(score.frames_not_comparable() == 0);
  CHECK(score.frames_left_out() == 0);
  CHECK(std::isnan(score.mean_over_frames()));
  CHECK(std::isnan(score.pooled_over_pixels()));
  OverlapScore strict({.least_union_px = 400});
  strict.reset();
  strict.add(frame(399, 399, 399));
  CHECK(strict.frames() == 0);  // settings stay
}

TEST_CASE("Overlap score: settings are checked") {
  for (const std::int64_t bad : {std::int64_t(0), std::int64_t(-1), std::numeric_limits<std::int64_t>::min()}) {
    CHECK_THROWS_WITH(OverlapScore({.least_union_px = bad}),
                      Catch::Matchers::StartsWith("OverlapScore: least_union_px must be >= 1, got -") ||
                          Catch::Matchers::Equals("OverlapScore: least_union_px must be >= 1, got 0"));
    CHECK_THROWS_AS(OverlapScore({.least_union_px = bad}), std::invalid_argument);
  }
}

TEST_CASE("Recordings score: each recording has the same weight, or each pixel") {
  OverlapScore longer, shorter, dry, small;
  for (int k = 0; k < 9; ++k) {
    longer.add(frame(1000, 1000, 1000));
  }
  longer.add(frame(1000, 0, 0));      // mean 0.9, pooled 9000 / 10000
  shorter.add(frame(300, 300, 200));  // 0.5
  dry.add(frame(0, 0, 0));
  small.add(frame(100, 100, 100));
  RecordingsScore all;
  CHECK(std::isnan(all.mean_over_recordings()));
  CHECK(std::isnan(all.mean_of_pooled()));
  CHECK(std::isnan(all.pooled_over_pixels()));
  all.add(longer);
  all.add(shorter);
  all.add(dry);
  CHECK(all.mean_over_recordings() == Approx(0.7));
  CHECK(all.mean_of_pooled() == Approx(0.7));
  CHECK(all.pooled_over_pixels() == Approx(9200.0 / 10400));
  CHECK(all.recordings() == 2);
  CHECK(all.recordings_left_out() == 1);
  all.add(small);  // no frame large enough for the mean, pixels all the same
  CHECK(all.mean_over_recordings() == Approx(0.7));
  CHECK(all.mean_of_pooled() == Approx(2.4 / 3));
  CHECK(all.pooled_over_pixels() == Approx(9300.0 / 10500));
  CHECK(all.recordings_left_out() == 2);
}
