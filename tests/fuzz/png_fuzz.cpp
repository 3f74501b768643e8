// SPDX-License-Identifier: MIT
// libFuzzer target: any bytes as a PNG file end in an image of the size that its header states or in std::runtime_error
// of one line. Mutations get their checksums mended, or nearly all of them would end there. Build with clang++
// -fsanitize=fuzzer,address,undefined and link libpng and zlib; seeds are in corpus/png.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include <zlib.h>

#include <decant/io/png.hpp>

#include "survive.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed) {
  size = LLVMFuzzerMutate(data, size, max_size);
  if (seed % 8 == 0) {
    return size;  // wrong checksums now and then
  }
  // a chunk: length, four letters, content, checksum of letters and content
  for (std::size_t at = 8; at + 12 <= size;) {
    const std::size_t length = static_cast<std::size_t>(data[at]) << 24 | static_cast<std::size_t>(data[at + 1]) << 16 |
                               static_cast<std::size_t>(data[at + 2]) << 8 | data[at + 3];
    if (length > size - at - 12) {
      break;
    }
    const auto sum = static_cast<std::uint32_t>(crc32(0, data + at + 4, static_cast<unsigned int>(length + 4)));
    for (std::size_t k = 0; k < 4; ++k) {
      data[at + 8 + length + k] = static_cast<std::uint8_t>(sum >> (24 - 8 * k));
    }
    at += length + 12;
  }
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  survive([&] {
    const decant::PngHeader header = decant::parse_png_header(bytes, "fuzz.png");
    // anything larger is but slow, and its size is bounded by the file's bytes
    if (static_cast<std::int64_t>(header.width) * header.height > 1 << 20) {
      return;
    }
    survive([&] {
      const auto image = decant::parse_png_grey8(bytes, "fuzz.png");
      require(image.cols() == header.width && image.rows() == header.height);
    });
    survive([&] {
      const auto image = decant::parse_png_grey16(bytes, "fuzz.png");
      require(image.cols() == header.width && image.rows() == header.height);
    });
    survive([&] {
      const auto picture = decant::parse_png_picture(bytes, "fuzz.png");
      require(picture.width == header.width && picture.height == header.height);
    });
  });
  return 0;
}
