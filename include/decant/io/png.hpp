// SPDX-License-Identifier: MIT
#pragma once

/// Pictures, masks and thermographic images as PNG (libpng; link PNG::PNG). Files may come from anywhere: sizes are
/// held against bounds, and against the bytes that a file has, before memory is taken for them.

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <png.h>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

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

/// A picture of few colours: PNG files of such take a tenth of the room of others.
struct PalettePicture {
  Image<std::uint8_t> index{};                         ///< of each pixel's colour
  std::vector<std::array<std::uint8_t, 3>> colours{};  ///< red, green, blue; 1 to 256 of them
};

/// What a PNG file says about itself before its pixels.
struct PngHeader {
  int width = 0;        ///< [px], 1 to 16384
  int height = 0;       ///< [px], 1 to 16384
  int bit_depth = 0;    ///< of one channel, or of a palette's index: 1, 2, 4, 8 or 16
  int colour_type = 0;  ///< PNG's own: 0 grey, 2 red green blue, 3 palette, 4 grey and alpha, 6 colour and alpha
};

/// The header in the first bytes of a PNG file; 29 of them are enough. `name` stands for the file in messages. Throws
/// std::runtime_error, one line, where this is no PNG or one of more than 16384 pixels a side or 2^26 in all.
inline PngHeader parse_png_header(std::string_view bytes, std::string_view name) {
  constexpr std::string_view beginning("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", 16);
  const auto refuse = [&](std::string_view what, std::string_view expected, std::string_view got) {
    detail::refuse_file(std::string(name).append(what), expected, got);
  };
  if (bytes.size() < 29 || bytes.substr(0, beginning.size()) != beginning) {
    refuse("", "a PNG file", bytes.empty() ? "an empty one" : detail::visible_text(bytes, 16));
  }
  const auto byte = [&](std::size_t k) { return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[k])); };
  const auto number = [&](std::size_t k) {
    return byte(k) << 24U | byte(k + 1) << 16U | byte(k + 2) << 8U | byte(k + 3);
  };
  const std::uint32_t width = number(16), height = number(20);
  constexpr std::uint32_t side_limit = 16384;
  constexpr std::uint64_t pixel_limit = std::uint64_t{1} << 26;
  if (!(width >= 1 && width <= side_limit && height >= 1 && height <= side_limit &&
        std::uint64_t{width} * height <= pixel_limit)) {
    refuse(": size [px]", "1 to 16384 a side and at most 2^26 in all",
           std::to_string(width) + " x " + std::to_string(height));
  }
  PngHeader header;
  header.width = static_cast<int>(width);
  header.height = static_cast<int>(height);
  header.bit_depth = static_cast<int>(byte(24));
  header.colour_type = static_cast<int>(byte(25));
  return header;
}

namespace detail {

/// Throws std::runtime_error, one line, where the image is of another size.
inline void expect_png_size(const PngHeader& header, int width, int height, const std::string& name) {
  if (header.width != width || header.height != height) {
    refuse_file(name + ": size [px]", std::to_string(width) + " x " + std::to_string(height),
                std::to_string(header.width) + " x " + std::to_string(header.height));
  }
}

/// Takes a PNG apart with libpng's own calls: its simplified ones apply the file's gamma, which would change what a
/// mask or a thermographic image says. Nothing in the members that libpng may leave by longjmp has a destructor.
class PngDecoder {
 public:
  PngDecoder(std::string_view bytes, std::string_view name) : bytes_(bytes), name_(name) {
    header_ = parse_png_header(bytes, name);
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, &PngDecoder::on_error, &PngDecoder::on_warning);
    info_ = png_ != nullptr ? png_create_info_struct(png_) : nullptr;
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, &info_, nullptr);
      throw std::runtime_error("libpng cannot be set up");
    }
  }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;
  ~PngDecoder() { png_destroy_read_struct(&png_, &info_, nullptr); }

  const PngHeader& header() const noexcept { return header_; }
  std::size_t channels() const noexcept { return channels_; }

  /// Samples row by row, `channels()` of them for each pixel, one byte each, or two in this machine's order where
  /// `sixteen` (the file has to have 16 bits then). Alpha is left out.
  std::vector<std::uint8_t> samples(bool sixteen) {
    if (!begin(sixteen)) {
      refuse();
    }
    const auto height = static_cast<std::size_t>(header_.height);
    // deflate packs at most 1032 bytes into one: less cannot be the whole image
    if (stored_row_bytes_ * height / 1032 > bytes_.size()) {
      refuse();
    }
    std::vector<std::uint8_t> out(row_bytes_ * height);
    std::vector<png_bytep> rows(height);
    for (std::size_t row = 0; row < height; ++row) {
      rows[row] = out.data() + row * row_bytes_;
    }
    if (!finish(rows.data())) {
      refuse();
    }
    return out;
  }

 private:
  [[noreturn]] void refuse() const {
    std::string reason(message_.data());
    for (char& c : reason) {
      c = c >= ' ' && c <= '~' ? c : '?';
    }
    refuse_file(name_, "a whole and undamaged PNG file",
                std::to_string(bytes_.size()) + " bytes" + (reason.empty() ? "" : " (libpng: " + reason + ")"));
  }

  bool begin(bool sixteen) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_set_read_fn(png_, this, &PngDecoder::on_read);
    png_set_chunk_malloc_max(png_, 1 << 20);  // notes and profiles are not looked at, so they need no room
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    stored_row_bytes_ = png_get_rowbytes(png_, info_);
    if (header_.colour_type == PNG_COLOR_TYPE_PALETTE) {
      png_set_palette_to_rgb(png_);
    } else if (header_.colour_type == PNG_COLOR_TYPE_GRAY && header_.bit_depth < 8) {
      png_set_expand_gray_1_2_4_to_8(png_);
    }
    if (header_.bit_depth == 16) {
      if (!sixteen) {
        png_set_scale_16(png_);
      } else if constexpr (std::endian::native == std::endian::little) {
        png_set_swap(png_);
      }
    }
    png_set_strip_alpha(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    row_bytes_ = png_get_rowbytes(png_, info_);
    channels_ = png_get_channels(png_, info_);
    const std::size_t sample_bytes = sixteen ? 2 : 1;
    return row_bytes_ == channels_ * sample_bytes * static_cast<std::size_t>(header_.width) &&
           (channels_ == 1 || channels_ == 3);
  }

  bool finish(png_bytepp rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    return true;
  }

  static void on_read(png_structp png, png_bytep out, std::size_t count) {
    auto& self = *static_cast<PngDecoder*>(png_get_io_ptr(png));
    if (count > self.bytes_.size() - self.at_) {
      png_error(png, "the file ends early");
    }
    std::memcpy(out, self.bytes_.data() + self.at_, count);
    self.at_ += count;
  }

  [[noreturn]] static void on_error(png_structp png, png_const_charp text) {
    auto& self = *static_cast<PngDecoder*>(png_get_error_ptr(png));
    for (std::size_t k = 0; k + 1 < self.message_.size() && text[k] != '\0'; ++k) {
      self.message_[k] = text[k];
    }
    png_longjmp(png, 1);
  }

  static void on_warning(png_structp, png_const_charp) {}

  std::string_view bytes_;
  std::string_view name_;
  std::size_t at_ = 0;
  PngHeader header_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::size_t stored_row_bytes_ = 0;
  std::size_t row_bytes_ = 0;
  std::size_t channels_ = 0;
  std::array<char, 100> message_{};  // zeros, so that it always ends
};

template <class Value>
Image<Value> parse_png_grey(PngDecoder& decoder, std::string_view name) {
  const std::vector<std::uint8_t> samples = decoder.samples(sizeof(Value) == 2);
  const std::size_t step = decoder.channels() * sizeof(Value);
  Image<Value> image(decoder.header().height, decoder.header().width);
  Value pixel[3] = {};
  for (Eigen::Index k = 0; k < image.size(); ++k) {
    std::memcpy(pixel, samples.data() + static_cast<std::size_t>(k) * step, step);
    if (step > sizeof(Value) && (pixel[0] != pixel[1] || pixel[0] != pixel[2])) [[unlikely]] {
      refuse_file(
          name, "grey in every pixel",
          "a colour in row " + std::to_string(k / image.cols()) + ", column " + std::to_string(k % image.cols()));
    }
    image.data()[k] = pixel[0];
  }
  return image;
}

inline std::string encode_png(std::uint32_t format, Eigen::Index width, Eigen::Index height, const void* samples,
                              Eigen::Index row_stride, std::size_t colours = 0, const void* palette = nullptr) {
  expects(width >= 1 && width <= 16384, "PNG: width [px]", "1 to 16384", width);
  expects(height >= 1 && height <= 16384, "PNG: height [px]", "1 to 16384", height);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = format;
  image.colormap_entries = static_cast<png_uint_32>(colours);
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, samples, static_cast<png_int_32>(row_stride),
                                palette) == 0) {
    throw std::runtime_error("a PNG picture cannot be encoded: " + std::string(image.message));
  }
  bytes.resize(size);
  return bytes;
}

inline constexpr std::uintmax_t png_byte_limit = std::uintmax_t{1} << 28;

}  // namespace detail

/// A mask or another grey image of 8 bits from a PNG file's bytes. Grey of 1, 2 or 4 bits is stretched to 0..255, 16
/// bits are rounded to 8, alpha is left out; palettes and colour files are taken where every pixel is grey, since which
/// of two colours would be the brighter is nothing to guess. Values are taken as they are, without any gamma. `name`
/// stands for the file in messages. Throws std::runtime_error, one line.
inline Image<std::uint8_t> parse_png_grey8(std::string_view bytes, std::string_view name) {
  detail::PngDecoder decoder(bytes, name);
  return detail::parse_png_grey<std::uint8_t>(decoder, name);
}

/// A thermographic or depth image of 16 bits, exactly as stored. Files of fewer bits are refused: what one of their
/// counts stands for is not known. Else as parse_png_grey8.
inline Image<std::uint16_t> parse_png_grey16(std::string_view bytes, std::string_view name) {
  detail::PngDecoder decoder(bytes, name);
  if (decoder.header().bit_depth != 16) {
    detail::refuse_file(std::string(name) + ": bits per sample", "16", std::to_string(decoder.header().bit_depth));
  }
  return detail::parse_png_grey<std::uint16_t>(decoder, name);
}

/// Any PNG as a picture of 8 bits; alpha is left out. Throws std::runtime_error, one line.
inline Picture parse_png_picture(std::string_view bytes, std::string_view name) {
  detail::PngDecoder decoder(bytes, name);
  std::vector<std::uint8_t> samples = decoder.samples(false);
  Picture picture(decoder.header().width, decoder.header().height);
  if (decoder.channels() == 3) {
    picture.rgb = std::move(samples);
  } else {
    for (std::size_t k = 0; k < samples.size(); ++k) {
      std::fill_n(picture.rgb.begin() + static_cast<std::ptrdiff_t>(3 * k), 3, samples[k]);
    }
  }
  return picture;
}

/// parse_png_grey8 of a file of at most 256 MiB.
inline Image<std::uint8_t> read_png_grey8(const std::filesystem::path& path) {
  return parse_png_grey8(detail::read_text_file(path, detail::png_byte_limit), path.string());
}

/// parse_png_grey16 of a file of at most 256 MiB.
inline Image<std::uint16_t> read_png_grey16(const std::filesystem::path& path) {
  return parse_png_grey16(detail::read_text_file(path, detail::png_byte_limit), path.string());
}

/// parse_png_picture of a file of at most 256 MiB.
inline Picture read_png_picture(const std::filesystem::path& path) {
  return parse_png_picture(detail::read_text_file(path, detail::png_byte_limit), path.string());
}

/// The picture as a PNG file's bytes. Throws std::runtime_error where libpng fails.
inline std::string png_bytes(const Picture& picture) {
  return detail::encode_png(PNG_FORMAT_RGB, picture.width, picture.height, picture.rgb.data(), 0);
}

/// A mask, as 8-bit grey.
inline std::string png_bytes(const ConstImageView<std::uint8_t>& image) {
  return detail::encode_png(PNG_FORMAT_GRAY, image.cols(), image.rows(), image.data(), image.outerStride());
}

/// As few bits per pixel as the number of colours allows: 1, 2, 4 or 8. Throws std::invalid_argument where there are
/// no colours, more than 256, or fewer than the pixels ask for.
inline std::string png_bytes(const PalettePicture& picture) {
  expects(!picture.colours.empty() && picture.colours.size() <= 256, "PalettePicture: number of colours", "1 to 256",
          picture.colours.size());
  const int highest = picture.index.size() > 0 ? picture.index.maxCoeff() : 0;
  expects(highest < static_cast<int>(picture.colours.size()), "PalettePicture: index",
          "less than the number of colours", highest);
  return detail::encode_png(PNG_FORMAT_RGB_COLORMAP, picture.index.cols(), picture.index.rows(), picture.index.data(),
                            0, picture.colours.size(), picture.colours.data());
}

/// 16-bit grey, every count as it is.
inline std::string png_bytes(const ConstImageView<std::uint16_t>& image) {
  return detail::encode_png(PNG_FORMAT_LINEAR_Y, image.cols(), image.rows(), image.data(), image.outerStride());
}

inline void write_png(const std::filesystem::path& path, const Picture& picture) {
  detail::write_text_file(path, png_bytes(picture));
}

inline void write_png(const std::filesystem::path& path, const ConstImageView<std::uint8_t>& image) {
  detail::write_text_file(path, png_bytes(image));
}

inline void write_png(const std::filesystem::path& path, const ConstImageView<std::uint16_t>& image) {
  detail::write_text_file(path, png_bytes(image));
}

}  // namespace decant::inline DECANT_TARGET
