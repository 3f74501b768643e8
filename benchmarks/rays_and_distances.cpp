// SPDX-License-Identifier: MIT
/// Times what bodies hide from a camera: 8,000 points in and around a cup of 5,000 and of 50,000 triangles, by rays and
/// by a depth buffer of 640 x 480 pixels, camera 0.6 m away. 16 camera poses take turns, as a processor learns the
/// branches of one. The column `particles` holds the points, or the pixels where an image is drawn; `neighbors` the
/// triangles. Usage: bench_micro_occlusion [threads, default 1 and 2]

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/camera/depth_buffer.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>

#include "common.hpp"

namespace {

using namespace decant_benchmark;
using decant::BoundingVolumeHierarchy;
using decant::DepthBuffer;
using decant::PosedCamera;
using decant::RayOcclusion;
using decant::Threads;
using Point = decant::Vector3<double>;

constexpr std::size_t poses = 16;
constexpr Index point_count = 8000;

// From all around, more or less from above.
std::vector<decant::Pose> camera_poses() {
  std::vector<decant::Pose> result;
  for (std::size_t k = 0; k < poses; ++k) {
    const double turn = 0.37 + 2.4 * static_cast<double>(k);
    const double tilt = 1.9 + 0.07 * static_cast<double>(k % 8);  // of the axis against the vertical
    const Eigen::Quaterniond camera_from_world(Eigen::AngleAxisd(tilt, Point::UnitX()) *
                                               Eigen::AngleAxisd(turn, Point::UnitZ()));
    result.push_back({camera_from_world, Point(0, 0, 0.6) - camera_from_world * Point(0, 0, 0.045)});
  }
  return result;
}

void run(Csv& csv, std::uint32_t steps, Threads threads) {
  const auto surface = std::make_shared<const BoundingVolumeHierarchy>(cup(steps));
  const auto triangles = static_cast<double>(surface->size());
  const std::vector<decant::Pose> camera_from_world = camera_poses();
  const decant::PinholeCamera pinhole(900, 900, 319.5, 239.5, 640, 480);
  const decant::DistortedPinholeCamera lens(pinhole, {-0.1, 0.02, 1e-3, -1e-3, 0});
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> place(-1, 1);
  decant::PointArray<float> points(3, point_count);
  for (Index i = 0; i < point_count; ++i) {
    points.col(i) =
        Point(0.06 * place(generator), 0.06 * place(generator), 0.045 + 0.07 * place(generator)).cast<float>();
  }

  std::vector<RayOcclusion<decant::PinholeCamera>> rays;
  std::vector<DepthBuffer<decant::PinholeCamera>> drawn;
  for (const decant::Pose& pose : camera_from_world) {
    rays.emplace_back(PosedCamera<decant::PinholeCamera>(pinhole, pose));
    rays.back().add(surface);
    drawn.emplace_back(PosedCamera<decant::PinholeCamera>(pinhole, pose));
    drawn.back().draw(*surface, {}, threads);
  }
  // all alike before any is timed
  std::vector<std::uint8_t> by_rays(point_count), by_buffer(point_count);
  std::size_t hidden = 0, differ = 0;
  for (std::size_t k = 0; k < poses; ++k) {
    decant::find_hidden(rays[k], points, threads, by_rays);
    decant::find_hidden(drawn[k], points, threads, by_buffer);
    for (std::size_t i = 0; i < by_rays.size(); ++i) {
      hidden += by_rays[i];
      differ += by_rays[i] == by_buffer[i] ? 0 : 1;
    }
  }
  const auto percent = [](std::size_t count) {
    return std::to_string(100.0 * static_cast<double>(count) / static_cast<double>(poses * point_count)).substr(0, 4);
  };
  if (differ > poses * point_count / 20) {
    throw std::runtime_error("rays and depth buffer disagree on " + percent(differ) + " % of the points");
  }

  std::size_t turn = 0;
  csv.row("RayOcclusion: hidden points", threads.count, point_count, triangles,
          time_of([&] { decant::find_hidden(rays[turn++ % poses], points, threads, by_rays); }),
          percent(hidden) + " % of the points are hidden");
  csv.row("DepthBuffer: hidden points", threads.count, point_count, triangles,
          time_of([&] { decant::find_hidden(drawn[turn++ % poses], points, threads, by_buffer); }),
          percent(differ) + " % otherwise than by rays");
  const Index pixels = drawn[0].depth().size();
  csv.row("DepthBuffer: clear and draw (pinhole)", threads.count, pixels, triangles, time_of([&] {
            DepthBuffer<decant::PinholeCamera>& buffer = drawn[turn++ % poses];
            buffer.clear();
            buffer.draw(*surface, {}, threads);
          }));
  DepthBuffer<decant::DistortedPinholeCamera> cast{PosedCamera<decant::DistortedPinholeCamera>(lens)};
  csv.row("DepthBuffer: clear and cast rays (lens)", threads.count, pixels, triangles, time_of([&] {
            cast.set_camera_pose(camera_from_world[turn++ % poses]);
            cast.clear();
            cast.draw(*surface, {}, threads);
          }));
  keep(by_rays);
  keep(by_buffer);
}

}  // namespace

int main(int argc, char** argv) {
  Csv csv;
  const std::vector<int> thread_counts = argc > 1 ? std::vector<int>{std::atoi(argv[1])} : std::vector<int>{1, 2};
  for (const std::uint32_t steps : {50U, 158U}) {
    for (const int threads : thread_counts) {
      run(csv, steps, Threads{threads});
    }
  }
}
