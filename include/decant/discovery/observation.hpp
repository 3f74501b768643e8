// SPDX-License-Identifier: MIT
#pragma once

/// All that was seen of an interaction, or would have been: by cameras, by sensors that give one number at a time, or
/// by both.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/discovery/silhouette_series.hpp>

namespace decant::inline DECANT_TARGET {

struct Observation {
  std::vector<SilhouetteSeries> silhouettes{};  ///< by camera
  std::vector<ReadingSeries> readings{};        ///< by sensor

  Observation() = default;
  /// By cameras alone.
  Observation(std::vector<SilhouetteSeries> by_camera) : silhouettes(std::move(by_camera)) {}
  /// By sensors alone.
  Observation(std::vector<ReadingSeries> by_sensor) : readings(std::move(by_sensor)) {}
  Observation(std::vector<SilhouetteSeries> by_camera, std::vector<ReadingSeries> by_sensor)
      : silhouettes(std::move(by_camera)), readings(std::move(by_sensor)) {}

  /// What a model that failed has seen.
  bool empty() const noexcept { return silhouettes.empty() && readings.empty(); }

  /// As numbers, for an Executor or a Journal: those of each camera and sensor after how many they are.
  std::vector<double> numbers() const {
    std::vector<double> all;
    const auto append = [&all](const std::vector<double>& own) {
      all.push_back(static_cast<double>(own.size()));
      all.insert(all.end(), own.begin(), own.end());
    };
    for (const SilhouetteSeries& each : silhouettes) {
      append(each.numbers());
    }
    for (const ReadingSeries& each : readings) {
      append(each.values());
    }
    return all;
  }
  /// Back from numbers that were made of something with the same cameras and sensors, frames and times. Empty where the
  /// numbers are. Throws std::invalid_argument if they are of others.
  Observation with_numbers(std::span<const double> all) const {
    if (all.empty()) {
      return {};
    }
    std::size_t begin = 0;
    const auto next = [&] {
      expects(begin < all.size(), "Observation: numbers", "those of all cameras and sensors", all.size());
      const auto count = static_cast<std::size_t>(all[begin]);
      expects(begin + 1 + count <= all.size(), "Observation: numbers", "as many as they say", all.size());
      const std::span<const double> own = all.subspan(begin + 1, count);
      begin += 1 + count;
      return own;
    };
    Observation other;
    for (const SilhouetteSeries& each : silhouettes) {
      other.silhouettes.push_back(each.with_numbers(next()));
    }
    for (const ReadingSeries& each : readings) {
      other.readings.push_back(each.with_values(next()));
    }
    expects(begin == all.size(), "Observation: numbers", "those of its cameras and sensors alone", all.size());
    return other;
  }

  /// Whether there is a reading wherever a recording of the same sensors has one.
  bool covers(const Observation& recording) const {
    for (std::size_t sensor = 0; sensor < readings.size(); ++sensor) {
      for (std::size_t k = 0; k < readings[sensor].size(); ++k) {
        if (recording.readings.at(sensor).seen(k) && !readings[sensor].seen(k)) {
          return false;
        }
      }
    }
    return true;
  }

  /// The same with errors of readings drawn. Silhouettes are as they are: their noise is next to nothing over a square.
  Observation with_errors(std::uint32_t seed) const {
    Observation other = *this;
    for (std::size_t sensor = 0; sensor < readings.size(); ++sensor) {
      std::seed_seq mixer{seed, static_cast<std::uint32_t>(sensor)};
      std::uint32_t own = 0;
      mixer.generate(&own, &own + 1);
      other.readings[sensor] = readings[sensor].with_errors(own);
    }
    return other;
  }
};

}  // namespace decant::inline DECANT_TARGET
