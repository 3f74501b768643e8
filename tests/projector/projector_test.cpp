// SPDX-License-Identifier: MIT
#include <decant/testing/projector.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include <decant/projector/disc_splat.hpp>
#include <decant/projector/projected_sphere.hpp>

#include "catch.hpp"

namespace {

using namespace decant;

// A projector of a user's own: each particle is a point. Faults are what the laws have to notice.
template <int Fault = 0>
struct Points {
  using Scalar = double;
  PixelBox render(const ConstPointsView<double>& position, std::span<const std::uint8_t> hidden,
                  const PinholeCamera& camera, const Pose& camera_from_world, ImageView<float> coverage,
                  Threads threads) noexcept {
    if (Fault != 1) {
      coverage.setZero();
    }
    for (Index i = 0; i < position.cols(); ++i) {
      const Projection seen = camera.project(camera_from_world * Vector3<double>(position.col(i)));
      const bool shown = hidden.empty() || hidden[static_cast<std::size_t>(i)] == 0 || (Fault == 2 && i % 2 == 0);
      if (shown && (seen.visible || Fault == 3)) {
        const auto u = static_cast<Index>(std::lround(seen.pixel.x())),
                   v = static_cast<Index>(std::lround(seen.pixel.y()));
        if (Fault != 3 || inside_image(seen.pixel, camera.width(), camera.height())) {
          coverage(v, u) += Fault == 4 ? -1.0f : Fault == 5 ? 0.9f : 1.0f;
        }
      }
    }
    if (Fault == 6) {
      coverage(0, 0) += static_cast<float>(threads.count);
    }
    if (Fault == 7) {
      coverage(0, 0) += static_cast<float>(++calls);
    }
    return Fault == 8 ? PixelBox{10, 10, 20, 20} : PixelBox::of(coverage);
  }
  int calls = 0;
};
static_assert(Projector<Points<>, PinholeCamera>);

template <class P>
int broken_laws(const P& projector) {
  int broken = 0;
  for (const auto& law : testing::projector_laws(projector)) {
    broken += law.holds() ? 0 : 1;
  }
  return broken;
}

}  // namespace

TEMPLATE_TEST_CASE("Every projector keeps the laws of its concept", "", DiscSplat<float>, DiscSplat<double>,
                   ProjectedSphere<float>, ProjectedSphere<double>) {
  for (const double radius : {0.002, 0.0033, 0.01}) {
    for (const auto& law : testing::projector_laws(TestType(radius))) {
      INFO("radius " << radius << " m: " << law.text());
      CHECK(law.holds());
    }
  }
}

TEST_CASE("The laws notice what is wrong with a projector") {
  CHECK(broken_laws(Points<0>{}) == 0);
  CHECK(broken_laws(Points<1>{}) > 0);
  CHECK(broken_laws(Points<2>{}) > 0);
  CHECK(broken_laws(Points<3>{}) > 0);
  CHECK(broken_laws(Points<4>{}) > 0);
  CHECK(broken_laws(Points<5>{}) > 0);
  CHECK(broken_laws(Points<6>{}) > 0);
  CHECK(broken_laws(Points<7>{}) > 0);
  CHECK(broken_laws(Points<8>{}) > 0);
}
