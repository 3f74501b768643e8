// SPDX-License-Identifier: MIT
#pragma once

/// How far estimated amounts of liquid are from the true ones.

#include <cmath>
#include <cstdint>
#include <limits>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Estimated against true volumes, over frames or over recordings. Amounts come in m^3, errors go out in millilitres,
/// in which one pours. All are NaN as long as nothing was compared.
class VolumeError {
 public:
  /// @param estimated,truth [m^3]. A truth that is not finite is a sample that is missing, and is passed over; an
  /// estimate that is not finite beside a truth that is, is counted as a failure and otherwise passed over.
  void add(double estimated, double truth) noexcept {
    if (!std::isfinite(truth)) {
      return;
    }
    if (!std::isfinite(estimated)) {
      ++failures_;
      return;
    }
    const double error_ml = 1e6 * (estimated - truth);
    ++count_;
    sum_ += error_ml;
    sum_of_magnitudes_ += std::abs(error_ml);
    sum_of_squares_ += error_ml * error_ml;
    if (std::abs(error_ml) >= std::abs(largest_)) {
      largest_ = error_ml;
    }
    last_ = error_ml;
  }

  void reset() noexcept { *this = {}; }

  double mean_ml() const noexcept { return mean_of(sum_); }  ///< signed: positive if too much is estimated
  double mean_absolute_ml() const noexcept { return mean_of(sum_of_magnitudes_); }
  double rms_ml() const noexcept { return std::sqrt(mean_of(sum_of_squares_)); }
  double largest_ml() const noexcept { return count_ > 0 ? largest_ : nothing; }  ///< with its sign
  double last_ml() const noexcept { return count_ > 0 ? last_ : nothing; }  ///< signed: the amount left after a pour

  std::int64_t count() const noexcept { return count_; }
  std::int64_t failures() const noexcept { return failures_; }  ///< estimates that were not finite

 private:
  static constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  double mean_of(double sum) const noexcept { return count_ > 0 ? sum / static_cast<double>(count_) : nothing; }

  std::int64_t count_ = 0;
  std::int64_t failures_ = 0;
  double sum_ = 0;
  double sum_of_magnitudes_ = 0;
  double sum_of_squares_ = 0;
  double largest_ = 0;
  double last_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
