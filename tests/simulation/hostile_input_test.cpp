// SPDX-License-Identifier: MIT
// What a simulator must not be broken by: each hostile input is refused in one line or survived with a status.

#include <decant/simulation/simulator.hpp>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/boundary/mesh_repair.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/simulation/fill.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

using decant_test::block;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

SimulatorSettings coarse() { return decant_test::with_spacing(0.008); }

// The one line that a set-up error says; empty if nothing was thrown.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    const std::string line = error.what();
    CHECK(line.find('\n') == std::string::npos);
    CHECK(line.size() > 10);
    return line;
  }
  return {};
}

// A small open box, half full, that has run a little.
template <class Scalar>
Simulator<DefaultParts<Scalar>> half_full_box() {
  Simulator<DefaultParts<Scalar>> simulator(coarse());
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
  const auto x = block<Scalar>(6, 6, 6, 0.008);
  simulator.add_particles(x, PointArray<Scalar>::Zero(3, x.cols()), 0);
  REQUIRE(simulator.step(0.05).advanced());
  return simulator;
}

template <class Array>
bool same_bits(const Array& a, const Array& b) {
  return a.count() == b.count() &&
         (a.count() == 0 ||
          std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(*a.data())) == 0);
}

template <class Scalar>
bool same_bits(const FluidState<Scalar>& a, const FluidState<Scalar>& b) {
  return same_bits(a.position, b.position) && same_bits(a.velocity, b.velocity) && same_bits(a.mass, b.mass) &&
         same_bits(a.density, b.density) && same_bits(a.pressure, b.pressure) && same_bits(a.id, b.id) &&
         same_bits(a.origin, b.origin);
}

template <class Scalar>
void check_in_box(const Simulator<DefaultParts<Scalar>>& simulator) {
  const auto& x = simulator.fluid().position;
  CHECK(x.allFinite());
  CHECK(simulator.fluid().velocity.allFinite());
  CHECK((x.row(0).array() > 0 && x.row(0).array() < Scalar(0.048)).all());
  CHECK((x.row(1).array() > 0 && x.row(1).array() < Scalar(0.048)).all());
  CHECK((x.row(2).array() > 0).all());
}

}  // namespace

TEST_CASE("hostile: settings out of range are refused in one line that names them") {
  using Change = std::function<void(SimulatorSettings&)>;
  const std::vector<std::pair<std::string, Change>> cases{
      {"spacing", [](SimulatorSettings& s) { s.spacing = 0; }},
      {"spacing", [](SimulatorSettings& s) { s.spacing = -0.01; }},
      {"spacing", [](SimulatorSettings& s) { s.spacing = not_a_number; }},
      {"spacing", [](SimulatorSettings& s) { s.spacing = 1e9; }},
      {"density", [](SimulatorSettings& s) { s.liquid.density = 0; }},
      {"density", [](SimulatorSettings& s) { s.liquid.density = -1; }},
      {"density", [](SimulatorSettings& s) { s.liquid.density = not_a_number; }},
      {"density", [](SimulatorSettings& s) { s.liquid.density = infinite; }},
      {"viscosity", [](SimulatorSettings& s) { s.liquid.dynamic_viscosity = -1; }},
      {"viscosity", [](SimulatorSettings& s) { s.liquid.dynamic_viscosity = 1e9; }},
      {"viscosity", [](SimulatorSettings& s) { s.liquid.dynamic_viscosity = not_a_number; }},
      {"surface tension", [](SimulatorSettings& s) { s.liquid.surface_tension = -1; }},
      {"surface tension", [](SimulatorSettings& s) { s.liquid.surface_tension = not_a_number; }},
      {"gravity",
       [](SimulatorSettings& s) {
         s.gravity = {0, 0, not_a_number};
       }},
      {"gravity",
       [](SimulatorSettings& s) {
         s.gravity = {0, infinite, 0};
       }},
      {"gravity",
       [](SimulatorSettings& s) {
         s.gravity = {0, 0, -1e7};
       }},
      {"support_in_spacings", [](SimulatorSettings& s) { s.support_in_spacings = 0; }},
      {"support_in_spacings", [](SimulatorSettings& s) { s.support_in_spacings = 100; }},
      {"support_in_spacings", [](SimulatorSettings& s) { s.support_in_spacings = not_a_number; }},
      {"largest_step", [](SimulatorSettings& s) { s.largest_step = 0; }},
      {"largest_step", [](SimulatorSettings& s) { s.largest_step = not_a_number; }},
      {"largest_step", [](SimulatorSettings& s) { s.largest_step = infinite; }},
      {"courant_number", [](SimulatorSettings& s) { s.courant_number = 0; }},
      {"courant_number", [](SimulatorSettings& s) { s.courant_number = not_a_number; }},
      {"courant_number", [](SimulatorSettings& s) { s.courant_number = 5; }},
      {"stability_number", [](SimulatorSettings& s) { s.stability_number = 0; }},
      {"stability_number", [](SimulatorSettings& s) { s.stability_number = not_a_number; }},
      {"stability_number", [](SimulatorSettings& s) { s.stability_number = 5; }},
      {"tolerance_factor", [](SimulatorSettings& s) { s.tolerance_factor = 0; }},
      {"tolerance_factor", [](SimulatorSettings& s) { s.tolerance_factor = not_a_number; }},
      {"tolerance_factor", [](SimulatorSettings& s) { s.tolerance_factor = infinite; }},
      {"fixed_step", [](SimulatorSettings& s) { s.fixed_step = -1; }},
      {"fixed_step", [](SimulatorSettings& s) { s.fixed_step = not_a_number; }},
      {"numerical_viscosity", [](SimulatorSettings& s) { s.numerical_viscosity = -1; }},
      {"numerical_viscosity", [](SimulatorSettings& s) { s.numerical_viscosity = not_a_number; }},
      {"most_sub_steps", [](SimulatorSettings& s) { s.most_sub_steps = 0; }},
      {"threads", [](SimulatorSettings& s) { s.threads = {-1}; }},
      {"threads", [](SimulatorSettings& s) { s.threads = {1 << 20}; }},
  };
  for (const auto& [word, change] : cases) {
    SimulatorSettings settings = coarse();
    change(settings);
    const std::string line = refusal([&] { LiquidSimulator simulator(settings); });
    INFO(word << ": " << line);
    CHECK(line.find(word) != std::string::npos);
    CHECK(line.find("must be") != std::string::npos);
  }
}

TEMPLATE_TEST_CASE("hostile: particles that are not finite are refused and none is added", "", float, double) {
  auto simulator = half_full_box<TestType>();
  const Index count = simulator.fluid().size();
  for (const double bad : {not_a_number, infinite, -infinite}) {
    PointArray<TestType> good = PointArray<TestType>::Constant(3, 2, TestType(0.01));
    PointArray<TestType> wrong = good;
    wrong(1, 1) = static_cast<TestType>(bad);
    CHECK(refusal([&] { simulator.add_particles(wrong, good, 0); }).find("positions") != std::string::npos);
    CHECK(refusal([&] { simulator.add_particles(good, wrong, 0); }).find("velocities") != std::string::npos);
  }
  CHECK(refusal([&] {
          simulator.add_particles(PointArray<TestType>::Zero(3, 2), PointArray<TestType>::Zero(3, 1), 0);
        }).find("number of velocities") != std::string::npos);
  // memory that nobody touches
  const PointArray<TestType> too_many(3, 100'000'000);
  CHECK(refusal([&] { simulator.add_particles(too_many, too_many, 0); }) ==
        "Simulator: number of particles must be at most 1e8, got " + std::to_string(100'000'000 + count));
  CHECK(simulator.fluid().size() == count);
}

TEST_CASE("hostile: poses that are not finite or not in order are refused") {
  const Pose here;
  Pose lost;
  lost.translation = {0, not_a_number, 0};
  Pose bent;
  bent.rotation.coeffs() << 0, 0, 0, 0;
  Pose turned;
  turned.rotation.coeffs() << infinite, 0, 0, 1;
  CHECK(refusal([&] { PoseTrack{lost}; }).find("pose") != std::string::npos);
  CHECK(refusal([&] { PoseTrack{turned}; }).find("pose") != std::string::npos);
  CHECK(refusal([&] { PoseTrack{bent}; }).find("quaternion") != std::string::npos);
  CHECK(refusal([&] { PoseTrack({{0.0, here}, {0.0, here}}); }).find("later") != std::string::npos);
  CHECK(refusal([&] { PoseTrack({{0.0, here}, {not_a_number, here}}); }).find("time") != std::string::npos);

  auto simulator = half_full_box<float>();
  CHECK(refusal([&] { simulator.move_body(0, lost, 0.1); }).find("pose") != std::string::npos);
  CHECK(refusal([&] { simulator.move_body(0, here, 0); }).find("duration") != std::string::npos);
  CHECK(refusal([&] { simulator.move_body(0, here, not_a_number); }).find("duration") != std::string::npos);
  CHECK(refusal([&] { simulator.move_body(7, here, 0.1); }).find("body") != std::string::npos);
  CHECK(refusal([&] { simulator.set_motion(7, PoseTrack(here)); }).find("body") != std::string::npos);
  CHECK(refusal([&] { fill(simulator, 7, FillAmount::fraction(0.1)); }).find("body") != std::string::npos);
  REQUIRE(simulator.step(0.02).advanced());
  check_in_box(simulator);
}

TEST_CASE("hostile: meshes that are empty or broken are refused") {
  LiquidSimulator simulator(coarse());
  TriangleMesh empty;
  TriangleMesh flat;
  flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}};
  TriangleMesh broken;
  broken.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  broken.triangles = {{0, 1, 7}};
  TriangleMesh lost = broken;
  lost.triangles = {{0, 1, 2}};
  lost.vertices[1][0] = not_a_number;
  for (const TriangleMesh& mesh : {empty, flat, broken, lost}) {
    CHECK_FALSE(refusal([&] { simulator.add_body("wrong", mesh); }).empty());
  }
  CHECK_FALSE(refusal([&] { simulator.add_body("wrong", CylinderInside{0, 1, 0.002, {}}); }).empty());
  CHECK_FALSE(refusal([&] { simulator.add_body("wrong", CylinderInside{0.1, not_a_number, 0.002, {}}); }).empty());
  CHECK_FALSE(refusal([&] { simulator.add_body("wrong", Cup{0.03, 0.04, 0.09, -0.002}); }).empty());
  CHECK_FALSE(refusal([&] { simulator.add_body("wrong", BoxInside{{0, 0, 0}, {0, 1, 1}, 0.002, {}}); }).empty());
  CHECK(simulator.bodies().size() == 0);
  CHECK(simulator.step(0.01).advanced());
}

TEST_CASE("hostile: an inverted mesh holds liquid all the same") {
  TriangleMesh mesh = CylinderInside{0.03, 0.06, 0.002, Face::PositiveZ}.mesh();
  for (auto& triangle : mesh.triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  LiquidSimulator simulator(coarse());
  const BodyId body = simulator.add_body("inverted", mesh);
  const auto x = block<float>(4, 4, 4, 0.008, {-0.016, -0.016, 0.001});
  simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), body);
  for (int k = 0; k < 20; ++k) {
    REQUIRE(simulator.step(0.02).advanced());
  }
  const auto& y = simulator.fluid().position;
  CHECK(y.allFinite());
  CHECK((y.topRows(2).colwise().norm().array() < 0.0301f).all());
  CHECK((y.row(2).array() > 0).all());
}

TEMPLATE_TEST_CASE("hostile: frame times out of range change nothing", "", float, double) {
  auto simulator = half_full_box<TestType>();
  const auto before = simulator.fluid();
  const double time = simulator.time();
  for (const double frame : {-0.01, not_a_number, infinite, -infinite}) {
    const StepReport report = simulator.step(frame);
    CHECK(report.status == StepStatus::BadTimeStep);
    CHECK_FALSE(report.advanced());
    CHECK(same_bits(simulator.fluid(), before));
    CHECK(simulator.time() == time);
  }
  const StepReport still = simulator.step(0);
  CHECK(still.status == StepStatus::Ok);
  CHECK(still.sub_steps == 0);
  CHECK(still.particles == before.size());
  CHECK(same_bits(simulator.fluid(), before));
  CHECK(simulator.step(1e-12).advanced());
  CHECK(simulator.step(1e6).status == StepStatus::TooManySteps);
}

TEMPLATE_TEST_CASE("hostile: state that the user breaks between frames fails the frame and stays as it was", "", float,
                   double) {
  for (const double bad : {not_a_number, infinite, -infinite, 1e30}) {
    for (const bool in_velocity : {true, false}) {
      for (const double fixed : {0.0, 0.001}) {
        INFO(bad << (in_velocity ? " velocity" : " position") << " fixed step " << fixed);
        SimulatorSettings settings = coarse();
        settings.fixed_step = fixed;
        Simulator<DefaultParts<TestType>> simulator(settings);
        simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
        const auto x = block<TestType>(5, 5, 5, 0.008);
        simulator.add_particles(x, PointArray<TestType>::Zero(3, x.cols()), 0);
        REQUIRE(simulator.step(0.01).advanced());
        const auto good = simulator.snapshot();
        (in_velocity ? simulator.fluid().velocity : simulator.fluid().position)(1, 17) = static_cast<TestType>(bad);
        const auto before = simulator.fluid();
        const double time = simulator.time();
        const StepReport report = simulator.step(0.01);
        if (std::isfinite(bad)) {
          // a place or speed beyond reason may go either way, but not unsaid
          CHECK((report.advanced() ? simulator.fluid().position.allFinite() && simulator.fluid().velocity.allFinite()
                                   : same_bits(simulator.fluid(), before)));
        } else {
          CHECK(report.status == StepStatus::NonFinite);
          CHECK(same_bits(simulator.fluid(), before));
          CHECK(simulator.time() == time);
        }
        // and the simulator is not spoilt by it
        simulator.restore(good);
        REQUIRE(simulator.step(0.01).advanced());
        check_in_box(simulator);
      }
    }
  }
}

TEMPLATE_TEST_CASE("hostile: two particles and three at one place", "", float, double) {
  for (const Index more : {1, 2}) {
    auto simulator = half_full_box<TestType>();
    PointArray<TestType> x(3, more);
    x.colwise() = Vector3<TestType>(simulator.fluid().position.col(20));
    simulator.add_particles(x, PointArray<TestType>::Zero(3, more), 0);
    for (int k = 0; k < 20; ++k) {
      const StepReport report = simulator.step(0.01);
      REQUIRE(report.advanced());
      REQUIRE(report.lost == 0);
    }
    check_in_box(simulator);
  }
}

TEMPLATE_TEST_CASE("hostile: a dozen particles at one place burst or are refused with a status", "", float, double) {
  auto simulator = half_full_box<TestType>();
  PointArray<TestType> x(3, 12);
  x.colwise() = Vector3<TestType>(simulator.fluid().position.col(20));
  simulator.add_particles(x, PointArray<TestType>::Zero(3, 12), 0);
  for (int k = 0; k < 5; ++k) {
    const auto before = simulator.fluid();
    const StepReport report = simulator.step(0.01);
    CHECK(report.lost == 0);
    CHECK((report.advanced() || same_bits(simulator.fluid(), before)));
    CHECK(simulator.fluid().position.allFinite());
    // out of the open box perhaps, but not through its floor
    Index beneath = 0;
    for (Index i = 0; i < simulator.fluid().size(); ++i) {
      const Vector3<double> place = simulator.fluid().position.col(i).template cast<double>();
      beneath +=
          place.z() < 0 && (place.head<2>().array() > 0).all() && (place.head<2>().array() < 0.048).all() ? 1 : 0;
    }
    CHECK(beneath == 0);
  }
}

TEST_CASE("hostile: a motion that begins elsewhere is refused while there is liquid") {
  auto simulator = half_full_box<float>();
  const Pose there{Eigen::Quaterniond::Identity(), {1, 0, 0}};
  CHECK(refusal([&] { simulator.set_motion(0, PoseTrack(there)); }).find("jump") != std::string::npos);
  REQUIRE(simulator.step(0.02).advanced());
  check_in_box(simulator);
  LiquidSimulator empty(coarse());
  empty.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
  CHECK_NOTHROW(empty.set_motion(0, PoseTrack(there)));
}

TEMPLATE_TEST_CASE("hostile: no particle and one particle", "", float, double) {
  Simulator<DefaultParts<TestType>> simulator(coarse());
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.08}, 0.002, Face::PositiveZ});
  const StepReport empty = simulator.step(0.1);
  CHECK(empty.status == StepStatus::Ok);
  CHECK(empty.particles == 0);
  CHECK(empty.volume == 0);
  CHECK(simulator.time() == Approx(0.1));
  simulator.settle();
  simulator.add_particles(PointArray<TestType>(3, 0), PointArray<TestType>(3, 0), 0);
  CHECK(simulator.fluid().size() == 0);
  CHECK(simulator.remove_particles_if([](Index) { return true; }) == 0);
  PointArray<TestType> x(3, 1);
  x << TestType(0.02), TestType(0.02), TestType(0.05);
  simulator.add_particles(x, PointArray<TestType>::Zero(3, 1), 0);
  for (int k = 0; k < 50; ++k) {
    REQUIRE(simulator.step(0.02).advanced());
  }
  check_in_box(simulator);
  CHECK(simulator.fluid().position(2, 0) < TestType(0.01));
  CHECK(simulator.remove_particles_if([](Index) { return true; }) == 1);
  CHECK(simulator.step(0.02).status == StepStatus::Ok);
}

TEST_CASE("hostile: a body that is put into the liquid pushes it out and loses none") {
  auto simulator = half_full_box<float>();
  const Index count = simulator.fluid().size();
  simulator.add_body("ball", Sphere{{0.024, 0.024, 0.02}, 0.012});
  Index within = 0;
  for (int k = 0; k < 25; ++k) {
    const StepReport report = simulator.step(0.02);
    REQUIRE(report.advanced());
    REQUIRE(report.lost == 0);
  }
  check_in_box(simulator);
  CHECK(simulator.fluid().size() == count);
  for (Index i = 0; i < count; ++i) {
    within += (simulator.fluid().position.col(i) - Eigen::Vector3f(0.024f, 0.024f, 0.02f)).norm() < 0.0118f ? 1 : 0;
  }
  CHECK(within == 0);
}

TEST_CASE("hostile: a body driven against the floor reports what it squeezes out") {
  auto simulator = half_full_box<float>();
  const Index count = simulator.fluid().size();
  const BodyId ball =
      simulator.add_body("ball", Sphere{{0, 0, 0}, 0.012}, PoseTrack(Pose{{1, 0, 0, 0}, {0.024, 0.024, 0.12}}));
  simulator.move_body(ball, Pose{{1, 0, 0, 0}, {0.024, 0.024, 0.0}}, 0.5);
  StepReport report;
  for (int k = 0; k < 40; ++k) {
    report = simulator.step(0.02);
    REQUIRE(report.advanced());
  }
  Index beneath = 0;
  for (Index i = 0; i < count; ++i) {
    const Eigen::Vector3f x = simulator.fluid().position.col(i);
    beneath += x.z() < 0 && (x - Eigen::Vector3f(0.024f, 0.024f, 0)).norm() > 0.012f ? 1 : 0;
  }
  CHECK(simulator.fluid().position.allFinite());
  INFO("lost as reported " << report.lost);
  CHECK(beneath <= report.lost);
}

TEST_CASE("hostile: a pose that jumps by a metre is refused with a status or carries the liquid along") {
  for (const double duration : {1e-9, 1e-4, 0.01}) {
    auto simulator = half_full_box<float>();
    const Pose there{Eigen::Quaterniond::Identity(), {1, 0, 0}};
    simulator.set_motion(0,
                         PoseTrack({{simulator.time() + 0.005, Pose{}}, {simulator.time() + 0.005 + duration, there}}));
    const auto before = simulator.fluid();
    const double time = simulator.time();
    const StepReport report = simulator.step(0.02);
    INFO("jump within " << duration << " s: " << to_string(report.status));
    if (report.advanced()) {
      const Pose now = simulator.bodies()[0].motion.at(simulator.time()).inverse();
      for (Index i = 0; i < simulator.fluid().size(); ++i) {
        const Vector3<double> x = now * Vector3<double>(simulator.fluid().position.col(i).cast<double>());
        REQUIRE(x.allFinite());
        REQUIRE((x.z() > 0.08 || ((x.array() > -1e-5).all() && x.x() < 0.04801 && x.y() < 0.04801)));
      }
      CHECK(report.lost == 0);
    } else {
      CHECK(report.status == StepStatus::TooManySteps);
      CHECK(same_bits(simulator.fluid(), before));
      CHECK(simulator.time() == time);
    }
  }
}

TEST_CASE("hostile: inlets and fills out of range are refused in one line") {
  auto simulator = half_full_box<float>();
  const auto with = [](const std::function<void(InletSettings&)>& change) {
    InletSettings inlet;
    inlet.flow = {{0, 1e-5}, {1, 1e-5}};
    change(inlet);
    return inlet;
  };
  const std::vector<InletSettings> wrong{
      with([](InletSettings& s) {
        s.position = {0, not_a_number, 0};
      }),
      with([](InletSettings& s) {
        s.direction = {0, 0, 0};
      }),
      with([](InletSettings& s) {
        s.direction = {infinite, 0, 0};
      }),
      with([](InletSettings& s) { s.radius = 0; }),
      with([](InletSettings& s) { s.radius = -1; }),
      with([](InletSettings& s) { s.radius = not_a_number; }),
      with([](InletSettings& s) { s.radius = 1e9; }),
      with([](InletSettings& s) {
        s.flow = {{0, -1e-5}};
      }),
      with([](InletSettings& s) {
        s.flow = {{0, not_a_number}};
      }),
      with([](InletSettings& s) {
        s.flow = {{1, 1e-5}, {0, 1e-5}};
      }),
      with([](InletSettings& s) {
        s.flow = {{not_a_number, 1e-5}};
      }),
  };
  for (const InletSettings& inlet : wrong) {
    CHECK(refusal([&] { simulator.add_inlet(inlet, 0); }).find("Inlet") != std::string::npos);
  }
  for (const FillAmount amount :
       {FillAmount::fraction(-0.1), FillAmount::fraction(1.1), FillAmount::fraction(not_a_number),
        FillAmount::volume(-1), FillAmount::volume(1), FillAmount::volume(not_a_number), FillAmount::level(-0.01),
        FillAmount::level(1), FillAmount::level(not_a_number)}) {
    CHECK(refusal([&] { fill(simulator, 0, amount); }).find("fill: body 'box'") != std::string::npos);
  }
}

TEST_CASE("hostile: a flow beyond reason is stopped by a status") {
  LiquidSimulator simulator(coarse());
  InletSettings inlet;
  inlet.radius = 0.01;
  inlet.flow = {{0, 10}, {1, 10}};  // 30 km/s
  simulator.add_inlet(inlet, 0);
  const StepReport report = simulator.step(0.02);
  CHECK(report.status == StepStatus::TooManySteps);
  CHECK(simulator.fluid().size() == 0);
  CHECK(simulator.time() == 0);
}
