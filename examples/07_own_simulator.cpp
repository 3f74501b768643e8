// SPDX-License-Identifier: MIT
// Somebody else's simulator under decant's Tracker and correctors: droplets that keep their places in arrays of
// their own, pulled by gravity alone. The real ones are slowed down by the air; the camera makes up for it.

#include <cmath>
#include <cstdio>
#include <vector>

#include <decant/decant.hpp>

/// The foreign code: x, y, z, x, y, z, ... and a clock.
struct Droplets {
  std::vector<float> place, speed;
  double clock = 0;
  void advance(double seconds, double drag) {
    for (std::size_t k = 0; k < place.size(); ++k) {
      const double pull = (k % 3 == 2 ? -9.81 : 0.0) - drag * static_cast<double>(speed[k]);
      speed[k] += static_cast<float>(pull * seconds);
      place[k] += static_cast<float>(seconds) * speed[k];
    }
    clock += seconds;
  }
};

/// What it takes to track it, see decant::LiquidModel.
class TrackedDroplets {
 public:
  using Scalar = float;
  struct Report {
    bool advanced() const { return true; }
  };

  explicit TrackedDroplets(Droplets droplets) : droplets_(std::move(droplets)) {
    fluid_.resize(static_cast<decant::Index>(droplets_.place.size() / 3));
    take_over();
  }
  decant::FluidState<float>& fluid() { return fluid_; }
  double time() const { return droplets_.clock; }
  double spacing() const { return 0.006; }
  const decant::RigidBodies<float>& bodies() const { return bodies_; }
  void move_body(decant::BodyId, const decant::Pose&, double) {}  // there is none
  Report step(double duration) {
    // what a corrector changed goes back first
    decant::PointArray<float>::Map(droplets_.place.data(), 3, fluid_.size()) = fluid_.position;
    decant::PointArray<float>::Map(droplets_.speed.data(), 3, fluid_.size()) = fluid_.velocity;
    droplets_.advance(duration, 0);
    take_over();
    return {};
  }

 private:
  void take_over() {
    fluid_.position = decant::PointArray<float>::Map(droplets_.place.data(), 3, fluid_.size());
    fluid_.velocity = decant::PointArray<float>::Map(droplets_.speed.data(), 3, fluid_.size());
  }
  Droplets droplets_;
  decant::FluidState<float> fluid_;
  decant::RigidBodies<float> bodies_;
};
static_assert(decant::LiquidModel<TrackedDroplets>);

int main() {
  using namespace decant;
  Droplets reality;
  for (int k = 0; k < 400; ++k) {
    for (double x : {0.006 * (k % 10) - 0.03, 0.006 * (k / 100) - 0.012, 0.006 * (k / 10 % 10) + 0.12}) {
      reality.place.push_back(static_cast<float>(x));
    }
  }
  reality.speed.assign(reality.place.size(), 0);
  Tracker<TrackedDroplets, TransportCorrector<>> tracker{TrackedDroplets(reality)};
  Tracker<TrackedDroplets, OpenLoop<>> alone{TrackedDroplets(reality)};
  Matrix3<double> axes;  // looks along the world's y
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const PinholeCamera camera(500, 500, 159.5, 159.5, 320, 320);
  const Pose camera_from_world{Eigen::Quaterniond(axes), {0, 0, 0.5}};
  tracker.add_camera({camera, {}}, camera_from_world);
  alone.add_camera({camera, {}}, camera_from_world);
  Mask mask(320, 320);
  Silhouette<> seen(DiscSplat<float>(0.004));
  double closed = 0, open = 0;
  for (int frame = 1; frame <= 7; ++frame) {
    reality.advance(1.0 / 30, 4);
    const Eigen::Map<const PointArray<float>> places(reality.place.data(), 3, 400);
    seen.render(places, {}, camera, camera_from_world, mask);
    const std::vector<CameraMask> masks{{0, mask}};
    closed = tracker.track({frame / 30.0, {}, masks}).posterior.iou();
    open = alone.track({frame / 30.0, {}, masks}).posterior.iou();
  }
  std::printf("overlap of what is simulated with what is seen: %.2f, without correction %.2f\n", closed, open);
  return closed > 0.85 && open < 0.5 ? 0 : 1;
}
