// SPDX-License-Identifier: MIT
#include <decant/camera/affine_registration.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/SVD>

#include "camera/affine_coefficients.hpp"
#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::AffineFit;
using decant::AffineFitSettings;
using decant::AffineFitStatus;
using decant::AffineMap;
using decant::fit_affine;
using Points = Eigen::Matrix2Xd;

using decant_test::coefficients;

// A board's corners as a thermal camera sees them: 6 x 5, 36 px apart, tilted by perspective.
Points board() {
  Points corners(2, 30);
  for (int i = 0; i < 30; ++i) {
    const double x = 36.0 * (i % 6);
    const double y = 35.0 * (i / 6);
    const double w = 1 + 2e-4 * x + 3e-4 * y;
    corners.col(i) << 190 + x / w, 230 + y / w - 0.05 * x;
  }
  return corners;
}

Points moved(const Points& points, const AffineMap& map, double noise_px, std::mt19937& random) {
  std::normal_distribution<double> noise(0, 1);
  Points to = map.apply_all(points);
  for (Eigen::Index i = 0; i < to.size(); ++i) {
    to.data()[i] += noise_px * noise(random);
  }
  return to;
}

// The fit written as one linear system in homogeneous pixels, solved by singular values.
AffineMap::Matrix by_singular_values(const Points& from, const Points& to) {
  Eigen::MatrixXd design(from.cols(), 3);
  design << from.transpose(), Eigen::VectorXd::Ones(from.cols());
  const Eigen::MatrixXd solution = design.jacobiSvd(Eigen::ComputeThinU | Eigen::ComputeThinV).solve(to.transpose());
  return solution.transpose();
}

double rms(const AffineMap::Matrix& map, const Points& from, const Points& to) {
  double sum = 0;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const double u = map(0, 0) * from(0, i) + map(0, 1) * from(1, i) + map(0, 2) - to(0, i);
    const double v = map(1, 0) * from(0, i) + map(1, 1) * from(1, i) + map(1, 2) - to(1, i);
    sum += u * u + v * v;
  }
  return std::sqrt(sum / static_cast<double>(from.cols()));
}

struct Corners {
  Points thermal;
  Points colour;
};

Corners read_corners(const std::filesystem::path& file) {
  std::ifstream lines(file);
  std::string line;
  std::getline(lines, line);
  std::vector<double> values;
  while (std::getline(lines, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream columns(line);
    double row = 0, column = 0, value = 0;
    columns >> row >> column;
    while (columns >> value) {
      values.push_back(value);
    }
  }
  const auto rows = static_cast<Eigen::Index>(values.size() / 4);
  const Eigen::Map<Eigen::Matrix<double, 4, Eigen::Dynamic>> table(values.data(), 4, rows);
  return {table.bottomRows<2>(), table.topRows<2>()};
}

// Pixels of the lens that the board's README states, without its distortion: OpenCV's plumb_bob, inverted by
// repetition.
Points undistorted(const Points& pixels) {
  const double fx = 767.94273, fy = 767.06879, cx = 317.24475, cy = 231.64493;
  const double k1 = -0.50404, k2 = 0.26894, p1 = 0.00345, p2 = -0.00075;
  Points straight(2, pixels.cols());
  for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
    const double xd = (pixels(0, i) - cx) / fx;
    const double yd = (pixels(1, i) - cy) / fy;
    double x = xd, y = yd;
    for (int repeat = 0; repeat < 100; ++repeat) {
      const double r2 = x * x + y * y;
      const double radial = 1 + k1 * r2 + k2 * r2 * r2;
      const double tangential_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
      const double tangential_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
      x = (xd - tangential_x) / radial;
      y = (yd - tangential_y) / radial;
    }
    straight.col(i) << fx * x + cx, fy * y + cy;
  }
  return straight;
}

const AffineMap thermal_to_colour(coefficients(1.57, 0.03, -24, 0.05, 1.5, -207));

}  // namespace

TEST_CASE("Affine fit: the thermal and colour board's published residual") {
  const auto folder = decant_test::measurements("thermal_rgb_board");
  if (!folder) {
    return;
  }
  const Corners corners = read_corners(*folder / "corners.csv");
  REQUIRE(corners.thermal.cols() == 30);
  // The README's figures are rounded to two decimals of pixels and four of slopes; the offsets are those of the corners
  // before they were rounded to 0.01 px, which a lever of 300 px makes 0.01 px more.
  for (const bool refuse : {false, true}) {
    const AffineFit fit = fit_affine(corners.thermal, corners.colour, {.refuse_outliers = refuse});
    CHECK(fit.status == AffineFitStatus::Good);
    CHECK(fit.inliers == 30);
    CHECK(fit.inlier.all());
    CHECK(fit.rms_px == Approx(3.09).margin(0.02));
    CHECK(fit.largest_px == Approx(8.50).margin(0.02));
    const AffineMap::Matrix published = coefficients(1.5736, 0.0268, -24.43, 0.0457, 1.5012, -206.72);
    CHECK((fit.map.linear() - published.leftCols<2>()).cwiseAbs().maxCoeff() < 1e-4);
    CHECK((fit.map.offset() - published.col(2)).cwiseAbs().maxCoeff() < 0.02);
  }
  const AffineFit straight = fit_affine(undistorted(corners.thermal), corners.colour);
  CHECK(straight.inliers == 30);
  CHECK(straight.rms_px == Approx(2.11).margin(0.02));
  CHECK(straight.largest_px == Approx(5.25).margin(0.02));
}

TEST_CASE("Affine fit: the board's corners survive beside gross errors, which do not") {
  const auto folder = decant_test::measurements("thermal_rgb_board");
  if (!folder) {
    return;
  }
  const Corners corners = read_corners(*folder / "corners.csv");
  std::mt19937 random(7);
  for (int trial = 0; trial < 40; ++trial) {
    // up to nine corners are taken for something 30 px away or further; a square of this board is 50 px wide
    Points colour = corners.colour;
    std::vector<Eigen::Index> order(30);
    std::iota(order.begin(), order.end(), Eigen::Index(0));
    std::shuffle(order.begin(), order.end(), random);
    std::uniform_real_distribution<double> angle(0, 6.283185307);
    std::uniform_real_distribution<double> distance(30, 200);
    Eigen::Array<bool, Eigen::Dynamic, 1> right = Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(30, true);
    for (int wrong = 0; wrong < trial % 10; ++wrong) {
      const Eigen::Index i = order[static_cast<std::size_t>(wrong)];
      const double a = angle(random);
      colour.col(i) += distance(random) * Eigen::Vector2d(std::cos(a), std::sin(a));
      right(i) = false;
    }
    const AffineFit fit = fit_affine(corners.thermal, colour);
    INFO("trial " << trial << ", kept " << fit.inliers);
    CHECK(fit.status == AffineFitStatus::Good);
    CHECK((fit.inlier == right).all());
  }
}

TEST_CASE("Affine fit: least squares over all pairs is the one that singular values give") {
  std::mt19937 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    std::uniform_real_distribution<double> pixel(0, 600);
    Points from(2, 3 + trial);
    for (Eigen::Index i = 0; i < from.size(); ++i) {
      from.data()[i] = pixel(random);
    }
    const Points to = moved(from, thermal_to_colour, 5, random);
    const AffineFit fit = fit_affine(from, to, {.refuse_outliers = false});
    const AffineMap::Matrix expected = by_singular_values(from, to);
    // coordinates of 1e3 px, and a triangle may be a hundred times as long as high: its square times the rounding of
    // 1e3
    CHECK((fit.map.matrix() - expected).cwiseAbs().maxCoeff() < 1e-7);
    CHECK(fit.rms_px == Approx(rms(expected, from, to)).margin(1e-8));
    CHECK(fit.inliers == from.cols());
  }
}

TEST_CASE("Affine fit: exact pairs give the map, whatever the number of wrong ones up to half") {
  std::mt19937 random(3);
  const Points from = board();
  for (Eigen::Index wrong = 0; wrong <= 13; ++wrong) {  // (30 - 3) / 2
    Points to = moved(from, thermal_to_colour, 0, random);
    for (Eigen::Index i = 0; i < wrong; ++i) {
      std::uniform_real_distribution<double> pixel(0, 640);
      to.col((7 * i) % 30) = Eigen::Vector2d(-300 - pixel(random), pixel(random));
    }
    const AffineFit fit = fit_affine(from, to);
    INFO(wrong << " wrong pairs");
    CHECK(fit.inliers == 30 - wrong);
    CHECK((fit.map.matrix() - thermal_to_colour.matrix()).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(fit.rms_px < 1e-9);
    CHECK(fit.status == AffineFitStatus::Good);
    if (wrong > 0) {
      CHECK_FALSE(fit.inlier(0));
      const AffineFit all = fit_affine(from, to, {.refuse_outliers = false});
      CHECK(all.rms_px > 50);
    }
  }
}

TEST_CASE("Affine fit: five pairs are enough to tell one that is wrong") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> pixel(0, 600);
  for (Eigen::Index count = 5; count < 12; ++count) {
    const Eigen::Index wrong = (count - 3) / 2;
    Points from(2, count);
    for (Eigen::Index i = 0; i < from.size(); ++i) {
      from.data()[i] = pixel(random);
    }
    Points to = moved(from, thermal_to_colour, 0, random);
    for (Eigen::Index i = 0; i < wrong; ++i) {
      to.col(i) += Eigen::Vector2d(100 + pixel(random), -pixel(random));
    }
    const AffineFit fit = fit_affine(from, to);
    INFO(count << " pairs, " << wrong << " wrong");
    CHECK(fit.inliers == count - wrong);
    CHECK_FALSE(fit.inlier.head(wrong).any());
    CHECK(fit.status == AffineFitStatus::Good);
  }
}

TEST_CASE("Affine fit: wrong pairs that are wrong together, as after a shift by one square, are refused") {
  std::mt19937 random(5);
  const Points from = board();
  Points to = moved(from, thermal_to_colour, 0.8, random);
  for (int i = 0; i < 12; ++i) {
    to.col(i) = thermal_to_colour.apply(Eigen::Vector2d(from.col(i + 1)));  // each taken for its neighbor
  }
  const AffineFit fit = fit_affine(from, to);
  CHECK(fit.inliers == 18);
  CHECK_FALSE(fit.inlier.head(12).any());
  // the map that the right pairs alone give
  const AffineMap::Matrix expected = by_singular_values(from.rightCols(18), to.rightCols(18));
  CHECK((fit.map.matrix() - expected).cwiseAbs().maxCoeff() < 1e-8);
}

TEST_CASE("Affine fit: many pairs, of which triples are drawn") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> pixel(0, 600);
  Points from(2, 400);
  for (Eigen::Index i = 0; i < from.size(); ++i) {
    from.data()[i] = pixel(random);
  }
  Points to = moved(from, thermal_to_colour, 0.5, random);
  for (Eigen::Index i = 0; i < 180; ++i) {
    to.col(i) = Eigen::Vector2d(pixel(random) + 1200, pixel(random));  // beyond where any right one falls
  }
  const AffineFit fit = fit_affine(from, to);
  CHECK(fit.status == AffineFitStatus::Good);
  CHECK(fit.inliers == 220);
  CHECK(fit.inlier.tail(220).all());
  CHECK(fit.rms_px == Approx(0.5 * std::sqrt(2.0)).epsilon(0.1));  // 220 pairs know it to 1 / sqrt(440)
  const AffineFit again = fit_affine(from, to);
  CHECK(again.map.matrix() == fit.map.matrix());
}

TEST_CASE("Affine fit: where points are found roughly, the scatter decides what is kept") {
  std::mt19937 random(13);
  const Points from = board();
  const Points to = moved(from, thermal_to_colour, 8, random);
  const AffineFit loose = fit_affine(from, to, {.largest_model_error_px = 1});
  CHECK(loose.inliers >= 28);
  CHECK(loose.status == AffineFitStatus::Scattered);  // 8 px each way is not within 1 px
  CHECK(fit_affine(from, to, {.largest_model_error_px = 40}).status == AffineFitStatus::Good);
}

TEST_CASE("Affine fit: says when a map cannot be trusted") {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> pixel(0, 600);
  const Points from = board();
  Points to(2, 30);
  for (Eigen::Index i = 0; i < to.size(); ++i) {
    to.data()[i] = pixel(random);
  }
  CHECK(fit_affine(from, to).status == AffineFitStatus::Scattered);
  CHECK(fit_affine(from, to, {.refuse_outliers = false}).status == AffineFitStatus::Scattered);

  Points three(2, 3), four(2, 4);
  three << 0, 100, 0, 0, 0, 100;
  four << 0, 100, 0, 100, 0, 0, 100, 100;
  const AffineFit exact = fit_affine(three, thermal_to_colour.apply_all(three));
  CHECK(exact.status == AffineFitStatus::Unverified);
  CHECK((exact.map.matrix() - thermal_to_colour.matrix()).cwiseAbs().maxCoeff() < 1e-10);
  Points bent = thermal_to_colour.apply_all(four);
  bent.col(3).x() += 100;
  const AffineFit uncertain = fit_affine(four, bent);
  CHECK(uncertain.status == AffineFitStatus::Unverified);
  CHECK(uncertain.inliers == 4);
  // one wrong corner of a parallelogram spreads over all four alike: a quarter of it each
  CHECK(uncertain.largest_px == Approx(25));

  CHECK(std::string(to_string(AffineFitStatus::Good)) == "good");
  CHECK(std::string(to_string(AffineFitStatus::Unverified)) == "too few pairs to tell a wrong one");
  CHECK(std::string(to_string(AffineFitStatus::Scattered)) ==
        "more than half of the pairs follow no common affine map");
}

TEST_CASE("Affine fit: refuses what fixes no map") {
  const Points good = board();
  const auto refused = [](const Points& from, const Points& to, const std::string& line, AffineFitSettings s = {}) {
    INFO(line);
    CHECK_THROWS_WITH(fit_affine(from, to, s), Catch::Matchers::StartsWith(line));
    CHECK_THROWS_AS(fit_affine(from, to, s), std::invalid_argument);
  };
  refused(good.leftCols(2), good.leftCols(2), "fit_affine: number of point pairs must be >= 3, got 2");
  refused(Points(2, 0), Points(2, 0), "fit_affine: number of point pairs must be >= 3, got 0");
  refused(good, good.leftCols(29), "fit_affine: number of points in `to` must be that of `from`, got 29");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e7}) {
    Points broken = good;
    broken(1, 4) = bad;
    refused(broken, good, "fit_affine: largest coordinate [px] must be finite and at most 1e6, got ");
    refused(good, broken, "fit_affine: largest coordinate [px] must be finite and at most 1e6, got ");
  }
  // on a line that is tilted, so that whole pixels are up to half a pixel off
  Points line(2, 30);
  for (int i = 0; i < 30; ++i) {
    line.col(i) << 10 * i, std::round(3.7 * i);
  }
  const std::string on_a_line =
      "fit_affine: root mean square distance of the points from a common line [px] must be >= 1";
  refused(line, good, on_a_line);
  refused(good, line, on_a_line);
  refused(Points::Constant(2, 30, 5), good, on_a_line);
  for (const double bad :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    refused(good, good, "fit_affine: largest_model_error_px must be > 0 and finite", {.largest_model_error_px = bad});
    refused(good, good, "fit_affine: scatter_factor must be >= 2 and finite", {.scatter_factor = bad});
  }
}

TEST_CASE("Affine fit: views of a larger table are read in place") {
  std::mt19937 random(19);
  Eigen::Matrix<double, 4, Eigen::Dynamic> table(4, 30);
  table.topRows<2>() = board();
  table.bottomRows<2>() = moved(board(), thermal_to_colour, 0.3, random);
  const AffineFit fit = fit_affine(table.topRows<2>(), table.bottomRows<2>());
  const AffineFit same = fit_affine(Points(table.topRows<2>()), Points(table.bottomRows<2>()));
  CHECK(fit.map.matrix() == same.map.matrix());
}
