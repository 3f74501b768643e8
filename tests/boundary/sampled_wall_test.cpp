// SPDX-License-Identifier: MIT
#include <decant/boundary/sampled_wall.hpp>

#include <cmath>
#include <limits>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

using decant::BoundingVolumeHierarchy;
using decant::SampledWall;
using decant::Threads;
using decant::TriangleMesh;
using decant::Vector3;
using decant::WallSample;

namespace {

using decant_test::spacing;

/// A square plate in the plane z = 0, cut into cells x cells squares.
TriangleMesh plate(double half, int cells) {
  TriangleMesh mesh;
  for (int i = 0; i <= cells; ++i) {
    for (int j = 0; j <= cells; ++j) {
      mesh.vertices.push_back({half * (2.0 * i / cells - 1), half * (2.0 * j / cells - 1), 0});
    }
  }
  const auto at = [cells](int i, int j) { return static_cast<std::uint32_t>(i * (cells + 1) + j); };
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

SampledWall wall_of(const BoundingVolumeHierarchy& surface) {
  return SampledWall::of<decant::CubicSpline<float>>(surface, spacing, spacing, Threads{1});
}

}  // namespace

TEST_CASE("SampledWall covers large and small triangles alike") {
  const double half = 0.05;
  for (const int cells : {1, 7, 60}) {  // squares of 20, 3 and a third of a spacing
    const BoundingVolumeHierarchy surface(plate(half, cells));
    const SampledWall wall = wall_of(surface);
    const double least = SampledWall::sample_distance * spacing;
    double nearest = 1, widest_gap = 0;
    for (std::size_t a = 0; a < wall.size(); ++a) {
      CHECK(std::abs(wall.places()[a][2]) < 1e-12);
      for (std::size_t b = 0; b < a; ++b) {
        nearest = std::min(nearest, (wall.places()[a] - wall.places()[b]).norm());
      }
    }
    for (double x = -half; x <= half; x += half / 40) {
      for (double y = -half; y <= half; y += half / 40) {
        double distance = 1;
        for (const Vector3<double>& place : wall.places()) {
          distance = std::min(distance, (place - Vector3<double>(x, y, 0)).norm());
        }
        widest_gap = std::max(widest_gap, distance);
      }
    }
    CHECK(nearest >= least);
    CHECK(widest_gap <
          1.35 * least);  // a full cover leaves no place farther than `least` from all darts; a few are missed
  }
}

TEST_CASE("SampledWall over a plate is even and pushes straight away from it") {
  const BoundingVolumeHierarchy surface(plate(0.06, 1));
  const SampledWall wall = wall_of(surface);
  for (const double z : {0.3 * spacing, 0.5 * spacing, 1.0 * spacing}) {
    double sum = 0, squares = 0, worst_tilt = 0;
    int count = 0;
    for (double x = -0.03; x <= 0.03; x += 0.0013) {
      for (double y = -0.03; y <= 0.03; y += 0.0017) {
        WallSample above, below;
        REQUIRE(wall.sample({x, y, z}, above));
        REQUIRE(wall.sample({x, y, -z}, below));
        CHECK(above.distance == Approx(z));
        CHECK(above.gradient[2] < 0);
        CHECK(below.gradient[2] == Approx(-above.gradient[2]));
        CHECK(below.share == Approx(above.share));
        worst_tilt = std::max(worst_tilt, above.gradient.head<2>().norm() / std::abs(above.gradient[2]));
        sum += above.share;
        squares += above.share * above.share;
        ++count;
      }
    }
    const double mean = sum / count;
    const double scatter = std::sqrt(std::max(0.0, squares / count - mean * mean)) / mean;
    // what an irregular cover gives: 0.067 and 0.45 are reached
    CHECK(scatter < 0.08);
    CHECK(worst_tilt < 0.55);
  }
}

TEST_CASE("SampledWall: particles on the surface see a full support of their own layer") {
  // by the choice of volumes the sum over the layer is one at each boundary particle if volumes are equal
  const BoundingVolumeHierarchy surface(plate(0.06, 3));
  const SampledWall wall = wall_of(surface);
  double sum = 0;
  int count = 0;
  for (const Vector3<double>& place : wall.places()) {
    if (place.cwiseAbs().maxCoeff() < 0.04) {
      WallSample sample;
      REQUIRE(wall.sample(place, sample));
      sum += sample.share;
      ++count;
    }
  }
  CHECK(sum / count == Approx(1).epsilon(0.03));
}

TEST_CASE("SampledWall: the gradient is that of the fraction") {
  const BoundingVolumeHierarchy surface(plate(0.03, 2));
  const SampledWall wall = wall_of(surface);
  for (const Vector3<double>& x : {Vector3<double>(0.001, 0.002, 0.003), Vector3<double>(0.0301, 0.01, 0.002),
                                   Vector3<double>(-0.005, 0.029, -0.004)}) {
    WallSample here;
    REQUIRE(wall.sample(x, here));
    Vector3<double> difference;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3<double> e = 1e-5 * Vector3<double>::Unit(axis);
      WallSample ahead, behind;
      REQUIRE(wall.sample(x + e, ahead));
      REQUIRE(wall.sample(x - e, behind));
      difference[axis] = (ahead.share - behind.share) / 2e-5;
    }
    // both are linear interpolations in tables of 512 entries
    CHECK((difference - here.gradient).norm() < 0.01 * here.gradient.norm());
  }
}

TEST_CASE("SampledWall: nothing is felt beyond the support or at a place that is not finite") {
  const BoundingVolumeHierarchy surface(plate(0.03, 2));
  const SampledWall wall = wall_of(surface);
  WallSample sample;
  CHECK(wall.reach() == Approx(2 * spacing));
  CHECK_FALSE(wall.sample({0, 0, 2.001 * spacing}, sample));
  CHECK_FALSE(wall.sample({1e30, 0, 0}, sample));
  CHECK_FALSE(wall.sample({std::numeric_limits<double>::quiet_NaN(), 0, 0}, sample));
}

TEST_CASE("SampledWall: a surface smaller than a particle still has one sample and bad settings are refused") {
  const BoundingVolumeHierarchy speck(plate(1e-5, 1));
  CHECK(wall_of(speck).size() == 1);
  CHECK_THROWS_WITH(SampledWall::of<decant::CubicSpline<float>>(speck, 0.005, 0.0, Threads{1}),
                    decant_test::contains("SampledWall: particle spacing [m] must be > 0"));
  CHECK_THROWS_WITH(SampledWall::of<decant::CubicSpline<float>>(speck, std::nan(""), 0.005, Threads{1}),
                    decant_test::contains("SampledWall: smoothing length [m] must be > 0"));
}

TEST_CASE("SampledWall serves rigid bodies as MeshWall does") {
  decant::RigidBodies<float, SampledWall> bodies;
  bodies.add<decant::CubicSpline<float>>("plate", decant::BodyShape{plate(0.03, 2)}, {}, decant::Slip::Free, spacing,
                                         spacing, Threads{1});
  bodies.set_interval(0, 0);
  decant::WallState<float> walls;
  decant::PointArray<float> x(3, 2);
  x << 0, 0, 0, 0, 0.002F, 0.02F;
  bodies.sample(x, spacing, Threads{1}, walls);
  CHECK(walls.share[0] > 0.1F);
  CHECK(walls.gradient(2, 0) < 0);
  CHECK(walls.share[1] == 0);
}
