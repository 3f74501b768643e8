// SPDX-License-Identifier: MIT
/// Times how a mesh becomes a wall, at 5 mm between particles: the 128 rays from 1,000 points near the surface, one by
/// one and as a fan; and the whole set-up. A cup of 5,000 and of 50,000 triangles, or a mesh of yours. The column
/// `particles` holds the points, `neighbors` the triangles. Usage: bench_micro_mesh_wall [threads, default 1 [mesh
/// file]]

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/mesh_wall.hpp>
#include <decant/boundary/ray_fan.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include "common.hpp"

namespace {

using namespace decant_benchmark;
using decant::BoundingVolumeHierarchy;
using Point = decant::Vector3<double>;

constexpr double spacing = 0.005;
constexpr std::size_t ray_count = 128;

decant::RayFan<ray_count> random_fan() {
  std::mt19937 generator(1);
  std::normal_distribution<double> component;
  std::array<Point, ray_count> directions;
  for (Point& direction : directions) {
    const double x = component(generator), y = component(generator), z = component(generator);
    direction = Point(x, y, z).normalized();
  }
  return decant::RayFan<ray_count>(directions);
}

void run(Csv& csv, const decant::TriangleMesh& mesh, decant::Threads threads) {
  const BoundingVolumeHierarchy surface(mesh);
  const auto triangles = static_cast<double>(surface.size());
  std::mt19937 generator(2);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<Point> points;
  while (points.size() < 1000) {
    const double x = place(generator), y = place(generator), z = place(generator);
    const Point point = surface.bounds().center() + surface.bounds().sizes().cwiseProduct(Point(x, y, z));
    if (surface.closest_point(point, spacing)) {
      points.push_back(point);
    }
  }
  const auto fan = random_fan();
  double sum = 0, sum_of_fans = 0;
  const auto one_by_one = [&] {
    sum = 0;
    for (const Point& point : points) {
      for (std::size_t k = 0; k < ray_count; ++k) {
        const auto hit = surface.first_hit_along(point, fan.direction(k), spacing);
        sum += hit ? 2 - hit->fraction : 0;
      }
    }
  };
  const auto as_fans = [&] {
    sum_of_fans = 0;
    for (const Point& point : points) {
      fan.first_hits(surface, point, spacing,
                     [&](std::size_t, const BoundingVolumeHierarchy::Hit& hit) { sum_of_fans += 2 - hit.fraction; });
    }
  };
  // alike before any is timed
  one_by_one();
  as_fans();
  if (!(std::abs(sum - sum_of_fans) < 1e-9 * sum)) {
    throw std::runtime_error("rays and fans disagree: " + std::to_string(sum) + " and " + std::to_string(sum_of_fans));
  }
  const auto count = static_cast<Index>(points.size());
  csv.row("BoundingVolumeHierarchy: 128 rays one by one", 1, count, triangles, time_of(one_by_one));
  csv.row("RayFan: 128 rays", 1, count, triangles, time_of(as_fans));
  csv.row("MeshWall: set-up", threads.count, count, triangles, time_of([&] {
            keep(decant::MeshWall::of<decant::CubicSpline<double>>(surface, spacing, spacing, threads));
          }));
}

}  // namespace

int main(int argc, char** argv) {
  Csv csv;
  const decant::Threads threads{argc > 1 ? std::atoi(argv[1]) : 1};
  if (argc > 2) {
    run(csv, decant::read_mesh(argv[2]), threads);
    return 0;
  }
  run(csv, cup(50), threads);
  run(csv, cup(158), threads);
}
