// SPDX-License-Identifier: MIT
#include <decant/core/pose.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "catch.hpp"

namespace {

using decant::Pose;
using decant::PoseTrack;
using Vector = decant::Vector3<double>;

using std::numbers::pi;
const double not_a_number = std::numeric_limits<double>::quiet_NaN();

Eigen::Quaterniond turn(double angle, const Vector& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

// Rounding of a few multiplications of numbers near one.
const double rounding = 1e-14;

bool near(const Vector& a, const Vector& b, double tolerance) { return (a - b).norm() <= tolerance; }

}  // namespace

TEST_CASE("A pose takes points of the body to the world") {
  const Pose pose{turn(pi / 2, Vector::UnitZ()), Vector(1, 2, 3)};
  CHECK(near(pose * Vector(1, 0, 0), Vector(1, 3, 3), rounding));
  CHECK(near(pose * Vector(0, 1, 0), Vector(0, 2, 3), rounding));
}

TEST_CASE("Poses chain and invert") {
  const Pose a{turn(0.7, Vector(1, 2, 3)), Vector(1, -2, 0.5)};
  const Pose b{turn(-1.9, Vector(-1, 0.3, 2)), Vector(-0.3, 4, 1)};
  const Vector x(0.2, -0.4, 0.9);
  CHECK(near((a * b) * x, a * (b * x), rounding));
  CHECK(near(a.inverse() * (a * x), x, rounding));
  CHECK(near(a * (a.inverse() * x), x, rounding));
}

TEST_CASE("A pose says whether it is finite") {
  CHECK(Pose{}.finite());
  Pose pose;
  pose.translation.y() = not_a_number;
  CHECK_FALSE(pose.finite());
  pose = {};
  pose.rotation.w() = std::numeric_limits<double>::infinity();
  CHECK_FALSE(pose.finite());
}

TEST_CASE("Poses interpolate linearly in place and along the shorter arc in rotation") {
  const Pose a{turn(0.2, Vector::UnitX()), Vector(0, 0, 0)};
  Pose b{turn(1.0, Vector::UnitX()), Vector(1, 2, -4)};
  b.rotation.coeffs() *= -1;  // the same rotation, on the other side of the sphere of quaternions
  const Pose middle = decant::interpolate(a, b, 0.25);
  CHECK(near(middle.translation, Vector(0.25, 0.5, -1), rounding));
  CHECK(middle.rotation.angularDistance(turn(0.4, Vector::UnitX())) < 1e-7);  // an angle from a cosine near one
  CHECK(near(decant::interpolate(a, b, 0) * Vector::Ones(), a * Vector::Ones(), rounding));
  CHECK(near(decant::interpolate(a, b, 1) * Vector::Ones(), b * Vector::Ones(), rounding));
}

TEST_CASE("The velocity between two poses moves points from one to the other") {
  const Pose before{turn(0.3, Vector(1, 1, 0)), Vector(0.1, 0.2, 0.3)};
  const double time_step = 1e-4;
  const Vector angular(0.5, -2, 3);
  const Vector linear(0.4, 0.1, -0.7);
  const Pose after{turn(angular.norm() * time_step, angular) * before.rotation,
                   before.translation + linear * time_step};
  const decant::RigidVelocity velocity = decant::velocity_between(before, after, time_step);
  CHECK(near(velocity.linear, linear, 1e-11));
  CHECK(near(velocity.angular, angular, 1e-10));
  const Vector x_in_body(0.02, -0.05, 0.04);
  const Vector start = before * x_in_body;
  // an explicit step misses the arc by half of |angular|^2 |x| dt^2
  CHECK(near(start + time_step * velocity.at(start), after * x_in_body, 0.5 * 13.3 * 0.07 * time_step * time_step));
  // at a lever arm, v = linear + angular x arm
  CHECK(near(velocity.at(before.translation + Vector(1, 0, 0)), linear + angular.cross(Vector(1, 0, 0)), 1e-9));
}

TEST_CASE("Turning velocity is exact for large, tiny and no turns") {
  const auto between = [](double angle) {
    return decant::velocity_between({}, {turn(angle, Vector::UnitY()), Vector::Zero()}, 0.5).angular;
  };
  for (const double angle : {3.0, -3.0, 1.0, 1e-3, 1e-8, -1e-11, 1e-13, 1e-15}) {
    INFO("angle " << angle);
    CHECK(near(between(angle), Vector(0, angle / 0.5, 0), 1e-12 * std::abs(angle)));
  }
  CHECK(between(0).isZero(0));
  CHECK(near(between(4), Vector(0, (4 - 2 * pi) / 0.5, 0), 1e-12));  // the shorter way round
  Pose negated;
  negated.rotation.coeffs() *= -1;
  CHECK(decant::velocity_between({}, negated, 1).angular.isZero(0));
}

TEST_CASE("A track interpolates between its samples and holds still outside") {
  const PoseTrack track({{1.0, {turn(0, Vector::UnitZ()), Vector(0, 0, 0)}},
                         {2.0, {turn(1, Vector::UnitZ()), Vector(1, 0, 0)}},
                         {4.0, {turn(1, Vector::UnitZ()), Vector(1, 4, 0)}}});
  CHECK(track.begin_time() == 1);
  CHECK(track.end_time() == 4);
  REQUIRE(track.samples().size() == 3);
  CHECK(near(track.at(0).translation, Vector(0, 0, 0), 0));
  CHECK(near(track.at(1.5).translation, Vector(0.5, 0, 0), rounding));
  CHECK(track.at(1.5).rotation.angularDistance(turn(0.5, Vector::UnitZ())) < 1e-7);
  CHECK(near(track.at(2).translation, Vector(1, 0, 0), 0));
  CHECK(near(track.at(2.5).translation, Vector(1, 1, 0), rounding));  // a quarter of an interval of two seconds
  CHECK(near(track.at(9).translation, Vector(1, 4, 0), 0));

  CHECK(near(track.velocity(1.2, 0.1).linear, Vector(1, 0, 0), 1e-12));
  CHECK(near(track.velocity(1.2, 0.1).angular, Vector(0, 0, 1), 1e-7));
  CHECK(near(track.velocity(3, 0.1).linear, Vector(0, 2, 0), 1e-12));
  CHECK(track.velocity(5, 0.1).linear.isZero(0));
  CHECK(track.velocity(0, 0.5).angular.isZero(0));
}

TEST_CASE("A track normalises its rotations") {
  Pose pose;
  pose.rotation.coeffs() *= 1.5;
  const PoseTrack track({{0.0, pose}});
  CHECK(track.at(0).rotation.norm() == Approx(1).epsilon(1e-15));
}

TEST_CASE("Tracks of none and of one sample stand still") {
  CHECK(near(PoseTrack{}.at(3) * Vector(1, 2, 3), Vector(1, 2, 3), 0));
  CHECK(PoseTrack{}.begin_time() == 0);
  CHECK(PoseTrack{}.end_time() == 0);
  const PoseTrack fixed{Pose{turn(0.4, Vector::UnitX()), Vector(0, 0, 2)}};
  CHECK(near(fixed.at(-1e9).translation, Vector(0, 0, 2), 0));
  CHECK(near(fixed.at(1e9).translation, Vector(0, 0, 2), 0));
  CHECK(fixed.velocity(0, 0.1).linear.isZero(0));
}

TEST_CASE("A track refuses what is not a motion, in one line") {
  const auto track = [](double first, double second, const Pose& pose) {
    return PoseTrack({{first, {}}, {second, pose}});
  };
  CHECK_NOTHROW(track(0, 1, {}));
  CHECK_THROWS_AS(track(0, 0, {}), std::invalid_argument);
  CHECK_THROWS_WITH(track(0, 0, {}), "PoseTrack: time [s] of a sample must be later than the one before, got 0");
  CHECK_THROWS_WITH(track(0, -1, {}), decant_test::contains("later than the one before, got -1"));
  CHECK_THROWS_WITH(track(0, not_a_number, {}), decant_test::contains("PoseTrack: time [s] must be finite"));
  CHECK_THROWS_WITH(track(0, std::numeric_limits<double>::infinity(), {}), decant_test::contains("must be finite"));
  Pose pose;
  pose.translation.x() = not_a_number;
  CHECK_THROWS_WITH(track(0, 1, pose), "PoseTrack: pose must be finite at every sample, sample number, got 1");
  pose = {};
  pose.rotation.coeffs().setZero();
  CHECK_THROWS_WITH(track(0, 1, pose), decant_test::contains("norm of a quaternion must be near 1, got 0"));
  pose.rotation.coeffs().setConstant(10);
  CHECK_THROWS_WITH(track(0, 1, pose), decant_test::contains("near 1, got 20"));
}
