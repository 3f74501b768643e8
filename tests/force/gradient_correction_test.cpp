// SPDX-License-Identifier: MIT
#include <decant/force/gradient_correction.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <decant/boundary/wall_function.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::Vector3;
using namespace decant::testing;

namespace {

using Matrix = Eigen::Matrix3d;

/// sum_j V_j (v_j - v_i) (C grad W_ij)^T, the gradient of a velocity as SPH sees it; C = 1 or the correction.
template <class Kernel>
Matrix velocity_gradient(const LooseLiquid<Kernel>& liquid, Index i, bool corrected) {
  using Scalar = typename Kernel::Scalar;
  Matrix result = Matrix::Zero();
  liquid.neighbors.for_each(i, [&](Index j, const Vector3<Scalar>& apart, Scalar r_squared) {
    const Vector3<Scalar> slope = Kernel::derivative_over_radius(std::sqrt(r_squared), liquid.smoothing_length) * apart;
    const Vector3<Scalar> gradient = corrected ? liquid.correction.apply(i, slope) : slope;
    const Vector3<Scalar> difference = liquid.fluid.velocity.col(j) - liquid.fluid.velocity.col(i);
    result += static_cast<double>(liquid.fluid.mass[j] / liquid.rest_density) * difference.template cast<double>() *
              gradient.template cast<double>().transpose();
  });
  return result;
}

template <class Kernel>
LooseLiquid<Kernel> ball_in_linear_flow(const Matrix& flow) {
  using Scalar = typename Kernel::Scalar;
  auto liquid = loose_ball<Kernel>(Scalar(0.005), 6, 0.15, 0);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) =
        (flow * liquid.fluid.position.col(i).template cast<double>()).template cast<Scalar>();
  }
  return liquid;
}

}  // namespace

TEMPLATE_TEST_CASE("GradientCorrection: the gradient of a linear velocity is exact among disordered particles", "",
                   float, double) {
  Matrix flow;
  flow << 1, 2, -0.5, 0.3, -2, 1, 0.7, -1, 1.5;
  const auto liquid = ball_in_linear_flow<CubicSpline<TestType>>(flow);
  double worst = 0, worst_plain = 0;
  int inside = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    if (liquid.fluid.position.col(i).norm() < TestType(3.5) * liquid.spacing) {
      ++inside;
      worst = std::max(worst, (velocity_gradient(liquid, i, true) - flow).norm() / flow.norm());
      worst_plain = std::max(worst_plain, (velocity_gradient(liquid, i, false) - flow).norm() / flow.norm());
    }
  }
  CHECK(inside > 100);
  CHECK(worst < 3e-3);        // the series is cut at the fourth power of what is amiss, here at most 0.22
  CHECK(worst_plain > 0.05);  // so there was something to correct
}

TEMPLATE_TEST_CASE("GradientCorrection: turning as one body has no divergence anywhere", "", float, double) {
  Matrix turn;
  turn << 0, -3, 2, 3, 0, -1, -2, 1, 0;
  const auto liquid = ball_in_linear_flow<decant::WendlandC2<TestType>>(turn);
  double worst = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    worst = std::max(worst, std::abs(velocity_gradient(liquid, i, true).trace()));
  }
  CHECK(worst < 1e3 * static_cast<double>(std::numeric_limits<TestType>::epsilon()));
}

TEMPLATE_TEST_CASE("GradientCorrection: particles alone, in pairs and at one place stay finite", "", float, double) {
  LooseLiquid<CubicSpline<TestType>> liquid;
  decant::PointArray<TestType> places(3, 6);
  places.setZero();
  places.col(1) << 1, 0, 0;  // alone
  places.col(2) << 2, 0, 0;  // a pair
  places.col(3) << TestType(2.004), 0, 0;
  places.col(4) << 3, 0, 0;  // two at one place
  places.col(5) << 3, 0, 0;
  liquid.place(places);
  for (Index i = 0; i < 6; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3<TestType> image = liquid.correction.apply(i, Vector3<TestType>::Unit(axis));
      CHECK(image.allFinite());
      CHECK(image.norm() <= TestType(4.001));
    }
  }
}

TEST_CASE("GradientCorrection: liquid crushed to many times its density keeps a positive correction") {
  using Kernel = CubicSpline<double>;
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0);
  liquid.place(0.5 * liquid.fluid.position);  // eight times as dense
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3<double> unit = Vector3<double>::Unit(axis);
      CHECK(unit.dot(liquid.correction.apply(i, unit)) > 0);
    }
  }
}

TEST_CASE("GradientCorrection: beside a wall the divergence of flow along and toward it is exact") {
  // liquid on a floor at z = 0; the wall's share is that of WallFunction at the layer's distance
  using Kernel = CubicSpline<double>;
  const double d = 0.005;
  const auto wall = decant::WallFunction::of<Kernel>(d, d);
  auto liquid = loose_ball<Kernel>(d, 6, 0, 0);
  std::vector<Vector3<double>> above;
  for (int i = -6; i <= 6; ++i) {
    for (int j = -6; j <= 6; ++j) {
      for (int k = 0; k < 6; ++k) {
        above.emplace_back(i * d, j * d, (k + 0.5) * d);
      }
    }
  }
  decant::PointArray<double> places(3, static_cast<Index>(above.size()));
  for (std::size_t k = 0; k < above.size(); ++k) {
    places.col(static_cast<Index>(k)) = above[k];
  }
  liquid.place(places);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const double height = places(2, i);
    auto& contact = *liquid.walls.contacts_of(i);
    liquid.walls.contact_count[i] = height < wall.reach() ? 1 : 0;
    contact.gradient = Vector3<double>(0, 0, -wall.slope(height));
    liquid.walls.moment(5, i) = wall.slope(height) * height;
  }
  liquid.correction.compute(liquid.view());
  Matrix flow = Matrix::Zero();
  flow.diagonal() << 2, 0.5, -3;  // no flow through z = 0
  int beside = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) = flow * places.col(i);
  }
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    if (places.col(i).head<2>().norm() > 3 * d || places(2, i) > 3 * d) {
      continue;
    }
    ++beside;
    double divergence = velocity_gradient(liquid, i, true).trace();
    if (liquid.walls.contact_count[i] > 0) {
      const Vector3<double> pull = liquid.correction.apply(i, liquid.walls.contacts_of(i)->gradient);
      divergence -= pull.dot(liquid.fluid.velocity.col(i));
    }
    CHECK(divergence == Approx(flow.trace()).margin(0.02 * flow.norm()));
  }
  CHECK(beside > 50);
}
