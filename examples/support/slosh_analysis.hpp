// SPDX-License-Identifier: MIT
#pragma once

/// Compares a simulated with a measured record of sloshing: highest value, the time shift that makes them most alike,
/// frequency and damping of the free decay.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Dense>

#include <decant/core/expects.hpp>

namespace example {

/// Numbers over time; times [s] increase strictly, a missing value is NaN.
struct Record {
  std::vector<double> time;   ///< [s]
  std::vector<double> value;  ///< as many
};

/// Linear between samples; NaN outside of the record, beside a missing value and in gaps longer than `longest_gap` [s].
inline double value_at(const Record& record, double time, double longest_gap = 0.1) {
  const auto after = std::lower_bound(record.time.begin(), record.time.end(), time);
  if (after == record.time.end()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const auto k = static_cast<std::size_t>(after - record.time.begin());
  if (record.time[k] == time) {
    return record.value[k];
  }
  if (k == 0 || record.time[k] - record.time[k - 1] > longest_gap) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double fraction = (time - record.time[k - 1]) / (record.time[k] - record.time[k - 1]);
  return record.value[k - 1] + fraction * (record.value[k] - record.value[k - 1]);
}

/// Mean over begin <= time < end, missing values left out; 0 where there is none.
inline double mean_between(const Record& record, double begin, double end) {
  double sum = 0;
  int count = 0;
  for (std::size_t k = 0; k < record.time.size(); ++k) {
    if (record.time[k] >= begin && record.time[k] < end && std::isfinite(record.value[k])) {
      sum += record.value[k];
      ++count;
    }
  }
  return count > 0 ? sum / count : 0.0;
}

/// The highest value between two times; NaN where there is none.
inline double peak_between(const Record& record, double begin, double end) {
  double peak = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t k = 0; k < record.time.size(); ++k) {
    if (record.time[k] >= begin && record.time[k] <= end && !(record.value[k] <= peak)) {
      peak = std::isfinite(record.value[k]) ? record.value[k] : peak;
    }
  }
  return peak;
}

/// One time shift between two records of the same event.
struct Alignment {
  double shift = 0;        ///< [s]: what happens at t in the first record happens at t + shift in the second
  double correlation = 0;  ///< Pearson's, over the window; -1 where the records do not overlap
};

/// Pearson's correlation of a(t) and b(t + shift) over [begin, end] [s] of a's time, on a grid of `step` [s]. Grid
/// points where either is missing are left out; -1 if that leaves less than nine tenths of them, or a constant record.
inline double correlation_at(const Record& a, const Record& b, double begin, double end, double shift,
                             double step = 0.005) {
  double n = 0, sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  const auto points = static_cast<int>(std::floor((end - begin) / step + 1e-9)) + 1;
  for (int k = 0; k < points; ++k) {
    const double t = begin + k * step;
    const double x = value_at(a, t), y = value_at(b, t + shift);
    if (!std::isfinite(x) || !std::isfinite(y)) {
      continue;
    }
    n += 1;
    sum_a += x;
    sum_b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  if (n < 0.9 * points || n < 3) {
    return -1;
  }
  const double spread = (aa - sum_a * sum_a / n) * (bb - sum_b * sum_b / n);
  return spread > 0 ? (ab - sum_a * sum_b / n) / std::sqrt(spread) : -1;
}

/// The shift that correlates best over [begin, end] [s] of a's time, among all for which b covers the window: first
/// every 20 ms (a tenth of the fastest slosh period here), then every millisecond around the best.
inline Alignment align(const Record& a, const Record& b, double begin, double end) {
  Alignment best{0, -1};
  if (b.time.empty() || !(end > begin)) {
    return best;
  }
  const auto search = [&](double low, double high, double step, double grid) {
    const int count = static_cast<int>(std::floor((high - low) / step + 1e-9));
    for (int k = 0; k <= count; ++k) {
      const double shift = low + k * step;
      const double correlation = correlation_at(a, b, begin, end, shift, grid);
      if (correlation > best.correlation) {
        best = {shift, correlation};
      }
    }
  };
  search(b.time.front() - begin, b.time.back() - end, 0.02, 0.02);
  if (best.correlation > -1) {
    const double coarse = best.shift;
    best.correlation = -1;  // the coarse grid's figure is not comparable
    search(coarse - 0.03, coarse + 0.03, 0.001, 0.005);
  }
  return best;
}

/// A decaying oscillation, c + d t + exp(-s t) (a cos w t + b sin w t).
struct Decay {
  double frequency = 0;      ///< w / 2 pi [Hz]
  double damping_ratio = 0;  ///< s / sqrt(w^2 + s^2), the logarithmic decrement over 2 pi for small values [-]
  double amplitude = 0;      ///< at the first sample, of the strongest channel; the records' unit
  double explained = 0;      ///< share of the variance that the oscillation accounts for, 0..1
};

/// Fits one oscillation between `lowest` and `highest` frequency [Hz] to all channels over [begin, end] [s]: common
/// frequency and damping, own amplitude, phase, offset and trend. Least squares: amplitudes follow linearly from a
/// frequency and a decay rate, and those two are searched on a grid that closes in on the best. A Decay of zeros where
/// fewer than two periods or 20 samples are there.
///
/// Which record shows which frequency: the lowest sloshing mode of an upright cylinder lifts one side as it lowers the
/// other, at f. Over the whole surface the highest point rises twice a period (|cos|), so its record holds 2 f and no f
/// at all. A record of one place, of the side that a camera sees, or of the centre of mass holds f. Cameras on the
/// container measured in the recordings here: they go below the rest level and oscillate at f.
inline Decay fit_decay(const std::vector<Record>& channels, double begin, double end, double lowest, double highest) {
  decant::expects(lowest > 0 && highest > lowest, "fit_decay: highest frequency [Hz]", "> the lowest > 0", highest);
  std::vector<double> time;
  std::vector<Eigen::VectorXd> value(channels.size());
  for (std::size_t c = 0; c < channels.size(); ++c) {
    std::vector<double> kept;
    for (std::size_t k = 0; k < channels[c].time.size(); ++k) {
      const double t = channels[c].time[k];
      if (t >= begin && t <= end && std::isfinite(channels[c].value[k])) {
        kept.push_back(channels[c].value[k]);
        if (c == 0) {
          time.push_back(t - begin);
        }
      }
    }
    value[c] = Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
    decant::expects(kept.size() == time.size(), "fit_decay: samples of a channel", "as many as of the first",
                    kept.size());
  }
  const auto n = static_cast<Eigen::Index>(time.size());
  if (n < 20 || (time.back() - time.front()) * lowest < 2) {
    return {};
  }
  const Eigen::Map<const Eigen::VectorXd> t(time.data(), n);
  const double length = time.back() - time.front();
  Eigen::MatrixXd trend(n, 2);
  trend.col(0).setOnes();
  trend.col(1) = t / length;
  const auto residual_of = [&](const Eigen::MatrixXd& basis) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(basis);
    double sum = 0;
    for (const Eigen::VectorXd& y : value) {
      sum += (y - basis * solver.solve(y)).squaredNorm();
    }
    return sum;
  };
  const auto basis_of = [&](double frequency, double rate) {
    Eigen::MatrixXd basis(n, 4);
    const double w = 2 * std::numbers::pi * frequency;
    basis.col(0) = ((-rate * t.array()).exp() * (w * t.array()).cos()).matrix();
    basis.col(1) = ((-rate * t.array()).exp() * (w * t.array()).sin()).matrix();
    basis.rightCols(2) = trend;
    return basis;
  };

  // The residual has a valley of width 1 / length around each candidate frequency: the first grid is finer than that.
  double best_frequency = 0, best_rate = 0, best = std::numeric_limits<double>::infinity();
  double frequency_step = 0.25 / length, rate_step = 0.5 / length;
  const auto look = [&](double frequency, double rate) {
    if (frequency >= lowest && frequency <= highest) {
      const double residual = residual_of(basis_of(frequency, rate));
      if (residual < best) {
        best = residual;
        best_frequency = frequency;
        best_rate = rate;
      }
    }
  };
  for (double frequency = lowest; frequency <= highest; frequency += frequency_step) {
    for (double rate = 0; rate <= 8 / length; rate += 2 * rate_step) {
      look(frequency, rate);
    }
  }
  for (int round = 0; round < 14; ++round) {
    const double frequency = best_frequency, rate = best_rate;
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        look(frequency + i * frequency_step, rate + j * rate_step);
      }
    }
    if (best_frequency == frequency && best_rate == rate) {
      frequency_step /= 2;
      rate_step /= 2;
    }
  }

  Decay decay;
  const double w = 2 * std::numbers::pi * best_frequency;
  decay.frequency = best_frequency;
  decay.damping_ratio = best_rate / std::hypot(w, best_rate);
  const double without = residual_of(trend);
  decay.explained = without > 0 ? 1 - best / without : 0;
  const Eigen::MatrixXd basis = basis_of(best_frequency, best_rate);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(basis);
  for (const Eigen::VectorXd& y : value) {
    const Eigen::VectorXd solution = solver.solve(y);
    decay.amplitude = std::max(decay.amplitude, std::hypot(solution[0], solution[1]));
  }
  return decay;
}

/// Frequency of the lowest sloshing mode of an upright cylinder [Hz], linear theory: w^2 = g k tanh(k depth) with
/// k = 1.8412 / radius, the first zero of J1' over the radius (Lamb, Hydrodynamics, art. 257). SI units, all > 0.
inline double cylinder_slosh_frequency(double radius, double depth, double gravity = 9.81) {
  const double k = 1.8411837813 / radius;
  return std::sqrt(gravity * k * std::tanh(k * depth)) / (2 * std::numbers::pi);
}

}  // namespace example
