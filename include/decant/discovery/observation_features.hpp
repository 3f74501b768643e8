// SPDX-License-Identifier: MIT
#pragma once

/// All numbers by which interactions are compared: those of silhouettes, then those of readings.

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/reading_features.hpp>
#include <decant/discovery/silhouette_features.hpp>

namespace decant::inline DECANT_TARGET {

/// See SilhouetteFeatures and ReadingFeatures.
class ObservationFeatures {
 public:
  /// @param simulated what the same cameras see in simulations.
  /// Throws std::invalid_argument if a setting is out of range, or cameras or frames are others.
  ObservationFeatures(const Observation& recording, std::span<const std::vector<SilhouetteSeries>> simulated,
                      const SilhouetteFeatureSettings& of_silhouettes, const ReadingFeatureSettings& of_readings)
      : silhouettes_(recording.silhouettes, simulated, of_silhouettes), readings_(recording.readings, of_readings) {}

  const SilhouetteFeatures& silhouettes() const noexcept { return silhouettes_; }
  const ReadingFeatures& readings() const noexcept { return readings_; }
  std::size_t size() const noexcept { return silhouettes_.size() + readings_.size(); }

  /// Of all features, those of silhouettes, and those of readings.
  auto of_silhouettes(const Eigen::VectorXd& features) const {
    return features.head(static_cast<Eigen::Index>(silhouettes_.size()));
  }
  auto of_readings(const Eigen::VectorXd& features) const {
    return features.tail(static_cast<Eigen::Index>(readings_.size()));
  }

  /// The least standard deviation of each. @param of_silhouettes that of a share of liquid.
  Eigen::VectorXd floor(double of_silhouettes) const {
    Eigen::VectorXd result = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(size()), of_silhouettes);
    const std::span<const double> least = readings_.least_errors();
    result.tail(static_cast<Eigen::Index>(least.size())) =
        Eigen::Map<const Eigen::VectorXd>(least.data(), static_cast<Eigen::Index>(least.size()));
    return result;
  }

  /// Whether a recording has the same cameras and sensors, and as many frames and readings.
  bool fit(const Observation& other) const noexcept {
    return silhouettes_.fit(other.silhouettes) && readings_.fit(other.readings);
  }

  /// Of the recording or a simulation. Throws std::invalid_argument if it is of other cameras, sensors or times.
  Eigen::VectorXd of(const Observation& seen) const {
    Eigen::VectorXd result(static_cast<Eigen::Index>(size()));
    result << silhouettes_.of(seen.silhouettes), readings_.of(seen.readings);
    return result;
  }

  /// By feature, whether another recording has all of it. Throws as of() does.
  std::vector<bool> seen_in(const Observation& recording) const {
    std::vector<bool> result = silhouettes_.seen_in(recording.silhouettes);
    for (const double feature : readings_.of(recording.readings)) {
      result.push_back(std::isfinite(feature));
    }
    return result;
  }

 private:
  SilhouetteFeatures silhouettes_;
  ReadingFeatures readings_;
};

}  // namespace decant::inline DECANT_TARGET
