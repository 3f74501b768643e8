// SPDX-License-Identifier: MIT
#pragma once

/// A draining tank as the workflow for missing effects takes it: a forward model without particles and cameras.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include "draining_tank.hpp"

namespace example {

/// Predicts the level of a tank that drains by Torricelli's law, and may be wrong about its hole, about how much it
/// holds, and about its sensor.
class DrainingTankModel {
 public:
  /// @param discharge the coefficient that is assumed. @param start level at the first of the times, as it was read
  /// [m].
  /// @param error of the level's readings. @param times of the readings [s].
  DrainingTankModel(DrainingTank tank, double discharge, double start, const decant::ReadingError& error,
                    std::vector<double> times)
      : tank_(std::move(tank)), start_(start), error_(error), times_(std::move(times)) {
    using decant::EffectKind;
    const auto add = [&](const char* name, const char* unit, const char* meaning, const decant::EffectComponent& of,
                         EffectKind kind = EffectKind::Physics) {
      effects_.push_back(decant::plain_effect(name, "", unit, meaning, of));
      effects_.back().kind = kind;
    };
    add("discharge", "", "the hole lets another share of what Torricelli's law says pass",
        {"", discharge, discharge - 0.25, discharge + 0.25});
    add("leak", "ml/s", "water is lost at a rate that the level does not change", {"", 0, 0, 3});
    add("fill", "of what was read", "the level at the beginning is another one than was read",
        {"", 1, 0.85, 1.15, error.deviation / start});
    add("latency", "s", "the drain was opened later than recorded", {"", 0, -60, 60, 1}, EffectKind::Measurement);
    add("sensor_scale", "", "the sensor reads the level times a factor", {"", 1, 0.85, 1.15, 0.002},
        EffectKind::Measurement);
  }

  const std::vector<decant::Effect>& effects() const noexcept { return effects_; }

  std::vector<decant::ReadingSeries> predict(const decant::ModelRun& run) const {
    std::mt19937 random(run.seed);
    std::vector<double> strength;
    for (const decant::AppliedEffect& each : decant::effects_of_run(effects_, run, random)) {
      strength.push_back(each.strength[0]);
    }
    const std::vector<double> levels = level(strength);
    decant::ReadingSeries series("level [m]", error_);
    for (std::size_t k = 0; k < times_.size(); ++k) {
      series.add(times_[k], levels[k]);
    }
    return {series};
  }

 private:
  /// A leak adds to what flows out, as a larger coefficient does where the level stands.
  std::vector<double> level(const std::vector<double>& strength) const {
    const double hole = std::numbers::pi * tank_.hole_radius * tank_.hole_radius;
    const auto rate = [&](double height) {
      const double over = std::max(0.0, height - tank_.hole_height);
      const double lost = over > 0 ? 1e-6 * strength[1] : 0;
      return -(strength[0] * hole * std::sqrt(2 * tank_.gravity * over) + lost) / tank_.area(height);
    };
    std::vector<double> levels;
    double height = strength[2] * start_, now = times_.front();
    for (const double time : times_) {
      const double opened = std::max(now, times_.front() + strength[3]);
      const double duration = std::max(0.0, time - opened) +
                              (time == times_.front() ? std::max(0.0, -strength[3]) : 0);  // it was open before
      const int steps = std::max(1, static_cast<int>(std::ceil(duration / DrainingTank::longest_step)));
      const double step = duration / steps;
      for (int n = 0; n < steps && step > 0; ++n) {  // the midpoint rule
        height += step * rate(height + 0.5 * step * rate(height));
      }
      now = time;
      levels.push_back(strength[4] * height);
    }
    return levels;
  }

  DrainingTank tank_;
  double start_;
  decant::ReadingError error_;
  std::vector<double> times_;
  std::vector<decant::Effect> effects_{};
};
static_assert(decant::ForwardModel<DrainingTankModel>);

/// What a tank's model lacks that assumes some discharge coefficient.
struct DrainDiagnosis {
  decant::MissingEffect result{};
  std::vector<double> assumed{}, mended{};  ///< levels by the model as it is, and with what was found [m]
  double off_before = 0, off_after = 0;     ///< mean size of what they are off by, where it was not learnt from [m]
};

/// Learns from the first half of a recording and checks on the second, which begins at the level read there. Errors of
/// the sensor last for as long as the level takes from one point of its calibration to the next, a centimetre.
inline DrainDiagnosis diagnose_drain(const DrainingTank& tank, const DrainRecord& record, double discharge,
                                     decant::Threads threads = {}) {
  using namespace decant;
  const std::size_t count = record.time.size(), half = count / 2;
  expects(half >= 10, "diagnose_drain: readings", "at least 20", count);
  const double fall = (record.level.front() - record.level.back()) / (record.time.back() - record.time.front());
  constexpr double count_size = 0.001;  // of the sensor [m]
  const ReadingError error{std::max(record.calibration_error, count_size), 0.01 / std::max(fall, 1e-9)};
  const auto part = [&](std::size_t begin, std::size_t end) {
    const std::vector<double> times(record.time.begin() + static_cast<std::ptrdiff_t>(begin),
                                    record.time.begin() + static_cast<std::ptrdiff_t>(end));
    ReadingSeries level("level [m]", error);
    for (std::size_t k = begin; k < end; ++k) {
      level.add(record.time[k], record.level[k]);
    }
    return std::pair(DrainingTankModel(tank, discharge, record.level[begin], error, times), Observation({level}));
  };
  const auto [first, first_read] = part(0, half);
  const auto [second, second_read] = part(half, count);
  ThreadExecutor executor{threads};
  MissingEffectSettings settings;
  settings.most_left = 1.5;  // but for its sensor, the model is as exact as what it tells of
  DrainDiagnosis diagnosis;
  diagnosis.result =
      MissingEffectSearch<DrainingTankModel>({{"first half", &first, first_read}},
                                             {{"second half", &second, second_read}}, run_jobs_on(executor), settings)
          .find();
  ModelRun with;
  for (const RefinedEffect& each : diagnosis.result.found) {
    with.effects.push_back(each.applied());
  }
  for (const DrainingTankModel* model : {&first, &second}) {
    const std::vector<double> assumed = model->predict({})[0].values(), mended = model->predict(with)[0].values();
    diagnosis.assumed.insert(diagnosis.assumed.end(), assumed.begin(), assumed.end());
    diagnosis.mended.insert(diagnosis.mended.end(), mended.begin(), mended.end());
  }
  for (std::size_t k = half; k < count; ++k) {
    diagnosis.off_before += std::abs(diagnosis.assumed[k] - record.level[k]) / static_cast<double>(count - half);
    diagnosis.off_after += std::abs(diagnosis.mended[k] - record.level[k]) / static_cast<double>(count - half);
  }
  return diagnosis;
}

}  // namespace example
