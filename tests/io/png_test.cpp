// SPDX-License-Identifier: MIT
// PNG: what is encoded is what is read back, whatever the kind of file; what is damaged is refused.

#include <decant/io/png.hpp>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

namespace {

// A PNG file of any kind through libpng's own calls. `rows` holds packed samples as the file has them.
std::string encoded(int width, int height, int depth, int colour_type, std::vector<std::vector<std::uint8_t>> rows,
                    const std::function<void(png_structp, png_infop)>& settings = {},
                    int interlace = PNG_INTERLACE_NONE) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp file, png_bytep data, std::size_t count) {
        static_cast<std::string*>(png_get_io_ptr(file))->append(reinterpret_cast<const char*>(data), count);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), depth, colour_type,
               interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (settings) {
    settings(png, info);
  }
  png_write_info(png, info);
  std::vector<png_bytep> pointers;
  for (auto& row : rows) {
    pointers.push_back(row.data());
  }
  png_write_image(png, pointers.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

std::string refusal(const std::string& bytes) {
  return decant_test::message_of([&] { decant::parse_png_grey8(bytes, "m.png"); });
}

}  // namespace

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

TEST_CASE("png: pictures of few colours take few bits and keep their colours") {
  for (const int count : {1, 2, 4, 6, 16, 200}) {
    INFO(count);
    decant::PalettePicture picture;
    picture.index.resize(3, 70);
    for (int k = 0; k < picture.index.size(); ++k) {
      picture.index.data()[k] = static_cast<std::uint8_t>((7 * k) % count);
    }
    for (int k = 0; k < count; ++k) {
      picture.colours.push_back({static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(255 - k), 77});
    }
    const std::string bytes = decant::png_bytes(picture);
    const decant::PngHeader header = decant::parse_png_header(bytes, "p.png");
    CHECK(header.colour_type == PNG_COLOR_TYPE_PALETTE);
    CHECK(header.bit_depth == (count <= 2 ? 1 : count <= 4 ? 2 : count <= 16 ? 4 : 8));
    decant::Picture read = decant::parse_png_picture(bytes, "p.png");
    REQUIRE(read.width == 70);
    REQUIRE(read.height == 3);
    bool equal = true;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 70; ++column) {
        equal = equal && std::equal(read.at(row, column), read.at(row, column) + 3,
                                    picture.colours[picture.index(row, column)].begin());
      }
    }
    CHECK(equal);
  }
  decant::PalettePicture wrong{decant::Image<std::uint8_t>::Constant(1, 1, 2), {{0, 0, 0}, {1, 1, 1}}};
  CHECK_THROWS_WITH(decant::png_bytes(wrong), "PalettePicture: index must be less than the number of colours, got 2");
  wrong.colours.clear();
  CHECK_THROWS_WITH(decant::png_bytes(wrong), "PalettePicture: number of colours must be 1 to 256, got 0");
}

TEST_CASE("png: sizes are checked") {
  CHECK_THROWS_WITH(decant::Picture(0, 5), "Picture: width [px] must be 1 to 16384, got 0");
  CHECK_THROWS_WITH(decant::Picture(5, 100000), "Picture: height [px] must be 1 to 16384, got 100000");
}

TEST_CASE("png: grey images of 8 and 16 bits are read back exactly") {
  const decant_test::TemporaryFolder folder("png_grey");
  decant::Mask mask(3, 5);
  decant::Image<std::uint16_t> thermal(3, 5);
  for (Eigen::Index k = 0; k < mask.size(); ++k) {
    mask.data()[k] = static_cast<std::uint8_t>(17 * k);
    thermal.data()[k] = static_cast<std::uint16_t>(31200 + 257 * k + (k % 3));
  }
  thermal(0, 0) = 1;
  thermal(2, 4) = 65535;
  decant::write_png(folder.path() / "m.png", mask);
  decant::write_png(folder.path() / "t.png", thermal);
  CHECK((decant::read_png_grey8(folder.path() / "m.png") == mask).all());
  CHECK((decant::read_png_grey16(folder.path() / "t.png") == thermal).all());
  // a block of an image is written without its surroundings
  const auto block = decant::parse_png_grey8(decant::png_bytes(mask.block(1, 2, 2, 3)), "b.png");
  CHECK((block == mask.block(1, 2, 2, 3)).all());
  CHECK(decant::parse_png_grey16(decant::png_bytes(thermal.block(1, 1, 2, 2)), "b.png")(1, 1) == thermal(2, 2));
}

TEST_CASE("png: a picture is read as colours, a grey one as equal ones") {
  const decant_test::TemporaryFolder folder("png_picture");
  decant::Picture picture(2, 1);
  picture.rgb = {1, 2, 3, 4, 5, 6};
  decant::write_png(folder.path() / "p.png", picture);
  CHECK(decant::read_png_picture(folder.path() / "p.png").rgb == picture.rgb);
  const auto grey = decant::parse_png_picture(decant::png_bytes(decant::Mask::Constant(1, 2, 7)), "g.png");
  CHECK(grey.rgb == std::vector<std::uint8_t>(6, 7));
}

TEST_CASE("png: masks of every kind of file") {
  const auto read = [](const std::string& bytes) { return decant::parse_png_grey8(bytes, "m.png"); };
  SECTION("one bit") {
    const auto mask = read(encoded(3, 1, 1, PNG_COLOR_TYPE_GRAY, {{0x40}}));
    CHECK((mask == (decant::Mask(1, 3) << 0, 255, 0).finished()).all());
  }
  SECTION("four bits") {
    const auto mask = read(encoded(2, 1, 4, PNG_COLOR_TYPE_GRAY, {{0x8F}}));
    CHECK((mask == (decant::Mask(1, 2) << 136, 255).finished()).all());
  }
  SECTION("16 bits") {
    const auto mask = read(encoded(3, 1, 16, PNG_COLOR_TYPE_GRAY, {{0xFF, 0xFF, 0x80, 0x00, 0x00, 0xFF}}));
    CHECK((mask == (decant::Mask(1, 3) << 255, 128, 1).finished()).all());
  }
  SECTION("grey with alpha") {
    const auto mask = read(encoded(2, 1, 8, PNG_COLOR_TYPE_GRAY_ALPHA, {{200, 0, 10, 255}}));
    CHECK((mask == (decant::Mask(1, 2) << 200, 10).finished()).all());
  }
  SECTION("a palette of greys, with transparency") {
    const auto mask = read(encoded(3, 1, 2, PNG_COLOR_TYPE_PALETTE, {{0x18}}, [](png_structp png, png_infop info) {
      png_color palette[3] = {{0, 0, 0}, {255, 255, 255}, {9, 9, 9}};
      png_byte alpha[3] = {0, 10, 255};
      png_set_PLTE(png, info, palette, 3);
      png_set_tRNS(png, info, alpha, 3, nullptr);
    }));
    CHECK((mask == (decant::Mask(1, 3) << 0, 255, 9).finished()).all());
  }
  SECTION("colours with alpha that are grey") {
    const auto mask = read(encoded(2, 1, 8, PNG_COLOR_TYPE_RGB_ALPHA, {{255, 255, 255, 0, 3, 3, 3, 1}}));
    CHECK((mask == (decant::Mask(1, 2) << 255, 3).finished()).all());
  }
  SECTION("interlaced, with a gamma that must not act") {
    const std::string bytes = encoded(
        3, 3, 8, PNG_COLOR_TYPE_GRAY, {{1, 2, 3}, {100, 128, 127}, {7, 8, 255}},
        [](png_structp png, png_infop info) { png_set_gAMA(png, info, 1.0); }, PNG_INTERLACE_ADAM7);
    CHECK((read(bytes) == (decant::Mask(3, 3) << 1, 2, 3, 100, 128, 127, 7, 8, 255).finished()).all());
  }
  SECTION("16 bits of grey with a gamma stay exact") {
    const std::string bytes = encoded(2, 1, 16, PNG_COLOR_TYPE_GRAY, {{0x79, 0xE0, 0x00, 0x01}},
                                      [](png_structp png, png_infop info) { png_set_gAMA(png, info, 0.45455); });
    const auto image = decant::parse_png_grey16(bytes, "t.png");
    CHECK(image(0, 0) == 31200);
    CHECK(image(0, 1) == 1);
  }
}

TEST_CASE("png: what is no image of the kind asked for is refused with one line") {
  const std::string colour = encoded(2, 1, 8, PNG_COLOR_TYPE_RGB, {{5, 5, 5, 255, 0, 0}});
  CHECK(refusal(colour) == "m.png must be grey in every pixel, got a colour in row 0, column 1");
  const std::string eight = encoded(2, 1, 8, PNG_COLOR_TYPE_GRAY, {{5, 6}});
  CHECK(decant_test::message_of([&] { decant::parse_png_grey16(eight, "t.png"); }) ==
        "t.png: bits per sample must be 16, got 8");
  CHECK(refusal("") == "m.png must be a PNG file, got an empty one");
  CHECK(refusal("GIF89a" + std::string(40, '\n')).find("m.png must be a PNG file, got \"GIF89a\\x0a") == 0);

  std::string large = eight;  // 2^14 + 1 pixels wide
  large[18] = '\x40';
  large[19] = '\x01';
  CHECK(refusal(large) == "m.png: size [px] must be 1 to 16384 a side and at most 2^26 in all, got 16385 x 1");
  std::string wide = eight;  // 16384 x 16384
  wide[18] = '\x40';
  wide[19] = '\0';
  wide[22] = '\x40';
  wide[23] = '\0';
  CHECK(refusal(wide).find("16384 x 16384") != std::string::npos);
  std::string empty = eight;
  empty[19] = '\0';
  CHECK(refusal(empty).find("got 0 x 1") != std::string::npos);

  for (std::size_t size = 0; size < eight.size(); ++size) {
    const std::string message = refusal(eight.substr(0, size));
    INFO(message);
    CHECK(message.find("m.png must be a") == 0);
    CHECK(message.find('\n') == std::string::npos);
  }
  std::string damaged = eight;
  damaged[damaged.size() - 20] = static_cast<char>(damaged[damaged.size() - 20] ^ 0x55);
  CHECK(refusal(damaged).find("m.png must be a whole and undamaged PNG file") == 0);
  CHECK(decant_test::message_of([] { decant::read_png_grey8("/nonexistent/m.png"); }) ==
        "/nonexistent/m.png: no such file");
}

TEST_CASE("png: a small file does not get memory for a large image") {
  // the header of 8192 x 8192 pixels with a right checksum, and nearly nothing behind it
  std::vector<std::vector<std::uint8_t>> rows(8192, std::vector<std::uint8_t>(8192, 0));
  const std::string whole = encoded(8192, 8192, 8, PNG_COLOR_TYPE_GRAY, std::move(rows));
  CHECK(decant::parse_png_grey8(whole, "m.png").size() == 8192 * 8192);
  CHECK(refusal(whole.substr(0, 2000)) == "m.png must be a whole and undamaged PNG file, got 2000 bytes");
}
