// SPDX-License-Identifier: MIT
#pragma once

/// Names for the few array shapes that every layer shares: a point, and one column or one entry per particle.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

using Index = Eigen::Index;

/// A point or direction in space.
template <class Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

template <class Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

/// 3xN, one column per particle.
template <class Scalar>
using PointArray = Eigen::Matrix<Scalar, 3, Eigen::Dynamic>;

/// N entries, one per particle.
template <class Scalar>
using ScalarArray = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

/// A column of a 3xN array that the caller owns.
template <class Scalar>
using PointsView = Eigen::Ref<PointArray<Scalar>>;
template <class Scalar>
using ConstPointsView = Eigen::Ref<const PointArray<Scalar>>;

}  // namespace decant::inline DECANT_TARGET
