// SPDX-License-Identifier: MIT
// PNG: what is encoded is what libpng reads back.

#include <decant/io/png.hpp>

#include <cstdint>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

TEST_CASE("png: a picture survives encoding and decoding") {
  decant::Picture picture(3, 2);
  picture.at(0, 2)[0] = 10;
  picture.at(1, 0)[1] = 20;
  picture.at(1, 2)[2] = 30;
  const decant_test::TemporaryFolder folder("png");
  decant::write_png(folder.path() / "p.png", picture);
  const std::string bytes = decant::detail::read_text_file(folder.path() / "p.png", 1 << 20);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) != 0);
  CHECK(image.width == 3);
  CHECK(image.height == 2);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(image));
  REQUIRE(png_image_finish_read(&image, nullptr, rgb.data(), 0, nullptr) != 0);
  CHECK(rgb == picture.rgb);
  CHECK(rgb[6] == 10);
}

TEST_CASE("png: sizes are checked") {
  CHECK_THROWS_WITH(decant::Picture(0, 5), "Picture: width [px] must be 1 to 16384, got 0");
  CHECK_THROWS_WITH(decant::Picture(5, 100000), "Picture: height [px] must be 1 to 16384, got 100000");
}
