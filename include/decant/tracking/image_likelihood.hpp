// SPDX-License-Identifier: MIT
#pragma once

/// How probable an observed mask is, given a predicted one: what tells simulations apart.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/tracking/overlap.hpp>

namespace decant::inline DECANT_TARGET {

/// The paper's probability that a pixel is as predicted (Schenck & Fox 2017), so close to 1/2 because of underflow: the
/// odds of two predictions, a power of delta / (1 - delta), then stay below e^13 for all 307,200 pixels of an image.
/// Sums of logarithms do not underflow, so any delta will do here. With the paper's, a pixel is worth 4e-5 nat: one nat
/// takes 25,000 pixels.
inline constexpr double agreement_schenck2017 = 0.50001;

struct ImageLikelihoodSettings {
  /// delta, in (1/2, 1): the probability that a pixel is observed as predicted, if the prediction is right.
  double agreement = agreement_schenck2017;

  /// How many pixels are right or wrong together, >= 1. The paper takes pixels for independent (1). They are not: where
  /// an edge or a jet is off, so are hundreds of pixels, and counted one by one they make any model certain of itself
  /// after one frame. The log-likelihood is divided by this number (a tempered likelihood; as the dispersion of a
  /// quasi-likelihood, Wedderburn 1974): an image of n pixels counts like n / pixels_per_error independent ones.
  double pixels_per_error = 1;
};

/// log p(observed | predicted) = (agreeing log delta + differing log(1 - delta)) / pixels_per_error (Schenck & Fox
/// 2017, in log space; pixels that are not seen do not enter). Predictions rank the same whatever the settings, namely
/// by the number of pixels that differ; the settings say how sure one may be of the ranking. Add up over frames; only
/// likelihoods of the same observations with the same seen pixels may be compared.
class ImageLikelihood {
 public:
  /// Throws std::invalid_argument for a setting that is out of range or NaN.
  explicit ImageLikelihood(const ImageLikelihoodSettings& settings = {}) : settings_(settings) {
    expects(settings.agreement > 0.5 && settings.agreement < 1, "ImageLikelihood: agreement", "in (0.5, 1)",
            settings.agreement);
    expects(settings.pixels_per_error >= 1 && std::isfinite(settings.pixels_per_error),
            "ImageLikelihood: pixels_per_error", ">= 1 and finite", settings.pixels_per_error);
    log_agreeing_ = std::log(settings.agreement) / settings.pixels_per_error;
    log_differing_ = std::log1p(-settings.agreement) / settings.pixels_per_error;
  }

  /// [nat], <= 0; 0 where nothing was seen. NaN for masks that are not comparable: any number would rank.
  double log_likelihood(const Overlap& frame) const noexcept {
    if (!frame.comparable) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    return static_cast<double>(frame.agreeing_px()) * log_agreeing_ +
           static_cast<double>(frame.differing_px()) * log_differing_;
  }
  double log_likelihood(const ConstMaskView& predicted, const ConstMaskView& observed) const noexcept {
    return log_likelihood(overlap(predicted, observed));
  }
  /// @param seen marks the pixels about which the observation says something.
  double log_likelihood(const ConstMaskView& predicted, const ConstMaskView& observed,
                        const ConstMaskView& seen) const noexcept {
    return log_likelihood(overlap(predicted, observed, seen));
  }

  /// By how much one more differing pixel lowers the log-likelihood [nat].
  double nats_per_pixel() const noexcept { return log_agreeing_ - log_differing_; }

  const ImageLikelihoodSettings& settings() const noexcept { return settings_; }

 private:
  ImageLikelihoodSettings settings_;
  double log_agreeing_ = 0;
  double log_differing_ = 0;
};

/// Settings measured on frames of predictions that are known to be right (a twin of a simulation, or the best that a
/// model can do), so that likelihoods mean what they say: `agreement` is the share of pixels that agree, and
/// `pixels_per_error` the variance of the number of differing pixels over that of independent pixels (Pearson's
/// chi-squared per degree of freedom): b, if errors come in clumps of b pixels.
///
/// What lasts longer than a frame is not in there: frames that are used one after the other err together too. Multiply
/// pixels_per_error by the number of frames for which an error stays, or use only every so many frames.
///
/// Nothing for fewer than two frames that can be compared, if no pixel differs, or if half or more of them do.
inline std::optional<ImageLikelihoodSettings> calibrate_image_likelihood(std::span<const Overlap> right) noexcept {
  Overlap sum;
  std::int64_t frames = 0;
  for (const Overlap& frame : right) {
    if (frame.comparable && frame.compared_px > 0) {
      sum += frame;
      ++frames;
    }
  }
  const double wrong =
      static_cast<double>(sum.differing_px()) / static_cast<double>(std::max<std::int64_t>(1, sum.compared_px));
  if (frames < 2 || !(wrong > 0 && wrong < 0.5)) {
    return std::nullopt;
  }
  double chi_squared = 0;
  for (const Overlap& frame : right) {
    if (frame.comparable && frame.compared_px > 0) {
      const double expected = wrong * static_cast<double>(frame.compared_px);
      const double excess = static_cast<double>(frame.differing_px()) - expected;
      chi_squared += excess * excess / (expected * (1 - wrong));
    }
  }
  // frames that agree with each other better than chance are no reason to be surer than independent pixels allow
  return ImageLikelihoodSettings{.agreement = 1 - wrong,
                                 .pixels_per_error = std::max(1.0, chi_squared / static_cast<double>(frames - 1))};
}

}  // namespace decant::inline DECANT_TARGET
