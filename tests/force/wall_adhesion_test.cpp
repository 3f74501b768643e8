// SPDX-License-Identifier: MIT
#include <decant/force/wall_adhesion.hpp>

#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

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

/// One particle at walls, which has `layers` spacings within the support radius.
template <class Scalar>
struct Attracted {
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;

  Attracted(double distance_in_spacings, double layers) {
    liquid.smoothing_length = static_cast<Scalar>(0.5 * layers) * liquid.spacing;
    liquid.place(decant::PointArray<Scalar>::Zero(3, 1));
    liquid.walls.distance[0] = static_cast<Scalar>(distance_in_spacings) * liquid.spacing;
  }

  void add(const decant::Vector3<double>& gradient) {
    liquid.walls.contacts_of(0)[liquid.walls.contact_count[0]++].gradient = gradient.cast<Scalar>();
    liquid.walls.gradient.col(0) += gradient.cast<Scalar>();
  }

  decant::Vector3<double> pull(decant::WallAdhesion<Scalar> force) {
    decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, 1);
    force.accumulate(liquid.view(), acceleration);
    return acceleration.col(0).template cast<double>();
  }
};

/// Toward a floor.
template <class Scalar>
double pull_to_floor(double distance_in_spacings, double layers, const decant::WallAdhesion<Scalar>& force) {
  Attracted<Scalar> at(distance_in_spacings, layers);
  at.add({0, 0, -40});
  const decant::Vector3<double> a = at.pull(force);
  CHECK(a[0] == 0);
  CHECK(a[1] == 0);
  return -a[2];
}

struct AdheringParts : decant::PeriodicParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, decant::Viscosity<double>, decant::ResidualViscosity<double>,
                            decant::WallAdhesion<double>>;
};

constexpr double plate_height = 0.2;  // of its lower face [m]

/// Liquid under a plate without end; layers of 6 by 6 particles of 5 mm.
decant::Simulator<AdheringParts> under_plate(int layers, double strength, double support_in_spacings = 2) {
  decant::SimulatorSettings settings;
  settings.threads = {1};
  settings.support_in_spacings = support_in_spacings;
  const int width = 8;
  const double period = width * settings.spacing;
  decant::Simulator<AdheringParts> simulator(settings, AdheringParts::Domain({period, period, 0}));
  simulator.force<decant::WallAdhesion<double>>() = {strength, support_in_spacings - 1};
  simulator.add_body("plate", decant::Box{{-1, -1, plate_height}, {1, 1, plate_height + 0.1}});
  const auto places = decant_test::block<double>({0, 0, plate_height - layers * settings.spacing}, width, width, layers,
                                                 settings.spacing);
  simulator.add_particles(places, decant::PointArray<double>::Zero(3, places.cols()), 0);
  return simulator;
}

/// How far below the plate the lowest and the highest particles are [spacings].
std::pair<double, double> hanging(const decant::Simulator<AdheringParts>& simulator) {
  const auto depth = ((plate_height - simulator.fluid().position.row(2).array()) / simulator.spacing()).eval();
  return {depth.maxCoeff(), depth.minCoeff()};
}

}  // namespace

TEMPLATE_TEST_CASE("wall adhesion keeps the laws of a force", "", float, double) {
  decant::WallAdhesion<TestType> force;
  force.strength = 3;
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEMPLATE_TEST_CASE("wall adhesion has the profile that it says, within the reach of walls", "", float, double) {
  using Scalar = TestType;
  const auto shape = [](double q) { return std::pow(4 * q * (1 - q), 0.25); };
  for (const double q : {0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98}) {
    CHECK(pull_to_floor<Scalar>(q, 2, {3, 1}) == Approx(3 * shape(q)).epsilon(1e-5));
    CHECK(pull_to_floor<Scalar>(1.5 * q, 3, {3, Scalar(1.5)}) == Approx(3 * shape(q)).epsilon(1e-5));
    // walls are felt to a spacing less than the support radius
    CHECK(pull_to_floor<Scalar>(q, 2, {3, 5}) == Approx(3 * shape(q)).epsilon(1e-5));
    CHECK(pull_to_floor<Scalar>(2 * q, 3, {3, 5}) == Approx(3 * shape(q)).epsilon(1e-5));
  }
  // Akinci's kernel between half the support and the support, both doubled: (-4 r^2 / h + 6 r - 2 h)^(1/4) over its
  // peak
  const double h = 2, r = 1.2;
  CHECK(pull_to_floor<Scalar>(r - 1, 2, {1, 1}) ==
        Approx(std::pow((-4 * r * r / h + 6 * r - 2 * h) / (h / 4), 0.25)).epsilon(1e-5));
  CHECK(pull_to_floor<Scalar>(0.5, 2, {3, 1}) == Approx(3));
  for (const double nothing : {0.0, 1.001, 1.2}) {
    CHECK(pull_to_floor<Scalar>(nothing, 2, {3, 1}) == 0);
  }
}

TEST_CASE("wall adhesion of several walls") {
  const decant::WallAdhesion<double> force{2, 1};
  Attracted<double> free(0.5, 2);
  CHECK(free.pull(force).norm() == 0);
  Attracted<double> middle(0.5, 2);
  middle.add({0, 0, -40});
  middle.add({0, 0, 40});
  CHECK(middle.pull(force).norm() == 0);
  Attracted<double> lower(0.5, 2);
  lower.add({0, 0, -40});
  lower.add({0, 0, 10});
  CHECK(lower.pull(force)[2] == Approx(-2 * 0.6));
  Attracted<double> corner(0.5, 2);
  corner.add({0, 0, -40});
  corner.add({-40, 0, 0});
  const decant::Vector3<double> both = corner.pull(force);
  CHECK(both[0] == Approx(-1));
  CHECK(both[2] == Approx(-1));
  Attracted<double> hidden(0.5, 2);
  hidden.add({0, -40, 0});
  hidden.add({0, 0, 0});
  CHECK(hidden.pull(force)[1] == Approx(-2));
}

TEMPLATE_TEST_CASE("wall adhesion points against the normal of curved walls, with any threads", "", float, double) {
  using Scalar = TestType;
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;
  const int count = 3000;
  const double radius = 0.05;
  decant::PointArray<Scalar> places(3, count);
  const auto out = [](int k) -> decant::Vector3<double> {  // Fibonacci lattice on the sphere
    const double up = 1 - (2 * k + 1.0) / count, turn = 2.399963 * k;
    return {std::sqrt(1 - up * up) * std::cos(turn), std::sqrt(1 - up * up) * std::sin(turn), up};
  };
  const auto height = [](int k) { return 0.001 + 0.0005 * (k % 7); };  // 0.2 to 0.8 spacings
  for (int k = 0; k < count; ++k) {
    places.col(k) = ((radius + height(k)) * out(k)).template cast<Scalar>();
  }
  liquid.template place<decant::CellGrid<Scalar>>(places);
  decant::RigidBodies<Scalar> bodies;
  bodies.template add<decant::CubicSpline<Scalar>>("ball", decant::Sphere{{0, 0, 0}, radius}, {}, decant::Slip::Free,
                                                   0.005, 0.005, {1});
  bodies.set_interval(0, 0);
  bodies.sample(places, 0.005, {1}, liquid.walls);
  decant::WallAdhesion<Scalar> force{5, 1};
  const auto accelerations = [&](int threads) {
    liquid.threads = {threads};
    decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, count);
    force.accumulate(liquid.view(), acceleration);
    return acceleration;
  };
  const decant::PointArray<Scalar> pull = accelerations(1);
  CHECK(accelerations(2) == pull);
  CHECK(accelerations(4) == pull);
  for (int k = 0; k < count; ++k) {
    const double q = height(k) / 0.005;
    const decant::Vector3<double> a = pull.col(k).template cast<double>();
    // the ball is of flat pieces, and distances are looked up
    CHECK(-a.dot(out(k)) == Approx(5 * std::pow(4 * q * (1 - q), 0.25)).epsilon(0.05));
    CHECK((a + a.norm() * out(k)).norm() < 0.05 * a.norm());
  }
}

TEST_CASE("wall adhesion takes the work of its potential from what leaves the wall") {
  decant::Simulator<AdheringParts> simulator = under_plate(0, 60);
  decant::PointArray<double> place(3, 1), velocity(3, 1);
  place.col(0) = decant::Vector3<double>(0, 0, plate_height - 0.0025);
  simulator.force<decant::Gravity<double>>().acceleration.setZero();
  // from half the range on, half of int_0^1 shape dq = 4^(1/4) Gamma(5/4)^2 / Gamma(5/2)
  const double work = 60 * 0.005 * 0.5 * std::pow(4, 0.25) * std::pow(std::tgamma(1.25), 2) / std::tgamma(2.5);
  CHECK(work == Approx(60 * 0.005 * 0.437).epsilon(1e-3));
  const auto leave = [&](double energy) {
    simulator.remove_particles_if([](decant::Index) { return true; });
    velocity.col(0) = decant::Vector3<double>(0, 0, -std::sqrt(2 * energy));
    simulator.add_particles(place, velocity, 0);
    for (int k = 0; k < 200; ++k) {
      REQUIRE(simulator.step(1e-4).advanced());
    }
    return 0.5 * simulator.fluid().velocity.squaredNorm();
  };
  CHECK(leave(2 * work) == Approx(work).epsilon(0.02));
  CHECK(leave(1.2 * work) == Approx(0.2 * work).epsilon(0.1));
  leave(0.8 * work);
  CHECK(hanging(simulator).first < 1);
}

TEST_CASE("wall adhesion holds a layer under a plate if it is stronger than weight, and else not") {
  auto strong = under_plate(1, 1.5 * 9.81);
  for (int frame = 0; frame < 10; ++frame) {
    REQUIRE(strong.step(0.05).advanced());
    CHECK(hanging(strong).first < 1);
  }
  auto weak = under_plate(1, 0.5 * 9.81);
  REQUIRE(weak.step(0.1).advanced());
  // with half of weight at first, and after a half spacing with all of it
  CHECK(hanging(weak).second > 0.25 * 9.81 * 0.1 * 0.1 / 0.005);
}

TEST_CASE("wall adhesion holds two layers where walls are felt as far") {
  auto wide = under_plate(2, 2 * 9.81, 3);
  for (int frame = 0; frame < 10; ++frame) {
    REQUIRE(wide.step(0.05).advanced());
    CHECK(hanging(wide).first < 2);
  }
  auto narrow = under_plate(2, 2 * 9.81, 2);
  REQUIRE(narrow.step(0.2).advanced());
  CHECK(hanging(narrow).first > 10);
  CHECK(hanging(narrow).second < 1);
}

TEMPLATE_TEST_CASE("wall adhesion of nothing, or out of range, changes no bit", "", float, double) {
  using Scalar = TestType;
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  using Force = decant::WallAdhesion<Scalar>;
  for (const Force& force :
       {Force{}, Force{0, 1}, Force{-1, 1}, Force{nan, 1}, Force{1, 0}, Force{1, -1}, Force{1, nan}}) {
    CHECK(pull_to_floor<Scalar>(0.5, 2, force) == 0);
    CHECK(std::isinf(force.largest_step(Attracted<Scalar>(0.5, 2).liquid.view())));
  }
  CHECK(Force{10, 1}.largest_step(Attracted<Scalar>(0.5, 2).liquid.view()) ==
        Approx(0.25 * std::sqrt(0.005 / 10)).epsilon(1e-5));
}
