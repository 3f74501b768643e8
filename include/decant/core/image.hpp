// SPDX-License-Identifier: MIT
#pragma once

/// Images as plain arrays, indexed (row, column) = (v, u), row by row in memory; pixel (0, 0) is the top left one and
/// whole numbers are pixel centres.

#include <cstdint>

#include <Eigen/Core>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// An image that owns its pixels.
template <class T>
using Image = Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Pixels that somebody else owns, to read: an Image, a block of one, or an Eigen::Map of a camera driver's buffer. A
/// row may be followed by padding. What is not stored row by row is copied.
template <class T>
using ConstImageView = Eigen::Ref<const Image<T>, 0, Eigen::OuterStride<>>;

/// Pixels that somebody else owns, to write.
template <class T>
using ImageView = Eigen::Ref<Image<T>, 0, Eigen::OuterStride<>>;

/// What a segmentation of the camera's picture says, one byte per pixel.
using Mask = Image<std::uint8_t>;
using ConstMaskView = ConstImageView<std::uint8_t>;
using MaskView = ImageView<std::uint8_t>;

inline constexpr std::uint8_t mask_liquid = 255;  ///< what decant writes where there is liquid, 0 elsewhere

/// Whether a mask's pixel counts as liquid: from 128 on, so that a mask that went through scaling or compression still
/// reads as one.
constexpr bool is_liquid(std::uint8_t value) noexcept { return value >= 128; }

}  // namespace decant::inline DECANT_TARGET
