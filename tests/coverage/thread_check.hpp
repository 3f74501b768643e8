// SPDX-License-Identifier: MIT
#pragma once

/// The law that fields over an image do not depend on the number of threads.

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>

#include "catch.hpp"
#include "masks.hpp"

namespace decant_test {

/// A field that was rebuilt with 2 and 4 threads has the same bits as with one, in the image and beyond its border.
template <class Field>
void check_threads_agree() {
  const auto mask = masks()[13].mask;  // salt
  const int width = static_cast<int>(mask.cols()), height = static_cast<int>(mask.rows());
  const decant::Image<float> coverage = some_coverage(mask.rows(), mask.cols(), 3);
  Field alone(width, height);
  alone.rebuild(mask, coverage, decant::Threads{1});
  for (const int threads : {2, 4}) {
    Field field(width, height);
    field.rebuild(mask, coverage, decant::Threads{threads});
    decant::Index different = 0;
    for (double v = -100; v < height + 100; v += 2.3) {
      for (double u = -100; u < width + 100; u += 2.9) {
        different += field.value({u, v}) == alone.value({u, v}) ? 0 : 1;
      }
    }
    INFO(threads << " threads");
    CHECK(different == 0);
  }
}

}  // namespace decant_test
