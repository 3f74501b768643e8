// SPDX-License-Identifier: MIT
// No allocation per frame once the largest number of particles and the image's size have been seen.

#include <decant/projector/projected_sphere.hpp>
#include <decant/projector/silhouette.hpp>

#include <random>

#include "allocation_count.hpp"
#include "cameras.hpp"
#include "catch.hpp"

using namespace decant;

namespace {

// Liquid that is spread ever wider, over ever fewer particles: the image fills, numbers do not grow.
template <class P, class Camera>
long allocations_after_first_frame(const Camera& camera, int threads) {
  Silhouette<P> silhouette(P(0.004));
  Mask mask(camera.height(), camera.width());
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> place(-0.05, 0.05);
  PointArray<typename P::Scalar> position(3, 2000);
  long counted = 0;
  for (int frame = 0; frame < 6; ++frame) {
    for (Index i = 0; i < position.cols(); ++i) {
      position.col(i) = (Vector3<double>(place(generator), place(generator), 0.2) * (1 + 0.2 * frame))
                            .template cast<typename P::Scalar>();
    }
    decant_test::allocations = 0;
    decant_test::watching = frame > 0;
    silhouette.render(position.leftCols(2000 - 300 * frame), {}, camera, {}, mask, Threads{threads});
    decant_test::watching = false;
    counted += decant_test::allocations;
  }
  REQUIRE((mask > 0).any());
  return counted;
}

}  // namespace

TEST_CASE("allocation: none per frame in projectors and silhouettes") {
  const PinholeCamera pinhole(300, 300, 80, 60, 160, 120);
  for (const int threads : {1, 2}) {
    INFO("threads " << threads);
    CHECK(allocations_after_first_frame<DiscSplat<float>>(pinhole, threads) == 0);
    CHECK(allocations_after_first_frame<ProjectedSphere<float>>(pinhole, threads) == 0);
    CHECK(allocations_after_first_frame<ProjectedSphere<double>>(decant_test::ForeignPinhole{pinhole}, threads) == 0);
  }
}
