// SPDX-License-Identifier: MIT
#include <decant/force/shear_thinning_viscosity.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"
#include "physics/scene.hpp"

namespace {

/// A liquid after Carreau.
struct Thinning {
  double nu_0, nu_inf, lambda, n;

  double viscosity(double shear_rate) const {
    return nu_inf + (nu_0 - nu_inf) * std::pow(1 + lambda * lambda * shear_rate * shear_rate, 0.5 * (n - 1));
  }

  /// Where viscosity(g) g is this stress over density [m^2/s^2]; it grows with g.
  double shear_rate(double stress) const {
    double low = 0, high = 1;
    while (viscosity(high) * high < stress) {
      high *= 2;
    }
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (viscosity(middle) * middle < stress ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

  template <class Scalar>
  decant::ShearThinningViscosity<Scalar> force() const {
    decant::ShearThinningViscosity<Scalar> force;
    force.kinematic_viscosity = static_cast<Scalar>(nu_0);
    force.high_shear_viscosity = static_cast<Scalar>(nu_inf);
    force.relaxation_time = static_cast<Scalar>(lambda);
    force.exponent = static_cast<Scalar>(n);
    return force;
  }
};

template <class Scalar>
decant::Viscosity<Scalar> newtonian(double nu) {
  decant::Viscosity<Scalar> force;
  force.kinematic_viscosity = static_cast<Scalar>(nu);
  return force;
}

template <class Liquid, class Force>
auto accelerations_by(Liquid& liquid, Force force) {
  using Points = decant::PointArray<typename Liquid::Scalar>;
  Points acceleration = Points::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), acceleration);
  return acceleration;
}

/// How far accelerations are from others, over the largest of these.
template <class Points>
double relative_error(const Points& are, const Points& should_be) {
  return static_cast<double>((are - should_be).cwiseAbs().maxCoeff()) /
         static_cast<double>(should_be.cwiseAbs().maxCoeff());
}

using Gradient = Eigen::Matrix3d;

/// Simple shear of a rate, along and across directions that are nobody's axes.
Gradient simple_shear(double rate) {
  const decant::Vector3<double> along(2.0 / 3, -1.0 / 3, 2.0 / 3), across(1 / std::sqrt(2.0), 0, -1 / std::sqrt(2.0));
  return rate * along * across.transpose();
}

Gradient spin_matrix(const decant::Vector3<double>& omega) {
  Gradient matrix;
  matrix << 0, -omega[2], omega[1], omega[2], 0, -omega[0], -omega[1], omega[0], 0;
  return matrix;
}

template <class Liquid>
void move_linearly(Liquid& liquid, const Gradient& gradient, const decant::Vector3<double>& offset) {
  using Scalar = typename Liquid::Scalar;
  for (decant::Index i = 0; i < liquid.fluid.size(); ++i) {
    const decant::Vector3<double> x = liquid.fluid.position.col(i).template cast<double>();
    liquid.fluid.velocity.col(i) = (offset + gradient * x).template cast<Scalar>();
  }
}

/// Neighbours' velocities are rounded, and differ by a tenth or so of what they are; a sum has some thirty.
template <class Scalar>
constexpr double linear_rounding = 30.0 * static_cast<double>(std::numeric_limits<Scalar>::epsilon());

/// A disordered block of liquid that fills the gap between two plates, the upper of which moves, and both turn.
template <class Scalar>
struct BetweenPlates {
  static constexpr double spacing = 0.005, height = 6 * spacing;
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;

  /// @param per_height velocity of the lid over its height.
  BetweenPlates(const decant::Vector3<double>& per_height, const decant::Vector3<double>& omega, decant::Slip slip) {
    const auto places = decant_test::block<Scalar>({-4 * spacing, -4 * spacing, 0}, 8, 8, 6, spacing, 0.2);
    liquid.template place<decant::CellGrid<Scalar>>(places);
    Gradient gradient = spin_matrix(omega);
    gradient.col(2) += per_height;
    move_linearly(liquid, gradient, {0, 0, 0});

    const double time_step = 1e-4;
    const auto turned = [&](const decant::Vector3<double>& moved) {
      const double angle = omega.norm() * time_step;
      const decant::Vector3<double> axis =
          angle > 0 ? decant::Vector3<double>(omega.normalized()) : decant::Vector3<double>(0, 0, 1);
      return decant::PoseTrack(
          {{0, decant::Pose{}}, {time_step, decant::Pose{Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), moved}}});
    };
    decant::RigidBodies<Scalar> bodies;
    using Kernel = decant::CubicSpline<Scalar>;
    bodies.template add<Kernel>("floor", decant::Box{{-1, -1, -0.1}, {1, 1, 0}}, turned({0, 0, 0}), slip, spacing,
                                spacing, {1});
    bodies.template add<Kernel>("lid", decant::Box{{-1, -1, height}, {1, 1, height + 0.1}},
                                turned(time_step * height * per_height), slip, spacing, spacing, {1});
    bodies.set_interval(0, time_step);
    bodies.sample(places, spacing, {1}, liquid.walls);
    liquid.template update<decant::CellGrid<Scalar>>();
  }
};

struct ThinningParts : decant::PeriodicParts<float> {
  using Forces =
      std::tuple<decant::Gravity<float>, decant::ShearThinningViscosity<float>, decant::ResidualViscosity<float>>;
};

/// Flow between plates that a constant pull drives, at Re = 20 by the viscosity at the wall.
class ThinningChannel {
 public:
  static constexpr double height = 0.1, wall_shear_rate = 4;

  /// @param thinning lambda times the shear rate at the wall.
  ThinningChannel(double n, double thinning) {
    const double at_wall = wall_shear_rate * height * height / 80;
    liquid_ = {at_wall * std::pow(1 + thinning * thinning, 0.5 * (1 - n)), 0, thinning / wall_shear_rate, n};
    pull_ = 2 * at_wall * wall_shear_rate / height;
    time_scale_ = height * height / at_wall;
    // the shear rate at the middles of intervals, added up from the wall on
    speed_.assign(intervals + 1, 0.0);
    const double width = 0.5 * height / intervals;
    for (std::size_t k = 0; k < intervals; ++k) {
      const double z = (static_cast<double>(k) + 0.5) * width;
      speed_[k + 1] = speed_[k] + width * liquid_.shear_rate(pull_ * (0.5 * height - z));
    }
  }

  double peak() const { return speed_.back(); }

  double speed(double z) const {
    const double place =
        std::clamp(std::min(z, height - z) / (0.5 * height), 0.0, 1.0) * static_cast<double>(intervals);
    const auto k = std::min(static_cast<std::size_t>(place), intervals - 1);
    return speed_[k] + (place - static_cast<double>(k)) * (speed_[k + 1] - speed_[k]);
  }

  /// Errors of the layers' mean velocities over the peak, in the last quarter of a run that begins with what is exact.
  std::vector<double> errors(int across) const {
    const double spacing = height / across;
    decant::SimulatorSettings settings;
    settings.spacing = spacing;
    settings.liquid.dynamic_viscosity = liquid_.nu_0 * settings.liquid.density;
    settings.gravity = {pull_, 0, 0};
    settings.largest_step = 1;  // what the flow itself asks for
    settings.threads = {1};
    const int width = 5;
    const auto period = static_cast<float>(width * spacing);
    decant::Simulator<ThinningParts> simulator(settings,
                                               ThinningParts::Domain(decant::Vector3<float>(period, period, 0)));
    auto& force = simulator.force<decant::ShearThinningViscosity<float>>();
    force.relaxation_time = static_cast<float>(liquid_.lambda);
    force.exponent = static_cast<float>(liquid_.n);
    simulator.add_body("floor", decant::Box{{-1, -1, -0.1}, {1, 1, 0}}, {}, decant::Slip::None);
    simulator.add_body("lid", decant::Box{{-1, -1, height}, {1, 1, height + 0.1}}, {}, decant::Slip::None);
    const auto places = decant_test::block<float>({0, 0, 0}, width, width, across, spacing);
    decant::PointArray<float> velocity = decant::PointArray<float>::Zero(3, places.cols());
    for (decant::Index i = 0; i < places.cols(); ++i) {
      velocity(0, i) = static_cast<float>(speed(static_cast<double>(places(2, i))));
    }
    simulator.add_particles(places, velocity, 0);

    std::vector<double> error(static_cast<std::size_t>(across)), count(error.size());
    const int frames = 40;
    // the slowest change decays as exp(-pi^2 n t / time scale)
    const double seconds = 0.3 / liquid_.n * time_scale_;
    for (int frame = 0; frame < frames; ++frame) {
      REQUIRE(simulator.step(seconds / frames).status == decant::StepStatus::Ok);
      if (frame < 3 * frames / 4) {
        continue;
      }
      for (decant::Index i = 0; i < simulator.fluid().size(); ++i) {
        const auto z = static_cast<double>(simulator.fluid().position(2, i));
        const auto layer = static_cast<std::size_t>(std::clamp(static_cast<int>(z / spacing), 0, across - 1));
        error[layer] += static_cast<double>(simulator.fluid().velocity(0, i)) - speed(z);
        count[layer] += peak();
      }
    }
    for (std::size_t layer = 0; layer < error.size(); ++layer) {
      REQUIRE(count[layer] > 0);
      error[layer] /= count[layer];
    }
    return error;
  }

 private:
  static constexpr std::size_t intervals = 1000;
  Thinning liquid_{};
  double pull_ = 0, time_scale_ = 0;  // [m/s^2], [s]
  std::vector<double> speed_{};       // up to the middle
};

double largest_error(const std::vector<double>& errors) {
  double worst = 0;
  for (const double error : errors) {
    worst = std::max(worst, std::abs(error));
  }
  return worst;
}

}  // namespace

TEMPLATE_TEST_CASE("shear-thinning viscosity keeps the laws of a force", "", float, double) {
  for (const double n : {0.3, 1.0}) {
    const auto force = Thinning{1e-3, 1e-5, 0.3, n}.force<TestType>();
    decant_test::check(
        decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::LinearAndAngular));
    decant_test::check(
        decant::testing::force_laws<decant::WendlandC2<TestType>>(force, decant::testing::Keeps::LinearAndAngular));
  }
}

TEMPLATE_TEST_CASE("shear-thinning viscosity that does not thin is Viscosity bit by bit", "", float, double) {
  using Scalar = TestType;
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN(), inf = std::numeric_limits<Scalar>::infinity();
  BetweenPlates<Scalar> between({30, 0, 0}, {1, 2, 3}, decant::Slip::None);
  const Scalar nu = Scalar(1e-3);
  const auto expected = accelerations_by(between.liquid, newtonian<Scalar>(1e-3));
  decant::ShearThinningViscosity<Scalar> force;
  force.kinematic_viscosity = nu;
  CHECK(accelerations_by(between.liquid, force) == expected);
  const auto thins_not = [&](Scalar high_shear, Scalar relaxation_time, Scalar exponent) {
    force.high_shear_viscosity = high_shear;
    force.relaxation_time = relaxation_time;
    force.exponent = exponent;
    CHECK(accelerations_by(between.liquid, force) == expected);
    CHECK(force.largest_step(between.liquid.view()) == newtonian<Scalar>(1e-3).largest_step(between.liquid.view()));
  };
  thins_not(0, 1, 1);
  thins_not(0, 0, Scalar(0.3));
  thins_not(nu, 1, Scalar(0.3));
  // out of range
  thins_not(2 * nu, 1, Scalar(0.3));
  for (const Scalar bad : {Scalar(-1), nan, inf}) {
    thins_not(0, bad, Scalar(0.3));
    thins_not(0, 1, bad);
  }
  thins_not(0, 1, 0);
  thins_not(0, 1, Scalar(1.5));
  for (const Scalar nothing : {Scalar(-1), nan}) {
    const auto thinning = Thinning{1e-3, 0, 1, 0.3}.force<Scalar>();
    auto bad = thinning;
    bad.high_shear_viscosity = nothing;
    CHECK(accelerations_by(between.liquid, bad) == accelerations_by(between.liquid, thinning));
  }
}

TEMPLATE_TEST_CASE("shear-thinning viscosity of zero leaves everything as it is", "", float, double) {
  BetweenPlates<TestType> between({30, 0, 0}, {1, 2, 3}, decant::Slip::None);
  for (const double nothing : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto force = Thinning{nothing, 0, 1, 0.3}.force<TestType>();
    CHECK(accelerations_by(between.liquid, force).cwiseAbs().maxCoeff() == 0);
    CHECK(std::isinf(force.largest_step(between.liquid.view())));
  }
}

TEMPLATE_TEST_CASE("shear-thinning viscosity is that of the shear rate, out to free surfaces, and turning is no shear",
                   "", float, double) {
  using Scalar = TestType;
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 5, 0.2, 0.0);
  for (const double n : {0.3, 0.8}) {
    for (const double shear_rate : {0.01, 1.0, 10.0, 1e3, 1e5}) {
      const Thinning material{1e-3, 1e-6, 0.1, n};
      move_linearly(liquid, simple_shear(shear_rate), {0, 0, 0});
      CHECK(relative_error(accelerations_by(liquid, material.force<Scalar>()),
                           accelerations_by(liquid, newtonian<Scalar>(material.viscosity(shear_rate)))) <
            linear_rounding<Scalar>);
      const Gradient turning = spin_matrix({2 * shear_rate, shear_rate, -3 * shear_rate});
      move_linearly(liquid, simple_shear(shear_rate) + turning, {shear_rate * 0.01, 0, 0});
      CHECK(relative_error(accelerations_by(liquid, material.force<Scalar>()),
                           accelerations_by(liquid, newtonian<Scalar>(material.viscosity(shear_rate)))) <
            10 * linear_rounding<Scalar>);
    }
  }
  // and of stretching, (1, -1/2, -1/2) times a rate has g = sqrt(3) of it
  const Thinning material{1e-3, 1e-6, 0.1, 0.3};
  move_linearly(liquid, decant::Vector3<double>(20, -10, -10).asDiagonal(), {0, 0, 0});
  CHECK(relative_error(accelerations_by(liquid, material.force<Scalar>()),
                       accelerations_by(liquid, newtonian<Scalar>(material.viscosity(20 * std::sqrt(3.0))))) <
        linear_rounding<Scalar>);
}

TEMPLATE_TEST_CASE("shear-thinning viscosity has the stress nu(g) g in simple shear", "", float, double) {
  using Scalar = TestType;
  using Domain = decant::PeriodicDomain<Scalar>;
  const int width = 6, layers = 8;
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>, Domain> liquid;
  const double period = width * 0.005;
  liquid.domain = Domain({static_cast<Scalar>(period), static_cast<Scalar>(period), 0});
  liquid.place(decant_test::block<Scalar>({0, 0, -0.02}, width, width, layers, 0.005));
  const Thinning material{1e-2, 1e-5, 0.5, 0.4};
  for (const double shear_rate : {1e-3, 0.1, 2.0, 20.0, 1e3, 1e5}) {
    Gradient shear = Gradient::Zero();
    shear(0, 2) = shear_rate;
    move_linearly(liquid, shear, {0, 0, 0});
    const auto acceleration = accelerations_by(liquid, material.force<Scalar>());
    double force = 0;  // on what is above the plane z = 0, by what is below
    for (decant::Index i = 0; i < liquid.fluid.size(); ++i) {
      force += liquid.fluid.position(2, i) > 0 ? static_cast<double>(liquid.fluid.mass[i] * acceleration(0, i)) : 0;
    }
    // a lattice has 1.06 or 0.94 of the viscosity, see Viscosity
    CHECK(-force / (period * period) == Approx(1000 * material.viscosity(shear_rate) * shear_rate).epsilon(0.07));
  }
}

TEMPLATE_TEST_CASE("shear-thinning viscosity at walls is that of the shear rate, also where all of it turns", "", float,
                   double) {
  using Scalar = TestType;
  const Thinning material{1e-3, 0, 0.1, 0.3};
  for (const decant::Slip slip : {decant::Slip::None, decant::Slip::Free}) {
    for (const double shear_rate : {1.0, 30.0, 1e3}) {
      for (const double turning : {0.0, 3.0}) {
        BetweenPlates<Scalar> between({shear_rate, 0, 0}, turning * shear_rate * decant::Vector3<double>(0.6, -0.8, 1),
                                      slip);
        // bodies' velocities are differences of poses 1e-4 s apart, which have 16 digits
        CHECK(relative_error(accelerations_by(between.liquid, material.force<Scalar>()),
                             accelerations_by(between.liquid, newtonian<Scalar>(material.viscosity(shear_rate)))) <
              std::max(10 * linear_rounding<Scalar>, 1e-9));
      }
    }
  }
  // plates that approach each other squeeze: D is the rate along their normal
  BetweenPlates<Scalar> squeezed({0, 0, -30}, {10, 20, 30}, decant::Slip::None);
  CHECK(relative_error(accelerations_by(squeezed.liquid, material.force<Scalar>()),
                       accelerations_by(squeezed.liquid, newtonian<Scalar>(material.viscosity(30 * std::sqrt(2.0))))) <
        std::max(10 * linear_rounding<Scalar>, 1e-9));
}

TEMPLATE_TEST_CASE("a single layer of shear-thinning liquid that slides on a plate shears as the plate says", "", float,
                   double) {
  using Scalar = TestType;
  const double spacing = 0.005;
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;
  const auto places = decant_test::block<Scalar>({0, 0, 0}, 6, 6, 1, spacing);
  liquid.place(places);
  decant::RigidBodies<Scalar> bodies;
  bodies.template add<decant::CubicSpline<Scalar>>("plate", decant::Box{{-1, -1, -0.1}, {1, 1, 0}}, {},
                                                   decant::Slip::None, spacing, spacing, {1});
  bodies.set_interval(0, 0);
  bodies.sample(places, spacing, {1}, liquid.walls);
  liquid.update();
  move_linearly(liquid, Gradient::Zero(), {0.3, 0.4, 0});
  const Thinning material{1e-4, 0, 0.1, 0.3};
  CHECK(relative_error(accelerations_by(liquid, material.force<Scalar>()),
                       accelerations_by(liquid, newtonian<Scalar>(material.viscosity(0.5 / (0.5 * spacing))))) <
        10 * linear_rounding<Scalar>);
}

TEST_CASE("shear-thinning viscosity of a pair is the mean of what both have, in any motion") {
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<double>>(0.005, 4, 0.2, 0.1);
  const Thinning material{1e-3, 1e-5, 0.1, 0.3};
  const auto step = liquid.view();
  const decant::Index count = liquid.fluid.size();
  std::vector<double> viscosity(static_cast<std::size_t>(count));
  std::vector<bool> surrounded(viscosity.size());
  for (decant::Index i = 0; i < count; ++i) {
    // the gradient that makes sum_j V_j (-W'/r) |v_i - v_j - G x_ij|^2 least
    Gradient moment = Gradient::Zero(), change = Gradient::Zero();
    step.neighbors.for_each(i, [&](decant::Index j, const decant::Vector3<double>& x, double r_squared) {
      const double r = std::sqrt(r_squared);
      const double weight = -1.25e-7 * decant::CubicSpline<double>::derivative(r, step.smoothing_length) / r;
      const decant::Vector3<double> apart = liquid.fluid.velocity.col(i) - liquid.fluid.velocity.col(j);
      moment += weight * x * x.transpose();
      change += weight * apart * x.transpose();
    });
    const auto k = static_cast<std::size_t>(i);
    surrounded[k] = Eigen::SelfAdjointEigenSolver<Gradient>(moment).eigenvalues().minCoeff() > 0.1;
    const Gradient gradient = change * moment.inverse();
    const Gradient strain = 0.5 * (gradient + gradient.transpose());
    viscosity[k] = material.viscosity(std::sqrt(2 * (strain * strain).trace()));
  }
  const auto acceleration = accelerations_by(liquid, material.force<double>());
  int tried = 0;
  for (decant::Index i = 0; i < count; ++i) {
    decant::Vector3<double> expected(0, 0, 0);
    bool all_surrounded = surrounded[static_cast<std::size_t>(i)];
    double size = 0;
    step.neighbors.for_each(i, [&](decant::Index j, const decant::Vector3<double>& x, double r_squared) {
      all_surrounded = all_surrounded && surrounded[static_cast<std::size_t>(j)];
      // Viscosity's own kernel, with R = 1 cm, and what keeps two at one place apart
      const double hat = 45 / (2 * std::acos(-1.0) * 1e-10) * (1 - std::sqrt(r_squared) / 0.01);
      const decant::Vector3<double> apart = liquid.fluid.velocity.col(i) - liquid.fluid.velocity.col(j);
      const double nu = 0.5 * (viscosity[static_cast<std::size_t>(i)] + viscosity[static_cast<std::size_t>(j)]);
      const decant::Vector3<double> push = -10 * nu * 1.25e-7 * apart.dot(x) * hat / (r_squared + 1e-10) * x;
      expected += push;
      size += push.norm();
    });
    if (all_surrounded) {
      ++tried;
      CHECK((acceleration.col(i) - expected).norm() < 1e-9 * size);
    }
  }
  CHECK(tried > count / 2);
}

TEMPLATE_TEST_CASE("shear-thinning viscosity is finite in any state", "", float, double) {
  using Scalar = TestType;
  const auto force = Thinning{1e-3, 0, 1, 0.3}.force<Scalar>();
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 3, 0.2,
                                                                         1e25);  // squared, too large for a float
  CHECK(accelerations_by(liquid, force).allFinite());
  // in a line, in a plane, two at one place, and alone
  decant::PointArray<Scalar> places(3, 9);
  places.setZero();
  for (decant::Index k = 0; k < 3; ++k) {
    places(0, k) = Scalar(0.004) * static_cast<Scalar>(k);
    places(1, 3 + k) = Scalar(0.1) + Scalar(0.004) * static_cast<Scalar>(k);
    places(2, 6 + k) = Scalar(0.1);
  }
  places(0, 5) = Scalar(0.004);
  places(0, 6) = 1;
  liquid.place(places);
  for (decant::Index i = 0; i < 9; ++i) {
    liquid.fluid.velocity.col(i) = decant::Vector3<Scalar>(static_cast<Scalar>(i * i), static_cast<Scalar>(i % 3), 1);
  }
  CHECK(accelerations_by(liquid, force).allFinite());
  // at walls that touch, have no slope, or face each other
  BetweenPlates<Scalar> between({30, 0, 0}, {0, 0, 0}, decant::Slip::None);
  for (decant::Index i = 0; i < between.liquid.fluid.size(); ++i) {
    auto* contacts = between.liquid.walls.contacts_of(i);
    between.liquid.walls.contact_count[i] = 2;
    contacts[0] = contacts[1] = {};
    contacts[0].friction = contacts[1].friction = Scalar(1e5);
    contacts[0].gradient = {0, 0, Scalar(i % 2)};
    contacts[1].gradient = {0, 0, -Scalar(i % 3)};
  }
  CHECK(accelerations_by(between.liquid, force).allFinite());
}

TEMPLATE_TEST_CASE("shear-thinning viscosity is stable at its longest step", "", float, double) {
  using Scalar = TestType;
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 4, 0.2, 1.0);
  auto force = Thinning{1e-2, 1e-5, 3e-3, 0.3}.force<Scalar>();
  const Scalar dt = force.largest_step(liquid.view());
  // where nothing is sheared
  CHECK(dt == newtonian<Scalar>(1e-2).largest_step(liquid.view()));
  double energy = static_cast<double>(liquid.fluid.velocity.squaredNorm());
  for (int k = 0; k < 100; ++k) {
    decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, liquid.fluid.size());
    force.accumulate(liquid.view(), acceleration);
    liquid.fluid.velocity += dt * acceleration;
    const double after = static_cast<double>(liquid.fluid.velocity.squaredNorm());
    REQUIRE(after <= energy * (1 + 1e-6));
    energy = after;
  }
}

TEST_CASE("shear-thinning viscosity takes its zero-shear viscosity from the liquid") {
  decant::SimulatorSettings settings;
  settings.liquid = decant::liquids::olive_oil;
  decant::Simulator<ThinningParts> simulator(settings);
  CHECK(simulator.force<decant::ShearThinningViscosity<float>>().kinematic_viscosity ==
        Approx(settings.liquid.kinematic_viscosity()));
}

TEST_CASE("shear-thinning liquid that is pushed between plates flows as the power law says") {
  const ThinningChannel newtonian(1, 1);
  CHECK(newtonian.peak() == Approx(0.5 * 0.05 * ThinningChannel::wall_shear_rate).epsilon(1e-4));
  const std::vector<double> of_newtonian = newtonian.errors(8);
  CHECK(largest_error(of_newtonian) < 0.05);
  for (const double n : {0.3, 0.6}) {
    // what is compared with: u = n / (n + 1) H/2 g_wall in the middle if all of it thins
    CHECK(ThinningChannel(n, 1e4).peak() ==
          Approx(n / (n + 1) * 0.05 * ThinningChannel::wall_shear_rate).epsilon(1e-3));
    const std::vector<double> of_thinning = ThinningChannel(n, 30).errors(8);
    CAPTURE(n, of_newtonian, of_thinning);
    // where stress is g^n, stress that is wrong by one per cent makes a flow that is wrong by 1/n per cent
    CHECK(largest_error(of_thinning) < largest_error(of_newtonian) / n);
  }
}
