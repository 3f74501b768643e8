// SPDX-License-Identifier: MIT
// Rigid bodies: where they are, what liquid feels of them, what stands between two points, and the guard at their
// walls.

#include <decant/boundary/rigid_bodies.hpp>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <decant/boundary/sampled_wall.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

using namespace decant;

namespace {

using decant_test::spacing;

Pose at(const Vector3<double>& x, double angle = 0, const Vector3<double>& axis = Vector3<double>::UnitZ()) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized())), x};
}

template <class Bodies>
BodyId add(Bodies& bodies, BodyShape shape, PoseTrack motion = {}, Slip slip = Slip::Free) {
  using Scalar = typename Bodies::Scalar;
  return bodies.template add<CubicSpline<Scalar>>("body", std::move(shape), std::move(motion), slip, spacing, spacing,
                                                  Threads{1});
}

template <class Scalar>
FluidState<Scalar> particles(const std::vector<Vector3<double>>& places, const Vector3<double>& velocity = {0, 0, 0}) {
  FluidState<Scalar> fluid;
  fluid.resize(static_cast<Index>(places.size()));
  for (std::size_t k = 0; k < places.size(); ++k) {
    fluid.position.col(static_cast<Index>(k)) = places[k].cast<Scalar>();
    fluid.velocity.col(static_cast<Index>(k)) = velocity.cast<Scalar>();
  }
  return fluid;
}

}  // namespace

TEMPLATE_TEST_CASE("rigid bodies: a step's velocity is that of the poses", "", float, double) {
  RigidBodies<TestType> bodies;
  const BodyId body =
      add(bodies, Box{{0, 0, 0}, {0.1, 0.1, 0.1}}, PoseTrack({{0, at({0, 0, 0})}, {1, at({0.5, 0, 0}, 1)}}));
  CHECK(bodies.size() == 1);
  bodies.set_interval(0.2, 0.01);
  const auto& moved = bodies[body];
  CHECK(moved.velocity.linear.isApprox(Vector3<double>(0.5, 0, 0), 1e-9));
  CHECK(moved.velocity.angular.isApprox(Vector3<double>(0, 0, 1), 1e-6));
  CHECK(moved.before.translation.x() == Approx(0.1));
  CHECK(moved.after.translation.x() == Approx(0.105));
  // no corner moves farther than said, and one moves that far
  double farthest = 0;
  for (int k = 0; k < 8; ++k) {
    const Vector3<double> x = 0.1 * Vector3<double>(k & 1, (k >> 1) & 1, k >> 2);
    farthest = std::max(farthest, (moved.after * x - moved.before * x).norm());
  }
  CHECK(moved.reach == Approx(farthest));
  bodies.set_interval(0.2, 0);
  CHECK(bodies[body].velocity.linear.isZero());
  CHECK(bodies[body].reach == 0);
  bodies.set_motion(body, PoseTrack(at({1, 2, 3})));
  bodies.set_interval(0, 0.01);
  CHECK(bodies[body].before.translation.isApprox(Vector3<double>(1, 2, 3)));
}

TEMPLATE_TEST_CASE("rigid bodies: walls fill up what the kernel misses and point into the wall", "", float, double) {
  RigidBodies<TestType> bodies;
  const Pose pose = at({0.3, 0.2, 0.1}, 0.7, {1, 2, 3});
  const BodyId body = add(bodies, Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, 0}}, PoseTrack(pose), Slip::None);
  bodies.set_interval(0, 0.01);
  // a wall reaches one spacing far (boundary/wall_function.hpp)
  const std::vector<double> heights{0.0005, 0.001, 0.0025, 0.004, 0.006};
  std::vector<Vector3<double>> places;
  for (const double height : heights) {
    places.push_back(pose * Vector3<double>(0, 0, height));
  }
  const auto fluid = particles<TestType>(places);
  WallState<TestType> walls;
  bodies.sample(fluid.position, spacing, Threads{1}, walls);
  const Vector3<double> down = pose.rotation * Vector3<double>(0, 0, -1);
  for (Index i = 0; i < 4; ++i) {
    INFO(heights[static_cast<std::size_t>(i)]);
    REQUIRE(walls.contact_count[i] == 1);
    CHECK(walls.contacts_of(i)[0].body == body);
    CHECK(walls.contacts_of(i)[0].friction > 0);
    CHECK(walls.distance[i] == Approx(heights[static_cast<std::size_t>(i)]).epsilon(1e-3));
    CHECK(walls.share[i] > 0);
    CHECK(walls.flux[i] == Approx(0).margin(1e-9));
    const Vector3<double> gradient = walls.gradient.col(i).template cast<double>();
    CHECK(gradient.normalized().dot(down) == Approx(1).epsilon(1e-5));
    if (i > 0) {
      CHECK(walls.share[i] < walls.share[i - 1]);
    }
  }
  CHECK(walls.contact_count[4] == 0);
  CHECK(walls.share[4] == 0);
  CHECK(walls.gradient.col(4).isZero());
  CHECK(walls.distance[4] == Approx(spacing));
}

TEMPLATE_TEST_CASE("rigid bodies: a moving wall is felt at its speed", "", float, double) {
  RigidBodies<TestType> bodies;
  add(bodies, Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, 0}}, PoseTrack({{0, at({0, 0, 0})}, {1, at({0, 0, 1})}}));
  bodies.set_interval(0, 0.001);
  const auto fluid = particles<TestType>({{0.01, 0.02, 0.003}});
  WallState<TestType> walls;
  bodies.sample(fluid.position, spacing, Threads{1}, walls);
  REQUIRE(walls.contact_count[0] == 1);
  CHECK(walls.contacts_of(0)[0].velocity[2] == Approx(1).epsilon(1e-6));
  CHECK(walls.contacts_of(0)[0].friction == 0);
  // the gradient points into the wall, that is down; the wall comes up
  CHECK(walls.flux[0] == Approx(walls.gradient(2, 0)).epsilon(1e-5));
  CHECK(walls.flux[0] < 0);
}

TEMPLATE_TEST_CASE("rigid bodies: what is hidden behind a nearer body does not count twice", "", float, double) {
  RigidBodies<TestType> one, two;
  add(one, Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, 0}});
  add(two, Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, 0}});
  add(two, Box{{-0.1, -0.1, -0.06}, {0.1, 0.1, -0.001}});
  const auto fluid = particles<TestType>({{0, 0, 0.002}, {0.03, 0.01, 0.004}});
  WallState<TestType> of_one, of_two;
  one.set_interval(0, 0.01);
  two.set_interval(0, 0.01);
  one.sample(fluid.position, spacing, Threads{1}, of_one);
  two.sample(fluid.position, spacing, Threads{1}, of_two);
  for (Index i = 0; i < 2; ++i) {
    CHECK(of_two.share[i] == Approx(of_one.share[i]).epsilon(1e-6));
    CHECK((of_two.gradient.col(i) - of_one.gradient.col(i)).norm() <= TestType(1e-4) * of_one.gradient.col(i).norm());
  }
}

TEMPLATE_TEST_CASE("rigid bodies: analytic and mesh walls agree", "", float, double) {
  RigidBodies<TestType> analytic, mesh;
  const CylinderInside vessel{0.04, 0.06, 0.001, Face::PositiveZ};
  add(analytic, vessel);
  add(mesh, vessel.mesh());
  analytic.set_interval(0, 0.01);
  mesh.set_interval(0, 0.01);
  const auto fluid = particles<TestType>({{0, 0, 0.0025}, {0.01, 0.01, 0.004}, {0.0375, 0, 0.03}, {0, -0.0365, 0.03}});
  WallState<TestType> a, m;
  analytic.sample(fluid.position, spacing, Threads{1}, a);
  mesh.sample(fluid.position, spacing, Threads{1}, m);
  for (Index i = 0; i < fluid.size(); ++i) {
    INFO(i);
    REQUIRE(m.contact_count[i] == 1);
    // sums over 128 directions and a grid of a third of a spacing, and a curved wall counted as its tangent plane
    CHECK(m.share[i] == Approx(a.share[i]).epsilon(0.1).margin(0.01));
    CHECK((m.gradient.col(i) - a.gradient.col(i)).norm() < TestType(0.1) * a.gradient.col(i).norm() + TestType(2));
    CHECK(m.distance[i] == Approx(a.distance[i]).margin(0.1 * spacing));
  }
}

TEMPLATE_TEST_CASE("rigid bodies: a wall however thin separates", "", float, double) {
  RigidBodies<TestType> bodies;
  const Pose pose = at({1, 2, 3}, 1.1, {0, 1, 0});
  add(bodies, CylinderInside{0.04, 0.06, 0.001, Face::PositiveZ}, PoseTrack(pose));
  bodies.set_interval(0, 0.01);
  const std::vector<Vector3<double>> places{
      {0.038, 0, 0.03}, {0.043, 0, 0.03}, {0.036, 0.002, 0.032}, {0.042, 0, 0.12}};
  std::vector<Vector3<double>> in_world;
  for (const auto& x : places) {
    in_world.push_back(pose * x);
  }
  const auto fluid = particles<TestType>(in_world);
  WallState<TestType> walls;
  bodies.sample(fluid.position, spacing, Threads{1}, walls);
  const auto separated = [&](Index i, Index j) {
    const Vector3<TestType> a = fluid.position.col(i), b = fluid.position.col(j);
    return bodies.separated(a, b, walls.contacts_of(i), walls.contact_count[i]);
  };
  CHECK(separated(0, 1));
  CHECK(separated(1, 0));
  CHECK(separated(1, 2));
  CHECK_FALSE(separated(0, 2));
  CHECK_FALSE(separated(0, 3));  // past the rim
  CHECK_FALSE(separated(0, 0));
}

TEMPLATE_TEST_CASE("rigid bodies: the guard bends paths that would cross a wall", "", float, double) {
  RigidBodies<TestType> bodies;
  add(bodies, BoxInside{{0, 0, 0}, {0.05, 0.05, 0.05}, 0.001, {}});
  const double step = 0.01, clearance = 0.1 * spacing;
  bodies.set_interval(0, step);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> inside(0.001, 0.049), speed(-10, 10);
  std::vector<Vector3<double>> places;
  for (int k = 0; k < 2000; ++k) {
    const double x = inside(random), y = inside(random), z = inside(random);
    places.emplace_back(x, y, z);
  }
  auto fluid = particles<TestType>(places);
  const PointArray<TestType> before = fluid.position;
  for (Index i = 0; i < fluid.size(); ++i) {
    const double x = speed(random), y = speed(random), z = speed(random);
    fluid.velocity.col(i) = Vector3<double>(x, y, z).cast<TestType>();
  }
  fluid.position += TestType(step) * fluid.velocity;
  WallState<TestType> walls;
  bodies.sample(before, spacing, Threads{1}, walls);
  auto with_four = fluid;
  const GuardReport report = bodies.guard(before, clearance, Threads{1}, walls, fluid);
  CHECK(report.slid > 500);
  CHECK(report.lost == 0);
  CHECK((fluid.position.array() > 0).all());
  CHECK((fluid.position.array() < TestType(0.05)).all());
  CHECK(fluid.velocity.allFinite());
  // the wall takes speed and gives none
  CHECK(fluid.velocity.norm() <= with_four.velocity.norm());
  const GuardReport four = bodies.guard(before, clearance, Threads{4}, walls, with_four);
  CHECK(four.slid == report.slid);
  CHECK(four.stopped == report.stopped);
  CHECK((with_four.position.array() == fluid.position.array()).all());
  CHECK((with_four.velocity.array() == fluid.velocity.array()).all());
}

TEMPLATE_TEST_CASE("rigid bodies: a fast thin plate takes along what is in its way", "", float, double) {
  RigidBodies<TestType> bodies;
  const double step = 0.01;
  add(bodies, Box{{-0.1, -0.1, -0.001}, {0.1, 0.1, 0}}, PoseTrack({{0, at({0, 0, 0})}, {step, at({0, 0, 0.05})}}));
  bodies.set_interval(0, step);
  auto fluid = particles<TestType>({{0, 0, 0.02}, {0.05, 0.02, 0.001}, {0, 0, -0.01}});
  const PointArray<TestType> before = fluid.position;
  WallState<TestType> walls;
  bodies.sample(before, spacing, Threads{1}, walls);
  const GuardReport report = bodies.guard(before, 0.0005, Threads{1}, walls, fluid);
  CHECK(report.slid == 2);
  CHECK(fluid.position(2, 0) > TestType(0.05));
  CHECK(fluid.position(2, 1) > TestType(0.05));
  CHECK(fluid.position(2, 2) == TestType(-0.01));
  // and they move with it from now on
  CHECK(fluid.velocity(2, 0) == Approx(5).epsilon(1e-3));
  CHECK(fluid.velocity(2, 2) == 0);
}

TEMPLATE_TEST_CASE("rigid bodies: what is squeezed between two bodies is counted", "", float, double) {
  RigidBodies<TestType> bodies;
  const double step = 0.01;
  add(bodies, Box{{-0.1, -0.1, -0.02}, {0.1, 0.1, 0}});
  add(bodies, Box{{-0.1, -0.1, 0}, {0.1, 0.1, 0.02}}, PoseTrack({{0, at({0, 0, 0.004})}, {step, at({0, 0, -0.01})}}));
  bodies.set_interval(0, step);
  auto fluid = particles<TestType>({{0, 0, 0.002}, {0.5, 0, 0.002}});
  const PointArray<TestType> before = fluid.position;
  WallState<TestType> walls;
  bodies.sample(before, spacing, Threads{1}, walls);
  const GuardReport report = bodies.guard(before, 0.0005, Threads{1}, walls, fluid);
  CHECK(report.lost == 1);
  CHECK(fluid.position.allFinite());
}

TEMPLATE_TEST_CASE("rigid bodies: liquid in a body's material is pushed out of it", "", float, double) {
  RigidBodies<TestType> bodies;
  const Pose pose = at({0.1, 0, 0}, 0.3);
  const BodyId ball = add(bodies, Sphere{{0, 0, 0}, 0.02}, PoseTrack(pose));
  bodies.set_interval(0, 0);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-0.03, 0.03);
  std::vector<Vector3<double>> places;
  Index within = 0;
  for (int k = 0; k < 500; ++k) {
    const double x = place(random), y = place(random), z = place(random);
    places.emplace_back(0.1 + x, y, z);
    within += Vector3<double>(x, y, z).norm() < 0.0199 ? 1 : 0;
  }
  auto fluid = particles<TestType>(places, {1, 2, 3});
  const auto before = fluid;
  const Index moved = bodies.push_out(ball, 0.002, fluid);
  CHECK(moved >= within);
  CHECK(moved < within + 20);  // the polygons lie within the ball
  for (Index i = 0; i < fluid.size(); ++i) {
    const double distance = (fluid.position.col(i).template cast<double>() - Vector3<double>(0.1, 0, 0)).norm();
    REQUIRE(distance > 0.0198);
    const bool same = fluid.position.col(i) == before.position.col(i);
    REQUIRE(fluid.velocity.col(i).isZero() != same);
  }
  // outside of everything nothing happens
  auto far = particles<TestType>({{1, 1, 1}});
  CHECK(bodies.push_out(ball, 0.002, far) == 0);
}

TEST_CASE("rigid bodies: no bodies are no walls") {
  RigidBodies<double> bodies;
  auto fluid = particles<double>({{0, 0, 0}});
  const PointArray<double> before = fluid.position;
  WallState<double> walls;
  bodies.set_interval(0, 0.01);
  bodies.sample(fluid.position, spacing, Threads{1}, walls);
  CHECK(walls.share[0] == 0);
  CHECK(walls.contact_count[0] == 0);
  const GuardReport report = bodies.guard(before, 0.001, Threads{1}, walls, fluid);
  CHECK(report.slid + report.stopped + report.lost == 0);
}

TEST_CASE("rigid bodies: speeds are relative to what moves") {
  decant::Reduction<double> reduction;
  auto fluid = particles<double>({{0.01, 0, 0.02}, {0, 0.01, 0.02}});
  fluid.velocity.col(0) << 3, 0, 0;
  fluid.velocity.col(1) << 3, 0, 0.25;
  const auto speed = [&](const auto& bodies) { return bodies.largest_relative_speed(fluid, Threads{1}, reduction); };
  const double in_world = std::hypot(3, 0.25);
  RigidBodies<double> bodies;
  CHECK(speed(bodies) == Approx(in_world));
  // a cup that travels with its liquid
  const auto cup = add(bodies, CylinderInside{0.04, 0.06, 0.002, Face::PositiveZ}.mesh());
  bodies.set_motion(cup, PoseTrack({{0, Pose{}}, {1, Pose{Eigen::Quaterniond::Identity(), {3, 0, 0}}}}));
  bodies.set_interval(0, 0.01);
  CHECK(speed(bodies) == Approx(0.25));
  // spinning on the spot, it passes the liquid by what its nearest points do
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.5, Vector3<double>::UnitZ()));
  fluid.velocity.setZero();
  fluid.position.col(1) << 0, 0, 0.02;
  fluid.position.col(0) << 0.5, 0, 0.02;  // far away: the body's own rim counts
  bodies.set_motion(cup, PoseTrack({{0, Pose{}}, {1, Pose{turned, {0, 0, 0}}}}));
  bodies.set_interval(0, 0.01);
  CHECK(speed(bodies) == Approx(0.5 * 0.042).epsilon(0.01));
  // a table that stands: the world counts again
  fluid.velocity.col(0) << 3, 0, 0;
  add(bodies, Box{{-1, -1, -0.1}, {1, 1, -0.05}});
  bodies.set_interval(0, 0.01);
  CHECK(speed(bodies) == Approx(std::hypot(3, 0.021)).epsilon(1e-4));  // past the spinning rim
  fluid.velocity(2, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::isnan(speed(bodies)));
}

TEST_CASE("rigid bodies: a drop that has left the scene shortens nobody's sub-steps") {
  decant::Reduction<double> reduction;
  RigidBodies<double> bodies;
  add(bodies, CylinderInside{0.04, 0.06, 0.002, Face::PositiveZ}.mesh());
  auto fluid = particles<double>({{0, 0, 0.02}, {0, 0, -2}});
  fluid.velocity.col(0) << 0.5, 0, 0;
  fluid.velocity.col(1) << 0, 0, -6;
  const auto speed = [&](double duration) {
    bodies.set_interval(0, duration);
    return bodies.largest_relative_speed(fluid, Threads{1}, reduction);
  };
  CHECK(speed(0.01) == Approx(0.5));
  CHECK(speed(1) == Approx(6));  // in this time it might come back
  fluid.position.col(1) << 0, 0, -0.05;
  CHECK(speed(0.01) == Approx(6));  // near
  fluid.position(2, 1) = -2;
  fluid.velocity(2, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::isnan(speed(0.01)));
}

TEMPLATE_TEST_CASE("rigid bodies: with sampled walls", "", float, double) {
  RigidBodies<TestType, SampledWall> bodies;
  add(bodies, CylinderInside{0.04, 0.06, 0.002, Face::PositiveZ}.mesh());
  bodies.set_interval(0, 0.01);
  const auto fluid = particles<TestType>({{0, 0, 0.0025}, {0, 0, 0.03}});
  WallState<TestType> walls;
  bodies.sample(fluid.position, spacing, Threads{1}, walls);
  CHECK(walls.contact_count[0] == 1);
  CHECK(walls.share[0] > 0);
  CHECK(walls.gradient(2, 0) < 0);
  CHECK(walls.contact_count[1] == 0);
}
