// SPDX-License-Identifier: MIT
// No allocation per frame once the images' size has been seen, however noisy the mask.

#include <decant/coverage/activation.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/coverage/silhouette_distance.hpp>
#include <decant/coverage/warp_sum.hpp>

#include <random>

#include "allocation_count.hpp"
#include "catch.hpp"

using namespace decant;

TEST_CASE("allocation: none per frame in coverage") {
  std::mt19937 generator(1);
  const Index rows = 70, columns = 90;
  ActivationField activation_field(90, 70);
  WarpSumField warp_field(90, 70);
  MaskCleaning cleaning;
  SilhouetteDistance distance;
  Mask mask(rows, columns), clean(rows, columns);
  Image<float> coverage = Image<float>::Zero(rows, columns);
  for (int frame = 0; frame < 8; ++frame) {
    std::bernoulli_distribution liquid(0.1 * frame);  // none at first
    for (Index k = 0; k < mask.size(); ++k) {
      mask.data()[k] = liquid(generator) ? 255 : 0;
    }
    decant_test::allocations = 0;
    // the first frame sets sizes, the second sees two threads for the first time
    decant_test::watching = frame > 1;
    const Threads threads{1 + frame % 2};
    cleaning.apply(mask, clean, threads);
    distance.rebuild(clean, MaskPart::Liquid, threads);
    distance.rebuild(clean, MaskPart::Background, threads);
    activation_field.rebuild(mask, coverage, threads);
    warp_field.rebuild(mask, coverage, threads);
    const double sum = activation_field.value({20.5, 30.5}) + warp_field.value({20.5, 30.5}).norm() +
                       activation(mask, coverage, {20.5, 30.5}) + warp_sum(mask, coverage, {20.5, 30.5}).norm();
    decant_test::watching = false;
    CHECK(sum >= 0);
    CHECK(decant_test::allocations == 0);
  }
}
