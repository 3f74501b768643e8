// SPDX-License-Identifier: MIT
// Which masks are believed: liquid that comes and goes by and by, against a segmentation that fails.

#include <decant/tracking/mask_trust.hpp>

#include "catch.hpp"

using decant::Mask;
using decant::MaskTrust;

namespace {

bool believes(MaskTrust& trust, int pixels) {
  Mask mask = Mask::Zero(100, 100);
  mask.reshaped().head(pixels).setConstant(decant::mask_liquid);
  return trust.believes(mask);
}

}  // namespace

TEST_CASE("mask trust: liquid may come into sight and leave it by and by") {
  MaskTrust trust(150);
  for (int pixels : {0, 0, 20, 100, 149, 150, 3000, 9000, 3000, 600, 100, 3, 0, 0, 40}) {
    INFO(pixels << " pixels");
    CHECK(believes(trust, pixels));
  }
}

TEST_CASE("mask trust: a mask that is suddenly empty is a failure, however long it lasts") {
  MaskTrust trust(150);
  CHECK(believes(trust, 200));
  CHECK(believes(trust, 601));
  for (int frame = 0; frame < 5; ++frame) {
    CHECK_FALSE(believes(trust, 0));
    CHECK_FALSE(believes(trust, 149));
  }
  CHECK(believes(trust, 150));
  CHECK(believes(trust, 0));  // the last that was believed showed little
  CHECK(believes(trust, 9000));
  CHECK_FALSE(believes(trust, 0));
  trust.reset();
  CHECK(believes(trust, 0));
}
