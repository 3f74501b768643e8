// SPDX-License-Identifier: MIT
// A boundary without guard in a bundle of parts.
// expect: Parts::Boundary must model decant::Boundary, see <decant/boundary/concept.hpp>
// expect: built.guard(
#include <string>

#include <decant/simulation/simulator.hpp>

struct NoWalls {
  using Scalar = double;
  struct Body {
    decant::PoseTrack motion;
    Eigen::AlignedBox3d bounds;
  };
  template <class Kernel>
  decant::BodyId add(std::string, decant::BodyShape, decant::PoseTrack, decant::Slip, double, double, decant::Threads) {
    return 0;
  }
  std::size_t size() const noexcept { return 0; }
  const Body& operator[](decant::BodyId) const { return body; }
  void set_motion(decant::BodyId, decant::PoseTrack) {}
  decant::Index push_out(decant::BodyId, double, decant::FluidState<double>&) const { return 0; }
  void set_interval(double, double) noexcept {}
  double largest_relative_speed(const decant::FluidState<double>&, decant::Threads, decant::Reduction<double>&) const noexcept {
    return 0;
  }
  void sample(const decant::ConstPointsView<double>&, double, decant::Threads,
              decant::WallState<double>&) const noexcept {}
  bool separated(const decant::Vector3<double>&, const decant::Vector3<double>&, const decant::WallContact<double>*,
                 int) const noexcept {
    return false;
  }
#ifdef DECANT_TWIN
  decant::GuardReport guard(const decant::ConstPointsView<double>&, double, decant::Threads,
                            const decant::WallState<double>&, decant::FluidState<double>&) const noexcept {
    return {};
  }
#endif
  Body body;
};

struct MyParts : decant::DefaultParts<double> {
  using Boundary = NoWalls;
};
static_assert(sizeof(decant::Simulator<MyParts>) > 0);
