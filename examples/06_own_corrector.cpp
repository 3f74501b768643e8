// SPDX-License-Identifier: MIT
// A corrector of one's own, under the Tracker: it moves all liquid that a camera sees by what the middle of the
// silhouette is off. A drop that wind carries away is followed by a simulation that knows of no wind.

#include <cmath>
#include <cstdio>
#include <vector>

#include <decant/decant.hpp>

struct MiddleCorrector {
  using Scalar = float;
  using Observation = decant::Silhouettes<decant::DistortedPinholeCamera>;

  static Eigen::Vector2d middle(const decant::Mask& mask) noexcept {
    Eigen::Vector3d sum(0, 0, 0);
    for (decant::Index v = 0; v < mask.rows(); ++v) {
      for (decant::Index u = 0; u < mask.cols(); ++u) {
        if (decant::is_liquid(mask(v, u)))
          sum += Eigen::Vector3d(static_cast<double>(u), static_cast<double>(v), 1);
      }
    }
    return sum.z() > 0 ? Eigen::Vector2d(sum.head<2>() / sum.z()) : Eigen::Vector2d::Constant(std::nan(""));
  }
  void reset() noexcept {}
  decant::CorrectionReport correct(decant::FluidState<float>& fluid, const Observation& seen, float dt) noexcept {
    decant::CorrectionReport report;
    const auto& view = seen.views.front();
    const Eigen::Vector2d off = middle(*view.observed) - middle(*view.predicted);
    for (decant::Index i = 0; i < fluid.size() && off.allFinite(); ++i) {
      const decant::Vector3<double> x = fluid.position.col(i).cast<double>();
      const decant::Projection at = view.camera().project(x);
      if (at.visible && view.hidden[static_cast<std::size_t>(i)] == 0) {
        const decant::Vector3<float> move = (view.camera().unproject(at.pixel + off, at.depth) - x).cast<float>();
        fluid.position.col(i) += move;
        fluid.velocity.col(i) += 0.5f / dt * move;
        ++report.moved;
      }
    }
    return report;
  }
};
static_assert(decant::Corrector<MiddleCorrector>);

int main() {
  using namespace decant;
  const double d = 0.005, wind = 3;  // [m], [m/s^2]
  const auto drop = [&](double side, double height) {
    PointArray<float> x(3, 216);
    for (int i = 0; i < 216; ++i) {
      x.col(i) << static_cast<float>(d * (i % 6) + side), static_cast<float>(d * (i / 6 % 6)),
          static_cast<float>(d * (i / 36) + height);
    }
    return x;
  };
  SimulatorSettings settings;
  settings.spacing = d;
  LiquidSimulator model(settings);
  model.add_particles(drop(0, 0.1), PointArray<float>::Zero(3, 216), 0);
  Tracker<LiquidSimulator, MiddleCorrector> tracker(model);
  Matrix3<double> axes;  // looks along the world's y, from half a metre before the drop
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const PinholeCamera camera(500, 500, 159.5, 119.5, 320, 240);
  const Pose camera_from_world{Eigen::Quaterniond(axes), {0, 0, 0.5}};
  tracker.add_camera({camera, {}}, camera_from_world);

  Mask mask(240, 320);
  Silhouette<> reality(DiscSplat<float>(0.66 * d));
  for (int frame = 1; frame <= 5; ++frame) {
    const double t = frame / 30.0;
    reality.render(drop(0.5 * wind * t * t, 0.1 - 0.5 * 9.81 * t * t), {}, camera, camera_from_world, mask);
    const std::vector<CameraMask> masks{{0, mask}};
    if (!tracker.track({t, {}, masks}).advanced())
      return 1;
  }
  const double t = tracker.model().time(), truth = 0.5 * wind * t * t + 2.5 * d;
  const double tracked = tracker.model().fluid().position.row(0).mean();
  std::printf("the drop is at %.1f mm, the tracked one at %.1f mm, without a camera at %.1f mm\n", 1e3 * truth,
              1e3 * tracked, 2.5e3 * d);
  return std::abs(tracked - truth) < 0.003 ? 0 : 1;
}
