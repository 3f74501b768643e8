// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a Boundary.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <decant/boundary/concept.hpp>
#include <decant/boundary/wall_state.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Tries the laws of a boundary around places of liquid.
/// @param bodies with all bodies added; they are held where they are at time 0. Copied.
/// @param inside 3xN [m], N > 0, where liquid may be; some of it near walls.
/// @param reach [m], how far a particle is thrown from each place in each direction to see whether walls hold it.
template <class Kernel, class Bodies>
std::vector<Law> boundary_laws(Bodies bodies, const PointArray<typename Bodies::Scalar>& inside, double spacing,
                               double reach) {
  static_assert(Boundary<Bodies, Kernel>);
  using Scalar = typename Bodies::Scalar;
  using Point = Vector3<Scalar>;
  const Index count = inside.cols();
  bodies.set_interval(0, 0);
  const auto sampled = [&](const PointArray<Scalar>& position, int threads) {
    WallState<Scalar> walls;
    bodies.sample(position, spacing, {threads}, walls);
    return walls;
  };
  const WallState<Scalar> walls = sampled(inside, 1);
  const bool sized = walls.share.count() == count && walls.gradient.count() == count && walls.moment.count() == count &&
                     walls.flux.count() == count && walls.distance.count() == count &&
                     walls.contact_count.count() == count;
  if (!sized || count == 0) {
    return {{"every array has an entry per particle, and there are particles (1 if not)", 1, 0}};
  }
  // over which gradients are compared [1/m]
  const double steepest = std::max(static_cast<double>(walls.gradient.colwise().norm().maxCoeff()), 1e-30);

  const bool finite =
      walls.share.allFinite() && walls.gradient.allFinite() && walls.moment.allFinite() && walls.flux.allFinite();
  double touching = 0, not_zero = 0, not_the_sum = 0, moving = 0;
  for (Index i = 0; i < count; ++i) {
    Point sum = Point::Zero();
    for (int k = 0; k < walls.contact_count[i]; ++k) {
      sum += walls.contacts_of(i)[k].gradient;
    }
    not_the_sum = std::max(not_the_sum, static_cast<double>((sum - walls.gradient.col(i)).norm()) / steepest);
    touching += walls.contact_count[i] > 0 ? 1 : 0;
    if (walls.contact_count[i] == 0) {
      not_zero += walls.share[i] == 0 && walls.gradient.col(i).isZero(0) ? 0 : 1;
    }
    moving += walls.flux[i] == 0 ? 0 : 1;
  }

  double differ = 0;
  for (const int threads : {2, 4}) {
    const WallState<Scalar> again = sampled(inside, threads);
    const bool alike = again.share.count() == count && again.gradient.count() == count &&
                       again.distance.count() == count && again.share == walls.share &&
                       again.gradient == walls.gradient && again.distance == walls.distance;
    differ += alike ? 0 : 1;
  }

  // Differences over a tenth of a spacing: wider than what looked-up walls vary by from cell to cell. The median, since
  // at edges and where walls meet the share has a kink.
  const Scalar width = static_cast<Scalar>(0.05 * spacing);
  PointArray<Scalar> slope(3, count);
  for (int axis = 0; axis < 3; ++axis) {
    PointArray<Scalar> ahead = inside, back = inside;
    ahead.row(axis).array() += width;
    back.row(axis).array() -= width;
    slope.row(axis) = ((sampled(ahead, 1).share - sampled(back, 1).share) / (2 * width)).transpose();
  }
  std::vector<double> errors;
  for (Index i = 0; i < count; ++i) {
    const double length = static_cast<double>(walls.gradient.col(i).norm());
    if (length > 0.1 * steepest) {
      errors.push_back(static_cast<double>((slope.col(i) - walls.gradient.col(i)).norm()) / length);
    }
  }
  double median = 0;
  if (!errors.empty()) {
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    median = *middle;
  }

  // Steps that stay and steps that leave: who has passed a wall, or was touched without a reason?
  double passed = 0, disturbed = 0, one_sided = 0;
  const double clearance = 0.1 * spacing;
  for (int direction = 0; direction < 7; ++direction) {
    Point step = Point::Zero();
    if (direction > 0) {
      step[(direction - 1) / 2] = static_cast<Scalar>(direction % 2 == 0 ? reach : -reach);
    }
    FluidState<Scalar> fluid;
    fluid.resize(count);
    fluid.position = inside.colwise() + step;
    fluid.velocity.setZero();
    const GuardReport report = bodies.guard(inside, clearance, {1}, walls, fluid);
    passed += static_cast<double>(report.lost);
    for (Index i = 0; i < count; ++i) {
      const Point from = inside.col(i), to = fluid.position.col(i), wanted = from + step;
      const auto between = [&](const Point& a, const Point& b) {
        return bodies.separated(a, b, walls.contacts_of(i), walls.contact_count[i]);
      };
      passed += between(from, to) ? 1 : 0;
      one_sided += between(from, wanted) == between(wanted, from) ? 0 : 1;
      const bool roomy = 0.9 * static_cast<double>(walls.distance[i]) > clearance;
      disturbed += direction == 0 && roomy && to != from ? 1 : 0;
    }
  }

  // 0.03: meshes and boundary particles, whose walls are looked up or sums over points, are off by 0.01
  return {
      {"share, gradient, moment and flux are finite (1 if not)", finite ? 0.0 : 1.0, 0},
      {"some place given is near a wall (1 if not)", touching > 0 ? 0.0 : 1.0, 0},
      {"without a contact share and gradient are zero (particles)", not_zero, 0},
      {"the gradient is the sum of the contacts', over the largest", not_the_sum, 1e-5},
      {"bodies that stand have no flux (particles)", moving, 0},
      {"the same bits with 1, 2 and 4 threads (numbers of threads that differ)", differ, 0},
      {"the gradient is the share's, median of the error over the gradient", median, 0.03},
      {"walls hold what is thrown at them (particles that passed)", passed, 0},
      {"what stays off the walls is left alone (particles moved)", disturbed, 0},
      {"a wall between a and b is one between b and a (pairs)", one_sided, 0},
  };
}

}  // namespace decant::inline DECANT_TARGET::testing
