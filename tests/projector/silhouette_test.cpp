// SPDX-License-Identifier: MIT
#include <decant/projector/silhouette.hpp>

#include <cstdint>
#include <random>
#include <vector>

#include <decant/projector/projected_sphere.hpp>

#include "catch.hpp"

namespace {

using namespace decant;

// Closing by the book, on an image with room around it: a pixel stays if every disc position that reaches it has
// liquid.
Mask closed(const Mask& mask, int radius) {
  const Index rows = mask.rows(), columns = mask.cols();
  const Index room = radius;
  Image<int> grown = Image<int>::Zero(rows + 2 * room, columns + 2 * room);
  for (Index v = 0; v < grown.rows(); ++v) {
    for (Index u = 0; u < grown.cols(); ++u) {
      for (Index y = 0; y < rows; ++y) {
        for (Index x = 0; x < columns; ++x) {
          const Index dv = v - room - y, du = u - room - x;
          grown(v, u) |= mask(y, x) >= 128 && dv * dv + du * du <= radius * radius ? 1 : 0;
        }
      }
    }
  }
  Mask result = Mask::Constant(rows, columns, 255);
  for (Index y = 0; y < rows; ++y) {
    for (Index x = 0; x < columns; ++x) {
      for (Index v = 0; v < grown.rows(); ++v) {
        for (Index u = 0; u < grown.cols(); ++u) {
          const Index dv = v - room - y, du = u - room - x;
          if (dv * dv + du * du <= radius * radius && grown(v, u) == 0) {
            result(y, x) = 0;
          }
        }
      }
    }
  }
  return result;
}

Mask random_mask(Index rows, Index columns, double share, unsigned seed) {
  std::mt19937 generator(seed);
  std::bernoulli_distribution liquid(share);
  Mask mask(rows, columns);
  for (Index k = 0; k < mask.size(); ++k) {
    mask.data()[k] = liquid(generator) ? 255 : 0;
  }
  return mask;
}

}  // namespace

TEST_CASE("Closing is growing and shrinking by a disc") {
  // 63, 64 and 65 columns and more: rows are handled 64 pixels at a time
  const Index columns[] = {1, 7, 60, 63, 64, 65, 70};
  unsigned seed = 1;
  for (const Index width : columns) {
    for (const int gap : {1, 2, 3, 4, 7}) {
      Mask mask = random_mask(11, width, 0.15, seed++);
      const Mask expected = closed(mask, (gap + 1) / 2);
      for (const int threads : {1, 2, 4}) {
        Mask result = mask;
        GapClosing(gap).apply(result, PixelBox::of(result), Threads{threads});
        INFO("width " << width << ", gap " << gap << ", threads " << threads);
        CHECK((result == expected).all());
        CHECK((result >= mask).all());
      }
    }
  }
}

TEST_CASE("Gaps up to the given width are closed, wider ones are not") {
  for (const int gap : {2, 4, 6, 40}) {
    for (int width = 1; width <= gap + 2; ++width) {
      Mask mask = Mask::Zero(200, 200);
      mask.block(20, 20, 160, 60).setConstant(mask_liquid);
      mask.block(20, 80 + width, 160, 40).setConstant(mask_liquid);
      GapClosing(gap).apply(mask, PixelBox::of(mask));
      INFO("gap " << gap << ", width " << width);
      CHECK((mask(100, 80) == mask_liquid) == (width <= gap));
      CHECK((mask(100, 80 + width / 2) == mask_liquid) == (width <= gap));
      CHECK(mask(100, 19) == 0);
      CHECK(mask(19, 50) == 0);
    }
  }
}

TEST_CASE("Closing within the box of what was drawn gives what closing the image gives") {
  Mask mask = Mask::Zero(100, 200);
  mask.block(30, 50, 40, 90) = random_mask(40, 90, 0.2, 3);
  Mask everywhere = mask, within = mask;
  GapClosing closing(4);
  closing.apply(everywhere, PixelBox::of(mask));
  closing.apply(within, {50, 30, 140, 70});
  CHECK((everywhere == within).all());
  CHECK((everywhere != mask).any());
  // a smaller box after a larger one, an empty one, and one beyond the image
  Mask corner = Mask::Zero(100, 200);
  corner.block(0, 0, 9, 9) = random_mask(9, 9, 0.3, 4);
  const Mask expected = closed(corner.topLeftCorner(12, 12), 2);
  closing.apply(corner, {-5, -5, 9, 9});
  CHECK((corner.topLeftCorner(12, 12) == expected).all());
  const Mask before = corner;
  closing.apply(corner, {});
  CHECK((corner == before).all());
}

TEST_CASE("A gap of nothing changes nothing") {
  Mask mask = random_mask(20, 30, 0.5, 2);
  const Mask before = mask;
  GapClosing(0).apply(mask, PixelBox::of(mask));
  CHECK((mask == before).all());
}

TEST_CASE("Gaps that are none are refused") {
  CHECK_THROWS_WITH(GapClosing(-1), "GapClosing: gap_px [px] must be 0 to 64, got -1");
  CHECK_THROWS_WITH(GapClosing(65), decant_test::contains("must be 0 to 64, got 65"));
}

TEMPLATE_TEST_CASE("A silhouette is where particles are, gaps closed", "", DiscSplat<float>, ProjectedSphere<double>) {
  const PinholeCamera camera(300, 300, 80, 60, 160, 120);
  using Scalar = typename TestType::Scalar;
  // a loose lattice: particles 3 px in radius, 8 px apart, so 2 px between neighbours
  PointArray<Scalar> position(3, 25);
  for (Index i = 0; i < 25; ++i) {
    const Eigen::Vector2d pixel(60 + 8 * static_cast<double>(i % 5), 40 + 8 * static_cast<double>(i / 5));
    position.col(i) = camera.unproject(pixel, 0.3).template cast<Scalar>();
  }
  Mask open = Mask::Constant(120, 160, 77), filled = open;
  const std::vector<std::uint8_t> hidden(25, 0);
  Silhouette<TestType> loose(TestType(0.0031), GapClosing(0)), tight(TestType(0.0031), GapClosing(4));
  const PixelBox box = loose.render(position, hidden, camera, {}, open);
  for (const int threads : {1, 2, 4}) {
    tight.render(position, hidden, camera, {}, filled, Threads{threads});
    CHECK(((open == 0) || (open == mask_liquid)).all());
    CHECK(((loose.coverage() > 0) == (open == mask_liquid)).all());
    CHECK(open(40, 64) == 0);
    CHECK(filled(40, 64) == mask_liquid);
    CHECK((filled >= open).all());
    CHECK(filled(40, 52) == 0);
    CHECK(box == PixelBox{57, 37, 96, 76});
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        CHECK((filled(v, u) == 0 || box.contains(u, v)));
      }
    }
  }
  // hidden ones leave a hole
  std::vector<std::uint8_t> some = hidden;
  some[12] = 1;
  loose.render(position, some, camera, {}, open);
  CHECK(open(56, 76) == 0);
  CHECK(open(56, 68) == mask_liquid);
  // nothing to see: nothing left of the mask before
  loose.render(PointArray<Scalar>(3, 0), {}, camera, {}, open);
  CHECK((open == 0).all());
}

TEMPLATE_TEST_CASE("What was drawn before leaves nothing in the next silhouette", "", DiscSplat<float>,
                   ProjectedSphere<float>) {
  std::mt19937 random(8);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  Silhouette<TestType> again(TestType(0.004), GapClosing(3));
  for (int frame = 0; frame < 20; ++frame) {
    // liquid that wanders through the image and beyond it; now and then the image is another one
    const PinholeCamera camera(300, 300, 80, 60, frame % 7 < 5 ? 160 : 120, 120);
    const Index count = frame % 4 == 3 ? 0 : 1500;
    const Eigen::Vector2d place(between(-20, 180), between(-20, 140));
    PointArray<float> position(3, count);
    for (Index i = 0; i < count; ++i) {
      const Eigen::Vector2d pixel = place + Eigen::Vector2d(between(-25, 25), between(-25, 25));
      position.col(i) = camera.unproject(pixel, between(0.2, 0.4)).template cast<float>();
    }
    Mask mask(camera.height(), camera.width()), expected = mask;
    Silhouette<TestType> fresh(TestType(0.004), GapClosing(3));
    const PixelBox box = again.render(position, {}, camera, {}, mask, Threads{1 << frame % 3});
    CHECK(box == fresh.render(position, {}, camera, {}, expected));
    CHECK((mask == expected).all());
    CHECK((again.coverage() == fresh.coverage()).all());
  }
}
