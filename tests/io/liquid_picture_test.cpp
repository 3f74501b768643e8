// SPDX-License-Identifier: MIT
// Pictures of liquid: things appear where the view puts them, in front of or behind each other.

#include <decant/io/liquid_picture.hpp>

#include <cmath>
#include <limits>

#include "catch.hpp"

namespace {

// Looks along +y from 1 m away; 100 px for 0.2 m, so 500 px per metre in the plane y = 0.
decant::PictureView front_view() {
  decant::PictureView view;
  view.width = 120;
  view.height = 100;
  view.field_of_view = 2 * std::atan(0.1);
  return view;
}

bool white(decant::Picture picture, int row, int column) {
  const std::uint8_t* p = picture.at(row, column);
  return p[0] > 250 && p[1] > 250 && p[2] > 250;
}

bool blue(decant::Picture picture, int row, int column) {
  const std::uint8_t* p = picture.at(row, column);
  return p[2] > p[0] + 30;
}

// An edge may fall between two pixels, which share its ink.
bool dark(decant::Picture picture, int row, int first_column, int last_column) {
  int ink = 0;
  for (int column = first_column; column <= last_column; ++column) {
    ink += 255 - picture.at(row, column)[0];
  }
  return ink > 100;
}

// A square of 0.1 m across the line of sight at that depth y.
decant::TriangleMesh square(double y) {
  return {{{-0.05, y, -0.05}, {0.05, y, -0.05}, {0.05, y, 0.05}, {-0.05, y, 0.05}}, {{0, 1, 2}, {0, 2, 3}}};
}

const Eigen::VectorXf no_shade;

}  // namespace

TEST_CASE("liquid picture: a particle covers its disc and nothing else") {
  decant::LiquidPainter painter(front_view());
  Eigen::Matrix3Xf x(3, 2);
  x.col(0) << 0.04F, 0, 0.02F;  // 20 px right of and 10 px above the middle
  x.col(1) << std::numeric_limits<float>::quiet_NaN(), 0, 0;
  const auto& picture = painter.draw(x, 0.01, no_shade, {});
  CHECK(blue(picture, 40, 80));
  CHECK(blue(picture, 40, 84));
  CHECK(white(picture, 40, 87));
  CHECK(white(picture, 50, 60));
  CHECK(white(picture, 60, 80));
}

TEST_CASE("liquid picture: lighter where the shade is higher") {
  decant::LiquidPainter painter(front_view());
  Eigen::Matrix3Xf x(3, 2);
  x.col(0) << -0.05F, 0, 0;
  x.col(1) << 0.05F, 0, 0;
  const Eigen::Vector2f shade(0, 1);
  decant::Picture picture = painter.draw(x, 0.01, shade, {});
  CHECK(picture.at(50, 85)[1] > picture.at(50, 35)[1] + 40);
}

TEST_CASE("liquid picture: glass and edges before and behind the liquid") {
  decant::LiquidPainter painter(front_view());
  Eigen::Matrix3Xd x(3, 1);
  x.col(0) << 0, 0, 0;
  const decant::PictureBody before(square(-0.1)), behind(square(0.1));
  decant::Picture plain = painter.draw(x, 0.02, no_shade, {});
  decant::Picture with_glass = painter.draw(x, 0.02, no_shade, {{&before, {}}});
  decant::Picture with_back = painter.draw(x, 0.02, no_shade, {{&behind, {}}});
  // in the middle the pane before the liquid shows, the one behind it hardly does
  const int change_before = std::abs(with_glass.at(50, 60)[2] - plain.at(50, 60)[2]);
  const int change_behind = std::abs(with_back.at(50, 60)[2] - plain.at(50, 60)[2]);
  CHECK(change_before > change_behind);
  CHECK(with_glass.at(35, 60)[0] < 255);  // tinted beside the liquid
  CHECK(white(with_glass, 5, 5));
  // nearer, so larger: 0.05 m at 0.9 m is 27.8 px; at 1.1 m it is 22.7 px
  CHECK(dark(with_glass, 50, 60 + 27, 60 + 28));
  CHECK(dark(with_back, 50, 60 + 22, 60 + 23));
  CHECK(white(with_back, 50, 60 + 27));
  // moved by its pose: 10 px to the right
  const decant::Pose pose{Eigen::Quaterniond::Identity(), {0.018, 0, 0}};
  CHECK(painter.draw(x, 0.02, no_shade, {{&before, pose}}).rgb != with_glass.rgb);
  CHECK(white(painter.draw(x, 0.02, no_shade, {{&before, pose}}), 50, 60 - 26));
}

TEST_CASE("liquid picture: drawing twice gives the same bytes and odd input does not crash") {
  decant::LiquidPainter painter(front_view());
  Eigen::Matrix3Xf x = Eigen::Matrix3Xf::Zero(3, 4);
  x.col(1) << 0, -1, 0;  // at the eye
  x.col(2) << std::numeric_limits<float>::infinity(), 0, 0;
  x.col(3) << 1e30F, 1e30F, 1e30F;
  decant::TriangleMesh odd = square(0);
  odd.vertices.push_back({0, -1, 0});  // a triangle that reaches the eye
  odd.vertices.push_back({0, std::nan(""), 0});
  odd.triangles.push_back({0, 1, 4});
  odd.triangles.push_back({0, 1, 5});
  odd.triangles.push_back({0, 0, 0});
  const decant::PictureBody body(odd);
  const decant::Picture first = painter.draw(x, 0.01, no_shade, {{&body, {}}});
  CHECK(first.rgb == painter.draw(x, 0.01, no_shade, {{&body, {}}}).rgb);
  CHECK(blue(first, 50, 60));
}

TEST_CASE("liquid picture: the view around a box shows all of it") {
  const Eigen::AlignedBox3d box(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(1.2, 2.1, 3.3));
  const auto view = decant::PictureView::around(box, {0.3, 1, -0.4}, decant::Vector3<double>::UnitZ(), 200, 150);
  decant::LiquidPainter painter(view);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Matrix3Xd x = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    const auto& picture = painter.draw(x, 0.005, no_shade, {});
    INFO(corner);
    CHECK(std::any_of(picture.rgb.begin(), picture.rgb.end(), [](std::uint8_t byte) { return byte < 128; }));
  }
  decant::PictureView bad;
  bad.up = {0, 1, 0};
  CHECK_THROWS_AS(decant::LiquidPainter(bad), std::invalid_argument);
}
