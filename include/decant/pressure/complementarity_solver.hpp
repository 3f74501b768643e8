// SPDX-License-Identifier: MIT
#pragma once

/// Pressures that push where liquid is compressed and nowhere else.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <vector>

#include <decant/core/batch.hpp>
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
  /// Mean of what regions (around the nodes of CoarseGrid) may be amiss by as a whole, over rest density, > 0. What is
  /// left in a region adds up over its depth and from one sub-step to the next: eighty layers that each give way by
  /// 1e-4 fall through themselves, while particles that are amiss by ten times as much, some too dense and some too
  /// loose, do not.
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
    for (auto* values : {&residual_, &asked_, &direction_, &image_, &contact_, &smooth_}) {
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
    const bool is_brief = static_cast<double>(step.spacing) > fastest_filling * static_cast<double>(step.time_step);
    bool particles_done = false, by_grid = false;
    int steps_by_grid = 0;
    const auto judge = [&](const Progress& progress) {
      report.error = progress.amiss / (rest_density * static_cast<double>(count));
      net_ = grid_.restrict(is_brief ? asked_ : residual_, contact_, step.threads);
      particles_done = progress.amiss <= allowed && progress.largest <= largest_allowed;
      report.converged = particles_done && net_ <= net_allowed;
      return report.converged;
    };
    const int patience = impatient_steps_ > 0 ? 0 : most_patience;
    // @return whether the grid takes part from here on.
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
      if (!call_grid() && by_grid && grid_.outgrown(contact_, step.threads)) {
        grid_.assemble(step, system, contact_);
      }
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
        // When only whole regions are still amiss, a step by the grid alone settles them; particles have no say in it,
        // and what they ask for would take it seven more. Where it does not, the grid's matrix is no longer that of
        // these contacts.
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
        turn(step, keep);
      }
    }
  }

 private:
  static constexpr int least_steps_between_starts = 2, most_steps_between_starts = 6;
  static constexpr double largest_outside = 0.5;  ///< of what is amiss within the contacts
  static constexpr int most_steps_by_grid = 8;    ///< per solve
  static constexpr int most_patience = 6;         ///< evaluations before the grid is called
  /// In sub-steps in which a spacing would have to be filled faster than this [m/s], room is not asked for. In longer
  /// ones it is, as the pushes are ones that liquid survives, and without them deep columns converge less well.
  static constexpr double fastest_filling = 100;
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

  using B = Batch<Scalar>;

  /// Calls f(number, at) for all of [begin, end), a batch at a time and what is left one by one: `number` is an empty
  /// value of the type that f is to compute with.
  template <class Function>
  [[gnu::always_inline]] static void for_all(Index begin, Index end, Function&& f) noexcept {
    auto at = static_cast<std::size_t>(begin);
    for (; at + B::width <= static_cast<std::size_t>(end); at += B::width) {
      f(std::type_identity<B>{}, at);
    }
    for (; at < static_cast<std::size_t>(end); ++at) {
      f(std::type_identity<Scalar>{}, at);
    }
  }

  /// Sum of term(number, at) over the particles, see for_all; the same for any number of threads.
  template <class Step, class Term>
  double sum_over(const Step& step, Term&& term) noexcept {
    return reduction_of_sums_.over(
        step.fluid.size(), step.threads, 0.0,
        [&](Index begin, Index end) {
          B batches(Scalar(0));
          Scalar rest = 0;
          for_all(begin, end, [&](auto number, std::size_t at) {
            if constexpr (std::is_same_v<typename decltype(number)::type, Scalar>) {
              rest += term(number, at);
            } else {
              batches += term(number, at);
            }
          });
          return static_cast<double>(sum(batches)) + static_cast<double>(rest);
        },
        [](double a, double b) { return a + b; });
  }

  /// What of a residual regions have to answer for in brief sub-steps. A particle that has come loose is to lose its
  /// pressure, and no more: the room that it has then is none that those around it have to fill. Were it asked for, all
  /// would be pushed for one, the faster the less time there is: in a frame of a microsecond at kilometres per second.
  template <class Number>
  [[gnu::always_inline]] static Number asked(Number left, Number pressure, Number slope) noexcept {
    const Number zero(Scalar(0));
    return select(pressure > zero, maximum(left, zero - pressure * slope), left);
  }

  /// The next direction, from image_ and `keep` times the last one.
  template <class Step>
  void turn(const Step& step, Scalar keep) noexcept {
    parallel_ranges(
        step.fluid.size(), threads_for(step.fluid.size(), step.threads), default_grain, [&](Index begin, Index end) {
          for_all(begin, end, [&]<class Number>(std::type_identity<Number>, std::size_t at) {
            store_as(multiply_add(Number(keep), load_as<Number>(&direction_[at]), load_as<Number>(&image_[at])),
                     &direction_[at]);
          });
        });
  }

  /// Puts into image_ what residual_ asks for, over the contacts. Returns residual . image.
  template <class Step>
  double precondition(const Step& step, const PressureSystem<Scalar>& system, Scalar squared_step,
                      Scope scope) noexcept {
    if (scope != Scope::Particles) {
      grid_.solve(step.time_step, step.threads, smooth_);
    }
    return sum_over(step, [&]<class Number>(std::type_identity<Number>, std::size_t at) {
      const Number residual = load_as<Number>(&residual_[at]), contact = load_as<Number>(&contact_[at]),
                   zero(Scalar(0));
      const Number slope = Number(squared_step) * load_as<Number>(&system.diagonal()[at]);
      // what is not in contact may have no slope to divide by
      const Number alone = scope != Scope::Grid ? select(contact > zero, residual / slope, zero) : zero;
      const Number smooth = scope != Scope::Particles ? load_as<Number>(&smooth_[at]) : zero;
      const Number asked = contact * (alone + smooth);
      store_as(asked, &image_[at]);
      return residual * asked;
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
              asked_[own] = asked(left, term[own], slope);
              contact_[own] = term[own] > 0 || left > 0 ? Scalar(1) : Scalar(0);
            } else {
              // Feels neither neighbours nor walls: no pressure changes what is left here, and the pressure it has is
              // from a place where it had company. In contact, it would hold up the others for ever.
              residual_[own] = asked_[own] = term[own] = contact_[own] = 0;
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

  /// What some particles add to a Progress, one number or a batch of them at a time.
  template <class Number>
  struct Tally {
    Number amiss{Scalar(0)}, outside{Scalar(0)}, largest{Scalar(0)};
    bool negative = false, touched = false;

    Progress total() const noexcept {
      return {static_cast<double>(sum(amiss)), static_cast<double>(sum(outside)),
              static_cast<double>(largest_lane(largest)), negative, touched};
    }
  };

  template <class Step>
  Progress advance(const Step& step, const PressureSystem<Scalar>& system, std::vector<Scalar>& term, Scalar along,
                   Scalar squared_step) noexcept {
    return reduction_.over(
        step.fluid.size(), step.threads, Progress{},
        [&](Index begin, Index end) {
          std::tuple<Tally<B>, Tally<Scalar>> tallies;
          for_all(begin, end, [&]<class Number>(std::type_identity<Number>, std::size_t at) {
            const Number zero(Scalar(0));
            const Number pressure =
                multiply_add(Number(along), load_as<Number>(&direction_[at]), load_as<Number>(&term[at]));
            const Number left =
                multiply_add(Number(-along), load_as<Number>(&image_[at]), load_as<Number>(&residual_[at]));
            store_as(pressure, &term[at]);
            store_as(left, &residual_[at]);
            const Number slope = Number(squared_step) * load_as<Number>(&system.diagonal()[at]);
            const Number pull = zero - pressure * slope;  // of a negative pressure, which will be clipped
            store_as(asked(left, pressure, slope), &asked_[at]);
            const auto negative = pressure < zero;
            // particles out of contact stay out until the next start
            const auto touched =
                (load_as<Number>(&contact_[at]) == zero) & (left > zero) & (slope > Number(smallest_slope_));
            const Number amiss =
                select(negative, maximum(left, zero) + pull, maximum(left, minimum(zero - left, zero - pull)));
            auto& tally = std::get<Tally<Number>>(tallies);
            tally.amiss += amiss;
            tally.largest = maximum(amiss, tally.largest);
            tally.outside += select(negative, pull, select(touched, left, zero));
            tally.negative = tally.negative || any(negative);
            tally.touched = tally.touched || any(touched);
          });
          add_up(system, begin, end, along);
          return Progress::both(std::get<0>(tallies).total(), std::get<1>(tallies).total());
        },
        Progress::both);
  }

  /// Adds what the direction does to sum_, for some particles.
  void add_up(const PressureSystem<Scalar>& system, Index begin, Index end, Scalar along) noexcept {
    // the fourth number of a record is not an acceleration
    std::array<Scalar, 4 + static_cast<std::size_t>(B::width)> factor;
    for (std::size_t k = 0; k < factor.size(); ++k) {
      factor[k] = k % 4 == 3 ? Scalar(0) : along;
    }
    for_all(4 * begin, 4 * end, [&]<class Number>(std::type_identity<Number>, std::size_t at) {
      store_as(multiply_add(load_as<Number>(&factor[at % 4]), load_as<Number>(system.accelerations() + at),
                            load_as<Number>(&sum_[at])),
               &sum_[at]);
    });
  }

  Scalar smallest_slope_ = 0;
  CoarseGrid<Scalar> grid_{};
  bool sorted_ = false;      ///< the grid, in this sub-step
  int impatient_steps_ = 0;  ///< sub-steps in which the grid is called at once
  double net_ = 0;           ///< what regions are amiss by as a whole, summed over the grid's nodes [kg/m^3]
  std::vector<Scalar> residual_{}, direction_{}, image_{};
  std::vector<Scalar> asked_{};    ///< see asked
  std::vector<Scalar> contact_{};  ///< 1 or 0
  std::vector<Scalar> smooth_{};   ///< the grid's part of what residual_ asks for
  std::vector<Scalar> sum_{};      ///< accelerations by `term`, records as the system's
  Reduction<Progress> reduction_{};
  Reduction<double> reduction_of_sums_{};
};

}  // namespace decant::inline DECANT_TARGET
