// SPDX-License-Identifier: MIT
/// Times what turns particles into images and images into pulls: 8,000 particles at 640 x 480, a litre of liquid of 5
/// mm spacing, 0.8 m before the camera. Inputs change from call to call. Usage: bench_micro_coverage [threads, default
/// 1 and 2]

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/coverage/activation.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/coverage/silhouette_distance.hpp>
#include <decant/coverage/warp_sum.hpp>
#include <decant/projector/disc_splat.hpp>
#include <decant/projector/projected_sphere.hpp>
#include <decant/projector/silhouette.hpp>

#include "common.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;

constexpr int width = 640, height = 480;
constexpr std::size_t inputs = 16;  // in rotation, so that nothing learns one by heart
constexpr double spacing = 0.005;   // [m]

// A camera that projectors have no formula for.
struct AnyCamera {
  PinholeCamera camera;
  Projection project(const Vector3<double>& x) const noexcept { return camera.project(x); }
  Vector3<double> unproject(const Eigen::Vector2d& p, double depth) const noexcept {
    return camera.unproject(p, depth);
  }
  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x) const noexcept { return camera.jacobian(x); }
  int width() const noexcept { return camera.width(); }
  int height() const noexcept { return camera.height(); }
};

struct Frames {
  PinholeCamera camera{600, 600, 319.5, 239.5, width, height};
  PointArray<float> liquid = resting_liquid<float>(20, spacing);
  std::vector<Pose> pose{inputs};
  std::vector<Mask> mask{inputs}, raw{inputs};
  std::vector<Image<float>> coverage{inputs};
  std::size_t turn = 0;

  Frames() {
    const Vector3<float> middle = liquid.rowwise().mean();
    liquid.colwise() -= middle;
    std::mt19937 generator(2);
    std::uniform_real_distribution<double> shift(-0.05, 0.05), angle(-1, 1);
    std::bernoulli_distribution salt(0.01);
    Silhouette<> silhouette(DiscSplat<float>(0.66 * spacing));
    for (std::size_t k = 0; k < inputs; ++k) {
      pose[k].rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle(generator), Vector3<double>(1, 2, 3).normalized()));
      pose[k].translation = {shift(generator), shift(generator), 0.8 + shift(generator)};
      mask[k] = Mask::Zero(height, width);
      silhouette.render(liquid, {}, camera, pose[k], mask[k]);
      coverage[k] = silhouette.coverage();
      raw[k] = mask[k];
      for (Index p = 0; p < raw[k].size(); ++p) {
        raw[k].data()[p] = salt(generator) ? static_cast<std::uint8_t>(255 - raw[k].data()[p]) : raw[k].data()[p];
      }
    }
  }

  std::size_t next() { return turn = (turn + 1) % inputs; }
};

void run(Csv& csv, Frames& frames, Threads threads) {
  const Index count = frames.liquid.cols();
  const PinholeCamera& camera = frames.camera;
  Image<float> image(height, width);
  Mask mask(height, width);
  const auto row = [&](const std::string& name, const Timing& timing, const std::string& note = "") {
    csv.row(name, threads.count, count, 0, timing, note);
  };

  DiscSplat<float> discs(0.66 * spacing);
  ProjectedSphere<float> spheres(0.66 * spacing);
  Silhouette<> silhouette(discs);
  row("coverage: DiscSplat",
      time_of([&] { discs.render(frames.liquid, {}, camera, frames.pose[frames.next()], image, threads); }));
  row("coverage: ProjectedSphere",
      time_of([&] { spheres.render(frames.liquid, {}, camera, frames.pose[frames.next()], image, threads); }));
  row("coverage: ProjectedSphere of any camera", time_of([&] {
        spheres.render(frames.liquid, {}, AnyCamera{camera}, frames.pose[frames.next()], image, threads);
      }));
  row("silhouette: DiscSplat and gaps closed",
      time_of([&] { silhouette.render(frames.liquid, {}, camera, frames.pose[frames.next()], mask, threads); }));

  MaskCleaning cleaning;
  row("mask cleaning: 3 x 3 vote and regions below 10 px",
      time_of([&] { cleaning.apply(frames.raw[frames.next()], mask, threads); }), "1 % salt");
  SilhouetteDistance distance;
  row("distance transform", time_of([&] { distance.rebuild(frames.mask[frames.next()], MaskPart::Liquid, threads); }),
      "silhouette of the liquid");
  row("distance transform", time_of([&] { distance.rebuild(frames.raw[frames.next()], MaskPart::Liquid, threads); }),
      "1 % salt");

  ActivationField activation_field(width, height);
  WarpSumField warp_field(width, height);
  const Mask everywhere = Mask::Constant(height, width, mask_liquid);
  const auto rebuild = [&](auto& field, const std::vector<Mask>& masks) {
    return time_of([&] {
      const std::size_t k = frames.next();
      field.rebuild(masks[k % masks.size()], frames.coverage[k], threads);
    });
  };
  row("Psi: rebuild", rebuild(activation_field, frames.mask), "silhouette of the liquid");
  row("Psi: rebuild", rebuild(activation_field, frames.raw), "1 % salt");
  row("Psi: rebuild", rebuild(activation_field, {everywhere}), "all liquid");
  row("warp sum: rebuild", rebuild(warp_field, frames.mask), "silhouette of the liquid");
  row("warp sum: rebuild", rebuild(warp_field, {everywhere}), "all liquid");

  // 27 hypotheses on a 3 x 3 x 3 grid of 5 mm around each particle, projected before the clock starts
  std::vector<Eigen::Vector2d> places;
  for (Index i = 0; i < count; ++i) {
    for (int h = 0; h < 27; ++h) {
      const Vector3<double> offset = spacing * Vector3<double>(h % 3 - 1, h / 3 % 3 - 1, h / 9 - 1);
      places.push_back(
          camera.project(frames.pose[0] * Vector3<double>(frames.liquid.col(i).cast<double>() + offset)).pixel);
    }
  }
  std::vector<float> psi(places.size());
  const auto look_up = [&] {
    parallel_for(static_cast<Index>(places.size()), threads, [&](Index k) {
      const auto at = static_cast<std::size_t>(k);
      psi[at] = static_cast<float>(activation_field.value(places[at]));
    });
  };
  row("Psi: 27 look-ups per particle", time_of(look_up));
  row("Psi: rebuild and 27 look-ups per particle", time_of([&] {
        const std::size_t k = frames.next();
        activation_field.rebuild(frames.mask[k], frames.coverage[k], threads);
        look_up();
      }));

  // the same by the direct sum: every 500th place, and what all of them would take
  activation_field.rebuild(frames.mask[0], frames.coverage[0], threads);
  look_up();
  constexpr std::size_t every = 500;
  const auto tried = static_cast<Index>(places.size() / every);
  std::vector<double> direct(static_cast<std::size_t>(tried));
  Timing timing = time_of([&] {
    parallel_ranges(tried, threads, 1, [&](Index begin, Index) {
      const auto k = static_cast<std::size_t>(begin);
      direct[k] = activation(frames.mask[0], frames.coverage[0], places[k * every]);
    });
  });
  for (double* const time : {&timing.median, &timing.spread, &timing.fastest}) {
    *time *= static_cast<double>(every);
  }
  double largest = 0, error = 0;
  for (std::size_t k = 0; k < direct.size(); ++k) {
    largest = std::max(largest, direct[k]);
    error = std::max(error, std::abs(direct[k] - static_cast<double>(psi[k * every])));
  }
  if (!(error < 1e-3 * largest)) {
    throw std::runtime_error("the field disagrees with the direct sum");
  }
  row("Psi: direct sums for 27 hypotheses per particle", timing,
      "extrapolated from every 500th; largest difference of the field over the maximum " +
          std::to_string(error / largest));
}

}  // namespace

int main(int argc, char** argv) {
  Csv csv;
  Frames frames;
  const std::vector<int> thread_counts = argc > 1 ? std::vector<int>{std::atoi(argv[1])} : std::vector<int>{1, 2};
  for (const int threads : thread_counts) {
    run(csv, frames, Threads{threads});
  }
}
