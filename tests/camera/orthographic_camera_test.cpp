// SPDX-License-Identifier: MIT
#include <decant/camera/orthographic_camera.hpp>

#include <limits>

#include "catch.hpp"

using decant::OrthographicCamera;

TEST_CASE("The orthographic camera has one scale at every depth") {
  const OrthographicCamera camera(1000, 320, 240, 640, 480);
  for (const double z : {1e-9, 0.1, 5.0, 1e6}) {
    const decant::Projection seen = camera.project({0.1, -0.05, z});
    CHECK(seen.pixel.x() == Approx(420));
    CHECK(seen.pixel.y() == Approx(190));
    CHECK(seen.depth == z);
    CHECK(seen.visible);
  }
  CHECK(camera.project({0.1, 0, -1e-9}).depth == 0);
  CHECK_FALSE(camera.project({0.1, 0, -1e-9}).visible);
  CHECK_FALSE(camera.project({0.4, 0, 1}).visible);
  // sight begins on the image plane, straight before the point
  CHECK((camera.unproject({420, 190}, 0) - decant::Vector3<double>(0.1, -0.05, 0)).norm() < 1e-15);
}

TEST_CASE("What is not an orthographic camera is refused in one line") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(OrthographicCamera(0, 0, 0, 640, 480),
                    "OrthographicCamera: pixels per metre [px/m] must be > 0 and at most 1e6, got 0");
  CHECK_THROWS_WITH(OrthographicCamera(1000, nan, 0, 640, 480), "OrthographicCamera: cx [px] must be finite, got nan");
  CHECK_THROWS_WITH(OrthographicCamera(1000, 0, nan, 640, 480), "OrthographicCamera: cy [px] must be finite, got nan");
  CHECK_THROWS_WITH(OrthographicCamera(1000, 0, 0, -1, 480),
                    "OrthographicCamera: width [px] must be 1 to 32768, got -1");
  CHECK_THROWS_WITH(OrthographicCamera(1000, 0, 0, 640, 0),
                    "OrthographicCamera: height [px] must be 1 to 32768, got 0");
}
