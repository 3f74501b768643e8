// SPDX-License-Identifier: MIT
// No allocation in the frame loop after warm-up.

#include <decant/simulation/simulator.hpp>

#include <numeric>
#include <vector>

#include <decant/boundary/shapes.hpp>

#include "allocation_count.hpp"
#include "catch.hpp"
#include "scene.hpp"

using namespace decant;
using decant_test::allocations;
using decant_test::block;
using decant_test::watching;
using decant_test::with_spacing;

namespace {

// A block of liquid that has come to rest in a box which then rocks gently, so that numbers of neighbours stay alike.
template <class Parts>
std::vector<long> allocations_per_frame(int threads, int warm_up, int frames, int layers = 7) {
  using Scalar = typename Parts::Scalar;
  constexpr double spacing = 0.006;  // [m]
  Simulator<Parts> simulator(with_spacing(spacing, threads));
  const BodyId box =
      simulator.add_body("box", BoxInside{{0, 0, 0}, {0.06, 0.06, 0.08}, 0.002, {}}, decant_test::rocking(4, 7));
  simulator.add_body("post", TriangleMesh(Cylinder{0.008, 0.1}.mesh()),
                     PoseTrack(Pose{Eigen::Quaterniond::Identity(), {0.03, 0.03, -0.1}}));
  const auto x = block<Scalar>(10, 10, layers, spacing);
  const Index n = x.cols();
  simulator.add_particles(x, PointArray<Scalar>::Zero(3, n), 0);
  simulator.watch_contents(box);
  std::vector<long> counts;
  for (int k = 0; k < warm_up + frames; ++k) {
    allocations = 0;
    watching = true;
    const StepReport report = simulator.step(0.01);
    watching = false;
    const long count = allocations;
    REQUIRE(report.advanced());
    REQUIRE(report.contents[0].particles == n);
    if (k >= warm_up) {
      counts.push_back(count);
    }
  }
  return counts;
}

long total(const std::vector<long>& counts) { return std::accumulate(counts.begin(), counts.end(), 0L); }

}  // namespace

TEST_CASE("allocation: the counter counts") {
  allocations = 0;
  watching = true;
  delete new std::vector<int>(10);
  watching = false;
  CHECK(allocations >= DECANT_TEST_COUNTS_ALLOCATIONS);
#if defined(DECANT_TEST_COUNTS_MALLOC)
  const Index large = 1000 + allocations;  // not known to the compiler, which else would leave the array out
  allocations = 0;
  watching = true;
  const PointArray<float> array = PointArray<float>::Zero(3, large);
  watching = false;
  CHECK(array(0, large - 1) == 0);
  CHECK(allocations == 1);
#endif
}

TEMPLATE_TEST_CASE("allocation: none in the frame loop after warm-up", "", DefaultParts<float>, DefaultParts<double>,
                   PositionBasedParts<float>, ThickLiquidParts<float>, StateEquationParts<float>, CapillaryParts<float>,
                   Schenck2017Parts<float>) {
  // one swing of the box to warm up: storage grows with the largest number of neighbours seen
  CHECK(total(allocations_per_frame<TestType>(1, 100, 30)) == 0);
}

TEST_CASE("allocation: none with two threads") {
  static_assert(10 * 10 * 11 >= 2 * least_per_thread);  // else one of them would do everything
  CHECK(total(allocations_per_frame<DefaultParts<float>>(2, 100, 30, 11)) == 0);
}

TEST_CASE("allocation: none while liquid goes out, but for the accelerations of fewer particles") {
  constexpr double spacing = 0.006;  // [m]
  const bool goes_on = GENERATE(true, false);
  LiquidSimulator simulator(with_spacing(spacing));
  // a box whose hole leads into a larger one around it, so that nothing falls away for good
  const BodyId box = simulator.add_body("box", BoxInside{{0, 0, 0}, {0.06, 0.06, 0.08}, 0.002, {}});
  simulator.add_body("tray", BoxInside{{-0.03, -0.03, -0.04}, {0.09, 0.09, 0.12}, 0.002, {}});
  const auto x = block<float>(10, 10, 7, spacing);
  simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), 0);
  OutletSettings outlet;
  outlet.body = box;
  outlet.position = {0.03, 0.03, 0};
  outlet.flow = {{0, 2e-5}, {2, 2e-5}};
  if (goes_on) {
    outlet.exit = {0.03, 0.03, -0.008};
  } else {
    outlet.radius = 1;
    outlet.order = OutletOrder::Evenly;
  }
  simulator.add_outlet(outlet);
  StepReport report;
  for (int k = 0; k < 100; ++k) {
    const Index before = simulator.fluid().size();
    allocations = 0;
    watching = true;
    report = simulator.step(0.01);
    watching = false;
    const long count = allocations;
    REQUIRE(report.advanced());
    if (k >= 60) {
      // force terms are given an array of the size that they fill (force/concept.hpp): one for each that is gone
      REQUIRE(count <= before - report.particles);
    }
  }
  CHECK(report.drained > 1.9e-5);
  CHECK((report.particles == x.cols()) == goes_on);
}
