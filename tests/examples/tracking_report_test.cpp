// SPDX-License-Identifier: MIT
// The parts of a tracking report: what an overlay holds, which frames are shown, how bodies are drawn.

#include "../../examples/support/tracking_report.hpp"

#include <cstddef>
#include <limits>
#include <vector>

#include "catch.hpp"

using namespace example;

TEST_CASE("tracking report: an overlay is the part of the image that has liquid") {
  decant::Mask predicted = decant::Mask::Zero(20, 30), seen = decant::Mask::Zero(20, 30);
  predicted.block(5, 7, 2, 3).setConstant(255);
  seen.block(6, 8, 3, 4).setConstant(200);
  seen(0, 0) = 127;  // no liquid
  const Overlay overlay = overlay_of(predicted, &seen);
  CHECK(overlay.top == 5);
  CHECK(overlay.left == 7);
  decant::Image<std::uint8_t> expected(4, 5);
  expected << 2, 2, 2, 0, 0,  //
      2, 3, 3, 1, 1,          //
      0, 1, 1, 1, 1,          //
      0, 1, 1, 1, 1;
  REQUIRE(overlay.label.rows() == 4);
  REQUIRE(overlay.label.cols() == 5);
  CHECK((overlay.label == expected).all());
  CHECK(overlay.has_mask);

  const Overlay blind = overlay_of(predicted, nullptr);
  CHECK((blind.label == Overlay::predicted).all());
  CHECK_FALSE(blind.has_mask);
  CHECK(overlay_of(decant::Mask::Zero(20, 30), nullptr).label.size() == 0);
}

TEST_CASE("tracking report: pictures are cut to the liquid of all frames and methods, inside of the image") {
  std::vector<NamedResult> results(2);
  const auto labelled = [](decant::Index top, decant::Index left) {
    Overlay overlay;
    overlay.label.setConstant(12, 12, 3);
    overlay.top = top;
    overlay.left = left;
    return overlay;
  };
  results[0].result.overlays = {Overlay(), labelled(3, 40)};
  results[1].result.overlays = {labelled(30, 88)};
  const example::detail::Region region =
      example::detail::region_of_liquid(example::detail::film_sources(results), 100, 100);
  CHECK(region.top == 0);
  CHECK(region.left == 40 - 13);  // 8 and a twelfth of 60
  CHECK(region.top + region.height == 42 + 13);
  CHECK(region.left + region.width == 100);
  const auto picture = example::detail::overlay_picture(
      decant::Image<std::uint8_t>::Constant(region.height, region.width, example::detail::body),
      results[1].result.overlays[0], region);
  CHECK((picture.index == example::detail::both).count() == 144);
  CHECK(picture.index(30, 88 - 27) == example::detail::both);
  CHECK(picture.index(29, 88 - 27) == example::detail::body);

  const example::detail::Region all = example::detail::region_of_liquid({}, 100, 80);
  CHECK(all.height == 100);
  CHECK(all.width == 80);
}

TEST_CASE("tracking report: the frames that are shown have liquid and are spread") {
  std::vector<Overlay> overlays(100);
  for (std::size_t frame = 30; frame < 90; ++frame) {
    overlays[frame].label.setConstant(20, 20, frame == 50 ? Overlay::predicted : 3);
  }
  CHECK(example::detail::telling_frames(overlays, 3) == std::vector<std::size_t>{30, 60, 89});
  CHECK(example::detail::telling_frames(overlays, 6).size() == 6);
  CHECK(example::detail::telling_frames(std::vector<Overlay>(2), 6) == std::vector<std::size_t>{0, 1});
  CHECK(example::detail::telling_frames({}, 6).empty());
}

TEST_CASE("tracking report: bodies have an edge where something far lies beside them") {
  decant::Image<float> depth = decant::Image<float>::Constant(6, 6, std::numeric_limits<float>::infinity());
  depth.block(1, 1, 4, 4).setConstant(1.0F);
  depth.block(1, 3, 4, 2).setConstant(1.5F);
  const auto picture = example::detail::bodies_from_depth(depth, {0, 0, 6, 6});
  CHECK(picture(0, 0) == example::detail::background);
  CHECK(picture(1, 1) == example::detail::body_edge);
  CHECK(picture(2, 2) == example::detail::body_edge);  // nearer than what is right of it
  CHECK(picture(2, 3) == example::detail::body);       // farther than what is left of it
  CHECK((example::detail::bodies_from_depth(depth, {2, 2, 2, 3}) == picture.block(2, 2, 2, 3)).all());
}

TEST_CASE("tracking report: figures read well") {
  CHECK(example::detail::figure(0.12345, 3) == "0.123");
  CHECK(example::detail::figure(-1234.5, 1) == "\u22121234.5");
  CHECK(example::detail::figure(-12345678, 0) == "\u221212\u202f345\u202f678");
  CHECK(example::detail::figure(-0.0001, 1) == "0.0");
  CHECK(example::detail::figure(std::numeric_limits<double>::quiet_NaN(), 1) == "\u2013");
}
