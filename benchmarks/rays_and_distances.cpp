// SPDX-License-Identifier: MIT
/// Questions to a mesh, a cup of 5,000 and of 50,000 triangles or a mesh of yours: sight lines of 8,000 points from 16
/// places around it, distances of 8,000 points near it, and what setting up its wall integrals takes at 5 mm between
/// particles. Exact answers stand beside quick ones, and beside going through all triangles.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/mesh_wall.hpp>
#include <decant/boundary/ray_fan.hpp>
#include <decant/boundary/sampled_wall.hpp>
#include <decant/camera/depth_buffer.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include "common.hpp"
#include "inputs.hpp"

namespace {

using namespace decant_benchmark;
using decant::BoundingVolumeHierarchy;
using decant::DepthBuffer;
using decant::PosedCamera;
using decant::RayOcclusion;
using decant::Threads;
using Point = decant::Vector3<double>;
using Rays = RayOcclusion<decant::PinholeCamera>;
using Buffer = DepthBuffer<decant::PinholeCamera>;

constexpr Index point_count = 8000;
constexpr double spacing = 0.005;  // [m]

/// A mesh with points and cameras around it, each input_count times.
struct Scene {
  decant::TriangleMesh mesh;
  std::shared_ptr<const BoundingVolumeHierarchy> surface = std::make_shared<const BoundingVolumeHierarchy>(mesh);
  std::vector<decant::PointArray<float>> points{};  ///< in and around the mesh, moved as liquid moves in a sub-step
  std::vector<decant::Pose> camera_from_world{};    ///< from all around, more or less from above

  explicit Scene(decant::TriangleMesh of) : mesh(std::move(of)) {
    const Point middle = surface->bounds().center(), reach = 0.7 * surface->bounds().sizes();
    const double away = 4 * surface->bounds().diagonal().norm();
    std::mt19937 generator(1);
    std::uniform_real_distribution<double> place(-1, 1);
    const auto anywhere = [&] {
      const double x = place(generator), y = place(generator), z = place(generator);
      return Point(x, y, z);
    };
    decant::PointArray<double> base(3, point_count);
    for (Index i = 0; i < point_count; ++i) {
      base.col(i) = middle + reach.cwiseProduct(anywhere());
    }
    for (std::size_t input = 0; input < input_count; ++input) {
      points.emplace_back(3, point_count);
      for (Index i = 0; i < point_count; ++i) {
        points.back().col(i) = (base.col(i) + 0.4 * spacing * anywhere()).cast<float>();
      }
      const double turn = 0.37 + 2.4 * static_cast<double>(input);
      const double tilt = 1.9 + 0.07 * static_cast<double>(input % 8);  // of the axis against the vertical
      const Eigen::Quaterniond rotation(Eigen::AngleAxisd(tilt, Point::UnitX()) *
                                        Eigen::AngleAxisd(turn, Point::UnitZ()));
      camera_from_world.push_back({rotation, Point(0, 0, away) - rotation * middle});
    }
  }

  decant::PinholeCamera camera() const { return {900, 900, 319.5, 239.5, 640, 480}; }
  /// Places change when all cameras have had their turn, so that no camera sees the same points soon again.
  const decant::PointArray<float>& points_at(std::size_t turn) const {
    return points[(turn + turn / input_count) % input_count];
  }
  std::string title(const std::string& what) const {
    return what + ", " + std::to_string(surface->size()) + " triangles";
  }
};

// ---- sight lines ----------------------------------------------------------------------------------------------------

/// Whether a segment meets any of the triangles, all of which are gone through: the test of Moeller and Trumbore 1997.
bool meets_any(const decant::TriangleMesh& mesh, const Point& from, const Point& to) {
  const Point way = to - from;
  return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& corner) {
    const Point &a = mesh.vertices[corner[0]], ab = mesh.vertices[corner[1]] - a, ac = mesh.vertices[corner[2]] - a;
    const Point across = way.cross(ac), from_a = from - a, around = from_a.cross(ab);
    const double scale = 1 / ab.dot(across), u = scale * from_a.dot(across), v = scale * way.dot(around);
    const double fraction = scale * ac.dot(around);
    return u >= 0 && v >= 0 && u + v <= 1 && fraction >= 0 && fraction <= 1;
  });
}

void measure_rays(Report& report, const Scene& scene, int threads) {
  std::vector<std::uint8_t> hit(point_count), expected(point_count);
  std::vector<Point> eye;
  for (const decant::Pose& pose : scene.camera_from_world) {
    eye.push_back(pose.inverse().translation);
  }
  const auto over_points = [&](std::size_t turn, Index step, const auto& meets) {
    const Point& from = eye[turn % input_count];
    decant::parallel_for(point_count / step, Threads{threads}, [&, step](Index k) {
      const Point to = scene.points_at(turn).col(k * step).template cast<double>();
      hit[static_cast<std::size_t>(k * step)] = meets(from, to) ? 1 : 0;
    });
    keep(hit);
  };
  const auto any_hit = [&](std::size_t turn) {
    over_points(turn, 1, [&](const Point& a, const Point& b) { return scene.surface->any_hit(a, b); });
  };
  constexpr Index every = 50;
  const auto all_triangles = [&](std::size_t turn) {
    over_points(turn, every, [&](const Point& a, const Point& b) { return meets_any(scene.mesh, a, b); });
  };
  any_hit(0);
  expected = hit;
  all_triangles(0);
  Index differ = 0;
  for (std::size_t i = 0; i < hit.size(); ++i) {
    differ += hit[i] == expected[i] ? 0 : 1;
  }
  decant::expects(differ <= 1, "bench_rays_and_distances: rays that the hierarchy answers otherwise", "none", differ);

  Comparison rays(report, scene.title("rays from camera to point"), point_count, threads);
  rays.add("BoundingVolumeHierarchy: any hit", any_hit);
  rays.add("BoundingVolumeHierarchy: first hit", [&](std::size_t turn) {
    over_points(turn, 1, [&](const Point& a, const Point& b) { return scene.surface->first_hit(a, b).has_value(); });
  });
  rays.add("all triangles in turn", all_triangles, "from every 50th").scale = every;
  rays.run();
}

void measure_hidden_points(Report& report, const Scene& scene, int thread_count) {
  if (!report.wants(scene.title("hidden points")) && !report.wants(scene.title("drawing depth"))) {
    return;
  }
  const Threads threads{thread_count};
  std::vector<Rays> rays;
  std::vector<Buffer> drawn;
  for (const decant::Pose& pose : scene.camera_from_world) {
    rays.emplace_back(PosedCamera<decant::PinholeCamera>(scene.camera(), pose)).add(scene.surface);
    drawn.emplace_back(PosedCamera<decant::PinholeCamera>(scene.camera(), pose)).draw(*scene.surface, {}, threads);
  }
  std::vector<std::uint8_t> by_rays(point_count), by_buffer(point_count);
  double hidden = 0, differ = 0;
  for (std::size_t k = 0; k < input_count; ++k) {
    decant::find_hidden(rays[k], scene.points_at(k), threads, by_rays);
    decant::find_hidden(drawn[k], scene.points_at(k), threads, by_buffer);
    for (std::size_t i = 0; i < by_rays.size(); ++i) {
      hidden += by_rays[i];
      differ += by_rays[i] == by_buffer[i] ? 0 : 1;
    }
  }
  const double percent = 100.0 / static_cast<double>(input_count * point_count);
  decant::expects(percent * differ < 5, "bench_rays_and_distances: points that depth buffer and rays disagree on [%]",
                  "below 5", percent * differ);
  const auto in_words = [percent](double count) {
    return std::to_string(percent * count).substr(0, 4) + " % of points";
  };

  for (std::size_t turn = 0; turn < 4 * input_count; ++turn) {  // until memory has what it can have
    rays[turn % input_count].find_hidden(scene.points_at(turn), threads, by_rays);
  }
  Comparison points(report, scene.title("hidden points"), point_count, thread_count);
  points.add(
      "RayOcclusion, each point by itself",
      [&](std::size_t turn) {
        decant::find_hidden(rays[turn % input_count], scene.points_at(turn), threads, by_rays);
        keep(by_rays);
      },
      "hides " + in_words(hidden));
  points.add("RayOcclusion, remembers, camera at rest", [&](std::size_t turn) {
    rays[turn % input_count].find_hidden(scene.points_at(turn), threads, by_rays);
    keep(by_rays);
  });
  Rays moved = rays[0];
  points.add("RayOcclusion, remembers, camera moved", [&](std::size_t turn) {
    moved.set_camera_pose(scene.camera_from_world[turn % input_count]);
    moved.find_hidden(scene.points_at(turn), threads, by_rays);
    keep(by_rays);
  });
  points.add(
      "DepthBuffer, drawn before",
      [&](std::size_t turn) {
        decant::find_hidden(drawn[turn % input_count], scene.points_at(turn), threads, by_buffer);
        keep(by_buffer);
      },
      "otherwise than rays: " + in_words(differ));
  points.add("DepthBuffer, drawn anew", [&](std::size_t turn) {
    Buffer& buffer = drawn[turn % input_count];
    buffer.clear();
    buffer.draw(*scene.surface, {}, threads);
    decant::find_hidden(buffer, scene.points_at(turn), threads, by_buffer);
    keep(by_buffer);
  });
  points.run();

  Comparison drawing(report, scene.title("drawing depth"), drawn[0].depth().size(), thread_count);
  drawing.add("pinhole: triangles are filled", [&](std::size_t turn) {
    Buffer& buffer = drawn[turn % input_count];
    buffer.clear();
    buffer.draw(*scene.surface, {}, threads);
  });
  const decant::DistortedPinholeCamera lens(scene.camera(), {-0.1, 0.02, 1e-3, -1e-3, 0});
  DepthBuffer<decant::DistortedPinholeCamera> cast{PosedCamera<decant::DistortedPinholeCamera>(lens)};
  drawing.add("lens: a ray for each pixel", [&](std::size_t turn) {
    cast.set_camera_pose(scene.camera_from_world[turn % input_count]);
    cast.clear();
    cast.draw(*scene.surface, {}, threads);
  });
  drawing.run();
}

// ---- distances and walls --------------------------------------------------------------------------------------------

/// Points where liquid may be: outside of the material, from a third of a spacing to max_distance off its surface.
std::vector<Point> points_near(const BoundingVolumeHierarchy& surface, double max_distance, std::size_t count,
                               unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<Point> points;
  while (points.size() < count) {
    const double x = place(generator), y = place(generator), z = place(generator);
    const Point point = surface.bounds().center() + 0.8 * surface.bounds().sizes().cwiseProduct(Point(x, y, z));
    const auto near = surface.closest_point(point, max_distance);
    if (near && near->distance > spacing / 3 && !surface.inside_material(point)) {
      points.push_back(point);
    }
  }
  return points;
}

void measure_distances(Report& report, const Scene& scene, int threads) {
  if (!report.wants(scene.title("distances"))) {
    return;
  }
  using Kernel = decant::CubicSpline<double>;
  const BoundingVolumeHierarchy& surface = *scene.surface;
  const auto wall = decant::MeshWall::of<Kernel>(surface, spacing, spacing, Threads{threads});
  const auto sampled = decant::SampledWall::of<Kernel>(surface, spacing, spacing, Threads{threads});
  std::vector<std::vector<Point>> points;  // as far as walls are felt: two spacings
  for (unsigned seed = 0; seed < input_count; ++seed) {
    points.push_back(points_near(surface, 2 * spacing, point_count, seed + 1));
  }
  std::vector<double> result(point_count);
  const auto over_points = [&](Index step, auto&& distance) {
    return [&, step, distance](std::size_t turn) {
      decant::parallel_for(point_count / step, Threads{threads}, [&](Index k) {
        const auto i = static_cast<std::size_t>(k * step);
        result[i] = distance(points[turn % input_count][i]);
      });
      keep(result);
    };
  };
  const auto of_wall = [](const auto& of) {
    return [&of](const Point& x) {
      decant::WallSample sample;
      return of.sample(x, sample) ? sample.distance : 0.0;
    };
  };
  const auto exact = [&](const Point& x) { return surface.closest_point(x, 2 * spacing)->distance; };
  double worst = 0;
  for (const Point& x : points[0]) {
    decant::WallSample sample;
    if (wall.sample(x, sample)) {
      worst = std::max(worst, std::abs(sample.distance - exact(x)));
    }
  }

  constexpr Index every = 10;
  const auto directly = [&](const Point& x) {
    decant::WallSample sample;
    return wall.sample_directly(x, sample) ? sample.distance : 0.0;
  };
  Comparison distances(report, scene.title("distances"), point_count, threads);
  distances.add("BoundingVolumeHierarchy: closest point, exact", over_points(1, exact),
                "points 1.7 to 10 mm off the surface");
  distances.add("MeshWall: distance, share and gradient", over_points(1, of_wall(wall)),
                "distances off by at most " + std::to_string(1e3 * worst).substr(0, 5) + " mm");
  distances.add("MeshWall: the same, summed over directions", over_points(every, directly), "from every 10th").scale =
      every;
  distances.add("SampledWall: share and gradient", over_points(1, of_wall(sampled)));
  distances.run();
}

void measure_walls(Report& report, const Scene& scene, int threads) {
  constexpr std::size_t ray_count = 128;
  const BoundingVolumeHierarchy& surface = *scene.surface;
  std::mt19937 generator(1);
  std::normal_distribution<double> component;
  std::array<Point, ray_count> directions;
  for (Point& direction : directions) {
    const double x = component(generator), y = component(generator), z = component(generator);
    direction = Point(x, y, z).normalized();
  }
  const decant::RayFan<ray_count> fan(directions);
  std::vector<std::vector<Point>> points;
  for (unsigned seed = 0; seed < input_count; ++seed) {
    points.push_back(points_near(surface, spacing, 1000, seed + 1));
  }
  double sum = 0, sum_of_fans = 0;
  const auto one_by_one = [&](std::size_t turn) {
    sum = 0;
    for (const Point& point : points[turn % input_count]) {
      for (std::size_t k = 0; k < ray_count; ++k) {
        const auto hit = surface.first_hit_along(point, fan.direction(k), spacing);
        sum += hit ? 2 - hit->fraction : 0;
      }
    }
  };
  const auto as_fans = [&](std::size_t turn) {
    sum_of_fans = 0;
    for (const Point& point : points[turn % input_count]) {
      fan.first_hits(surface, point, spacing,
                     [&](std::size_t, const BoundingVolumeHierarchy::Hit& hit) { sum_of_fans += 2 - hit.fraction; });
    }
  };
  one_by_one(0);
  as_fans(0);
  if (!(std::abs(sum - sum_of_fans) < 1e-9 * sum)) {
    throw std::runtime_error("rays and fans disagree: " + std::to_string(sum) + " and " + std::to_string(sum_of_fans));
  }
  Comparison rays(report, scene.title("rays of wall integrals, 128 from each point"), 1000, 1);
  rays.add("BoundingVolumeHierarchy: one by one", one_by_one);
  rays.add("RayFan", as_fans);
  rays.run();

  using Kernel = decant::CubicSpline<double>;
  Comparison set_up(report, scene.title("set-up of walls"), static_cast<long>(surface.size()), threads);
  set_up.add("BoundingVolumeHierarchy", [&](std::size_t) { keep(BoundingVolumeHierarchy(scene.mesh)); });
  set_up.add("MeshWall",
             [&](std::size_t) { keep(decant::MeshWall::of<Kernel>(surface, spacing, spacing, Threads{threads})); });
  set_up.add("SampledWall",
             [&](std::size_t) { keep(decant::SampledWall::of<Kernel>(surface, spacing, spacing, Threads{threads})); });
  set_up.run();
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_rays_and_distances", "sight lines, hidden points, distances and walls of a mesh");
  options.add_threads()
      .add("unit", "1", "of the mesh file's coordinates [m]; 0.001 for mm")
      .argument("", "a mesh file in place of the cups");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const std::vector<int> threads = given.numbers("threads");
    std::vector<decant::TriangleMesh> meshes;
    if (const std::string& file = given.text("argument"); !file.empty()) {
      meshes.push_back(decant::read_mesh(file));
      for (Point& vertex : meshes.back().vertices) {
        vertex *= given.number("unit");
      }
    } else {
      meshes = {cup(50), cup(158)};
    }
    for (const decant::TriangleMesh& mesh : meshes) {
      const Scene scene(mesh);
      for (const int count : threads) {
        measure_rays(report, scene, count);
        measure_hidden_points(report, scene, count);
        measure_distances(report, scene, count);
        measure_walls(report, scene, count);
      }
    }
  });
}
