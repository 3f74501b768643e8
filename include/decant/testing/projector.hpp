// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a Projector.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/projector/concept.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Tries the laws of a projector that draws one particle as something that covers at least one pixel when it fills
/// some: spheres of millimetres, seen by a pinhole camera from 30 to 70 cm. Takes some milliseconds.
template <class P>
requires Projector<P, PinholeCamera> std::vector<Law> projector_laws(const P& configured) {
  using Scalar = typename P::Scalar;
  const PinholeCamera camera(300, 310, 80.2, 59.7, 160, 120);
  Pose camera_from_world;
  camera_from_world.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Vector3<double>(0.3, -0.5, 0.8).normalized()));
  camera_from_world.translation = {0.01, -0.02, 0.5};
  const Pose world_from_camera = camera_from_world.inverse();

  // Scattered on purpose without a random generator: fractions of multiples of irrational numbers.
  const Index count = 1500;
  PointArray<Scalar> position(3, count);
  for (Index i = 0; i < count; ++i) {
    const auto fraction = [i](double step) { return std::fmod(step * static_cast<double>(i + 1), 1.0) - 0.5; };
    const Vector3<double> x_in_camera(0.25 * fraction(0.6180339887), 0.2 * fraction(0.7548776662),
                                      0.5 + 0.4 * fraction(0.5698402910));
    position.col(i) = (world_from_camera * x_in_camera).template cast<Scalar>();
  }

  P projector = configured;
  const auto draw = [&](const PointArray<Scalar>& x, std::span<const std::uint8_t> hidden, int threads,
                        PixelBox* box = nullptr) {
    Image<float> image = Image<float>::Constant(camera.height(), camera.width(), -7);
    const PixelBox drawn = projector.render(x, hidden, camera, camera_from_world, image, Threads{threads});
    if (box != nullptr) {
      *box = drawn;
    }
    return image;
  };
  const auto difference = [](const Image<float>& a, const Image<float>& b) {
    const double largest = (a - b).abs().maxCoeff();
    return std::isfinite(largest) && (a == a).all() && (b == b).all() ? largest
                                                                      : std::numeric_limits<double>::infinity();
  };

  PixelBox box;
  const Image<float> all = draw(position, {}, 1, &box);
  double outside = 0;
  for (int v = 0; v < camera.height(); ++v) {
    for (int u = 0; u < camera.width(); ++u) {
      outside += all(v, u) != 0 && !box.contains(u, v) ? 1 : 0;
    }
  }
  double threads_matter = 0;
  for (const int threads : {2, 4}) {
    threads_matter += (draw(position, {}, threads) == all).all() ? 0 : 1;
  }

  // hidden particles are left out: hiding every third and hiding the rest add up to all
  std::vector<std::uint8_t> hidden(static_cast<std::size_t>(count)), others(hidden.size());
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    hidden[i] = i % 3 == 0 ? 255 : 0;
    others[i] = i % 3 == 0 ? 0 : 1;
  }
  const Image<float> some = draw(position, hidden, 1);
  const Image<float> rest = draw(position, others, 1);
  const std::vector<std::uint8_t> everything(hidden.size(), 1);

  // what cannot be seen: behind the camera, beside the image, not finite
  PointArray<Scalar> unseen = position;
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  const Scalar infinity = std::numeric_limits<Scalar>::infinity();
  for (Index i = 0; i < count; ++i) {
    const Vector3<double> places[] = {{0.01, 0.01, -0.5}, {3, 0, 0.5}, {0, -3, 0.5}, {0, 0, 0}, {1e30, 1e30, 1e-7}};
    unseen.col(i) = (world_from_camera * places[i % 5]).template cast<Scalar>();
    if (i % 7 == 0) {
      unseen(i % 3, i) = i % 2 == 0 ? nan : infinity;
    }
  }

  // a single particle before the camera, at a pixel's centre
  PointArray<Scalar> one(3, 1);
  one.col(0) = (world_from_camera * camera.unproject({70, 50}, 0.4)).template cast<Scalar>();
  const Image<float> lone = draw(one, {}, 1);

  return {
      {"coverage is finite and never negative (pixels where it is not)",
       static_cast<double>(camera.width() * camera.height() - (all >= 0 && all.isFinite()).count()), 0},
      {"liquid before the camera is seen (1 if not)", all.maxCoeff() > 0 ? 0.0 : 1.0, 0},
      {"outside of the rectangle returned, coverage is zero (pixels where it is not)", outside, 0},
      {"a second call gives the same bits", difference(draw(position, {}, 1), all), 0},
      {"2 and 4 threads give the bits that 1 gives (numbers of threads that do not)", threads_matter, 0},
      {"what is drawn of one part of the particles and of the rest adds up to what is drawn of all [particles]",
       difference(some + rest, all), 1e-4},
      {"nothing is drawn if all are hidden [particles]", draw(position, everything, 1).maxCoeff(), 0},
      {"nothing is drawn of no particles [particles]", draw(PointArray<Scalar>(3, 0), {}, 1).abs().maxCoeff(), 0},
      {"what is behind, beside or not finite is not drawn [particles]", draw(unseen, {}, 1).abs().maxCoeff(), 0},
      {"a particle covers the pixel that its centre falls on [particles]", std::abs(lone(50, 70) - 1.0), 1e-4},
      {"a particle covers nothing 40 pixels away [particles]",
       static_cast<double>(lone.topRows(10).maxCoeff() + lone.rightCols(50).maxCoeff()), 0},
  };
}

}  // namespace decant::inline DECANT_TARGET::testing
