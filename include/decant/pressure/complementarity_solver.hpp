// SPDX-License-Identifier: MIT
#pragma once

/// Pressures that push where liquid is compressed and nowhere else.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/pressure_system.hpp>

namespace decant {

/// How a solve went.
struct ComplementarityReport {
  int iterations = 0;      ///< evaluations of the system
  double error = 0;        ///< mean of what is amiss, over rest density [-]
  bool converged = false;
};

/// Finds P >= 0 for a PressureSystem such that
///   r = offset + dt^2 D(a(P)) <= 0,   and r = 0 wherever P > 0
/// a linear complementarity problem with a symmetric positive semi-definite matrix. Conjugate gradients, with the
/// diagonal as preconditioner, over the particles that are in contact (P > 0 or r > 0). Where pressures have become
/// negative or particles have come into contact, these are set to zero and those taken in every few steps, and the
/// directions start over.
template <class ScalarType>
class ComplementaritySolver {
 public:
  using Scalar = ScalarType;

  double mean_tolerance = 1e-3;     ///< mean of what may be left amiss, over rest density [-], > 0
  double largest_tolerance = 3e-3;  ///< for any one particle [-], > 0
  int most_iterations = 100;        ///< >= 1

  /// @param offset N, [kg/m^3]. @param term N, P: start and result. Leaves the matching accelerations in the system.
  /// What is amiss at a particle: compression that is left, or pressure that pushes liquid apart (as far as it does).
  template <class Step>
  ComplementarityReport solve(const Step& step, PressureSystem<Scalar>& system, const std::vector<Scalar>& offset,
                              std::vector<Scalar>& term) noexcept {
    const Index count = step.fluid.size();
    const auto n = static_cast<std::size_t>(count);
    residual_.resize(n);
    direction_.resize(n);
    image_.resize(n);
    sum_.resize(4 * n);
    ComplementarityReport report;
    const Scalar squared_step = step.time_step * step.time_step;
    if (count == 0 || !(squared_step > 0)) {
      std::fill(term.begin(), term.end(), Scalar(0));
      system.accelerate(step.neighbors, term.data(), step.threads);
      report.converged = true;
      return report;
    }
    const double rest_density = static_cast<double>(step.rest_density);
    const double allowed = mean_tolerance * rest_density * static_cast<double>(count);
    const double largest_allowed = largest_tolerance * rest_density;
    const Scalar steep = step.time_step * step.rest_density / step.spacing;
    smallest_slope_ = Scalar(1e-6) * steep * steep;
    while (true) {
      Progress now = start(step, system, offset, term, squared_step);
      ++report.iterations;
      report.error = now.amiss / (rest_density * static_cast<double>(count));
      report.converged = now.amiss <= allowed && now.largest <= largest_allowed;
      if (report.converged || report.iterations >= most_iterations) {
        return report;
      }
      for (int since_start = 1;; ++since_start) {
        const double curvature = apply(step, system, squared_step);
        ++report.iterations;
        if (!(curvature > 0) || !(now.product > 0) || !std::isfinite(curvature)) {
          break;  // nothing in contact, or a state that is not finite
        }
        const Progress next = advance(step, system, term, static_cast<Scalar>(now.product / curvature), squared_step);
        const bool close = next.amiss <= allowed && next.largest <= largest_allowed;
        const bool enough = close || report.iterations >= most_iterations - 1;
        if (enough || ((next.negative || next.touched) && since_start >= steps_between_starts)) {
          report.error = next.amiss / (rest_density * static_cast<double>(count));
          report.converged = close;
          if (enough && next.negative) {
            clip(step, term);
            system.accelerate(step.neighbors, term.data(), step.threads);
          } else if (enough) {
            std::swap(sum_, system.accelerations_to_replace());
          }
          if (enough) {
            return report;
          }
          break;
        }
        const Scalar keep = static_cast<Scalar>(next.product / now.product);
        parallel_for(count, step.threads, [&](Index i) {
          const auto own = static_cast<std::size_t>(i);
          // particles out of contact stay out until the next start
          if (direction_[own] != 0) {
            direction_[own] = preconditioned(system, squared_step, own) + keep * direction_[own];
          }
        });
        now = next;
      }
    }
  }

 private:
  static constexpr int steps_between_starts = 6;

  struct Progress {
    double product = 0;     ///< residual . preconditioned residual, over the contacts
    double amiss = 0;       ///< sum over particles [kg/m^3]
    double largest = 0;     ///< of them
    bool negative = false;  ///< some pressure is
    bool touched = false;   ///< some particle has come into contact

    static Progress both(const Progress& a, const Progress& b) noexcept {
      return {a.product + b.product, a.amiss + b.amiss, std::max(a.largest, b.largest), a.negative || b.negative,
              a.touched || b.touched};
    }
    void add(Scalar amiss_here) noexcept {
      amiss += static_cast<double>(amiss_here);
      largest = std::max(largest, static_cast<double>(amiss_here));
    }
  };

  Scalar preconditioned(const PressureSystem<Scalar>& system, Scalar squared_step, std::size_t own) const noexcept {
    const Scalar slope = squared_step * system.diagonal()[own];
    // a particle that feels neither neighbours nor walls has no slope to divide by
    return slope > smallest_slope_ ? residual_[own] / slope : Scalar(0);
  }

  template <class Step>
  static void clip(const Step& step, std::vector<Scalar>& term) noexcept {
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      Scalar& own = term[static_cast<std::size_t>(i)];
      own = own > 0 ? own : Scalar(0);
    });
  }

  /// Clips pressures, finds residuals and contacts, and sets out along the preconditioned residual.
  template <class Step>
  Progress start(const Step& step, PressureSystem<Scalar>& system, const std::vector<Scalar>& offset,
                 std::vector<Scalar>& term, Scalar squared_step) noexcept {
    const Index count = step.fluid.size();
    clip(step, term);
    system.accelerate(step.neighbors, term.data(), step.threads);
    return reduction_.over(
        count, step.threads, Progress{},
        [&](Index begin, Index end) {
          Progress partial;
          for (Index i = begin; i < end; ++i) {
            const auto own = static_cast<std::size_t>(i);
            const Scalar left =
                offset[own] + squared_step * system.density_rate(step.neighbors, system.accelerations(), i, false);
            const Scalar slope = squared_step * system.diagonal()[own];
            residual_[own] = left;
            partial.add(std::max(left, std::min(-left, term[own] * slope)));
            const bool contact = term[own] > 0 || left > 0;
            direction_[own] = contact ? preconditioned(system, squared_step, own) : Scalar(0);
            partial.product += static_cast<double>(left) * static_cast<double>(direction_[own]);
            for (std::size_t axis = 0; axis < 4; ++axis) {
              sum_[4 * own + axis] = system.accelerations()[4 * own + axis];
            }
          }
          return partial;
        },
        Progress::both);
  }

  /// The system's answer to the direction; returns direction . answer.
  template <class Step>
  double apply(const Step& step, PressureSystem<Scalar>& system, Scalar squared_step) noexcept {
    system.accelerate(step.neighbors, direction_.data(), step.threads);
    return reduction_of_sums_.over(
        step.fluid.size(), step.threads, 0.0,
        [&](Index begin, Index end) {
          double partial = 0;
          for (Index i = begin; i < end; ++i) {
            const auto own = static_cast<std::size_t>(i);
            image_[own] = -squared_step * system.density_rate(step.neighbors, system.accelerations(), i, false);
            partial += static_cast<double>(image_[own]) * static_cast<double>(direction_[own]);
          }
          return partial;
        },
        [](double a, double b) { return a + b; });
  }

  template <class Step>
  Progress advance(const Step& step, const PressureSystem<Scalar>& system, std::vector<Scalar>& term, Scalar along,
                   Scalar squared_step) noexcept {
    return reduction_.over(
        step.fluid.size(), step.threads, Progress{},
        [&](Index begin, Index end) {
          Progress partial;
          for (Index i = begin; i < end; ++i) {
            const auto own = static_cast<std::size_t>(i);
            term[own] += along * direction_[own];
            residual_[own] -= along * image_[own];
            for (std::size_t axis = 0; axis < 4; ++axis) {
              sum_[4 * own + axis] += along * system.accelerations()[4 * own + axis];
            }
            const Scalar left = residual_[own], slope = squared_step * system.diagonal()[own];
            // a negative pressure will be clipped: its own push will be missing
            partial.add(term[own] < 0 ? std::max(left, Scalar(0)) - term[own] * slope
                                      : std::max(left, std::min(-left, term[own] * slope)));
            partial.negative = partial.negative || term[own] < 0;
            if (direction_[own] != 0) {
              const Scalar scaled = preconditioned(system, squared_step, own);
              partial.product += static_cast<double>(left) * static_cast<double>(scaled);
            } else {
              partial.touched = partial.touched || left > 0;
            }
          }
          return partial;
        },
        Progress::both);
  }

  Scalar smallest_slope_ = 0;
  std::vector<Scalar> residual_{}, direction_{}, image_{};
  std::vector<Scalar> sum_{};  ///< accelerations by `term`, records of four
  Reduction<Progress> reduction_{};
  Reduction<double> reduction_of_sums_{};
};

}  // namespace decant
