// SPDX-License-Identifier: MIT
#pragma once

/// A threshold for images in which liquid and surroundings differ in brightness, found from the image itself.

#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A split of pixel values in two.
struct OtsuThreshold {
  double counts = 0;  ///< values below it are one class, values above it the other; no pixel has this value itself

  /// Variance between the classes over variance of the whole (Otsu 1979, eta), in (0, 1]: 1 for two values, 0.75 for
  /// evenly spread ones, 0.64 for one Gaussian. At or below these, the image does not fall into two classes.
  double separability = 0;
};

/// How often each pixel value occurs, in one image or in many: a threshold from several frames, some with much liquid,
/// is steadier than one per frame. One bin per value, so nothing is rounded: 256 bins for 8 bits, 65,536 for 16.
template <class Pixel>
requires std::same_as<Pixel, std::uint8_t> || std::same_as<Pixel, std::uint16_t>
class PixelHistogram {
 public:
  PixelHistogram() : counts_(static_cast<std::size_t>(std::numeric_limits<Pixel>::max()) + 1, 0) {}

  /// Counts an image's pixels in. Does not allocate.
  void add(const ConstImageView<Pixel>& image) noexcept {
    for (Index v = 0; v < image.rows(); ++v) {
      const Pixel* row = image.data() + v * image.outerStride();
      for (Index u = 0; u < image.cols(); ++u) {
        ++counts_[row[u]];
      }
    }
  }

  void clear() noexcept { counts_.assign(counts_.size(), 0); }

  /// How many pixels had this value.
  std::int64_t count(Pixel value) const noexcept { return counts_[value]; }

  /// The threshold that leaves most variance between the classes (Otsu 1979, "A Threshold Selection Method from
  /// Gray-Level Histograms", eq. 19), half way between the two values that occur on either side of it: all splits in
  /// between are equally good, and there the nearer class is farthest. Of equal maxima the lowest. Nothing where fewer
  /// than two values occur: there is no second class then, and any threshold would be a guess.
  std::optional<OtsuThreshold> otsu() const noexcept {
    std::int64_t pixels = 0;
    double sum = 0;
    for (std::size_t value = 0; value < counts_.size(); ++value) {
      pixels += counts_[value];
      sum += static_cast<double>(value) * static_cast<double>(counts_[value]);
    }
    const double all = static_cast<double>(pixels);
    double variance = 0;  // of the whole, times the number of pixels
    double largest = 0;   // between the classes, likewise
    std::size_t below = 0;
    std::optional<OtsuThreshold> best;
    std::int64_t pixels_below = 0;
    double sum_below = 0;
    bool open = false;  // the best split so far waits for the next value that occurs
    for (std::size_t value = 0; value < counts_.size(); ++value) {
      if (counts_[value] == 0) {
        continue;
      }
      if (open) {
        best = OtsuThreshold{0.5 * (static_cast<double>(below) + static_cast<double>(value)), 0};
        open = false;
      }
      const double from_mean = static_cast<double>(value) - sum / all;
      variance += from_mean * from_mean * static_cast<double>(counts_[value]);
      pixels_below += counts_[value];
      sum_below += static_cast<double>(value) * static_cast<double>(counts_[value]);
      if (pixels_below == pixels) {
        break;
      }
      // eq. 18 with the two means apart, which does not cancel
      const double n0 = static_cast<double>(pixels_below);
      const double n1 = all - n0;
      const double apart = (sum - sum_below) / n1 - sum_below / n0;
      const double between = n0 * n1 / all * apart * apart;
      if (between > largest) {
        largest = between;
        below = value;
        open = true;
      }
    }
    if (best) {
      best->separability = largest / variance;
    }
    return best;
  }

 private:
  std::vector<std::int64_t> counts_;
};

/// Otsu's threshold of one 8 or 16 bit image, any row stride. Nothing where the image has fewer than two different
/// values. Allocates its histogram: for set-up; keep a PixelHistogram where frames come in.
template <class Derived>
std::optional<OtsuThreshold> otsu_threshold(const Eigen::ArrayBase<Derived>& image) {
  PixelHistogram<typename Derived::Scalar> histogram;
  histogram.add(image.derived());
  return histogram.otsu();
}

}  // namespace decant::inline DECANT_TARGET
