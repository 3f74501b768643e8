// SPDX-License-Identifier: MIT
#include <decant/force/wall_friction.hpp>

#include <cmath>
#include <limits>
#include <tuple>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"
#include "physics/scene.hpp"

namespace {

/// One particle at a wall below it.
template <class Scalar>
struct AtWall {
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;

  AtWall(const decant::Vector3<double>& velocity, double distance_in_spacings) {
    liquid.place(decant::PointArray<Scalar>::Zero(3, 1));
    liquid.fluid.velocity.col(0) = velocity.cast<Scalar>();
    liquid.walls.distance[0] = static_cast<Scalar>(distance_in_spacings) * liquid.spacing;
    add({0, 0, -100}, {0, 0, 0});
  }

  void add(const decant::Vector3<double>& gradient, const decant::Vector3<double>& velocity) {
    auto& contact = liquid.walls.contacts_of(0)[liquid.walls.contact_count[0]++];
    contact.gradient = gradient.cast<Scalar>();
    contact.velocity = velocity.cast<Scalar>();
  }

  decant::Vector3<double> velocity_after(double rate, double time_step, double depth = 1) {
    decant::WallFriction<Scalar> force{static_cast<Scalar>(rate), static_cast<Scalar>(depth)};
    liquid.time_step = static_cast<Scalar>(time_step);
    decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, 1);
    force.accumulate(liquid.view(), acceleration);
    return (liquid.fluid.velocity.col(0) + liquid.time_step * acceleration.col(0)).template cast<double>();
  }
};

struct RubbedParts : decant::PeriodicParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, decant::Viscosity<double>, decant::ResidualViscosity<double>,
                            decant::WallFriction<double>>;
};

constexpr int sheet_width = 6;  // [spacings]

/// Layers of liquid without end on a plate that slides along x.
decant::Simulator<RubbedParts> sheet(int layers, double rate, const decant::Vector3<double>& gravity,
                                     double plate_speed) {
  decant::SimulatorSettings settings;
  settings.spacing = 0.005;
  settings.threads = {1};
  settings.gravity = gravity;
  settings.liquid.dynamic_viscosity = 5;  // layers stay together
  const double period = sheet_width * settings.spacing;
  decant::Simulator<RubbedParts> simulator(settings, RubbedParts::Domain({period, period, 0}));
  simulator.force<decant::WallFriction<double>>().rate = rate;
  const auto at = [](double x) { return decant::Pose{Eigen::Quaterniond::Identity(), {x, 0, 0}}; };
  simulator.add_body("plate", decant::Box{{-4, -1, -0.1}, {4, 1, 0}},
                     decant::PoseTrack({{0, at(0)}, {3, at(3 * plate_speed)}}));
  const auto places = decant_test::block<double>({0, 0, 0}, sheet_width, sheet_width, layers, settings.spacing);
  simulator.add_particles(places, decant::PointArray<double>::Zero(3, places.cols()), 0);
  return simulator;
}

/// Mean speed along x of what is nearer to the plate than a spacing.
double speed_at_plate(const decant::Simulator<RubbedParts>& simulator) {
  double total = 0;
  int count = 0;
  for (decant::Index i = 0; i < simulator.fluid().size(); ++i) {
    if (simulator.fluid().position(2, i) < simulator.spacing()) {
      total += simulator.fluid().velocity(0, i);
      ++count;
    }
  }
  REQUIRE(count == sheet_width * sheet_width);
  return total / count;
}

}  // namespace

TEMPLATE_TEST_CASE("wall friction keeps the laws of a force", "", float, double) {
  decant::WallFriction<TestType> force;
  force.rate = 3;
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEMPLATE_TEST_CASE("wall friction takes the slip along the wall and nothing else", "", float, double) {
  const double rounding = 8 * static_cast<double>(std::numeric_limits<TestType>::epsilon());
  for (const double rate_times_step : {1e-3, 1.0, 1e6}) {
    AtWall<TestType> at({1, 2, 3}, 0.5);
    at.liquid.walls.contacts_of(0)[0].velocity = decant::Vector3<TestType>(-1, 0, 7);
    const decant::Vector3<double> after = at.velocity_after(rate_times_step / 0.01, 0.01);
    const double left = std::exp(-rate_times_step);
    CHECK(after[0] == Approx(-1 + 2 * left).margin(4 * rounding));
    CHECK(after[1] == Approx(2 * left).margin(4 * rounding));
    CHECK(after[2] == 3);
  }
}

TEST_CASE("wall friction reaches as deep as it is told and no deeper") {
  const decant::Vector3<double> v(1, 0, 0);
  CHECK(AtWall<double>(v, 0.99).velocity_after(100, 0.01)[0] == Approx(std::exp(-1.0)));
  CHECK(AtWall<double>(v, 1.0).velocity_after(100, 0.01) == v);
  CHECK(AtWall<double>(v, 1.5).velocity_after(100, 0.01) == v);
  CHECK(AtWall<double>(v, 1.5).velocity_after(100, 0.01, 1.6)[0] == Approx(std::exp(-1.0)));
  CHECK(AtWall<double>(v, 0.5).velocity_after(100, 0.01, 0.4) == v);
  AtWall<double> free(v, 0.5);
  free.liquid.walls.contact_count[0] = 0;
  CHECK(free.velocity_after(100, 0.01) == v);
}

TEST_CASE("wall friction between walls: each counts by how near it is") {
  const double left = std::exp(-1.0);
  AtWall<double> corner({1, 0, 1}, 0.5);  // of the floor and a wall across x
  corner.add({100, 0, 0}, {0, 0, 0});
  const decant::Vector3<double> held = corner.velocity_after(100, 0.01);
  CHECK(held[0] == Approx(left));
  CHECK(held[2] == Approx(left));
  AtWall<double> twice({1, 0, 0}, 0.5);  // between floor and lid
  twice.add({0, 0, 100}, {0, 0, 0});
  CHECK(twice.velocity_after(100, 0.01)[0] == Approx(left * left));
  AtWall<double> hidden({1, 0, 1}, 0.5);
  hidden.add({0, 0, 0}, {5, 5, 5});
  hidden.add({20, 0, 0}, {0, 0, 0});
  CHECK(hidden.velocity_after(100, 0.01)[0] == Approx(left));
  CHECK(hidden.velocity_after(100, 0.01)[2] == Approx(std::exp(-0.2)));
}

TEST_CASE("wall friction: a body may be rougher than others") {
  const double step = 0.01;
  AtWall<double> corner({1, 0, 1}, 0.5);  // of the floor, body 0, and a wall across x, body 7
  corner.add({100, 0, 0}, {0, 0, 0});
  corner.liquid.walls.contacts_of(0)[1].body = 7;
  const auto after = [&](double rate, double at_wall) {
    decant::WallFriction<double> force;
    force.rate = rate;
    force.rougher = {{3, 1e3}, {7, at_wall}};
    corner.liquid.time_step = step;
    decant::PointArray<double> acceleration = decant::PointArray<double>::Zero(3, 1);
    force.accumulate(corner.liquid.view(), acceleration);
    return decant::Vector3<double>(corner.liquid.fluid.velocity.col(0) + step * acceleration.col(0));
  };
  // the wall slows what goes up, the floor what goes along x
  CHECK(after(100, 40)[0] == Approx(std::exp(-1.0)));
  CHECK(after(100, 40)[2] == Approx(std::exp(-1.4)));
  CHECK(after(0, 40)[0] == 1);
  CHECK(after(0, 40)[2] == Approx(std::exp(-0.4)));
  CHECK(after(0, -40)[2] == 1);
}

TEMPLATE_TEST_CASE("wall friction of less than nothing, none or NaN changes no bit", "", float, double) {
  const decant::Vector3<double> v(1, 2, 3);
  for (const double rate : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(AtWall<TestType>(v, 0.5).velocity_after(rate, 0.01) == v);
  }
  CHECK(AtWall<TestType>(v, 0.5).velocity_after(1, 0.01, std::numeric_limits<double>::quiet_NaN()) == v);
  decant::WallFriction<TestType> force;
  force.rate = 1e9f;
  CHECK(std::isinf(force.largest_step(AtWall<TestType>(v, 0.5).liquid.view())));
}

TEMPLATE_TEST_CASE("wall friction lets liquid turn with its vessel and takes it along, with any threads", "", float,
                   double) {
  using Scalar = TestType;
  const double turn = 2;  // about z [1/s]
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;
  const int ring = 3000;
  decant::PointArray<Scalar> places(3, ring);
  for (int k = 0; k < ring; ++k) {
    const double angle = 0.1 * k, radius = 0.1 - 0.0005 - 0.0015 * (k % 5);
    places.col(k) =
        decant::Vector3<double>(radius * std::cos(angle), radius * std::sin(angle), 0.1 + 1e-5 * k).cast<Scalar>();
  }
  liquid.template place<decant::CellGrid<Scalar>>(places);
  decant::RigidBodies<Scalar> bodies;
  const auto pose = [&](double time) {
    return decant::Pose{Eigen::Quaterniond(Eigen::AngleAxisd(turn * time, Eigen::Vector3d::UnitZ())), {0, 0, 0}};
  };
  bodies.template add<decant::CubicSpline<Scalar>>("drum", decant::CylinderInside{0.1, 0.3, 0.01, {}},
                                                   decant::PoseTrack({{0, pose(0)}, {0.5, pose(0.5)}}),
                                                   decant::Slip::Free, 0.005, 0.005, {1});
  bodies.set_interval(0, 1e-4);
  bodies.sample(places, 0.005, {1}, liquid.walls);
  decant::WallFriction<Scalar> force{40};
  const auto accelerations = [&](int threads) {
    liquid.threads = {threads};
    decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, ring);
    force.accumulate(liquid.view(), acceleration);
    return acceleration;
  };
  const auto around = [&](int k) -> decant::Vector3<double> {
    return decant::Vector3<double>(-turn * static_cast<double>(places(1, k)), turn * static_cast<double>(places(0, k)),
                                   0);
  };
  const decant::PointArray<Scalar> from_rest = accelerations(1);
  CHECK(accelerations(2) == from_rest);
  CHECK(accelerations(4) == from_rest);
  const double mean_rate = -std::expm1(-40 * 1e-3) / 1e-3;
  for (int k = 0; k < ring; ++k) {
    // 0.5, 2, 3.5, 5 and 6.5 mm off the wall, which is of flat pieces
    const decant::Vector3<double> expected = mean_rate * (k % 5 < 3 ? 1 : 0) * around(k);
    if (k % 5 != 3) {
      CHECK((from_rest.col(k).template cast<double>() - expected).norm() < 0.02 * mean_rate * turn * 0.1);
    }
    liquid.fluid.velocity.col(k) = around(k).template cast<Scalar>();
  }
  CHECK(static_cast<double>(accelerations(1).cwiseAbs().maxCoeff()) < 1e-4 * mean_rate * turn * 0.1);
}

TEST_CASE("wall friction: the slip of a layer on a moving plate falls exponentially") {
  const double speed = 0.5, rate = 4;
  auto simulator = sheet(1, rate, {0, 0, -9.81}, speed);
  for (int frame = 1; frame <= 4; ++frame) {
    REQUIRE(simulator.step(0.1).advanced());
    CHECK(speed - speed_at_plate(simulator) == Approx(speed * std::exp(-rate * 0.1 * frame)).epsilon(1e-6));
  }
  auto free = sheet(1, 0, {0, 0, -9.81}, speed);
  REQUIRE(free.step(0.4).advanced());
  CHECK(std::abs(speed_at_plate(free)) < 1e-9);
}

TEST_CASE("wall friction: layers on a slope slide as fast as the lowest one's friction lets them") {
  const double rate = 8, slope = 0.3, along = 9.81 * std::sin(slope), into = -9.81 * std::cos(slope);
  for (const int layers : {1, 2}) {
    CAPTURE(layers);
    auto simulator = sheet(layers, rate, {along, 0, into}, 0);
    // the start is gone to exp(-8 * 1.5) and exp(-4 * 1.5); a sub-step's weight comes on top of the slip
    for (int frame = 0; frame < 5; ++frame) {
      REQUIRE(simulator.step(0.3).advanced());
    }
    CHECK(speed_at_plate(simulator) == Approx(layers * along / rate).epsilon(0.02));
  }
}
