// SPDX-License-Identifier: MIT
// Walls of one's own: the inside of a ball in closed form, half full of water.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include <decant/decant.hpp>

/// A round flask that stands still. It needs no mesh: distance and normal are known everywhere.
struct Flask {
  using Scalar = float;
  double radius = 0.06;  ///< [m], > 0
  struct Body {
    decant::PoseTrack motion{};
    Eigen::AlignedBox3d bounds{};
  };

  template <class Kernel>
  decant::BodyId add(std::string, decant::BodyShape, decant::PoseTrack motion, decant::Slip, double smoothing_length,
                     double spacing, decant::Threads) {
    wall_ = decant::WallFunction::of<Kernel>(smoothing_length, spacing);
    const decant::Vector3<double> corner = decant::Vector3<double>::Constant(radius);
    flask_ = {motion, Eigen::AlignedBox3d(-corner, corner)};
    size_ = 1;
    return 0;
  }
  std::size_t size() const noexcept { return size_; }
  const Body& operator[](decant::BodyId) const { return flask_; }
  void set_motion(decant::BodyId, decant::PoseTrack motion) { flask_.motion = motion; }  // but it stays where it is
  decant::Index push_out(decant::BodyId, double, decant::FluidState<float>&) const { return 0; }
  void set_interval(double, double) noexcept {}
  double largest_relative_speed(const decant::FluidState<float>& fluid, decant::Threads,
                                decant::Reduction<double>&) const noexcept {
    return static_cast<double>(fluid.size() > 0 ? fluid.velocity.colwise().norm().maxCoeff<Eigen::PropagateNaN>() : 0);
  }
  bool separated(const decant::Vector3<float>&, const decant::Vector3<float>&, const decant::WallContact<float>*,
                 int) const noexcept {
    return false;  // all liquid is on one side
  }

  void sample(const decant::ConstPointsView<float>& position, double, decant::Threads threads,
              decant::WallState<float>& walls) const noexcept {
    walls.resize(position.cols());
    decant::parallel_for(position.cols(), threads, [&](decant::Index i) {
      const double from_center = position.col(i).cast<double>().norm(), distance = radius - from_center;
      const bool near = distance < wall_.reach();
      const double slope = near ? wall_.slope(distance) / from_center : 0;
      walls.share[i] = near ? static_cast<float>(wall_.share(distance)) : 0;
      walls.gradient.col(i) = static_cast<float>(slope) * position.col(i);  // outward: into the wall
      const decant::Vector3<float> outward = position.col(i) / static_cast<float>(from_center + 1e-12);
      const decant::Vector3<float> pull = static_cast<float>(slope * from_center * distance) * outward;
      walls.moment.col(i) << pull.x() * outward, pull.y() * outward.tail<2>(), pull.z() * outward.z();
      walls.flux[i] = 0;
      walls.distance[i] = static_cast<float>(std::min(distance, wall_.reach()));
      walls.contact_count[i] = near ? 1 : 0;
      *walls.contacts_of(i) = {};  // a wall without friction, at rest
      walls.contacts_of(i)->gradient = walls.gradient.col(i);
    });
  }

  decant::GuardReport guard(const decant::ConstPointsView<float>&, double clearance, decant::Threads,
                            const decant::WallState<float>&, decant::FluidState<float>& fluid) const noexcept {
    decant::GuardReport report;
    for (decant::Index i = 0; i < fluid.size(); ++i) {
      const float beyond = fluid.position.col(i).norm() - static_cast<float>(radius - clearance);
      if (beyond > 0) {
        const decant::Vector3<float> outward = fluid.position.col(i).normalized();
        fluid.position.col(i) -= beyond * outward;
        fluid.velocity.col(i) -= std::max(0.0f, outward.dot(fluid.velocity.col(i))) * outward;
        ++report.slid;
      }
    }
    return report;
  }

 private:
  decant::WallFunction wall_{};
  Body flask_{};
  std::size_t size_ = 0;
};

struct MyParts : decant::DefaultParts<float> {
  using Boundary = Flask;
};

int main() {
  using namespace decant;
  SimulatorSettings settings;
  settings.spacing = 0.006;  // [m]
  Simulator<MyParts> simulator(settings);
  simulator.add_body("flask", {});
  const double radius = simulator.bodies().radius;
  // a heap in the middle, as much as fills the lower half
  const double half = 2.0 / 3 * 3.14159265 * radius * radius * radius, edge = std::cbrt(half);
  const int count = static_cast<int>(std::round(edge / settings.spacing));
  PointArray<float> heap(3, count * count * count);
  for (int i = 0; i < heap.cols(); ++i) {
    const Vector3<int> place(i % count, i / count % count, i / count / count);
    heap.col(i) = 0.006f * (place.cast<float>().array() + 0.5f * static_cast<float>(1 - count));
  }
  simulator.add_particles(heap, PointArray<float>::Zero(3, heap.cols()), 0);
  for (int frame = 0; frame < 60; ++frame) {
    if (!simulator.step(1.0 / 30).advanced())
      return 1;
  }
  const double volume = static_cast<double>(heap.cols()) * std::pow(settings.spacing, 3);
  const double center = simulator.fluid().position.row(2).mean();
  const double farthest = simulator.fluid().position.colwise().norm().maxCoeff();
  // A half ball's centre of mass is 3 / 8 of its radius below the middle; liquid beyond that adds a layer at the
  // middle.
  const double theory = -3.0 / 8 * radius * half / volume;
  std::printf("centre of mass %.1f mm below the middle, in theory %.1f mm; farthest particle at %.1f of %.1f mm\n",
              -1e3 * center, -1e3 * theory, 1e3 * farthest, 1e3 * radius);
  return std::abs(center - theory) < 0.25 * settings.spacing && farthest < radius ? 0 : 1;
}
