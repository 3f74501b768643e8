// SPDX-License-Identifier: MIT
#include <decant/coverage/silhouette_distance.hpp>

#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include <decant/coverage/detail/liquid_box.hpp>

#include "catch.hpp"

namespace {

using namespace decant;

// Squared distance to the nearest pixel of the part, by trying all; -1 if there is none.
Image<int> squared_distances(const Mask& mask, MaskPart part) {
  Image<int> result = Image<int>::Constant(mask.rows(), mask.cols(), -1);
  for (Index v = 0; v < mask.rows(); ++v) {
    for (Index u = 0; u < mask.cols(); ++u) {
      for (Index y = 0; y < mask.rows(); ++y) {
        for (Index x = 0; x < mask.cols(); ++x) {
          const int squared = static_cast<int>((u - x) * (u - x) + (v - y) * (v - y));
          if ((mask(y, x) >= 128) == (part == MaskPart::Liquid) && (result(v, u) < 0 || squared < result(v, u))) {
            result(v, u) = squared;
          }
        }
      }
    }
  }
  return result;
}

void check(const Mask& mask) {
  SilhouetteDistance transform;
  for (const MaskPart part : {MaskPart::Liquid, MaskPart::Background}) {
    const Image<int> expected = squared_distances(mask, part);
    Image<std::int32_t> first;
    for (const int threads : {1, 2, 4}) {
      transform.rebuild(mask, part, Threads{threads});
      Index wrong = 0, misled = 0;
      for (Index v = 0; v < mask.rows(); ++v) {
        for (Index u = 0; u < mask.cols(); ++u) {
          const int squared = expected(v, u);
          const std::int32_t at = transform.nearest()(v, u);
          if (squared < 0) {
            wrong += transform.distance_px()(v, u) == std::numeric_limits<float>::infinity() ? 0 : 1;
            misled += at == -1 ? 0 : 1;
            continue;
          }
          wrong += transform.distance_px()(v, u) == static_cast<float>(std::sqrt(static_cast<double>(squared))) ? 0 : 1;
          const Index y = at / mask.cols(), x = at % mask.cols();
          const bool right = at >= 0 && y < mask.rows() && (mask(y, x) >= 128) == (part == MaskPart::Liquid) &&
                             (u - x) * (u - x) + (v - y) * (v - y) == squared;
          misled += right ? 0 : 1;
        }
      }
      INFO(mask.rows() << " x " << mask.cols() << ", threads " << threads);
      CHECK(wrong == 0);
      CHECK(misled == 0);
      if (threads == 1) {
        first = transform.nearest();
      }
      CHECK((transform.nearest() == first).all());
    }
  }
}

}  // namespace

TEST_CASE("Distances are those that trying all pixels finds") {
  std::mt19937 generator(2);
  for (const double share : {0.0, 0.001, 0.02, 0.5, 0.98, 1.0}) {
    for (const auto& [rows, columns] : {std::pair<Index, Index>{1, 1}, {1, 90}, {90, 1}, {37, 70}, {40, 130}}) {
      std::bernoulli_distribution liquid(share);
      Mask mask(rows, columns);
      for (Index k = 0; k < mask.size(); ++k) {
        mask.data()[k] = liquid(generator) ? 200 : 100;  // not only 0 and 255
      }
      check(mask);
    }
  }
}

TEST_CASE("Distances to shapes with many ties are right") {
  Mask mask = Mask::Zero(60, 60);
  for (Index v = 0; v < 60; ++v) {
    for (Index u = 0; u < 60; ++u) {
      mask(v, u) =
          (u % 7 == 3 && v % 5 == 2) || std::abs((u - 30) * (u - 30) + (v - 30) * (v - 30) - 400) < 12 ? 255 : 0;
    }
  }
  check(mask);
}

TEST_CASE("A rebuild forgets the mask before, and takes a part of a larger image") {
  SilhouetteDistance transform;
  Mask mask = Mask::Zero(50, 80);
  mask(10, 10) = 255;
  transform.rebuild(mask);
  CHECK(transform.distance_px()(10, 50) == 40);
  transform.rebuild(mask.block(10, 10, 20, 30));
  CHECK(transform.distance_px().rows() == 20);
  CHECK(transform.distance_px()(12, 0) == 12);
  mask.setZero();
  transform.rebuild(mask);
  CHECK(transform.distance_px().minCoeff() == std::numeric_limits<float>::infinity());
  transform.rebuild(Mask(0, 0));
  CHECK(transform.distance_px().size() == 0);
}

TEST_CASE("Distances within a box that holds the liquid are those of the whole image") {
  std::mt19937 random(6);
  SilhouetteDistance whole, within;
  for (int trial = 0; trial < 60; ++trial) {
    Mask mask = Mask::Zero(90, 130);
    const auto between = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    PixelBox liquid;
    for (int k = between(0, 40); k > 0; --k) {
      const int u = between(40, 100), v = between(20, 60);
      mask(v, u) = 255;
      liquid = liquid.hull({u, v, u + 1, v + 1});
    }
    CHECK(detail::liquid_box(mask) == liquid);
    CHECK(detail::count_liquid(mask) == (mask >= 128).count());
    CHECK(detail::count_liquid(mask, liquid) == (mask >= 128).count());
    const PixelBox box = liquid.hull({between(0, 50), between(0, 30), between(51, 130), between(31, 90)});
    whole.rebuild(mask);
    within.rebuild(mask, box, MaskPart::Liquid, Threads{1 << trial % 3});
    const auto part = [&](const auto& image) {
      return image.block(box.v_begin, box.u_begin, box.height(), box.width());
    };
    CHECK((part(whole.distance_px()) == part(within.distance_px())).all());
    CHECK((part(whole.nearest()) == part(within.nearest())).all());
  }
}

TEST_CASE("The box of a mask's liquid reads bytes as is_liquid does") {
  Mask mask = Mask::Constant(20, 70, 127);
  CHECK(detail::liquid_box(mask).empty());
  CHECK(detail::count_liquid(mask) == 0);
  mask(3, 69) = 128;
  mask(17, 0) = 255;
  mask(9, 30) = 200;
  CHECK(detail::liquid_box(mask) == PixelBox{0, 3, 70, 18});
  CHECK(detail::liquid_box(mask.block(4, 1, 10, 60)) == PixelBox{29, 5, 30, 6});
  CHECK(detail::count_liquid(mask) == 3);
}

TEST_CASE("Large images keep their exactness") {
  // 4000 px apart: squares of 1.6e7 are no longer whole numbers for float
  Mask mask = Mask::Zero(3, 4001);
  mask(0, 0) = 255;
  SilhouetteDistance transform;
  transform.rebuild(mask);
  CHECK(transform.distance_px()(2, 4000) == static_cast<float>(std::sqrt(4000.0 * 4000.0 + 4.0)));
  CHECK(transform.distance_px()(0, 4000) == 4000);
}
