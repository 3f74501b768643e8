// SPDX-License-Identifier: MIT
#pragma once

/// Affine maps from their six numbers, for tests.

#include <decant/camera/affine_map.hpp>

namespace decant_test {

/// u = a x + b y + c, v = d x + e y + f.
inline decant::AffineMap::Matrix coefficients(double a, double b, double c, double d, double e, double f) {
  decant::AffineMap::Matrix matrix;
  matrix << a, b, c, d, e, f;
  return matrix;
}

}  // namespace decant_test
