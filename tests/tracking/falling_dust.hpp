// SPDX-License-Identifier: MIT
#pragma once

/// Somebody else's simulations, as small as they can be: what trackers are tried on.

#include <memory>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/tracking/liquid_model.hpp>

#include "correction/seen.hpp"

namespace decant_test {

/// Somebody else's simulation: particles that fall, and one body that is not in their way.
struct FallingDust {
  using Scalar = double;
  struct Body {
    std::shared_ptr<const decant::BoundingVolumeHierarchy> surface;
    decant::PoseTrack motion;
  };
  struct Report {
    bool went_well = true;
    bool advanced() const { return went_well; }
  };

  decant::FluidState<double> dust = liquid_block<double>({0, 0, 0});
  std::vector<Body> scene{{std::make_shared<const decant::BoundingVolumeHierarchy>(
                               decant::Box{{-0.05, -0.05, -0.2}, {0.05, 0.05, -0.19}}.mesh()),
                           decant::PoseTrack()}};
  double now = 0;
  double gravity = -1;  // [m/s^2]
  bool broken = false;

  decant::FluidState<double>& fluid() { return dust; }
  double time() const { return now; }
  double spacing() const { return block_spacing; }
  const std::vector<Body>& bodies() const { return scene; }
  void move_body(decant::BodyId body, const decant::Pose& pose, double duration) {
    scene[body].motion = decant::PoseTrack({{now, scene[body].motion.at(now)}, {now + duration, pose}});
  }
  Report step(double duration) {
    if (broken) {
      return {false};
    }
    now += duration;
    dust.velocity.row(2).array() += gravity * duration;
    dust.position += duration * dust.velocity;
    return {};
  }
};

/// The same, but the particles stick to the body.
struct CarriedDust : FallingDust {
  Report step(double duration) {
    const decant::Pose before = scene[0].motion.at(now);
    now += duration;
    const decant::Pose after = scene[0].motion.at(now);
    for (decant::Index i = 0; i < dust.size(); ++i) {
      dust.position.col(i) = after * (before.inverse() * decant::Vector3<double>(dust.position.col(i)));
    }
    return {};
  }
};
static_assert(decant::LiquidModel<CarriedDust>);

/// What a camera before the block sees of a liquid, raw.
template <class Scalar>
decant::Mask seen(const decant::FluidState<Scalar>& fluid) {
  Eye<Scalar> eye(before_the_block());
  eye.observe(fluid);
  return eye.observed;
}

}  // namespace decant_test
