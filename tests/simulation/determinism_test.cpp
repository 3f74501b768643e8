// SPDX-License-Identifier: MIT
// Same input, same build: the same bits, whatever the number of threads, the simulators beside it, or a snapshot in
// between. And every bundle of parts compiles and runs.

#include <decant/simulation/simulator.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <tuple>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/kernel/spiky.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/neighbor/brute_force.hpp>
#include <decant/neighbor/kd_tree.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

// A column of liquid that collapses in a rocking box beside a post, with an inlet above.
template <class Parts>
Simulator<Parts> splash(int threads, int per_side, int rows, int layers) {
  using Scalar = typename Parts::Scalar;
  constexpr double spacing = 0.006;  // [m]
  Simulator<Parts> simulator(decant_test::with_spacing(spacing, threads));
  const double depth = std::max(10, rows) * spacing + 1e-4;
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.12, depth, 0.12}, 0.002, {}}, decant_test::rocking(1, 9, 0.01, 12));
  simulator.add_body("post", TriangleMesh(Cylinder{0.006, 0.05}.mesh()),
                     PoseTrack(Pose{Eigen::Quaterniond::Identity(), {0.066, 0.03, 0.035}}), Slip::None);
  const auto x = decant_test::block<Scalar>(per_side, rows, layers, spacing);
  simulator.add_particles(x, PointArray<Scalar>::Zero(3, x.cols()), 0);
  InletSettings inlet;
  inlet.position = {0.05, 0.03, 0.085};
  inlet.radius = 0.008;
  inlet.flow = {{0, 3e-5}, {0.2, 3e-5}};
  simulator.add_inlet(inlet, 7);
  return simulator;
}

template <class Parts>
Simulator<Parts> splash(int threads, int per_side = 10) {
  return splash<Parts>(threads, per_side, per_side, per_side);
}

// The same, but more liquid: a fourth thread gets no work before there is enough of it.
template <class Parts>
Simulator<Parts> shared_splash(int threads) {
  static_assert(10 * 18 * 12 >= 4 * least_per_thread);
  return splash<Parts>(threads, 10, 18, 12);
}

// Positions and velocities by id, and the reports: all bits that a user can see.
template <class Parts>
std::vector<unsigned char> run(Simulator<Parts>& simulator, int frames) {
  using Scalar = typename Parts::Scalar;
  std::vector<unsigned char> bits;
  const auto write = [&](const auto* data, std::size_t count) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(data);
    bits.insert(bits.end(), bytes, bytes + count * sizeof(*data));
  };
  for (int k = 0; k < frames; ++k) {
    const StepReport report = simulator.step(0.01);
    REQUIRE(report.advanced());
    REQUIRE(report.lost == 0);
    write(&report.sub_steps, 1);
    write(&report.density_iterations, 1);
    write(&report.kinetic_energy, 1);
    write(&report.density_error, 1);
  }
  const auto& fluid = simulator.fluid();
  std::vector<Index> place(static_cast<std::size_t>(fluid.size()));
  for (Index i = 0; i < fluid.size(); ++i) {
    REQUIRE(fluid.id[i] < place.size());
    place[fluid.id[i]] = i;
  }
  for (const Index i : place) {
    const Vector3<Scalar> x = fluid.position.col(i), v = fluid.velocity.col(i);
    REQUIRE(x.allFinite());
    write(x.data(), 3);
    write(v.data(), 3);
    write(&fluid.density[i], 1);
    write(&fluid.pressure[i], 1);
  }
  return bits;
}

template <class Scalar>
struct WendlandParts : DefaultParts<Scalar> {
  using Kernel = WendlandC2<Scalar>;
};
template <class Scalar>
struct MuellerParts : StateEquationParts<Scalar> {
  using Kernel = Spiky<Scalar>;
};
template <class Scalar>
struct TreeParts : DefaultParts<Scalar> {
  using NeighborSearch = KdTree<Scalar, OpenDomain>;
};
template <class Scalar>
struct BruteParts : DefaultParts<Scalar> {
  using NeighborSearch = BruteForce<Scalar, OpenDomain>;
};

}  // namespace

TEMPLATE_TEST_CASE("determinism: the same bits with 1 and 2 and 4 threads", "", float, double) {
  auto one = shared_splash<DefaultParts<TestType>>(1);
  const auto expected = run(one, 10);
  for (const int threads : {2, 4}) {
    auto other = shared_splash<DefaultParts<TestType>>(threads);
    CHECK((run(other, 10) == expected));
  }
}

TEMPLATE_TEST_CASE("determinism: the same bits with 1 and 2 and 4 threads for other parts", "",
                   StateEquationParts<float>, PositionBasedParts<float>, ThickLiquidParts<float>, CapillaryParts<float>,
                   TreeParts<float>) {
  auto one = shared_splash<TestType>(1);
  const auto expected = run(one, 2);
  for (const int threads : {2, 4}) {
    auto other = shared_splash<TestType>(threads);
    CHECK((run(other, 2) == expected));
  }
}

TEMPLATE_TEST_CASE("determinism: a run that is restored from a snapshot continues bit for bit", "", float, double) {
  auto simulator = splash<DefaultParts<TestType>>(1);
  run(simulator, 8);
  const auto kept = simulator.snapshot();
  const auto expected = run(simulator, 8);
  simulator.restore(kept);
  CHECK((run(simulator, 8) == expected));
  // into a simulator that has lived another life
  auto other = splash<DefaultParts<TestType>>(2);
  run(other, 3);
  other.restore(kept);
  CHECK((run(other, 8) == expected));
  // copies are independent of the first
  simulator.restore(kept);
  auto copy = simulator;
  run(simulator, 2);
  CHECK((run(copy, 8) == expected));
}

TEMPLATE_TEST_CASE("determinism: a snapshot of other solvers continues bit for bit", "", StateEquationParts<float>,
                   PositionBasedParts<float>, ThickLiquidParts<float>, CapillaryParts<float>) {
  auto simulator = splash<TestType>(1, 7);
  run(simulator, 3);
  const auto kept = simulator.snapshot();
  const auto expected = run(simulator, 3);
  simulator.restore(kept);
  CHECK((run(simulator, 3) == expected));
}

TEST_CASE("determinism: other simulators in the process make no difference") {
  auto alone = splash<DefaultParts<float>>(1);
  const auto expected = run(alone, 6);
  auto first = splash<DefaultParts<float>>(1);
  auto thick = splash<ThickLiquidParts<float>>(1, 5);
  auto weak = splash<StateEquationParts<float>>(1, 5);
  auto second = splash<DefaultParts<float>>(1);
  std::vector<unsigned char> of_first, of_second;
  for (int k = 0; k < 6; ++k) {
    REQUIRE(first.step(0.01).advanced());
    REQUIRE(thick.step(0.01).advanced());
    REQUIRE(weak.step(0.005).advanced());
    REQUIRE(second.step(0.01).advanced());
  }
  for (const auto* simulator : {&first, &second}) {
    CHECK((simulator->fluid().position.array() == alone.fluid().position.array()).all());
    CHECK((simulator->fluid().velocity.array() == alone.fluid().velocity.array()).all());
  }
}

TEMPLATE_TEST_CASE("determinism: every bundle of parts runs", "", DefaultParts<float>, DefaultParts<double>,
                   CapillaryParts<float>, ThickLiquidParts<float>, StateEquationParts<float>, PositionBasedParts<float>,
                   PositionBasedParts<double>, Schenck2017Parts<float>, WendlandParts<float>, MuellerParts<float>,
                   TreeParts<float>, BruteParts<float>) {
  auto simulator = splash<TestType>(1, 6);
  const double mass_of_one = 998.2 * std::pow(0.006, 3);
  for (int k = 0; k < 5; ++k) {
    const StepReport report = simulator.step(0.01);
    INFO(to_string(report.status));
    REQUIRE(report.advanced());
    CHECK(report.lost == 0);
    CHECK(report.particles == simulator.fluid().size());
    CHECK(report.particles >= 216);
    CHECK(static_cast<double>(simulator.fluid().mass.sum()) ==
          Approx(mass_of_one * static_cast<double>(report.particles)).epsilon(1e-5));
    CHECK(report.volume == Approx(std::pow(0.006, 3) * static_cast<double>(report.particles)).epsilon(1e-5));
  }
  CHECK(simulator.time() == Approx(0.05));
  CHECK(simulator.fluid().position.allFinite());
  CHECK(simulator.fluid().velocity.allFinite());
  // the box is closed: all liquid is in it
  const Pose from_world = simulator.bodies()[0].motion.at(simulator.time()).inverse();
  for (Index i = 0; i < simulator.fluid().size(); ++i) {
    const Vector3<double> x = from_world * Vector3<double>(simulator.fluid().position.col(i).template cast<double>());
    REQUIRE((x.array() > -1e-6).all());
    REQUIRE((x.array() < Vector3<double>(0.12, 0.0601, 0.12).array() + 1e-6).all());
  }
}

TEST_CASE("determinism: all searches find the same neighbours and the same densities") {
  auto grid = splash<DefaultParts<float>>(1, 6);
  auto tree = splash<TreeParts<float>>(1, 6);
  auto brute = splash<BruteParts<float>>(1, 6);
  REQUIRE(grid.step(0.002).advanced());
  REQUIRE(tree.step(0.002).advanced());
  REQUIRE(brute.step(0.002).advanced());
  const auto by_id = [](const auto& fluid) {
    std::vector<float> density(static_cast<std::size_t>(fluid.size()));
    for (Index i = 0; i < fluid.size(); ++i) {
      density[fluid.id[i]] = fluid.density[i];
    }
    return density;
  };
  const auto a = by_id(grid.fluid()), b = by_id(tree.fluid()), c = by_id(brute.fluid());
  REQUIRE(a.size() == b.size());
  REQUIRE(a.size() == c.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    // sums in another order
    REQUIRE(a[i] == Approx(b[i]).epsilon(1e-5));
    REQUIRE(a[i] == Approx(c[i]).epsilon(1e-5));
  }
}
