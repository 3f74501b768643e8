// SPDX-License-Identifier: MIT
#pragma once

/// Pressures that push where liquid is compressed and nowhere else.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/coarse_grid.hpp>
#include <decant/pressure/pressure_system.hpp>

namespace decant::inline DECANT_TARGET {

/// How a solve went.
struct ComplementarityReport {
  int iterations = 0;  ///< evaluations of the system
  double error = 0;    ///< mean of what is amiss, over rest density [-]
  bool converged = false;
};

/// Finds P >= 0 for a PressureSystem such that
///   r = offset + dt^2 D(a(P)) <= 0,   and r = 0 wherever P > 0
/// a linear complementarity problem with a symmetric positive semi-definite matrix. Conjugate gradients over the
/// particles that are in contact (P > 0 or r > 0), preconditioned by the diagonal plus, where whole regions are amiss,
/// CoarseGrid. Where pressures have become negative or particles have come into contact, these are set to zero and
/// those taken in, and the directions start over, every few steps and whenever more is amiss outside the contacts than
/// within them: steps only mend what is within (the proportioning of Dostal 1997, SIAM J. Optim. 7).
template <class ScalarType>
class ComplementaritySolver {
 public:
  using Scalar = ScalarType;

  double mean_tolerance = 1e-3;     ///< mean of what may be left amiss, over rest density [-], > 0
  double largest_tolerance = 3e-3;  ///< for any one particle [-], > 0
  /// Mean of what regions (cells of CoarseGrid) may be amiss by as a whole, over rest density, > 0. What is left in a
  /// region adds up over its depth and from one sub-step to the next: eighty layers that each give way by 1e-4 fall
  /// through themselves, while particles that are amiss by ten times as much, some too dense and some too loose, do
  /// not.
  double net_tolerance = 3e-4;
  int most_iterations = 100;  ///< >= 1

  /// Forgets all that earlier frames have left: what a frame comes to depends on its state alone.
  void begin_frame() noexcept { impatient_steps_ = 0; }

  /// Forgets the places of particles; call once per sub-step, before the first solve.
  void begin_step() noexcept {
    sorted_ = false;
    impatient_steps_ = std::max(impatient_steps_ - 1, 0);
  }

  /// @param offset N, [kg/m^3]. @param term N, P: start and result. Leaves the matching accelerations in the system.
  /// What is amiss at a particle: compression that is left, or pressure that pushes liquid apart (as far as it does).
  template <class Step>
  ComplementarityReport solve(const Step& step, PressureSystem<Scalar>& system, const std::vector<Scalar>& offset,
                              std::vector<Scalar>& term) noexcept {
    const Index count = step.fluid.size();
    const auto n = static_cast<std::size_t>(count);
    for (auto* values : {&residual_, &direction_, &image_, &contact_, &smooth_}) {
      values->resize(n);
    }
    sum_.resize(4 * n);
    ComplementarityReport report;
    const Scalar squared_step = step.time_step * step.time_step;
    if (count == 0 || !(squared_step > 0)) {
      std::fill(term.begin(), term.end(), Scalar(0));
      system.accelerate(step.neighbors, term.data(), step.threads);
      report.converged = true;
      return report;
    }
    if (!sorted_) {
      grid_.sort(step);
      sorted_ = true;
    }
    const double rest_density = static_cast<double>(step.rest_density);
    const double allowed = mean_tolerance * rest_density * static_cast<double>(count);
    const double largest_allowed = largest_tolerance * rest_density;
    const double net_allowed = net_tolerance * rest_density * static_cast<double>(count);
    const Scalar steep = step.time_step * step.rest_density / step.spacing;
    smallest_slope_ = Scalar(1e-6) * steep * steep;
    bool particles_done = false, by_grid = false;
    int steps_by_grid = 0;
    const auto judge = [&](const Progress& progress) {
      report.error = progress.amiss / (rest_density * static_cast<double>(count));
      net_ = grid_.restrict(residual_, contact_, step.threads);
      particles_done = progress.amiss <= allowed && progress.largest <= largest_allowed;
      report.converged = particles_done && net_ <= net_allowed;
      return report.converged;
    };
    const int patience = impatient_steps_ > 0 ? 0 : most_patience;
    // @return whether cells take part from here on.
    const auto call_grid = [&] {
      if (by_grid || net_ <= net_allowed || report.iterations <= patience) {
        return false;
      }
      impatient_steps_ = patience > 0 ? lasting_impatience : impatient_steps_;
      grid_.assemble(step, system, contact_);
      return by_grid = true;
    };
    while (true) {
      const Progress start = set_out(step, system, offset, term, squared_step);
      ++report.iterations;
      if (judge(start) || report.iterations >= most_iterations) {
        return report;
      }
      call_grid();
      Scope scope = by_grid ? Scope::Both : Scope::Particles;
      double product = precondition(step, system, squared_step, scope);
      direction_.swap(image_);
      for (int since_start = 1;; ++since_start) {
        const double curvature = apply(step, system, squared_step);
        ++report.iterations;
        if (!(curvature > 0) || !(product > 0) || !std::isfinite(curvature)) {
          // nothing that could be corrected is in contact, or the state is not finite
          system.accelerate(step.neighbors, term.data(), step.threads);
          return report;
        }
        const Progress now = advance(step, system, term, static_cast<Scalar>(product / curvature), squared_step);
        const bool enough = judge(now) || report.iterations >= most_iterations - 1;
        if (enough && now.negative) {
          clip(step, term);
          system.accelerate(step.neighbors, term.data(), step.threads);
        } else if (enough) {
          std::swap(sum_, system.accelerations_to_replace());
        }
        if (enough) {
          return report;
        }
        const bool lopsided =
            since_start >= least_steps_between_starts && now.outside > largest_outside * (now.amiss - now.outside);
        if ((now.negative || now.touched) && (lopsided || since_start >= most_steps_between_starts)) {
          break;
        }
        // When only whole regions are still amiss, a step by cells alone settles them; particles have no say in it, and
        // what they ask for would take it seven more. Where it does not, the matrix is not that of these cells.
        const bool was_whole = scope == Scope::Grid, fresh = call_grid();
        if (by_grid) {
          const bool whole = particles_done && !was_whole && steps_by_grid < most_steps_by_grid;
          scope = whole ? Scope::Grid : Scope::Both;
          steps_by_grid += whole ? 1 : 0;
        }
        const double next_product = precondition(step, system, squared_step, scope);
        const bool goes_on = !fresh && !was_whole && scope != Scope::Grid;
        const Scalar keep = goes_on ? static_cast<Scalar>(next_product / product) : Scalar(0);
        product = next_product;
        parallel_for(count, step.threads, [&](Index i) {
          const auto own = static_cast<std::size_t>(i);
          direction_[own] = image_[own] + keep * direction_[own];
        });
      }
    }
  }

 private:
  static constexpr int least_steps_between_starts = 2, most_steps_between_starts = 6;
  static constexpr double largest_outside = 0.5;  ///< of what is amiss within the contacts
  static constexpr int most_steps_by_grid = 8;    ///< per solve
  static constexpr int most_patience = 6;         ///< evaluations before cells are called
  static constexpr int lasting_impatience = 8;  ///< sub-steps in which they are called at once, after they were needed

  /// Whose residuals a direction answers to.
  enum class Scope { Particles, Grid, Both };

  struct Progress {
    double amiss = 0;       ///< sum over particles [kg/m^3]
    double outside = 0;     ///< of this, by pressures that are negative and where there has been no contact
    double largest = 0;     ///< of them
    bool negative = false;  ///< some pressure is
    bool touched = false;   ///< some particle has come into contact

    static Progress both(const Progress& a, const Progress& b) noexcept {
      return {a.amiss + b.amiss, a.outside + b.outside, std::max(a.largest, b.largest), a.negative || b.negative,
              a.touched || b.touched};
    }
    void add(Scalar amiss_here) noexcept {
      amiss += static_cast<double>(amiss_here);
      largest = std::max(largest, static_cast<double>(amiss_here));
    }
  };

  /// Sum of term(i) over the particles, the same for any number of threads.
  template <class Step, class Term>
  double sum_over(const Step& step, Term&& term) noexcept {
    return reduction_of_sums_.over(
        step.fluid.size(), step.threads, 0.0,
        [&](Index begin, Index end) {
          double partial = 0;
          for (Index i = begin; i < end; ++i) {
            partial += term(static_cast<std::size_t>(i));
          }
          return partial;
        },
        [](double a, double b) { return a + b; });
  }

  /// Puts into image_ what residual_ asks for, over the contacts. Returns residual . image.
  template <class Step>
  double precondition(const Step& step, const PressureSystem<Scalar>& system, Scalar squared_step,
                      Scope scope) noexcept {
    if (scope != Scope::Particles) {
      grid_.solve(step.time_step, step.threads, smooth_);
    }
    return sum_over(step, [&](std::size_t own) {
      const Scalar slope = squared_step * system.diagonal()[own];
      // what is not in contact may have no slope to divide by
      const Scalar alone = scope != Scope::Grid && contact_[own] > 0 ? residual_[own] / slope : Scalar(0);
      image_[own] = contact_[own] * (scope != Scope::Particles ? alone + smooth_[own] : alone);
      return static_cast<double>(residual_[own]) * static_cast<double>(image_[own]);
    });
  }

  template <class Step>
  static void clip(const Step& step, std::vector<Scalar>& term) noexcept {
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      Scalar& own = term[static_cast<std::size_t>(i)];
      own = own > 0 ? own : Scalar(0);
    });
  }

  /// Clips pressures, finds residuals and contacts.
  template <class Step>
  Progress set_out(const Step& step, PressureSystem<Scalar>& system, const std::vector<Scalar>& offset,
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
            if (slope > smallest_slope_) {
              partial.add(std::max(left, std::min(-left, term[own] * slope)));
              contact_[own] = term[own] > 0 || left > 0 ? Scalar(1) : Scalar(0);
            } else {
              // Feels neither neighbours nor walls: no pressure changes what is left here, and the pressure it has is
              // from a place where it had company. In contact, it would hold up the others for ever.
              residual_[own] = term[own] = contact_[own] = 0;
            }
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
    return sum_over(step, [&](std::size_t own) {
      image_[own] =
          -squared_step * system.density_rate(step.neighbors, system.accelerations(), static_cast<Index>(own), false);
      return static_cast<double>(image_[own]) * static_cast<double>(direction_[own]);
    });
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
            for (std::size_t axis = 0; axis < 3; ++axis) {
              sum_[4 * own + axis] += along * system.accelerations()[4 * own + axis];
            }
            const Scalar left = residual_[own], slope = squared_step * system.diagonal()[own];
            // a negative pressure will be clipped: its own push will be missing
            partial.add(term[own] < 0 ? std::max(left, Scalar(0)) - term[own] * slope
                                      : std::max(left, std::min(-left, term[own] * slope)));
            // particles out of contact stay out until the next start
            const bool touched = contact_[own] == 0 && left > 0 && slope > smallest_slope_;
            partial.outside += static_cast<double>(term[own] < 0 ? -term[own] * slope : touched ? left : Scalar(0));
            partial.negative = partial.negative || term[own] < 0;
            partial.touched = partial.touched || touched;
          }
          return partial;
        },
        Progress::both);
  }

  Scalar smallest_slope_ = 0;
  CoarseGrid<Scalar> grid_{};
  bool sorted_ = false;      ///< the grid, in this sub-step
  int impatient_steps_ = 0;  ///< sub-steps in which the grid is called at once
  double net_ = 0;           ///< what cells are amiss by as a whole, summed over them [kg/m^3]
  std::vector<Scalar> residual_{}, direction_{}, image_{};
  std::vector<Scalar> contact_{};  ///< 1 or 0
  std::vector<Scalar> smooth_{};   ///< the grid's part of what residual_ asks for
  std::vector<Scalar> sum_{};      ///< accelerations by `term`, records as the system's
  Reduction<Progress> reduction_{};
  Reduction<double> reduction_of_sums_{};
};

}  // namespace decant::inline DECANT_TARGET
