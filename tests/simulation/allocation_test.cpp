// SPDX-License-Identifier: MIT
// No allocation in the frame loop after warm-up.

#include <decant/simulation/simulator.hpp>

#include <cmath>
#include <vector>

#include <decant/boundary/shapes.hpp>

#include "allocation_count.hpp"
#include "catch.hpp"

using namespace decant;
using decant_test::allocations;
using decant_test::watching;

namespace {

// A block of liquid that has come to rest in a box which then rocks gently, so that numbers of neighbours stay alike.
template <class Parts>
std::vector<long> allocations_per_frame(int threads, int warm_up, int frames) {
  using Scalar = typename Parts::Scalar;
  SimulatorSettings settings;
  settings.spacing = 0.006;
  settings.threads = {threads};
  Simulator<Parts> simulator(settings);
  std::vector<PoseTrack::Sample> rocking;
  for (int k = 0; k <= 400; ++k) {
    const double t = 0.01 * k;
    rocking.push_back(
        {t, {Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * std::sin(7 * t), Eigen::Vector3d::UnitY())), {}}});
    rocking.back().pose.translation.setZero();
  }
  const BodyId box = simulator.add_body("box", BoxInside{{0, 0, 0}, {0.06, 0.06, 0.08}, 0.002, {}}, PoseTrack(rocking));
  simulator.add_body("post", TriangleMesh(Cylinder{0.008, 0.1}.mesh()),
                     PoseTrack(Pose{Eigen::Quaterniond::Identity(), {0.03, 0.03, -0.1}}));
  constexpr int side = 10, layers = 7;
  PointArray<Scalar> x(3, side * side * layers);
  Index n = 0;
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      for (int k = 0; k < layers; ++k) {
        x.col(n++) = (settings.spacing * Vector3<double>(i + 0.5, j + 0.5, k + 0.5)).template cast<Scalar>();
      }
    }
  }
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

long total(const std::vector<long>& counts) {
  long sum = 0;
  for (const long count : counts) {
    sum += count;
  }
  return sum;
}

}  // namespace

TEST_CASE("allocation: the counter counts") {
  allocations = 0;
  watching = true;
  delete new std::vector<int>(10);
  watching = false;
  CHECK(allocations >= 1);
}

TEMPLATE_TEST_CASE("allocation: none in the frame loop after warm-up", "", DefaultParts<float>, DefaultParts<double>,
                   PositionBasedParts<float>, ThickLiquidParts<float>) {
  // one swing of the box to warm up: storage grows with the largest number of neighbours seen
  CHECK(total(allocations_per_frame<TestType>(1, 100, 30)) == 0);
}

TEST_CASE("allocation: none with two threads") {
  CHECK(total(allocations_per_frame<DefaultParts<float>>(2, 100, 30)) == 0);
}
