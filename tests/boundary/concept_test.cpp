// SPDX-License-Identifier: MIT
// The laws of a Boundary over the shipped ones: solids in closed form, meshes, boundary particles.

#include <decant/boundary/concept.hpp>

#include <cmath>
#include <random>
#include <string>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/boundary/sampled_wall.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/boundary.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr double d = 0.008;  // spacing [m]
const CylinderInside vessel{0.04, 0.08, 0.003, {}};

// Places in the vessel, from a twentieth of a spacing off its wall on.
template <class Scalar>
PointArray<Scalar> places() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> across(-vessel.radius, vessel.radius), along(0, vessel.height);
  PointArray<Scalar> result(3, 400);
  for (Index i = 0; i < result.cols();) {
    const double x = across(random), y = across(random), z = along(random);
    if (std::hypot(x, y) < vessel.radius - 0.05 * d && z > 0.05 * d && z < vessel.height - 0.05 * d) {
      result.col(i++) = Vector3<double>(x, y, z).cast<Scalar>();
    }
  }
  return result;
}

template <class Bodies>
void check_laws(const BodyShape& shape) {
  using Scalar = typename Bodies::Scalar;
  using Kernel = CubicSpline<Scalar>;
  Bodies bodies;
  bodies.template add<Kernel>("vessel", shape, {}, Slip::Free, d, d, {1});
  // farther than the vessel is wide: to the other side of any wall
  for (const testing::Law& law : testing::boundary_laws<Kernel>(bodies, places<Scalar>(), d, 0.3)) {
    INFO(law.text());
    CHECK(law.holds());
  }
}

}  // namespace

TEMPLATE_TEST_CASE("boundary: the laws hold for solids in closed form", "", float, double) {
  check_laws<RigidBodies<TestType>>(vessel);
}

TEMPLATE_TEST_CASE("boundary: the laws hold for meshes", "", float, double) {
  check_laws<RigidBodies<TestType>>(vessel.mesh());
}

TEMPLATE_TEST_CASE("boundary: the laws hold for boundary particles", "", float, double) {
  check_laws<RigidBodies<TestType, SampledWall>>(vessel.mesh());
}
