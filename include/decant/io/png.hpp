// SPDX-License-Identifier: MIT
#pragma once

/// Colour pictures in memory and as PNG (libpng; link PNG::PNG).

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <png.h>

#include <decant/core/expects.hpp>
#include <decant/io/detail/text.hpp>

namespace decant {

/// Pixels row by row from the top left, three bytes (red, green, blue) each.
struct Picture {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  std::vector<std::uint8_t> rgb;

  Picture() = default;
  Picture(int columns, int rows) : width(columns), height(rows) {
    expects(columns > 0 && columns <= 16384, "Picture: width [px]", "1 to 16384", columns);
    expects(rows > 0 && rows <= 16384, "Picture: height [px]", "1 to 16384", rows);
    rgb.resize(3 * static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 255);
  }

  /// The three bytes of a pixel.
  std::uint8_t* at(int row, int column) {
    return &rgb[3 *
                (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column))];
  }
};

/// The picture as a PNG file's bytes. Throws std::runtime_error where libpng fails.
inline std::string png_bytes(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.rgb.data(), 0, nullptr) == 0) {
    throw std::runtime_error("a PNG picture cannot be encoded: " + std::string(image.message));
  }
  bytes.resize(size);
  return bytes;
}

inline void write_png(const std::filesystem::path& path, const Picture& picture) {
  detail::write_text_file(path, png_bytes(picture));
}

}  // namespace decant
