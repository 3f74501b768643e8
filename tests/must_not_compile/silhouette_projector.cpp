// SPDX-License-Identifier: MIT
// A projector that forgets noexcept, in a silhouette.
// expect: Silhouette's projector must model decant::Projector, see <decant/projector/concept.hpp>
// expect: render
#include <decant/projector/silhouette.hpp>

struct MyProjector {
  using Scalar = float;
#ifdef DECANT_TWIN
  decant::PixelBox render(const decant::ConstPointsView<float>&, std::span<const std::uint8_t>,
                          const decant::PinholeCamera&, const decant::Pose&, decant::ImageView<float> coverage,
                          decant::Threads) noexcept {
#else
  decant::PixelBox render(const decant::ConstPointsView<float>&, std::span<const std::uint8_t>,
                          const decant::PinholeCamera&, const decant::Pose&, decant::ImageView<float> coverage,
                          decant::Threads) {
#endif
    coverage.setZero();
    return {};
  }
};

inline decant::PixelBox draw(decant::Silhouette<MyProjector>& silhouette, const decant::PinholeCamera& camera,
                             decant::MaskView mask) {
  return silhouette.render(decant::PointArray<float>(3, 0), {}, camera, {}, mask);
}
