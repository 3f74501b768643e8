// SPDX-License-Identifier: MIT
#pragma once

/// Tells liquid from its surroundings by temperature: heated liquid shines in a thermal image, whatever its colour.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

#include <decant/camera/affine_map.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What thermal cameras deliver: raw counts of 8 or 16 bits, or temperatures.
template <class P>
concept ThermalPixel = std::same_as<P, std::uint8_t> || std::same_as<P, std::uint16_t> || std::same_as<P, float> ||
    std::same_as<P, double>;

/// Marks pixels from `threshold` on (in the image's own counts) as liquid, others with 0. Image and mask are paired
/// from the top left pixel; mask pixels beyond the image get 0. NaN, as pixel or threshold, is not liquid.
template <class Derived>
requires ThermalPixel<typename Derived::Scalar>
void label_by_threshold(const Eigen::ArrayBase<Derived>& thermal, double threshold, MaskView liquid) noexcept {
  using Pixel = typename Derived::Scalar;
  const ConstImageView<Pixel> image(thermal.derived());
  // In the image's own type, so that no pixel is converted: the smallest value that is not below the threshold.
  constexpr double largest = static_cast<double>(std::numeric_limits<Pixel>::max());
  constexpr double lowest = static_cast<double>(std::numeric_limits<Pixel>::lowest());
  const bool none = !(threshold <= largest);
  const double within = none ? 0.0 : std::max(threshold, lowest);
  auto least = static_cast<Pixel>(std::is_integral_v<Pixel> ? std::ceil(within) : within);
  if constexpr (std::same_as<Pixel, float>) {
    if (static_cast<double>(least) < within) {
      least = std::nextafter(least, std::numeric_limits<float>::infinity());
    }
  }
  const std::uint8_t hit = none ? 0 : mask_liquid;
  const Index rows = std::min(image.rows(), liquid.rows());
  const Index columns = std::min(image.cols(), liquid.cols());
  for (Index v = 0; v < liquid.rows(); ++v) {
    std::uint8_t* out = liquid.data() + v * liquid.outerStride();
    const Index in_image = v < rows ? columns : 0;
    const Pixel* row = image.data() + (v < rows ? v * image.outerStride() : 0);
    for (Index u = 0; u < in_image; ++u) {
      out[u] = row[u] >= least ? hit : std::uint8_t(0);
    }
    std::fill(out + in_image, out + liquid.cols(), std::uint8_t(0));
  }
}

/// The label of a thermal image in another camera's image, for two cameras beside each other whose images are tied by
/// an affine map. A value; label and mark_seen may be called from any thread and do not allocate.
///
/// Each pixel of the other image is taken back into the thermal one, the counts there are interpolated bilinearly, and
/// then compared with the threshold. Labelling first and taking the nearest label puts edges wherever the thermal
/// pixels' edges are; a thermal pixel is often wider than one of the other image. Interpolated counts cross the
/// threshold where the edge is.
///
/// How exact the map is decides more: an affine map leaves some pixels of lens distortion and perspective
/// (camera/affine_registration.hpp measures them), and it holds for one distance from the cameras.
class ThermalLabel {
 public:
  /// @param threshold in the thermal image's counts, finite; from it on a value is liquid, as with masks.
  /// @param image_from_thermal takes thermal pixels to the other image's (affine_to_image of a recording).
  /// Throws std::invalid_argument.
  ThermalLabel(double threshold, const AffineMap& image_from_thermal)
      : threshold_(threshold), thermal_from_image_(image_from_thermal.inverse()) {
    expects(std::isfinite(threshold), "ThermalLabel: threshold [counts]", "finite", threshold);
  }

  /// Marks liquid in the other camera's image, of any size, and writes 0 elsewhere, also where the thermal camera does
  /// not see: mark_seen tells these two apart. @param thermal image of any size.
  template <class Derived>
  requires ThermalPixel<typename Derived::Scalar>
  void label(const Eigen::ArrayBase<Derived>& thermal, MaskView liquid) const noexcept {
    const ConstImageView<typename Derived::Scalar> image(thermal.derived());
    fill(image, liquid, [threshold = threshold_](double counts) { return counts >= threshold; });
  }

  /// Marks with 255 the pixels about which this thermal image says something, and with 0 the others: those that fall
  /// more than half a pixel outside of it, or on a value that is NaN. No liquid there means "not known", so a
  /// corrector, score or likelihood has to leave them out.
  template <class Derived>
  requires ThermalPixel<typename Derived::Scalar>
  void mark_seen(const Eigen::ArrayBase<Derived>& thermal, MaskView seen) const noexcept {
    const ConstImageView<typename Derived::Scalar> image(thermal.derived());
    fill(image, seen, [](double counts) { return counts == counts; });
  }

  double threshold() const noexcept { return threshold_; }
  const AffineMap& thermal_from_image() const noexcept { return thermal_from_image_; }

 private:
  // Writes 255 where test(counts) holds; counts are NaN where the thermal image has nothing. Between the outermost
  // pixels' centres and the image's border, the outermost value holds.
  template <class Pixel, class Test>
  void fill(const ConstImageView<Pixel>& image, MaskView& mask, Test&& test) const noexcept {
    if (image.size() == 0) {
      mask.setZero();
      return;
    }
    // plain numbers, which the compiler knows not to change when a label, a byte like any other, is written
    const Eigen::Matrix2d a = thermal_from_image_.linear();
    const Eigen::Vector2d b = thermal_from_image_.offset();
    const double x_per_column = a(0, 0), x_per_row = a(0, 1), x_offset = b(0);
    const double y_per_column = a(1, 0), y_per_row = a(1, 1), y_offset = b(1);
    const double last_column = static_cast<double>(image.cols() - 1);
    const double last_row = static_cast<double>(image.rows() - 1);
    const int next_column = image.cols() > 1 ? 1 : 0;
    const int next_row = image.rows() > 1 ? 1 : 0;
    const double last_left = static_cast<double>(image.cols() - 1 - next_column);
    const double last_top = static_cast<double>(image.rows() - 1 - next_row);
    const std::ptrdiff_t stride = image.outerStride();
    const Pixel* data = image.data();
    for (Index v = 0; v < mask.rows(); ++v) {
      std::uint8_t* out = mask.data() + v * mask.outerStride();
      const double row_x = x_per_row * static_cast<double>(v) + x_offset;
      const double row_y = y_per_row * static_cast<double>(v) + y_offset;
      for (Index u = 0; u < mask.cols(); ++u) {
        const double x = x_per_column * static_cast<double>(u) + row_x;
        const double y = y_per_column * static_cast<double>(u) + row_y;
        const bool inside = (x >= -0.5) & (y >= -0.5) & (x < last_column + 0.5) & (y < last_row + 0.5);
        const double column = std::min(std::max(x, 0.0), last_column);
        const double row = std::min(std::max(y, 0.0), last_row);
        const int left = static_cast<int>(std::min(column, last_left));
        const int top = static_cast<int>(std::min(row, last_top));
        const Pixel* corner = data + top * stride + left;
        const double right_share = column - left;
        const double lower_share = row - top;
        const double upper = mix<Pixel>(corner[0], corner[next_column], right_share);
        const double lower =
            mix<Pixel>(corner[next_row * stride], corner[next_row * stride + next_column], right_share);
        // no branch: an edge would be mispredicted
        out[u] = static_cast<std::uint8_t>(mask_liquid * (inside & test(mix<Pixel>(upper, lower, lower_share))));
      }
    }
  }

  // A NaN that has no share in the value does not spoil it; integers need not be asked.
  template <class Pixel>
  static double mix(double first, double second, double share) noexcept {
    if constexpr (std::floating_point<Pixel>) {
      if (share == 0) {
        return first;
      }
      if (share == 1) {
        return second;
      }
    }
    return first + share * (second - first);
  }

  double threshold_;
  AffineMap thermal_from_image_;
};

}  // namespace decant::inline DECANT_TARGET
