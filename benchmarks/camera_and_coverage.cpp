// SPDX-License-Identifier: MIT
/// What turns particles into images and images into pulls: 8,000 particles at 640 x 480, a litre of liquid of 5 mm
/// spacing, 0.8 m before the camera. Psi and the warp sum are set beside the direct sums that they stand for.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/coverage/activation.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/coverage/silhouette_distance.hpp>
#include <decant/coverage/warp_sum.hpp>
#include <decant/projector/disc_splat.hpp>
#include <decant/projector/projected_sphere.hpp>
#include <decant/projector/silhouette.hpp>

#include "common.hpp"
#include "inputs.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;

constexpr int width = 640, height = 480;
constexpr double spacing = 0.005;  // [m]

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

/// What a camera sees of a litre of liquid from several places.
struct Frames {
  PinholeCamera camera{600, 600, 319.5, 239.5, width, height};
  PointArray<float> liquid = resting_liquid<float>(20, spacing);
  std::vector<Pose> pose{input_count};
  std::vector<Mask> mask{input_count}, raw{input_count};  ///< raw: with 1 % salt
  std::vector<Image<float>> coverage{input_count};

  Frames() {
    const Vector3<float> middle = liquid.rowwise().mean();
    liquid.colwise() -= middle;
    std::mt19937 generator(2);
    std::uniform_real_distribution<double> shift(-0.05, 0.05), angle(-1, 1);
    std::bernoulli_distribution salt(0.01);
    Silhouette<> silhouette(DiscSplat<float>(0.66 * spacing));
    for (std::size_t k = 0; k < input_count; ++k) {
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
};

// ---- cameras and projectors -----------------------------------------------------------------------------------------

void measure_cameras(Report& report, const Frames& frames, int threads) {
  const Index count = frames.liquid.cols();
  std::vector<Eigen::Vector2d> pixel(static_cast<std::size_t>(count));
  const auto project = [&](const auto& camera) {
    return [&, camera](std::size_t turn) {
      const Pose& pose = frames.pose[turn % input_count];
      parallel_for(count, Threads{threads}, [&](Index i) {
        const Vector3<double> x = frames.liquid.col(i).cast<double>();
        pixel[static_cast<std::size_t>(i)] = camera.project(pose * x).pixel;
      });
      keep(pixel);
    };
  };
  Comparison cameras(report, "projecting points", count, threads);
  cameras.add("PinholeCamera", project(frames.camera));
  cameras.add("DistortedPinholeCamera", project(DistortedPinholeCamera(frames.camera, {-0.1, 0.02, 1e-3, -1e-3, 0})));
  cameras.run();
}

void measure_projectors(Report& report, const Frames& frames, int thread_count) {
  const Index count = frames.liquid.cols();
  const Threads threads{thread_count};
  Image<float> image(height, width);
  Mask mask(height, width);
  DiscSplat<float> discs(0.66 * spacing);
  ProjectedSphere<float> spheres(0.66 * spacing);
  Silhouette<> silhouette(discs);
  const auto pose = [&](std::size_t turn) -> const Pose& { return frames.pose[turn % input_count]; };

  Comparison projectors(report, "particles to images", count, thread_count);
  projectors.add("coverage: DiscSplat",
                 [&](std::size_t turn) { discs.render(frames.liquid, {}, frames.camera, pose(turn), image, threads); });
  projectors.add("coverage: ProjectedSphere", [&](std::size_t turn) {
    spheres.render(frames.liquid, {}, frames.camera, pose(turn), image, threads);
  });
  projectors.add("coverage: ProjectedSphere, of any camera", [&](std::size_t turn) {
    spheres.render(frames.liquid, {}, AnyCamera{frames.camera}, pose(turn), image, threads);
  });
  projectors.add("silhouette: DiscSplat and gaps closed", [&](std::size_t turn) {
    silhouette.render(frames.liquid, {}, frames.camera, pose(turn), mask, threads);
  });
  projectors.run();
}

// ---- masks ----------------------------------------------------------------------------------------------------------

/// Squared distances to the nearest liquid pixel [px^2], of one pixel by going through all of the image.
double nearest_liquid_px(const Mask& mask, Index v, Index u) {
  double nearest = 1e12;
  for (Index row = 0; row < mask.rows(); ++row) {
    for (Index column = 0; column < mask.cols(); ++column) {
      if (is_liquid(mask(row, column))) {
        const double across = static_cast<double>(column - u), down = static_cast<double>(row - v);
        nearest = std::min(nearest, across * across + down * down);
      }
    }
  }
  return std::sqrt(nearest);
}

void measure_masks(Report& report, const Frames& frames, int thread_count) {
  const Threads threads{thread_count};
  Mask clean(height, width);
  MaskCleaning cleaning;
  Comparison masks(report, "masks: cleaning", width * height, thread_count);
  masks.add(
      "3 x 3 vote and regions below 10 px",
      [&](std::size_t turn) { cleaning.apply(frames.raw[turn % input_count], clean, threads); }, "1 % salt");
  masks.run();

  SilhouetteDistance distance;
  constexpr Index every = 5000;
  distance.rebuild(frames.mask[0], MaskPart::Liquid, threads);
  for (Index p = 0; p < width * height; p += every) {
    const double error = std::abs(static_cast<double>(distance.distance_px()(p / width, p % width)) -
                                  nearest_liquid_px(frames.mask[0], p / width, p % width));
    expects(error < 1e-2, "bench_camera_and_coverage: error of a distance [px]", "below 0.01", error);
  }
  std::vector<double> direct(width * height / every + 1);
  Comparison distances(report, "masks: distance to the silhouette", width * height, thread_count);
  distances
      .add(
          "all pixels in turn",
          [&](std::size_t turn) {
            parallel_ranges(static_cast<Index>(direct.size()), threads, 1, [&](Index k, Index) {
              const Index p = std::min<Index>(k * every, width * height - 1);
              direct[static_cast<std::size_t>(k)] =
                  nearest_liquid_px(frames.mask[turn % input_count], p / width, p % width);
            });
            keep(direct);
          },
          "from every 5000th")
      .scale = static_cast<double>(width * height) / static_cast<double>(direct.size());
  distances.add("SilhouetteDistance, a silhouette of liquid", [&](std::size_t turn) {
    distance.rebuild(frames.mask[turn % input_count], MaskPart::Liquid, threads);
  });
  distances.add("SilhouetteDistance, with 1 % salt",
                [&](std::size_t turn) { distance.rebuild(frames.raw[turn % input_count], MaskPart::Liquid, threads); });
  distances.run();
}

// ---- Psi and the warp sum -------------------------------------------------------------------------------------------

/// 27 hypotheses on a 3 x 3 x 3 grid of 5 mm around each particle, as pixels.
std::vector<Eigen::Vector2d> hypotheses(const Frames& frames) {
  std::vector<Eigen::Vector2d> places;
  for (Index i = 0; i < frames.liquid.cols(); ++i) {
    for (int h = 0; h < 27; ++h) {
      const Vector3<double> offset = spacing * Vector3<double>(h % 3 - 1, h / 3 % 3 - 1, h / 9 - 1);
      const Vector3<double> x = frames.liquid.col(i).cast<double>() + offset;
      places.push_back(frames.camera.project(frames.pose[0] * x).pixel);
    }
  }
  return places;
}

/// A sum over the liquid pixels around each place, directly and by a field. Reference is the direct one.
/// @param size_of the length of a value, whose largest over the places an error is compared with.
template <class Field, class Direct, class SizeOf>
void measure_sums(Report& report, const std::string& name, const Frames& frames,
                  const std::vector<Eigen::Vector2d>& places, int thread_count, Direct&& direct_sum, SizeOf&& size_of) {
  using Value = decltype(direct_sum(frames.mask[0], frames.coverage[0], places[0]));
  const Threads threads{thread_count};
  Field field(width, height);
  std::vector<Value> value(places.size());
  const auto rebuild = [&](const std::vector<Mask>& masks) {
    return [&](std::size_t turn) {
      field.rebuild(masks[turn % masks.size()], frames.coverage[turn % input_count], threads);
    };
  };
  const auto look_up = [&](std::size_t) {
    parallel_for(static_cast<Index>(places.size()), threads, [&](Index k) {
      value[static_cast<std::size_t>(k)] = field.value(places[static_cast<std::size_t>(k)]);
    });
    keep(value);
  };
  constexpr std::size_t every = 2000;
  std::vector<Value> direct(places.size() / every);
  const auto sum_directly = [&](std::size_t turn) {
    const std::size_t input = turn % input_count;
    parallel_ranges(static_cast<Index>(direct.size()), threads, 1, [&](Index k, Index) {
      const auto at = static_cast<std::size_t>(k);
      direct[at] = direct_sum(frames.mask[input], frames.coverage[input], places[at * every]);
    });
    keep(direct);
  };

  rebuild(frames.mask)(0);
  look_up(0);
  sum_directly(0);
  double largest = 0, error = 0;
  for (std::size_t k = 0; k < direct.size(); ++k) {
    largest = std::max(largest, size_of(direct[k]));
    error = std::max(error, size_of(Value(direct[k] - value[k * every])));
  }
  if (!(error < 1e-3 * largest)) {
    throw std::runtime_error(name + ": the field disagrees with the direct sum");
  }
  char accuracy[64];
  std::snprintf(accuracy, sizeof accuracy, "off by %.1e of the largest at most", error / largest);

  Comparison sums(report, name + ", 27 hypotheses of each particle", frames.liquid.cols(), thread_count);
  sums.add("direct sums", sum_directly, "from every 2000th").scale = static_cast<double>(every);
  sums.add(
      "field: rebuild and look-ups",
      [&](std::size_t turn) {
        rebuild(frames.mask)(turn);
        look_up(turn);
      },
      accuracy);
  sums.add("field: look-ups", look_up);
  sums.run();

  const std::vector<Mask> everywhere{Mask::Constant(height, width, mask_liquid)};
  Comparison once(report, name + ", once per frame", width * height, thread_count);
  once.add("rebuild, a silhouette of liquid", rebuild(frames.mask));
  once.add("rebuild, with 1 % salt", rebuild(frames.raw));
  once.add("rebuild, all liquid", rebuild(everywhere));
  once.run();
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_camera_and_coverage", "particles to images, masks, Psi and the warp sum at 640 x 480");
  options.add_threads();
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const Frames frames;
    const std::vector<Eigen::Vector2d> places = hypotheses(frames);
    for (const int threads : given.numbers("threads")) {
      measure_cameras(report, frames, threads);
      measure_projectors(report, frames, threads);
      measure_masks(report, frames, threads);
      measure_sums<ActivationField>(
          report, "Psi", frames, places, threads,
          [](const Mask& mask, const Image<float>& coverage, const Eigen::Vector2d& p) {
            return activation(mask, coverage, p);
          },
          [](double psi) { return std::abs(psi); });
      measure_sums<WarpSumField>(
          report, "warp sum", frames, places, threads,
          [](const Mask& mask, const Image<float>& coverage, const Eigen::Vector2d& p) {
            return warp_sum(mask, coverage, p);
          },
          [](const Eigen::Vector2d& pull) { return pull.norm(); });
    }
  });
}
