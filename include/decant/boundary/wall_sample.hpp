// SPDX-License-Identifier: MIT
#pragma once

/// What one body contributes to a particle's support, in the body's own frame.

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// The wall is everything that a straight line from the particle reaches only through the body's surface: a thin wall
/// shields what lies behind it, so a cup of paper and a cup of stone feel alike from inside.
struct WallSample {
  double share = 0;                                    ///< added to the density, over rest density [-]
  Vector3<double> gradient = Vector3<double>::Zero();  ///< of the share, points into the wall [1/m]
  /// Sum over its faces of |gradient| a n n^T, with a face's distance a and normal n; symmetric [-]. Says how liquid
  /// that slides along the wall sees itself continued behind it (force/gradient_correction.hpp).
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  double distance = 0;  ///< to the nearest point of the surface [m]
};

}  // namespace decant::inline DECANT_TARGET
