// SPDX-License-Identifier: MIT
#include <decant/camera/pinhole_camera.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <png.h>

#include <decant/camera/posed_camera.hpp>
#include <decant/core/image.hpp>

#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::PinholeCamera;
using Point = decant::Vector3<double>;

template <int Size>
Eigen::Matrix<double, Size, Size> matrix_from(const std::filesystem::path& path) {
  std::ifstream file(path);
  Eigen::Matrix<double, Size, Size> result;
  for (int row = 0; row < Size; ++row) {
    for (int column = 0; column < Size; ++column) {
      file >> result(row, column);
    }
  }
  REQUIRE(file);
  return result;
}

decant::Mask mask_from(const std::filesystem::path& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&image, path.c_str()) != 0);
  image.format = PNG_FORMAT_GRAY;
  decant::Mask mask(image.height, image.width);
  REQUIRE(png_image_finish_read(&image, nullptr, mask.data(), 0, nullptr) != 0);
  return mask;
}

}  // namespace

TEST_CASE("The pinhole projects by its formula") {
  const PinholeCamera camera(600, 500, 320, 240, 640, 480);
  const decant::Projection seen = camera.project({0.2, -0.1, 0.5});
  CHECK(seen.pixel.x() == Approx(560));  // 600 * 0.4 + 320
  CHECK(seen.pixel.y() == Approx(140));  // 240 - 500 * 0.2
  CHECK(seen.depth == 0.5);
  CHECK(seen.visible);
  CHECK_FALSE(camera.project({0.3, -0.1, 0.5}).visible);  // u = 680
  CHECK(camera.project({0.3, -0.1, 0.5}).projected());
  CHECK_FALSE(camera.project({0.2, -0.1, -0.5}).projected());
  CHECK((camera.unproject({560, 140}, 2) - Point(0.8, -0.4, 2)).norm() < 1e-12);
}

TEST_CASE("What is not a pinhole is refused in one line") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(PinholeCamera(-3, 500, 320, 240, 640, 480), "PinholeCamera: fx [px] must be > 0, got -3");
  CHECK_THROWS_WITH(PinholeCamera(600, nan, 320, 240, 640, 480), "PinholeCamera: fy [px] must be > 0, got nan");
  CHECK_THROWS_WITH(PinholeCamera(600, 500, nan, 240, 640, 480), "PinholeCamera: cx [px] must be finite, got nan");
  CHECK_THROWS_WITH(PinholeCamera(600, 500, 320, nan, 640, 480), "PinholeCamera: cy [px] must be finite, got nan");
  CHECK_THROWS_WITH(PinholeCamera(600, 500, 320, 240, 0, 480), "PinholeCamera: width [px] must be 1 to 32768, got 0");
  CHECK_THROWS_WITH(PinholeCamera(600, 500, 320, 240, 640, 40000),
                    "PinholeCamera: height [px] must be 1 to 32768, got 40000");
}

// Figures from the data's README, computed there by other means: the rays of the liquid's mask meet the vertical plane
// through the bottle, across the horizontal part of the bottle's axis, where the stream is.
TEST_CASE("The pinhole finds the stream in photographs of a robot that pours") {
  const auto folder = decant_test::measurements("pourit_frames");
  if (!folder) {
    return;
  }
  struct Frame {
    std::string name;
    int liquid_pixels;
    double curvature;  // of the stream's centre line: z = curvature s^2 + ... [1/m]
  };
  for (const Frame& frame : {Frame{"scene1/000248", 1946, -14.8}, Frame{"scene2/000246", 2114, -16.8}}) {
    INFO(frame.name);
    const std::string stem = (*folder / frame.name).string();
    const auto intrinsics = matrix_from<3>(stem + "_camK.txt");
    const auto base_from_camera = matrix_from<4>(stem + "_Tcam2base.txt");
    const auto camera_from_bottle = matrix_from<4>(stem + "_Tobj2cam.txt");
    const decant::Mask mask = mask_from(stem + "_mask.png");
    REQUIRE((mask.rows() == 480 && mask.cols() == 480));

    const Eigen::Matrix4d camera_from_base = base_from_camera.inverse();
    const decant::Pose pose{Eigen::Quaterniond(Eigen::Matrix3d(camera_from_base.topLeftCorner<3, 3>())).normalized(),
                            camera_from_base.topRightCorner<3, 1>()};
    const decant::PosedCamera<PinholeCamera> camera(
        PinholeCamera(intrinsics(0, 0), intrinsics(1, 1), intrinsics(0, 2), intrinsics(1, 2), 480, 480), pose);
    CHECK((camera.position() - base_from_camera.topRightCorner<3, 1>()).norm() < 1e-9);

    const Eigen::Matrix4d base_from_bottle = base_from_camera * camera_from_bottle;
    const Point on_plane = base_from_bottle.topRightCorner<3, 1>();
    Point normal = base_from_bottle.block<3, 1>(0, 2);
    normal.z() = 0;
    normal.normalize();
    const auto place = [&](const Eigen::Vector2d& pixel) -> Point {
      const Point ray = camera.unproject(pixel, 1) - camera.position();
      return camera.position() + normal.dot(on_plane - camera.position()) / normal.dot(ray) * ray;
    };

    int pixels = 0;
    Point low = Point::Constant(1e9), high = -low;
    std::vector<Point> center_line;
    for (decant::Index v = 0; v < mask.rows(); ++v) {
      double sum = 0;
      int count = 0;
      for (decant::Index u = 0; u < mask.cols(); ++u) {
        if (!decant::is_liquid(mask(v, u))) {
          continue;
        }
        const Eigen::Vector2d pixel(static_cast<double>(u), static_cast<double>(v));
        const Point x = place(pixel);
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
        const decant::Projection back = camera.project(x);
        REQUIRE(back.visible);
        REQUIRE((back.pixel - pixel).norm() < 1e-9);
        sum += static_cast<double>(u);
        ++count;
        ++pixels;
      }
      if (count > 0) {
        center_line.push_back(place({sum / count, static_cast<double>(v)}));
      }
    }
    CHECK(pixels == frame.liquid_pixels);
    // the README gives two digits behind the point, over both frames
    CHECK(low.x() > 0.40);
    CHECK(high.x() < 0.42);
    CHECK(low.y() > 0.06);
    CHECK(high.y() < 0.14);
    CHECK(low.z() > 0.83);
    CHECK(high.z() < 0.93);

    const Point along = Point::UnitZ().cross(normal);
    Eigen::MatrixX3d powers(static_cast<decant::Index>(center_line.size()), 3);
    Eigen::VectorXd height(powers.rows());
    for (decant::Index i = 0; i < powers.rows(); ++i) {
      const Point& x = center_line[static_cast<std::size_t>(i)];
      const double s = along.dot(x - on_plane);
      powers.row(i) << s * s, s, 1;
      height[i] = x.z();
    }
    const Eigen::Vector3d fit = powers.colPivHouseholderQr().solve(height);
    CHECK(fit[0] == Approx(frame.curvature).margin(0.1));  // printed with three digits
  }
}
