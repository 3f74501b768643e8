// SPDX-License-Identifier: MIT
#pragma once

/// Forces that only twins have: what a model is to be told about, or is not to know.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>

namespace example {

/// Air that cannot get in as fast as liquid gets out: under-pressure behind the neck holds the liquid back until a
/// bubble has passed, again and again. On liquid in the neck, between the plane of the mouth and `reach` behind it and
/// no farther than `radius` from the axis,
///   a = -strength (1 - cos(2 pi frequency (t - onset))) / 2 axis   from the onset on,
/// with the axis out of the mouth: for a plug of liquid of that length, an under-pressure of rho strength reach at
/// most. Not a model of bubbles, whose size and pace would follow from the flow.
struct BackPressure {
  using Scalar = float;

  double strength = 0;                                              ///< [m/s^2]
  double frequency = 4;                                             ///< [Hz]
  double onset = 0;                                                 ///< [s]
  double reach = 0.04;                                              ///< [m]
  double radius = 0.02;                                             ///< [m]
  decant::Vector3<double> mouth = decant::Vector3<double>::Zero();  ///< its middle, container's frame [m]
  decant::Vector3<double> axis = decant::Vector3<double>::UnitZ();  ///< container's frame, unit length
  decant::PoseTrack container{};                                    ///< world from container

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    if (!(strength > 0) || step.time < onset) {
      return;
    }
    const decant::Pose pose = container.at(step.time), into = pose.inverse();
    const double pulse = 0.5 * (1 - std::cos(2 * std::numbers::pi * frequency * (step.time - onset)));
    const decant::Vector3<Scalar> pull = (-strength * pulse * (pose.rotation * axis)).cast<Scalar>();
    decant::parallel_for(step.fluid.size(), step.threads, [&](decant::Index i) {
      const decant::Vector3<double> past =
          into * decant::Vector3<double>(step.fluid.position.col(i).template cast<double>()) - mouth;
      const double depth = -past.dot(axis);
      if (depth > 0 && depth < reach && (past + depth * axis).norm() < radius) {
        acceleration.col(i) += pull;
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

/// Turns the liquid about an upright axis, as a stirrer does:
///   a = rate (v_stir - v) across the axis,  v_stir = speed (r / radius) exp((1 - (r / radius)^2) / 2)
/// around it, with `rate` fading in the same way beyond 2 radii and above `height`.
struct Stirrer {
  using Scalar = float;

  double speed = 0;                                                ///< largest, at r = radius [m/s]
  double rate = 8;                                                 ///< [1/s]
  double radius = 0.03, height = 0.05;                             ///< [m]
  double onset = 0;                                                ///< [s]
  decant::Vector3<double> foot = decant::Vector3<double>::Zero();  ///< of the axis, world frame [m]

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    if (speed == 0 || step.time < onset) {
      return;
    }
    decant::parallel_for(step.fluid.size(), step.threads, [&](decant::Index i) {
      const decant::Vector3<double> past = step.fluid.position.col(i).template cast<double>() - foot;
      const double r = std::hypot(past.x(), past.y()), q = r / radius;
      if (r > 0 && q < 2 && past.z() < height) {
        const double around = speed * q * std::exp(0.5 * (1 - q * q)) / r;
        acceleration(0, i) += static_cast<Scalar>(rate * (-around * past.y() - double(step.fluid.velocity(0, i))));
        acceleration(1, i) += static_cast<Scalar>(rate * (around * past.x() - double(step.fluid.velocity(1, i))));
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return speed != 0 ? static_cast<Scalar>(0.25 / rate) : std::numeric_limits<Scalar>::infinity();
  }
};

/// Friction as WallFriction's, but only where a body's wall is on one side of a plane.
struct StickyPatch {
  using Scalar = float;

  double rate = 0;                                                  ///< [1/s]
  std::uint32_t body = 0;                                           ///< a BodyId
  decant::Vector3<double> side = decant::Vector3<double>::UnitY();  ///< of the body's origin, body's frame
  decant::PoseTrack motion{};                                       ///< world from body

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    if (!(rate > 0) || !(step.time_step > 0)) {
      return;
    }
    const decant::Pose into = motion.at(step.time).inverse();
    const Scalar mean_rate = -std::expm1(-static_cast<Scalar>(rate) * step.time_step) / step.time_step;
    decant::parallel_for(step.fluid.size(), step.threads, [&](decant::Index i) {
      const auto* nearest = step.walls.contacts_of(i);
      if (step.walls.contact_count[i] == 0 || nearest->body != body || step.walls.distance[i] > step.spacing ||
          (into * decant::Vector3<double>(step.fluid.position.col(i).template cast<double>())).dot(side) < 0) {
        return;
      }
      const Scalar steepness = nearest->gradient.norm();
      if (steepness > 0) {
        const decant::Vector3<Scalar> normal = nearest->gradient / steepness;
        const decant::Vector3<Scalar> slip = step.fluid.velocity.col(i) - nearest->velocity;
        acceleration.col(i) -= mean_rate * (slip - slip.dot(normal) * normal);
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

/// A jet of air or a spring from below: a = strength exp(-(r / radius)^2) upward, within a window of time and up to a
/// height above the foot.
struct Puff {
  using Scalar = float;

  double strength = 0;                                             ///< [m/s^2]
  double radius = 0.03, height = 0.035;                            ///< [m]
  double from = 0, until = 0;                                      ///< [s]
  decant::Vector3<double> foot = decant::Vector3<double>::Zero();  ///< world frame [m]

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    if (!(strength > 0) || step.time < from || step.time >= until) {
      return;
    }
    decant::parallel_for(step.fluid.size(), step.threads, [&](decant::Index i) {
      const decant::Vector3<double> past = step.fluid.position.col(i).template cast<double>() - foot;
      if (past.z() < height) {
        const double q_squared = (past.x() * past.x() + past.y() * past.y()) / (radius * radius);
        acceleration(2, i) += static_cast<Scalar>(strength * std::exp(-q_squared));
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

/// All that there is on a table that shakes, as seen from the table: a = size sin(2 pi frequency (t - from)) from then
/// on.
struct ShakingTable {
  using Scalar = float;

  decant::Vector3<double> size = decant::Vector3<double>::Zero();  ///< [m/s^2], world frame
  double frequency = 2;                                            ///< [Hz]
  double from = 0;                                                 ///< [s]

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    if (size.norm() > 0 && step.time >= from) {
      const decant::Vector3<double> pull = std::sin(2 * std::numbers::pi * frequency * (step.time - from)) * size;
      acceleration.colwise() += pull.cast<Scalar>();
    }
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

}  // namespace example
