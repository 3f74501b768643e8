// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a CameraModel and of an Occlusion.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include <decant/camera/concept.hpp>
#include <decant/camera/occlusion_concept.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

namespace detail {

// Pixels all over an image and on its border, which runs half a pixel outside of the outermost centres; `inset` [px]
// moves those on the border inward, or outward if it is negative.
inline std::vector<Eigen::Vector2d> image_samples(int width, int height, double inset, bool only_border) {
  constexpr int steps = 12;
  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row <= steps; ++row) {
    for (int column = 0; column <= steps; ++column) {
      const bool border = row == 0 || row == steps || column == 0 || column == steps;
      if (only_border && !border) {
        continue;
      }
      const double u = -0.5 + inset + (width - 2 * inset) * column / steps;
      const double v = -0.5 + inset + (height - 2 * inset) * row / steps;
      pixels.emplace_back(u, v);
    }
  }
  return pixels;
}

inline double worse(double error, double worst) { return error <= worst ? worst : error; }  // keeps a NaN

}  // namespace detail

/// Tries the laws of a camera at pixels all over its image, border included, and at depths from nearest to farthest
/// [m]. A lens may leave pixels on which nothing falls, but no more than half of them. Takes some milliseconds.
template <CameraModel Camera>
std::vector<Law> camera_laws(const Camera& camera, double nearest = 0.05, double farthest = 20) {
  using Point = Vector3<double>;
  const int width = camera.width();
  const int height = camera.height();
  const double longest = std::max(width, height);
  const auto same = [](const Projection& a, const Projection& b) {
    return a.pixel == b.pixel && a.depth == b.depth && a.visible == b.visible;
  };

  int samples = 0;
  int without_point = 0;
  double round_trip = 0;
  double wrong_depth = 0;
  double bent_rays = 0;
  double wrong_jacobian = 0;
  double inconsistent = 0;
  double changing = 0;
  for (const Eigen::Vector2d& pixel : detail::image_samples(width, height, 1e-3, false)) {
    const Point begin = camera.unproject(pixel, 0);
    const Point way = camera.unproject(pixel, 1) - begin;
    ++samples;
    if (!((camera.project(camera.unproject(pixel, 1)).pixel - pixel).norm() < 0.01)) {
      ++without_point;
      continue;
    }
    for (const double share : {0.0, 0.1, 0.4, 1.0}) {
      const double depth = nearest + share * (farthest - nearest);
      const Point x = camera.unproject(pixel, depth);
      const Projection seen = camera.project(x);
      round_trip = detail::worse((seen.pixel - pixel).norm(), round_trip);
      wrong_depth = detail::worse(std::max(std::abs(seen.depth / depth - 1), std::abs(x.z() / depth - 1)), wrong_depth);
      bent_rays = detail::worse((x - begin - depth * way).norm() / depth, bent_rays);
      inconsistent += seen.projected() && seen.visible ? 0 : 1;
      changing += same(seen, camera.project(x)) ? 0 : 1;

      // central differences of fourth order; the step moves the pixel by about a thousandth of the image
      const Eigen::Matrix<double, 2, 3> rate = camera.jacobian(x);
      const double step = std::min(0.01 * depth, 1e-3 * longest / std::max(rate.norm(), 1e-9));
      bool inside_lens = true;  // next to the edge of what the lens takes in there are no differences
      const auto pixel_at = [&](Index axis, double shift) {
        Point moved = x;
        moved[axis] += shift;
        const Projection there = camera.project(moved);
        inside_lens = inside_lens && there.projected();
        return there.pixel;
      };
      for (Index axis = 0; axis < 3; ++axis) {
        const Eigen::Vector2d wide = pixel_at(axis, 2 * step) - pixel_at(axis, -2 * step);
        const Eigen::Vector2d narrow = pixel_at(axis, step) - pixel_at(axis, -step);
        const Eigen::Vector2d difference = (8 * narrow - wide) / (12 * step);
        if (inside_lens) {
          wrong_jacobian = detail::worse((difference - rate.col(axis)).norm() / rate.norm(), wrong_jacobian);
        }
      }
    }
  }

  double wrong_border = 0;
  for (const double inset : {1e-3, -1e-3}) {
    for (const Eigen::Vector2d& pixel : detail::image_samples(width, height, inset, true)) {
      const Projection seen = camera.project(camera.unproject(pixel, 1));
      if (seen.projected() && (seen.pixel - pixel).norm() < 1e-4) {
        wrong_border += seen.visible == (inset > 0) ? 0 : 1;
      }
    }
  }

  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  double seen_but_impossible = 0;
  const std::array<Point, 14> impossible{
      Point(0, 0, 0),   Point(0, 0, -1),        Point(0.1, 0.2, -1e-3), Point(-3, 2, -50),       Point(nan, 0, 1),
      Point(0, nan, 1), Point(0, 0, nan),       Point(infinity, 0, 1),  Point(0, -infinity, 1),  Point(0, 0, infinity),
      Point(1, 1, 0),   Point(0, 0, -infinity), Point(nan, nan, nan),   Point(0, 1e300, -1e-300)};
  for (const Point& x : impossible) {
    const Projection seen = camera.project(x);
    const bool well = !seen.visible && !seen.projected() && seen.depth == 0 && seen.pixel.allFinite() &&
                      camera.jacobian(x) == (Eigen::Matrix<double, 2, 3>::Zero());
    seen_but_impossible += well ? 0 : 1;
  }
  double not_finite = 0;
  for (const double x : {0.0, 1e-300, 1e-9, 1.0, 1e9, 1e300}) {
    for (const double z : {1e-300, 1e-9, 1e-5, 1.0, 1e9, 1e300}) {
      for (const Point& point : {Point(x, 0, z), Point(0, -x, z), Point(x, x, z)}) {
        const Projection seen = camera.project(point);
        const bool well = seen.pixel.allFinite() && std::isfinite(seen.depth) && seen.depth >= 0 &&
                          seen.visible == (seen.projected() && inside_image(seen.pixel, width, height)) &&
                          camera.jacobian(point).allFinite();
        not_finite += well ? 0 : 1;
      }
    }
  }

  const double rounding = std::numeric_limits<double>::epsilon();
  return {
      {"the image has pixels", width >= 1 && height >= 1 ? 0.0 : 1.0, 0},
      {"half of the image's pixels or more have points that fall on them (share that has not)",
       static_cast<double>(without_point) / samples, 0.5},
      // a solver that stops at 1e-12 of the focal length, with room for images of many pixels
      {"a point that was taken from a pixel falls on it [px]", round_trip, 1e-7 + 1e-10 * longest},
      {"depths are z, when projecting and when taking a point from a pixel, relative", wrong_depth, 4 * rounding},
      {"what falls on a pixel is a straight line, per depth", bent_rays, 1e-9},
      {"the Jacobian equals differences of the projection, relative", wrong_jacobian, 1e-6},
      {"points before the image are visible (samples that are not)", inconsistent, 0},
      {"equal points have equal projections (samples that have not)", changing, 0},
      {"the image ends half a pixel beyond its outermost centres (samples where it does not)", wrong_border, 0},
      {"what is behind the camera or not finite has depth 0, is not visible, moves no pixel (points that do not)",
       seen_but_impossible, 0},
      {"pixels are finite for every finite point, and visible means projected into the image (points that break it)",
       not_finite, 0},
  };
}

/// Tries the laws of an occlusion on random lines of sight of the camera that it knows, at depths from nearest to
/// farthest [m]; put its walls between these. With a seed of its own generator. Takes as long as 8,000 questions.
template <Occlusion OcclusionType, CameraModel Camera>
std::vector<Law> occlusion_laws(const OcclusionType& occlusion, const PosedCamera<Camera>& camera, double nearest,
                                double farthest) {
  using Point = Vector3<double>;
  std::mt19937 generator(20170712);
  const auto uniform = [&generator](double low, double high) {  // the standard's distributions differ by library
    return low + (high - low) * (static_cast<double>(generator()) / 4294967296.0);
  };
  constexpr Index lines = 1000;
  constexpr Index along = 8;
  PointArray<double> points(3, lines * along);
  double reappearing = 0;
  double changing = 0;
  for (Index line = 0; line < lines; ++line) {
    const Eigen::Vector2d pixel(uniform(-0.4, camera.width() - 0.6), uniform(-0.4, camera.height() - 0.6));
    bool before = false;
    for (Index k = 0; k < along; ++k) {
      const double depth = nearest + (farthest - nearest) * static_cast<double>(k) / static_cast<double>(along - 1);
      const Point x = camera.unproject(pixel, depth);
      points.col(line * along + k) = x;
      const bool hidden = occlusion.hidden(x);
      reappearing += before && !hidden ? 1 : 0;
      changing += hidden == occlusion.hidden(x) ? 0 : 1;
      before = hidden;
    }
  }

  double batch_differs = 0;
  for (const int threads : {1, 2, 4}) {
    std::vector<std::uint8_t> hidden(static_cast<std::size_t>(points.cols()), 77);
    find_hidden(occlusion, points, Threads{threads}, hidden);
    for (Index i = 0; i < points.cols(); ++i) {
      const std::uint8_t single = occlusion.hidden(points.col(i)) ? 1 : 0;
      batch_differs += hidden[static_cast<std::size_t>(i)] == single ? 0 : 1;
    }
  }

  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  double behind_hidden = 0;
  for (const Point& x : {Point(0, 0, -farthest), Point(0.1, 0.2, -nearest), Point(0, 0, 0)}) {
    behind_hidden += occlusion.hidden(camera.to_world(x)) ? 1 : 0;
  }
  for (const Point& x : {Point(nan, 0, 1), Point(0, nan, 0), Point(infinity, 0, 0), Point(nan, nan, nan)}) {
    behind_hidden += occlusion.hidden(x) ? 1 : 0;
  }

  return {
      {"what lies farther away on a line of sight than a hidden point is hidden (points that are not)", reappearing, 0},
      {"equal questions have equal answers (points that have not)", changing, 0},
      {"a batch has the answers of single questions, with 1, 2 and 4 threads (points that differ)", batch_differs, 0},
      {"what the camera cannot project is not hidden (points that are)", behind_hidden, 0},
  };
}

}  // namespace decant::inline DECANT_TARGET::testing
