// SPDX-License-Identifier: MIT
// What reports say of the liquid in watched containers, against counts by the containers' own formulas.

#include <decant/simulation/step_report.hpp>

#include <cmath>
#include <string>

#include <decant/boundary/shapes.hpp>
#include <decant/simulation/contents.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

constexpr double spacing = 0.008;  // [m]

SimulatorSettings settings_for(int threads) { return decant_test::with_spacing(spacing, threads); }

// n^3 particles on a lattice of one spacing from a corner on.
template <class Scalar>
PointArray<Scalar> cube(int n, const Vector3<double>& corner) {
  return decant_test::block<Scalar>(n, n, n, spacing, corner);
}

template <class Parts>
void add(Simulator<Parts>& simulator, const PointArray<typename Parts::Scalar>& x) {
  simulator.add_particles(x, PointArray<typename Parts::Scalar>::Zero(3, x.cols()), 0);
}

const BoxInside jug{{0, 0, 0}, {0.048, 0.048, 0.06}, 0.002, Face::PositiveZ};
const BoxInside basin{{-0.2, -0.1, -0.2}, {0.1, 0.148, -0.05}, 0.004, Face::PositiveZ};

// Particles in a box as its measures say, below `top` in its own frame [m].
template <class Parts>
Index inside(const Simulator<Parts>& simulator, BodyId body, const BoxInside& box, double top) {
  const Pose from_world = simulator.bodies()[body].motion.at(simulator.time()).inverse();
  Index count = 0;
  for (Index i = 0; i < simulator.fluid().size(); ++i) {
    const Vector3<double> x = from_world * Vector3<double>(simulator.fluid().position.col(i).template cast<double>());
    count +=
        (x.array() > box.min.array()).all() && (x.head<2>().array() < box.max.head<2>().array()).all() && x.z() < top;
  }
  return count;
}

}  // namespace

TEST_CASE("step report: a list of contents keeps what fits and finds a body") {
  ContentsList list;
  CHECK(list.empty());
  CHECK(list.find(0) == nullptr);
  for (std::uint32_t body = 0; body < ContentsList::capacity + 3; ++body) {
    list.push_back({2 * body, static_cast<Index>(body), 0.5});
  }
  CHECK(list.size() == ContentsList::capacity);
  CHECK(list[3].body == 6);
  REQUIRE(list.find(8) != nullptr);
  CHECK(list.find(8)->particles == 4);
  CHECK(list.find(7) == nullptr);
}

TEMPLATE_TEST_CASE("step report: contents are those particles that were put into the container", "", float, double) {
  Simulator<DefaultParts<TestType>> simulator(settings_for(1));
  const BodyId first = simulator.add_body("first", jug);
  const Pose beside{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vector3<double>::UnitZ())), {0.3, 0, 0}};
  const BodyId second = simulator.add_body("second", jug, PoseTrack(beside));
  CHECK(simulator.step(0).contents.empty());

  simulator.watch_contents(second);
  simulator.watch_contents(first);
  add(simulator, cube<TestType>(6, {0, 0, 0}));
  add(simulator, cube<TestType>(3, {0.1, 0, 0}));  // falls beside both
  PointArray<TestType> there = cube<TestType>(4, {0.008, 0.008, 0});
  for (Index i = 0; i < there.cols(); ++i) {
    there.col(i) = (beside * Vector3<double>(there.col(i).template cast<double>())).template cast<TestType>();
  }
  add(simulator, there);
  for (const double frame : {0.0, 0.02, 0.02}) {
    const StepReport report = simulator.step(frame);
    REQUIRE(report.advanced());
    REQUIRE(report.contents.size() == 2);
    CHECK(report.contents[0].body == second);
    CHECK(report.contents[0].particles == 64);
    CHECK(report.contents[1].body == first);
    CHECK(report.contents[1].particles == 216);
    // single precision masses
    CHECK(report.contents[1].volume == Approx(216 * spacing * spacing * spacing).epsilon(1e-6));
    CHECK(report.particles == 216 + 27 + 64);
  }
}

TEST_CASE("step report: liquid that is poured leaves one container's entry and enters the other's") {
  LiquidSimulator simulator(settings_for(1));
  const Pose upright{}, over{Eigen::Quaterniond(Eigen::AngleAxisd(-2.0, Vector3<double>::UnitY())), {0, 0, 0.02}};
  const BodyId cup = simulator.add_body("jug", jug, PoseTrack({{0.0, upright}, {0.2, upright}, {0.6, over}}));
  const BodyId below = simulator.add_body("basin", basin);
  simulator.watch_contents(cup);
  simulator.watch_contents(below);
  add(simulator, cube<float>(6, {0, 0, 0}));
  bool on_the_way = false;
  StepReport report;
  for (int frame = 0; frame < 40; ++frame) {
    report = simulator.step(0.025);
    REQUIRE(report.advanced());
    REQUIRE(report.lost == 0);
    REQUIRE(report.contents.size() == 2);
    const Index in_cup = report.contents.find(cup)->particles, in_basin = report.contents.find(below)->particles;
    INFO("frame " << frame << ": " << in_cup << " in the jug, " << in_basin << " in the basin");
    // the rim's height is known to a thousandth of a column, here far below a tenth of a millimetre
    CHECK(in_cup >= inside(simulator, cup, jug, jug.max.z() - 1e-4));
    CHECK(in_cup <= inside(simulator, cup, jug, jug.max.z() + 1e-4));
    CHECK(in_basin >= inside(simulator, below, basin, basin.max.z() - 1e-4));
    CHECK(in_basin <= inside(simulator, below, basin, basin.max.z() + 1e-4));
    CHECK(report.contents[0].volume == Approx(static_cast<double>(in_cup) * spacing * spacing * spacing).epsilon(1e-6));
    on_the_way = on_the_way || (in_cup > 20 && in_basin > 20 && in_cup + in_basin < 216);
    if (frame < 8) {
      CHECK(in_cup == 216);
    }
  }
  CHECK(on_the_way);
  CHECK(report.contents.find(cup)->particles < 5);
  CHECK(report.contents.find(below)->particles > 200);
  CHECK(report.contents.find(below)->volume == Approx(Contents(simulator, below).volume(simulator)).epsilon(1e-6));
}

TEST_CASE("step report: contents are the same bits with 1 and 4 threads and after a snapshot") {
  const auto volumes = [](int threads, bool restored) {
    LiquidSimulator simulator(settings_for(threads));
    const BodyId body = simulator.add_body("tank", BoxInside{{0, 0, 0}, {0.12, 0.12, 0.12}, 0.002, Face::PositiveZ});
    simulator.watch_contents(body);
    add(simulator, cube<float>(14, {0, 0, 0}));
    simulator.fluid().mass *= 0.37f;  // not a number whose sums are exact
    if (restored) {
      const auto kept = simulator.snapshot();
      const BodyId other = simulator.add_body("other", jug, PoseTrack(Pose{Eigen::Quaterniond::Identity(), {1, 0, 0}}));
      simulator.watch_contents(other);
      simulator.restore(kept);
    }
    const StepReport report = simulator.step(0.005);
    REQUIRE(report.contents.size() == 1);
    return report.contents[0].volume;
  };
  const double alone = volumes(1, false);
  CHECK(alone > 0);
  CHECK(volumes(4, false) == alone);
  CHECK(volumes(1, true) == alone);
}

TEST_CASE("step report: what cannot be watched is refused by name") {
  LiquidSimulator simulator(settings_for(1));
  const BodyId block = simulator.add_body("block", Box{{0, 0, 0}, {0.05, 0.05, 0.05}});
  CHECK_THROWS_WITH(simulator.watch_contents(block), decant_test::contains("body 'block' to watch"));
  CHECK_THROWS_WITH(simulator.watch_contents(7), decant_test::contains("body must be one that was added"));
  for (std::size_t k = 0; k <= ContentsList::capacity; ++k) {
    const BodyId body = simulator.add_body("jug", jug);
    if (k < ContentsList::capacity) {
      simulator.watch_contents(body);
      simulator.watch_contents(body);  // again: still one entry
    } else {
      CHECK_THROWS_WITH(simulator.watch_contents(body), decant_test::contains("at most 16"));
    }
  }
  CHECK(simulator.step(0).contents.size() == ContentsList::capacity);
}
