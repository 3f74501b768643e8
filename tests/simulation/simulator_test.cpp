// SPDX-License-Identifier: MIT
// The simulator's own promises: time and reports, particles in and out, motions of bodies, weight on a body's walls.

#include <decant/simulation/simulator.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/simulation/fill.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

using decant_test::block;
using decant_test::with_spacing;

template <class Scalar>
Simulator<DefaultParts<Scalar>> box_of_liquid() {
  Simulator<DefaultParts<Scalar>> simulator(with_spacing(0.008));
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
  const auto x = block<Scalar>(6, 6, 5, 0.008);
  simulator.add_particles(x, PointArray<Scalar>::Zero(3, x.cols()), 3);
  return simulator;
}

}  // namespace

TEMPLATE_TEST_CASE("simulator: a frame takes its time and reports what there is", "", float, double) {
  auto simulator = box_of_liquid<TestType>();
  CHECK(simulator.time() == 0);
  CHECK(simulator.smoothing_length() == Approx(0.008));
  for (int k = 1; k <= 10; ++k) {
    const StepReport report = simulator.step(1.0 / 60);
    REQUIRE(report.advanced());
    CHECK(simulator.time() == Approx(k / 60.0).epsilon(1e-12));
    CHECK(report.sub_steps >= 4);  // at most 5 ms each
    CHECK(report.sub_steps < 100);
    CHECK(report.particles == 180);
    CHECK(report.volume == Approx(180 * std::pow(0.008, 3)).epsilon(1e-5));
    CHECK(report.density_error < 0.02);
    CHECK(report.density_iterations > 0);
    CHECK(report.lost == 0);
    CHECK(report.non_finite == 0);
    double energy = 0;
    for (Index i = 0; i < simulator.fluid().size(); ++i) {
      energy += 0.5 * static_cast<double>(simulator.fluid().mass[i]) *
                static_cast<double>(simulator.fluid().velocity.col(i).squaredNorm());
    }
    CHECK(report.kinetic_energy == Approx(energy).epsilon(1e-6));
  }
}

TEST_CASE("simulator: a status has a name") {
  CHECK(std::string(to_string(StepStatus::Ok)) == "ok");
  CHECK(std::string(to_string(StepStatus::NotConverged)) == "not converged");
  CHECK(std::string(to_string(StepStatus::BadTimeStep)) == "bad time step");
  CHECK(std::string(to_string(StepStatus::TooManySteps)) == "too many sub-steps");
  CHECK(std::string(to_string(StepStatus::NonFinite)) == "non-finite");
  CHECK(std::string(to_string(static_cast<StepStatus>(99))) == "unknown");
}

TEMPLATE_TEST_CASE("simulator: free fall without bodies is exact to the step", "", float, double) {
  SimulatorSettings settings = with_spacing(0.01);
  settings.fixed_step = 0.001;
  Simulator<DefaultParts<TestType>> simulator(settings);
  PointArray<TestType> x(3, 1), v(3, 1);
  x << TestType(0.1), TestType(0.2), TestType(0.3);
  v << TestType(1), TestType(0), TestType(2);
  simulator.add_particles(x, v, 0);
  for (int k = 0; k < 30; ++k) {
    REQUIRE(simulator.step(0.01).sub_steps == 10);
  }
  // symplectic Euler: velocity exact, position ahead by half a step's worth of speed
  const double t = 0.3, g = 9.81;
  CHECK(simulator.fluid().velocity(2, 0) == Approx(2 - g * t).epsilon(1e-4));
  CHECK(simulator.fluid().position(2, 0) == Approx(0.3 + 2 * t - 0.5 * g * t * (t + 0.001)).epsilon(1e-4));
  CHECK(simulator.fluid().position(0, 0) == Approx(0.4).epsilon(1e-4));
}

TEMPLATE_TEST_CASE("simulator: ids are unique and stay with their particles", "", float, double) {
  auto simulator = box_of_liquid<TestType>();
  auto& fluid = simulator.fluid();
  // written in place, without a copy
  for (Index i = 0; i < fluid.size(); ++i) {
    fluid.origin[i] = 1000 + fluid.id[i];
  }
  REQUIRE(simulator.step(0.05).advanced());
  std::set<std::uint32_t> seen;
  for (Index i = 0; i < fluid.size(); ++i) {
    CHECK(fluid.origin[i] == 1000 + fluid.id[i]);
    seen.insert(fluid.id[i]);
  }
  CHECK(seen.size() == 180);
  // half of them leave; others come and get new numbers
  const Index removed = simulator.remove_particles_if([&](Index i) { return fluid.id[i] % 2 == 0; });
  CHECK(removed == 90);
  CHECK(fluid.size() == 90);
  for (Index i = 0; i < fluid.size(); ++i) {
    CHECK(fluid.id[i] % 2 == 1);
    CHECK(fluid.origin[i] == 1000 + fluid.id[i]);
  }
  const PointArray<TestType> more = PointArray<TestType>::Constant(3, 1, TestType(0.03));
  simulator.add_particles(more, PointArray<TestType>::Zero(3, 1), 5);
  CHECK(fluid.id[fluid.size() - 1] == 180);
  CHECK(fluid.mass[fluid.size() - 1] == Approx(998.2 * std::pow(0.008, 3)));
  for (int k = 0; k < 5; ++k) {
    REQUIRE(simulator.step(0.02).advanced());
  }
  CHECK(fluid.size() == 91);
}

TEMPLATE_TEST_CASE("simulator: the force on a vessel is the weight in it within one percent", "", float, double) {
  Simulator<DefaultParts<TestType>> simulator(with_spacing(0.006));
  const BodyId body = simulator.add_body("glass", CylinderInside{0.03, 0.08, 0.002, Face::PositiveZ});
  const FillReport filled = fill(simulator, body, FillAmount::level(0.042));
  const double weight = filled.volume * 998.2 * 9.81;
  Vector3<double> mean = Vector3<double>::Zero();
  constexpr int frames = 20;
  for (int k = 0; k < 20 + frames; ++k) {
    REQUIRE(simulator.step(0.02).advanced());
    if (k >= 20) {
      mean += simulator.pressure_force_on(body) / frames;
    }
  }
  INFO("force [N] " << mean.transpose() << ", weight [N] " << weight);
  CHECK(std::abs(-mean.z() - weight) < 0.01 * weight);
  CHECK(mean.head<2>().norm() < 0.01 * weight);
}

TEST_CASE("simulator: a body moves where it is told to and takes its liquid along") {
  auto simulator = box_of_liquid<float>();
  REQUIRE(simulator.step(0.02).advanced());
  const double start = simulator.time();
  const Pose there{Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ())), {0.05, -0.02, 0.03}};
  simulator.move_body(0, there, 0.4);
  // where it was, half-way, there, and it stays
  CHECK(simulator.bodies()[0].motion.at(start).translation.norm() == Approx(0).margin(1e-12));
  CHECK(simulator.bodies()[0].motion.at(start + 0.2).translation.isApprox(0.5 * there.translation, 1e-9));
  for (int k = 0; k < 30; ++k) {
    REQUIRE(simulator.step(0.02).advanced());
  }
  const Pose now = simulator.bodies()[0].motion.at(simulator.time());
  CHECK(now.translation.isApprox(there.translation, 1e-9));
  CHECK(now.rotation.angularDistance(there.rotation) < 1e-9);
  for (Index i = 0; i < simulator.fluid().size(); ++i) {
    const Vector3<double> x = now.inverse() * Vector3<double>(simulator.fluid().position.col(i).cast<double>());
    REQUIRE((x.array() > 0).all());
    REQUIRE((x.head<2>().array() < 0.048).all());
  }
  // pose by pose, as from a robot
  for (int k = 0; k < 20; ++k) {
    Pose next = now;
    next.translation.x() += 0.004 * (k + 1);
    simulator.move_body(0, next, 0.02);
    REQUIRE(simulator.step(0.02).advanced());
    CHECK(simulator.bodies()[0].motion.at(simulator.time()).translation.isApprox(next.translation, 1e-9));
  }
  CHECK(simulator.fluid().position.row(0).mean() > 0.05f + 0.08f);
}

TEST_CASE("simulator: settling brings to rest without letting time pass") {
  LiquidSimulator simulator(with_spacing(0.008));
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.064, 0.048, 0.08}, 0.002, Face::PositiveZ},
                     PoseTrack({{0, Pose{}}, {1, Pose{Eigen::Quaterniond::Identity(), {2, 0, 0}}}}));
  InletSettings inlet;
  inlet.position = {0.03, 0.03, 0.1};
  inlet.flow = {{0, 1e-4}, {1, 1e-4}};
  simulator.add_inlet(inlet, 1);
  const auto x = block<float>(3, 6, 6, 0.008);
  simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), 0);
  const StepReport report = simulator.settle();
  CHECK(report.advanced());
  CHECK(simulator.time() == 0);
  CHECK(simulator.fluid().size() == 108);  // the inlet was held as well
  CHECK(simulator.fluid().velocity.isZero());
  CHECK(simulator.fluid().position.row(0).maxCoeff() > 0.05f);  // it has spread
  CHECK(simulator.fluid().position.row(0).maxCoeff() < 0.064f);
  CHECK(simulator.bodies()[0].motion.end_time() == 1);
  // and goes on from there
  REQUIRE(simulator.step(0.2).advanced());
  CHECK(simulator.fluid().size() > 108);
}

TEST_CASE("simulator: meshes are looked over when they are added") {
  LiquidSimulator simulator(with_spacing(0.008));
  const TriangleMesh glass = CylinderInside{0.05, 0.1, 0.003, Face::PositiveZ}.mesh();
  TriangleMesh torn = glass;
  torn.triangles.erase(torn.triangles.begin());
  std::swap(torn.triangles[5][0], torn.triangles[5][1]);
  const Pose over{Eigen::Quaterniond(Eigen::AngleAxisd(std::acos(-1.0), Eigen::Vector3d::UnitX())), {1, 0, 0.2}};
  const BodyId sound = simulator.add_body("sound", glass);
  const BodyId turned = simulator.add_body("turned", glass, PoseTrack(over));
  const BodyId damaged =
      simulator.add_body("damaged", torn, PoseTrack(Pose{Eigen::Quaterniond::Identity(), {2, 0, 0}}));
  CHECK(simulator.bodies()[sound].warnings.empty());
  CHECK(simulator.bodies()[turned].warnings.empty());
  REQUIRE(simulator.bodies()[damaged].warnings.size() == 2);
  CHECK(simulator.bodies()[damaged].warnings[0].find("surface is open: 3 open edges in 1 loop") == 0);
  CHECK(simulator.bodies()[damaged].warnings[1].find("orientation changes at") == 0);

  const double capacity = std::acos(-1.0) * 0.05 * 0.05 * 0.1;
  CHECK(simulator.mesh_report(sound).cavity_volume == Approx(capacity).epsilon(5e-3));
  CHECK(simulator.mesh_report(turned).cavity_volume == 0);
  CHECK(simulator.mesh_report(damaged).open_edges == 3);
  CHECK(simulator.mesh_report(damaged).warnings[0] == simulator.bodies()[damaged].warnings[0]);
  CHECK_THROWS_WITH(simulator.mesh_report(3), decant_test::contains("body must be one that was added"));

  CHECK_THROWS_WITH(
      simulator.add_body("cup", scaled(glass, 1000)),
      "body 'cup': body is 106 m large, more than 5000 particles of 8 mm: is the file in millimetres (scale "
      "0.001)?");
  CHECK_THROWS_WITH(simulator.add_body("crumb", scaled(glass, 0.01)), decant_test::contains("body 'crumb'"));
  CHECK(simulator.bodies().size() == 3);
}

TEST_CASE("simulator: parts take their settings from the simulator") {
  SimulatorSettings settings = with_spacing(0.005);
  settings.gravity = {1, 2, 3};
  settings.liquid = liquids::olive_oil;
  settings.numerical_viscosity = 0;
  settings.tolerance_factor = 3;
  settings.stability_number = 0.25;
  Simulator<CapillaryParts<double>> simulator(settings);
  CHECK(simulator.force<Gravity<double>>().acceleration == Vector3<double>(1, 2, 3));
  CHECK(simulator.force<Viscosity<double>>().kinematic_viscosity == Approx(0.084 / 911));
  CHECK(simulator.force<SurfaceTension<double>>().surface_tension == Approx(0.032));
  CHECK(simulator.pressure_solver().tolerance_factor == 3);
  CHECK(simulator.pressure_solver().stability_number == 0.25);
  settings.numerical_viscosity = 0.02;
  Simulator<CapillaryParts<double>> calmed(settings);
  CHECK(calmed.force<Viscosity<double>>().kinematic_viscosity == Approx(0.084 / 911));
  CHECK(calmed.force<ResidualViscosity<double>>().numerical_viscosity ==
        Approx(0.02 * 0.005 * std::sqrt(std::sqrt(14.0) * 0.005)));
}

TEST_CASE("simulator: settings for tracking take half the sub-steps, and liquid stays where it belongs") {
  struct Outcome {
    int sub_steps = 0, iterations = 0;
    double density_error = 0, height = 0, speed = 0;
  };
  // a column of liquid at one end of a box, or a layer all over it
  const auto run = [](const SimulatorSettings& settings, int long_by, int high_by) {
    LiquidSimulator simulator(settings);
    simulator.add_body("box", BoxInside{{0, 0, 0}, {0.16, 0.048, 0.16}, 0.002, {}});
    const auto x = block<float>(long_by, 6, high_by, 0.008);
    simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), 0);
    Outcome outcome;
    for (int k = 0; k < 60; ++k) {
      const StepReport report = simulator.step(1.0 / 60);
      REQUIRE(report.advanced());
      outcome.sub_steps += report.sub_steps;
      outcome.iterations += report.density_iterations + report.divergence_iterations;
      outcome.density_error = std::max(outcome.density_error, report.density_error);
    }
    outcome.height = static_cast<double>(simulator.fluid().position.row(2).mean());
    outcome.speed = std::sqrt(static_cast<double>(simulator.fluid().velocity.colwise().squaredNorm().mean()));
    return outcome;
  };
  const SimulatorSettings usual = with_spacing(0.008), quick = for_tracking(usual);
  const Outcome fell = run(usual, 8, 14), fell_quickly = run(quick, 8, 14);
  CHECK(fell_quickly.sub_steps < 0.65 * fell.sub_steps);
  CHECK(fell_quickly.iterations < fell.iterations);  // though longer sub-steps need more each
  CHECK(fell_quickly.density_error <= 0.00201);
  CHECK(fell_quickly.height == Approx(fell.height).margin(0.5 * 0.008));
  const Outcome rested = run(quick, 20, 12);
  CHECK(rested.height == Approx(6 * 0.008).margin(0.1 * 0.008));
  CHECK(rested.speed < 0.03);  // a tenth of sqrt(g d)
}

TEST_CASE("simulator: a body of another shape is as if it had been added with that one") {
  const auto post = [](double radius) { return BodyShape(TriangleMesh(Cylinder{radius, 0.16}.mesh())); };
  const PoseTrack where(Pose{Eigen::Quaterniond::Identity(), {0.024, 0.024, -0.08}});
  const auto scene = [&](double radius) {
    Simulator<> simulator(with_spacing(0.008));
    simulator.add_body("post", post(radius), where, Slip::None);
    simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
    return simulator;
  };
  const auto end_of = [](Simulator<> simulator) {
    const auto x = block<float>(6, 6, 5, 0.008);
    simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), 3);
    for (int k = 0; k < 6; ++k) {
      REQUIRE(simulator.step(1.0 / 60).advanced());
    }
    return PointArray<float>(simulator.fluid().position);
  };
  const Simulator<> thin = scene(0.006);
  Simulator<> replaced = thin;
  replaced.replace_shape(0, post(0.012));
  CHECK(replaced.bodies()[0].name == "post");
  CHECK(replaced.bodies()[0].slip == Slip::None);
  const PointArray<float> expected = end_of(scene(0.012)), unchanged = end_of(scene(0.006));
  CHECK(end_of(replaced) == expected);
  CHECK(end_of(thin) == unchanged);
  CHECK(expected != unchanged);

  // liquid makes room, and a run goes on
  Simulator<> running = scene(0.006);
  const auto x = block<float>(6, 6, 5, 0.008);
  running.add_particles(x, PointArray<float>::Zero(3, x.cols()), 3);
  running.watch_contents(1);
  REQUIRE(running.step(1.0 / 60).advanced());
  running.replace_shape(0, post(0.012));
  for (Index i = 0; i < running.fluid().size(); ++i) {
    CHECK((running.fluid().position.col(i).head<2>() - Eigen::Vector2f(0.024F, 0.024F)).norm() > 0.012F);
  }
  REQUIRE(running.step(1.0 / 60).advanced());
  CHECK(running.step(1.0 / 60).contents.size() == 1);
  running.replace_shape(1, BoxInside{{0, 0, 0}, {0.048, 0.048, 0.09}, 0.002, Face::PositiveZ});
  CHECK(running.step(1.0 / 60).contents.size() == 0);

  CHECK_THROWS_WITH(running.replace_shape(2, post(0.012)), Catch::Contains("body"));
  CHECK_THROWS_AS(running.replace_shape(0, BodyShape(TriangleMesh{})), std::invalid_argument);
  CHECK(running.bodies()[0].bounds.max().x() == Approx(0.012).epsilon(0.01));
}

TEST_CASE("simulator: a frame of a third of a microsecond changes nothing, in the middle of a splash either") {
  // as where a camera's stamps are rounded to microseconds, and steps of a sixtieth do not quite fill a frame
  Simulator<DefaultParts<float>> simulator(for_tracking(with_spacing(0.008)));
  const BodyId tank = simulator.add_body("tank", BoxInside{{0, 0, 0}, {0.32, 0.048, 0.4}, 0.01, Face::PositiveZ});
  const auto places = block<float>(12, 6, 16, 0.008);  // a column that falls over
  simulator.add_particles(places, PointArray<float>::Zero(3, places.cols()), tank);
  const double fall = std::sqrt(2 * 9.81 * 16 * 0.008);
  for (int frame = 0; frame < 60; ++frame) {
    INFO("frame " << frame);
    REQUIRE(simulator.step(1.0 / 60).advanced());
    const PointArray<float> before = simulator.fluid().velocity;
    const auto ids = simulator.fluid().id;
    REQUIRE(simulator.step(3.3e-7).advanced());
    const PointArray<float> after = simulator.fluid().velocity;
    std::map<std::uint32_t, Index> place;
    for (Index i = 0; i < simulator.fluid().size(); ++i) {
      place[simulator.fluid().id[i]] = i;
    }
    for (Index i = 0; i < before.cols(); ++i) {
      REQUIRE((after.col(place.at(ids[i])) - before.col(i)).norm() < 0.01F);
    }
    REQUIRE(static_cast<double>(after.colwise().norm().maxCoeff()) < 1.5 * fall);
  }
}

TEST_CASE("simulator: a periodic channel keeps its liquid and its mass") {
  struct Channel : DefaultParts<double> {
    using Domain = PeriodicDomain<double>;
    using NeighborSearch = CellGrid<double, Domain>;
  };
  SimulatorSettings settings = with_spacing(0.01);
  settings.gravity = {2, 0, -9.81};
  Simulator<Channel> simulator(settings, PeriodicDomain<double>({0.08, 0.08, 0}));
  simulator.add_body("floor", Box{{-1, -1, -0.05}, {1, 1, 0}});
  const auto x = block<double>(8, 8, 5, 0.01);
  simulator.add_particles(x, PointArray<double>::Zero(3, x.cols()), 0);
  for (int k = 0; k < 20; ++k) {
    REQUIRE(simulator.step(0.01).advanced());
  }
  const auto& fluid = simulator.fluid();
  CHECK(fluid.size() == 320);
  CHECK((fluid.position.topRows(2).array() >= 0).all());
  CHECK((fluid.position.topRows(2).array() < 0.08).all());
  CHECK((fluid.position.row(2).array() > 0).all());
  // a free floor: all of it speeds up alike
  CHECK(fluid.velocity.row(0).mean() == Approx(2 * 0.2).epsilon(0.01));
}

TEST_CASE("simulator: moves that a corrector made end at walls, and crowded liquid moves apart without speed") {
  const double d = 0.005;
  LiquidSimulator simulator(with_spacing(d));
  simulator.add_body("plate", Box{{0, -0.1, -0.1}, {0.002, 0.1, 0.1}});
  PointArray<float> x(3, 4), v = PointArray<float>::Zero(3, 4);
  x.col(0) << -0.01f, 0, 0;
  x.col(1) << -0.01f, 0.03f, 0;
  x.col(2) << -0.03f, 0, 0.05f;
  x.col(3) << -0.01f, -0.05f, 0;
  v.col(0) << 1, 2, 0;
  v.col(2) << 0, 3, 0;
  simulator.add_particles(x, v, 0);
  REQUIRE(simulator.step(1e-6).advanced());
  auto& fluid = simulator.fluid();
  const auto find = [&](std::uint32_t id) {
    return static_cast<Index>(std::find(fluid.id.data(), fluid.id.data() + fluid.size(), id) - fluid.id.data());
  };
  const PointArray<float> before = fluid.position;
  fluid.position(0, find(0)) = 0.01f;                            // through the plate
  fluid.position.col(find(1)) << 0.05f, 0.03f, 0;                // to the other side of it, by far
  fluid.position.col(find(2)) += Eigen::Vector3f(0.003f, 0, 0);  // free
  fluid.position.col(find(3)) << 0.001f, -0.09f, 0;              // far, but into the plate
  const double time = simulator.time();
  CHECK(simulator.adopt_moves(before, 5 * d, 0) >= 1);
  CHECK(simulator.time() == time);
  CHECK(fluid.position(0, find(0)) < 0);
  CHECK(fluid.position(0, find(0)) > -0.002f);                  // at the wall
  CHECK(fluid.velocity(0, find(0)) == Approx(0).margin(1e-3));  // which took the speed toward it
  CHECK(fluid.velocity(1, find(0)) == Approx(2));
  CHECK(fluid.position(0, find(1)) == Approx(0.05));
  CHECK(fluid.position(0, find(2)) == Approx(-0.027));
  CHECK(fluid.velocity(1, find(2)) == Approx(3));
  CHECK((fluid.position(0, find(3)) < 0 || fluid.position(0, find(3)) > 0.002f));  // out of the material

  // half of a block pushed into the other half
  LiquidSimulator crowd(with_spacing(d));
  const auto places = block<float>(8, 8, 8, d);
  crowd.add_particles(places, PointArray<float>::Constant(3, places.cols(), 0.5f), 0);
  REQUIRE(crowd.step(1e-6).advanced());
  const PointArray<float> start = crowd.fluid().position;
  for (Index i = 0; i < crowd.fluid().size(); ++i) {
    float& place = crowd.fluid().position(0, i);
    place = place > 0.02f ? 0.02f + 0.8f * (place - 0.02f) : place;
  }
  LiquidSimulator left_alone = crowd;
  REQUIRE(left_alone.step(1e-9).advanced());
  std::map<std::uint32_t, Vector3<float>> velocity;
  for (Index i = 0; i < crowd.fluid().size(); ++i) {
    velocity[crowd.fluid().id[i]] = crowd.fluid().velocity.col(i);
  }
  crowd.adopt_moves(start, 5 * d, 8);
  for (Index i = 0; i < crowd.fluid().size(); ++i) {
    REQUIRE(crowd.fluid().velocity.col(i) == velocity.at(crowd.fluid().id[i]));
  }
  REQUIRE(crowd.step(1e-9).advanced());
  const float relaxed = crowd.fluid().density.maxCoeff();
  INFO("density " << left_alone.fluid().density.maxCoeff() << " and relaxed " << relaxed);
  CHECK(left_alone.fluid().density.maxCoeff() > 1.1f * 998);
  CHECK(relaxed < 1.05f * 998);
}

TEST_CASE("simulator: moves are adopted alike whether walls are remembered from the moves before or asked anew") {
  const double d = 0.005;
  SimulatorSettings settings = with_spacing(d);
  settings.threads = {2};
  settings.gravity.setZero();
  settings.fixed_step = 1e-4;
  settings.most_sub_steps = 20;
  LiquidSimulator remembers(settings);
  remembers.add_body("floor", Box{{-0.1, -0.1, -0.01}, {0.1, 0.1, 0}});
  remembers.add_body("post", Box{{-0.01, -0.01, 0.001}, {0.01, 0.01, 0.1}}.mesh());
  const auto places = block<float>(14, 14, 8, 1.1 * d, {0.011, -0.04, 0.001});
  // at rest, and not too dense but where it is moved to: most stay where they are
  remembers.add_particles(places, PointArray<float>::Zero(3, places.cols()), 0);
  REQUIRE(remembers.step(1e-4).advanced());
  LiquidSimulator asks = remembers;
  Index cut_short = 0;
  for (int pass = 0; pass < 9; ++pass) {
    if (pass == 3) {  // bodies move on
      for (LiquidSimulator* simulator : {&remembers, &asks}) {
        simulator->move_body(1, {Eigen::Quaterniond::Identity(), {0.0005, 0, 0}}, 0.001);
        REQUIRE(simulator->step(0.0005).advanced());
      }
    }
    if (pass == 5) {  // one stands elsewhere at the same time
      for (LiquidSimulator* simulator : {&remembers, &asks}) {
        const Pose pose = simulator->bodies()[1].motion.at(simulator->time());
        simulator->set_motion(1, PoseTrack({pose.rotation, pose.translation + Vector3<double>(4e-6, 0, 0)}));
      }
    }
    if (pass == 7) {  // a frame fails while a body is on its way
      for (LiquidSimulator* simulator : {&remembers, &asks}) {
        simulator->move_body(1, {Eigen::Quaterniond::Identity(), {0.002, 0, 0}}, 0.01);
        REQUIRE_FALSE(simulator->step(0.01).advanced());
      }
    }
    asks.restore(asks.snapshot());
    Index cut[2];
    int k = 0;
    for (LiquidSimulator* simulator : {&remembers, &asks}) {
      const PointArray<float> before = simulator->fluid().position;
      for (Index i = 0; i < before.cols(); i += 37) {
        simulator->fluid().position.col(i) += Eigen::Vector3f(-0.004f, 0.001f, pass % 2 == 0 ? -0.003f : 0.002f);
      }
      cut[k++] = simulator->adopt_moves(before, 5 * d, pass == 6 ? 0 : 4);
    }
    CHECK(cut[0] == cut[1]);
    cut_short += cut[0];
    const auto &one = remembers.fluid(), &other = asks.fluid();
    REQUIRE((one.id.array() == other.id.array()).all());
    CHECK(PointArray<float>(one.position) == PointArray<float>(other.position));
    CHECK(PointArray<float>(one.velocity) == PointArray<float>(other.velocity));
    const auto &walls = remembers.walls(), &asked = asks.walls();
    CHECK((walls.share.array() == asked.share.array()).all());
    CHECK((walls.gradient.array() == asked.gradient.array()).all());
    CHECK((walls.moment.array() == asked.moment.array()).all());
    CHECK((walls.flux.array() == asked.flux.array()).all());
    CHECK((walls.distance.array() == asked.distance.array()).all());
    REQUIRE((walls.contact_count.array() == asked.contact_count.array()).all());
    for (Index i = 0; i < one.size(); ++i) {
      for (int contact = 0; contact < walls.contact_count[i]; ++contact) {
        REQUIRE(walls.contacts_of(i)[contact].body == asked.contacts_of(i)[contact].body);
        REQUIRE(walls.contacts_of(i)[contact].gradient == asked.contacts_of(i)[contact].gradient);
      }
    }
  }
  CHECK(cut_short > 0);
}
