// SPDX-License-Identifier: MIT
// A simulation of one's own that does not say how far its particles are apart.
// expect: Tracker: Model must model decant::LiquidModel, see <decant/tracking/liquid_model.hpp>
// expect: asked.spacing()
#include <memory>
#include <vector>

#include <decant/correction/open_loop.hpp>
#include <decant/tracking/tracker.hpp>

struct Body {
  std::shared_ptr<const decant::BoundingVolumeHierarchy> surface;
  decant::PoseTrack motion;
};
struct Stepped {
  bool advanced() const noexcept { return true; }
};
struct Puddle {
  using Scalar = float;
  decant::FluidState<float>& fluid() { return state; }
  double time() const { return 0; }
#ifdef DECANT_TWIN
  double spacing() const { return 0.005; }
#endif
  const std::vector<Body>& bodies() const { return all; }
  void move_body(decant::BodyId, const decant::Pose&, double) {}
  Stepped step(double) { return {}; }

  decant::FluidState<float> state;
  std::vector<Body> all;
};

static_assert(sizeof(decant::Tracker<Puddle, decant::OpenLoop<>>) > 0);
