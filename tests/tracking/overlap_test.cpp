// SPDX-License-Identifier: MIT
#include <decant/tracking/overlap.hpp>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "catch.hpp"

namespace {

using decant::Mask;
using decant::Overlap;
using decant::overlap;

// Counted one pixel at a time, in the words of the definition.
Overlap counted(const Mask& predicted, const Mask& observed, const Mask& seen) {
  Overlap sum;
  for (Eigen::Index v = 0; v < predicted.rows(); ++v) {
    for (Eigen::Index u = 0; u < predicted.cols(); ++u) {
      if (seen(v, u) < 128) {
        continue;
      }
      sum.compared_px += 1;
      sum.predicted_px += predicted(v, u) >= 128 ? 1 : 0;
      sum.observed_px += observed(v, u) >= 128 ? 1 : 0;
      sum.both_px += predicted(v, u) >= 128 && observed(v, u) >= 128 ? 1 : 0;
    }
  }
  return sum;
}

bool same(const Overlap& a, const Overlap& b) {
  return a.compared_px == b.compared_px && a.predicted_px == b.predicted_px && a.observed_px == b.observed_px &&
         a.both_px == b.both_px && a.comparable == b.comparable;
}

Mask random_mask(Eigen::Index rows, Eigen::Index columns, std::mt19937& random) {
  std::uniform_int_distribution<int> value(0, 255);
  Mask mask(rows, columns);
  for (Eigen::Index i = 0; i < mask.size(); ++i) {
    mask.data()[i] = static_cast<std::uint8_t>(value(random));
  }
  return mask;
}

}  // namespace

TEST_CASE("Overlap: counted by hand") {
  Mask predicted(3, 4), observed(3, 4);
  predicted << 0, 255, 255, 0,  //
      0, 255, 255, 0,           //
      0, 0, 0, 0;
  observed << 0, 0, 255, 255,  //
      0, 0, 255, 255,          //
      0, 0, 255, 0;
  const Overlap all = overlap(predicted, observed);
  CHECK(all.comparable);
  CHECK(all.compared_px == 12);
  CHECK(all.predicted_px == 4);
  CHECK(all.observed_px == 5);
  CHECK(all.both_px == 2);
  CHECK(all.union_px() == 7);
  CHECK(all.differing_px() == 5);
  CHECK(all.agreeing_px() == 7);
  CHECK(all.iou() == Approx(2.0 / 7));
  const decant::ConstMaskView view(predicted);
  CHECK(noexcept(overlap(view, view)));
  CHECK(noexcept(overlap(view, view, view)));

  Mask seen = Mask::Constant(3, 4, 255);
  seen.col(3).setZero();
  seen(2, 2) = 127;
  seen(0, 0) = 128;
  const Overlap part = overlap(predicted, observed, seen);
  CHECK(part.compared_px == 8);
  CHECK(part.predicted_px == 4);
  CHECK(part.observed_px == 2);
  CHECK(part.both_px == 2);
  CHECK(part.iou() == Approx(0.5));
}

TEST_CASE("Overlap: a pixel is liquid from 128 on") {
  Mask values(1, 4);
  values << 127, 128, 1, 254;
  const Overlap of_values = overlap(values, Mask::Constant(1, 4, 255));
  CHECK(of_values.predicted_px == 2);
  CHECK(of_values.both_px == 2);
}

TEST_CASE("Overlap: no liquid in either mask, nothing seen, no pixels, other sizes") {
  const Mask none = Mask::Zero(4, 5);
  const Mask all = Mask::Constant(4, 5, 255);
  CHECK(overlap(none, none).iou() == 1);
  CHECK(overlap(all, all).iou() == 1);
  CHECK(overlap(all, none).iou() == 0);
  CHECK(overlap(none, all).iou() == 0);
  const Overlap unseen = overlap(all, all, none);
  CHECK(unseen.comparable);
  CHECK(unseen.compared_px == 0);
  CHECK(std::isnan(unseen.iou()));
  CHECK(std::isnan(overlap(Mask(), Mask()).iou()));
  CHECK(overlap(Mask(), Mask()).comparable);
  CHECK(overlap(Mask(0, 5), Mask(0, 5)).compared_px == 0);
  CHECK(overlap(Mask::Constant(1, 1, 255), Mask::Constant(1, 1, 255)).iou() == 1);
  // as many pixels in another shape, then one side that differs
  for (const Mask& other :
       {Mask(Mask::Constant(5, 4, 255)), Mask(Mask::Constant(3, 5, 255)), Mask(Mask::Constant(4, 6, 255)), Mask()}) {
    CHECK_FALSE(overlap(all, other).comparable);
    CHECK_FALSE(overlap(other, all).comparable);
    CHECK_FALSE(overlap(all, all, other).comparable);
    CHECK_FALSE(overlap(all, other, all).comparable);
    CHECK(std::isnan(overlap(all, other).iou()));
    CHECK(overlap(all, other).compared_px == 0);
  }
}

TEST_CASE("Overlap: sums over frames") {
  Overlap sum = overlap(Mask::Constant(2, 3, 255), Mask::Zero(2, 3));
  sum += overlap(Mask::Constant(2, 2, 255), Mask::Constant(2, 2, 255));
  CHECK(sum.compared_px == 10);
  CHECK(sum.iou() == Approx(0.4));
  CHECK(sum.comparable);
  sum += overlap(Mask(1, 2), Mask(2, 1));
  CHECK_FALSE(sum.comparable);
  CHECK(std::isnan(sum.iou()));
}

TEST_CASE("Overlap: equals counting one by one, at any size") {
  std::mt19937 random(1);
  for (const Eigen::Index columns : {1, 2, 15, 16, 17, 31, 63, 64, 65, 255, 300, 4097}) {
    for (const Eigen::Index rows : {1, 3, 8}) {
      const Mask a = random_mask(rows, columns, random);
      const Mask b = random_mask(rows, columns, random);
      const Mask seen = random_mask(rows, columns, random);
      CHECK(same(overlap(a, b), counted(a, b, Mask::Constant(rows, columns, 255))));
      CHECK(same(overlap(a, b, seen), counted(a, b, seen)));
    }
  }
  // a row in which counters of 8 or 16 bits would overflow
  const Mask wide = Mask::Constant(2, 70000, 255);
  CHECK(overlap(wide, wide).both_px == 140000);
  CHECK(overlap(wide, wide, wide).both_px == 140000);
}

TEST_CASE("Overlap: rows may be followed by padding, and masks may be parts of others") {
  std::mt19937 random(2);
  const Mask a = random_mask(7, 21, random);
  const Mask b = random_mask(7, 21, random);
  const Mask seen = random_mask(7, 21, random);
  std::vector<std::uint8_t> buffer(7 * 32, 255);
  Eigen::Map<Mask, 0, Eigen::OuterStride<>> padded(buffer.data(), 7, 21, Eigen::OuterStride<>(32));
  padded = a;
  Mask larger = Mask::Constant(12, 40, 255);
  larger.block(2, 11, 7, 21) = b;
  CHECK(same(overlap(padded, larger.block(2, 11, 7, 21)), overlap(a, b)));
  CHECK(same(overlap(padded, larger.block(2, 11, 7, 21), seen), overlap(a, b, seen)));
  padded = seen;
  CHECK(same(overlap(a, larger.block(2, 11, 7, 21), padded), overlap(a, b, seen)));
  // column by column in memory: copied, and right
  const Eigen::Array<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic> by_columns = a;
  CHECK(same(overlap(by_columns, b), overlap(a, b)));
}

TEST_CASE("Overlap: laws of intersection over union") {
  std::mt19937 random(3);
  std::uniform_int_distribution<Eigen::Index> side(1, 40);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Index rows = side(random), columns = side(random);
    Mask a = random_mask(rows, columns, random);
    Mask b = random_mask(rows, columns, random);
    std::bernoulli_distribution keep(0.05 + 0.9 * (trial % 10) / 10);
    for (Eigen::Index i = 0; i < a.size(); ++i) {
      a.data()[i] = keep(random) ? a.data()[i] : 0;
      b.data()[i] = keep(random) ? a.data()[i] : b.data()[i];
    }
    const double ab = overlap(a, b).iou();
    CHECK(ab == overlap(b, a).iou());
    CHECK((ab >= 0 && ab <= 1));
    CHECK((ab == 1) == (overlap(a, b).differing_px() == 0));
    CHECK(overlap(a, a).iou() == 1);
    CHECK(overlap(a, b).agreeing_px() + overlap(a, b).differing_px() == rows * columns);

    // putting one differing pixel right never lowers it, and raises it unless nothing but that pixel was liquid
    std::vector<Eigen::Index> differing;
    for (Eigen::Index i = 0; i < a.size(); ++i) {
      if (decant::is_liquid(a.data()[i]) != decant::is_liquid(b.data()[i])) {
        differing.push_back(i);
      }
    }
    if (!differing.empty()) {
      const Eigen::Index i = differing[random() % differing.size()];
      Mask better = a;
      better.data()[i] = b.data()[i];
      CHECK(overlap(better, b).differing_px() == overlap(a, b).differing_px() - 1);
      const bool raised = overlap(better, b).iou() > ab;
      CHECK((raised || (ab == 0 && overlap(better, b).both_px == 0)));
    }

    // what is not seen cannot matter
    const Mask seen = random_mask(rows, columns, random);
    const double seen_only = overlap(a, b, seen).iou();
    for (Eigen::Index i = 0; i < a.size(); ++i) {
      if (!decant::is_liquid(seen.data()[i])) {
        a.data()[i] = static_cast<std::uint8_t>(random());
        b.data()[i] = static_cast<std::uint8_t>(random());
      }
    }
    const double again = overlap(a, b, seen).iou();
    CHECK((again == seen_only || (std::isnan(again) && std::isnan(seen_only))));

    // the Jaccard distance 1 - IoU is a metric: no detour is shorter (Levandowsky & Winter 1971)
    const Mask c = random_mask(rows, columns, random);
    const auto distance = [](const Mask& x, const Mask& y) { return 1 - overlap(x, y).iou(); };
    CHECK(distance(a, b) <= distance(a, c) + distance(c, b) + 1e-12);  // three quotients, rounded
  }
}
