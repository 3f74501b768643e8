// SPDX-License-Identifier: MIT
// Gauges on particles whose level, front, pressure, volume and highest point are known.

#include <decant/simulation/gauges.hpp>

#include <decant/boundary/shapes.hpp>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr double d = 0.01;  // spacing [m]

// A block of liquid with a surface z = surface(x, y), jittered by a tenth of the spacing as a settled liquid is.
template <class Scalar, class Surface>
FluidState<Scalar> liquid(const Vector3<double>& min, const Vector3<double>& max, Surface&& surface,
                          double jitter = 0.1) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> offset(-jitter * d, jitter * d);
  std::vector<Vector3<double>> places;
  for (double x = min.x() + d / 2; x < max.x(); x += d) {
    for (double y = min.y() + d / 2; y < max.y(); y += d) {
      // columns of whole particles below the surface, the topmost half a spacing below it
      const double top = std::min(max.z(), surface(x, y));
      for (double z = top - d / 2; z > min.z(); z -= d) {
        places.emplace_back(x + offset(random), y + offset(random), z + offset(random));
      }
    }
  }
  FluidState<Scalar> fluid;
  fluid.resize(static_cast<Index>(places.size()));
  for (std::size_t k = 0; k < places.size(); ++k) {
    fluid.position.col(static_cast<Index>(k)) = places[k].cast<Scalar>();
  }
  return fluid;
}

template <class Scalar>
void add(FluidState<Scalar>& fluid, const Vector3<double>& x) {
  fluid.resize(fluid.size() + 1);
  fluid.position.col(fluid.size() - 1) = x.cast<Scalar>();
}

const auto on_floor = [](const Vector3<double>& x) { return x.z() < 1.5 * d; };

}  // namespace

TEMPLATE_TEST_CASE("gauges: level of the column that stands and not of what flies or hangs", "", float, double) {
  auto fluid = liquid<TestType>({0, 0, 0}, {0.3, 0.1, 1}, [](double x, double) { return 0.1 + 0.3 * (x - 0.15); });
  Gauges<TestType> gauges(d);
  gauges.observe(fluid);
  for (const double x : {0.03, 0.15, 0.27}) {
    INFO(x);
    // noise of about ten particles of 0.1 d each
    CHECK(gauges.level(x, 0.05, on_floor).value() == Approx(0.1 + 0.3 * (x - 0.15)).margin(0.15 * d));
  }
  CHECK(gauges.level(0.299, 0.05, on_floor).value() == Approx(0.1447).margin(0.5 * d));  // at the wall, one-sided
  CHECK_FALSE(gauges.level(0.5, 0.05, on_floor).has_value());
  // a sheet of liquid above the column, a droplet above dry floor, a droplet on the floor
  const double before = gauges.level(0.15, 0.05, on_floor).value();
  for (double x = 0.1; x < 0.2; x += d) {
    for (double y = 0; y < 0.1; y += d) {
      add(fluid, {x, y, 0.2});
    }
  }
  add(fluid, {0.5, 0.05, 0.3});
  add(fluid, {0.7, 0.05, d / 2});
  gauges.observe(fluid);
  CHECK(gauges.level(0.15, 0.05, on_floor).value() == before);
  CHECK_FALSE(gauges.level(0.5, 0.05, on_floor).has_value());
  CHECK(gauges.level(0.7, 0.05, on_floor).value() == Approx(d));
}

TEMPLATE_TEST_CASE("gauges: the front is that of the bulk", "", float, double) {
  auto fluid = liquid<TestType>(
      {0, 0, 0}, {0.2, 0.1, 0.1}, [](double, double) { return 0.1; }, 0.0);
  Gauges<TestType> gauges(d);
  gauges.observe(fluid);
  CHECK(gauges.front().value() == Approx(0.2));
  add(fluid, {0.214, 0.05, d / 2});  // still within two spacings of the rest
  add(fluid, {0.3, 0.05, d / 2});    // a lone droplet
  add(fluid, {std::numeric_limits<double>::quiet_NaN(), 0, 0});
  gauges.observe(fluid);
  CHECK(gauges.front().value() == Approx(0.219));
  FluidState<TestType> none;
  gauges.observe(none);
  CHECK_FALSE(gauges.front().has_value());
  CHECK_FALSE(gauges.top({}, Eigen::AlignedBox3d(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1))).has_value());
  FluidState<TestType> broken;
  add(broken, {std::numeric_limits<double>::quiet_NaN(), 0, 0});
  gauges.observe(broken);
  CHECK_FALSE(gauges.front().has_value());
}

TEMPLATE_TEST_CASE("gauges: hydrostatic pressure in the liquid and on its walls", "", float, double) {
  auto fluid = liquid<TestType>({0, 0, 0}, {0.2, 0.1, 0.1}, [](double, double) { return 0.1; });
  for (Index i = 0; i < fluid.size(); ++i) {
    fluid.pressure[i] = TestType(9810) * (TestType(0.1) - fluid.position(2, i));
  }
  Gauges<TestType> gauges(d);
  gauges.observe(fluid);
  // the slope is held back a little, which costs a few per cent of one spacing's pressure at a wall
  const double margin = 0.06 * 9810 * d;
  CHECK(gauges.pressure({0.1, 0.05, 0.05}) == Approx(9810 * 0.05).margin(margin));
  CHECK(gauges.pressure({0.2, 0.05, 0.03}) == Approx(9810 * 0.07).margin(margin));
  CHECK(gauges.pressure({0.1, 0.05, 0.0}) == Approx(9810 * 0.1).margin(margin));
  CHECK(gauges.pressure({0.2, 0.1, 0.0}) == Approx(9810 * 0.1).margin(3 * margin));
  CHECK(gauges.pressure({0.1, 0.05, 0.2}) == 0);
  CHECK(gauges.pressure({0.1, 0.05, 0.115}) == Approx(0).margin(margin));
}

TEMPLATE_TEST_CASE("gauges: volume inside of a container that stands anywhere", "", float, double) {
  const CylinderInside glass{0.05, 0.15, 0.002, Face::PositiveZ};
  const Cavity cavity(glass.mesh());
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 0).normalized())), {1, 2, 3}};
  FluidState<TestType> fluid;
  int inside = 0;
  for (double x = -0.065; x < 0.07; x += d) {
    for (double y = -0.065; y < 0.07; y += d) {
      for (double z = -0.02; z < 0.2; z += d) {
        add(fluid, pose * Vector3<double>(x, y, z + 0.003));
        inside += std::hypot(x, y) < 0.05 && z + 0.003 > 0 && z + 0.003 < 0.15 ? 1 : 0;
      }
    }
  }
  Gauges<TestType> gauges(d);
  gauges.observe(fluid);
  CHECK(gauges.volume_in(cavity, pose) == Approx(inside * d * d * d));
}

TEMPLATE_TEST_CASE("gauges: the highest point in a tilted body's own frame", "", float, double) {
  // in the body's frame: a cylinder of liquid with a sloping surface, highest at the wall
  const double slope = 0.4, radius = 0.1;
  auto fluid = liquid<TestType>({-radius, -radius, 0}, {radius, radius, 1}, [&](double x, double y) {
    return std::hypot(x, y) < radius ? 0.12 + slope * x : -1.0;
  });
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d(-0.11, -0.11, -0.01), Eigen::Vector3d(0.11, 0.11, 0.3));
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {3, 2, 1}};
  const auto in_world = [&](FluidState<TestType> state) {
    for (Index i = 0; i < state.size(); ++i) {
      state.position.col(i) =
          (pose * Vector3<double>(state.position.col(i).template cast<double>())).template cast<TestType>();
    }
    return state;
  };
  Gauges<TestType> gauges(d);
  auto world = in_world(fluid);
  gauges.observe(world);
  const double top = gauges.top(pose, bounds).value();
  CHECK(top == Approx(0.12 + slope * radius).margin(0.3 * d));
  // neither droplets above it nor a lake beside the body count
  add(fluid, {0, 0, 0.25});
  for (double x = 0.2; x < 0.5; x += d) {
    for (double y = -0.2; y < 0.2; y += d) {
      for (double z = 0.2; z < 0.25; z += d) {
        add(fluid, {x, y, z});
      }
    }
  }
  world = in_world(fluid);
  gauges.observe(world);
  CHECK(gauges.top(pose, bounds).value() == Approx(top).margin(1e-4));
}

TEST_CASE("gauges: the top of a flat surface is less than that of its highest particle") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uneven(-0.35 * d, 0.35 * d);  // columns that settled at unlike heights
  const auto fluid =
      liquid<float>({-0.1, -0.1, 0}, {0.1, 0.1, 1}, [&](double, double) { return 0.1 + uneven(random); });
  Gauges<float> gauges(d);
  gauges.observe(fluid);
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d(-0.1, -0.1, 0), Eigen::Vector3d(0.1, 0.1, 0.3));
  const double highest = static_cast<double>(fluid.position.row(2).maxCoeff()) + d / 2;
  CHECK(highest > 0.1 + 0.4 * d);
  CHECK(gauges.top({}, bounds).value() == Approx(0.1).margin(0.25 * d));
  CHECK_THROWS_WITH(Gauges<float>(0), "Gauges: spacing [m] must be > 0 and finite, got 0");
}
