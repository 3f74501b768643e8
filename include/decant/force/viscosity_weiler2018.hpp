// SPDX-License-Identifier: MIT
#pragma once

/// Internal friction of thick liquids: implicit in time, stable for any viscosity and any step.

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/growable.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/viscous_pair.hpp>

namespace decant::inline DECANT_TARGET {

/// After Weiler, Koschier, Brand and Bender 2018, "A physically consistent implicit viscosity solver for SPH fluids"
/// (Computer Graphics Forum 37): the pair friction of Viscosity, evaluated at the velocities that it leads to,
///   v' = v + dt a(v'),   a_i(v) = 10 nu sum_j (m_j / rho_0) (v_ij . x_ij) / (r^2 + 0.01 h^2) grad W_ij - wall
///   friction,
/// solved by conjugate gradients; what is added is (v' - v) / dt. Walls that hold the liquid enter by their friction
/// rate and velocity (WallContact), where the paper uses boundary particles. Two things differ from the paper. rho_0
/// stands for rho_j, as in Viscosity. And there is no preconditioner: in the product weighted by mass the system is
/// symmetric, translations and rotations of the whole are eigenvectors of eigenvalue one, and plain conjugate gradients
/// never leave the space orthogonal to what they start from, so that linear and angular momentum are kept to rounding
/// however early the iteration ends. A block Jacobi preconditioner would lose that and, with particles of one size,
/// save few iterations.
template <class ScalarType>
struct ViscosityWeiler2018 {
  using Scalar = ScalarType;

  Scalar kinematic_viscosity = Scalar(1e-2);  ///< nu [m^2/s], >= 0
  Scalar tolerance = Scalar(1e-4);            ///< of the residual, relative to the change that is asked for [-], > 0
  int most_iterations = 100;                  ///< per sub-step, >= 1; the error that is left shows as less friction

  /// Of the last sub-step.
  int iterations() const noexcept { return iterations_; }

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    iterations_ = 0;
    const Index count = step.fluid.size();
    if (!(kinematic_viscosity > 0) || !(step.time_step > 0) || count == 0) {
      return;
    }
    assemble(step);
    const double scale = begin(step);
    double squared_residual = scale;
    const double enough = static_cast<double>(tolerance) * static_cast<double>(tolerance) * scale;
    while (squared_residual > enough && iterations_ < most_iterations) {
      ++iterations_;
      const double curvature = reduction_.over(
          count, step.threads, 0.0,
          [&](Index from, Index to) {
            double partial = 0;
            for (Index i = from; i < to; ++i) {
              const Vector3<Scalar> image = apply(step, direction_.data(), i);
              image_.col(i) = image;
              partial +=
                  static_cast<double>(step.fluid.mass[i]) * static_cast<double>(image.dot(vector(direction_, i)));
            }
            return partial;
          },
          [](double a, double b) { return a + b; });
      if (!(curvature > 0) || !std::isfinite(curvature)) {
        break;  // rounding or a state that is not finite: keep what there is
      }
      const Scalar along = static_cast<Scalar>(squared_residual / curvature);
      const double next = reduction_.over(
          count, step.threads, 0.0,
          [&](Index from, Index to) {
            double partial = 0;
            for (Index i = from; i < to; ++i) {
              change_.col(i) += along * vector(direction_, i);
              residual_.col(i) -= along * image_.col(i);
              partial += static_cast<double>(step.fluid.mass[i]) * static_cast<double>(residual_.col(i).squaredNorm());
            }
            return partial;
          },
          [](double a, double b) { return a + b; });
      const Scalar keep = static_cast<Scalar>(next / squared_residual);
      squared_residual = next;
      parallel_for(count, step.threads,
                   [&](Index i) { set(direction_, i, residual_.col(i) + keep * vector(direction_, i)); });
    }
    const Scalar rate = 1 / step.time_step;
    parallel_for(count, step.threads, [&](Index i) { acceleration.col(i) += rate * change_.col(i); });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }

 private:
  using B = Batch<Scalar>;

  static Vector3<Scalar> vector(const std::vector<Scalar>& records, Index i) noexcept {
    const Scalar* record = &records[static_cast<std::size_t>(4 * i)];
    return {record[0], record[1], record[2]};
  }
  static void set(std::vector<Scalar>& records, Index i, const Vector3<Scalar>& value) noexcept {
    Scalar* record = &records[static_cast<std::size_t>(4 * i)];
    record[0] = value[0];
    record[1] = value[1];
    record[2] = value[2];
  }

  /// Per pair w = nu dt / rho_0 * ViscousPair >= 0, so that the friction is dt a_i = -sum_j m_j w (v_ij . x_ij) x_ij;
  /// it is the same for all iterations. Positions come with the list.
  template <class Step>
  void assemble(const Step& step) noexcept {
    using Kernel = typename Step::Kernel;
    const Index count = step.fluid.size();
    const detail::ViscousPair<Scalar> weight(static_cast<Scalar>(Kernel::support_factor) * step.smoothing_length);
    const Scalar factor = kinematic_viscosity * step.time_step / step.rest_density;
    if (weight_.size() < step.neighbors.index_size()) {
      weight_.resize(step.neighbors.index_size());
    }
    direction_.resize(4 * static_cast<std::size_t>(count));
    change_.set_count(count);
    residual_.set_count(count);
    image_.set_count(count);
    parallel_for(count, step.threads, [&](Index i) {
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B shared = factor * step.mass(pair.neighbor) * weight(pair.distance_squared);
        shared.store(&weight_[pair.slot]);
      });
    });
  }

  /// Starts from v' = v. The residual is what an explicit step would add. Returns its squared norm, weighted by mass.
  template <class Step>
  double begin(const Step& step) noexcept {
    const Index count = step.fluid.size();
    parallel_for(count, step.threads, [&](Index i) { set(direction_, i, step.fluid.velocity.col(i)); });
    const double squared = reduction_.over(
        count, step.threads, 0.0,
        [&](Index from, Index to) {
          double partial = 0;
          for (Index i = from; i < to; ++i) {
            Vector3<Scalar> asked = -pair_friction(step, direction_.data(), i);
            for_each_wall(step, i, [&](Scalar rate, const Vector3<Scalar>& normal, const Vector3<Scalar>& velocity) {
              asked -= rate * tangential(step.fluid.velocity.col(i) - velocity, normal);
            });
            residual_.col(i) = asked;
            change_.col(i).setZero();
            partial += static_cast<double>(step.fluid.mass[i]) * static_cast<double>(asked.squaredNorm());
          }
          return partial;
        },
        [](double a, double b) { return a + b; });
    parallel_for(count, step.threads, [&](Index i) { set(direction_, i, residual_.col(i)); });
    return squared;
  }

  /// (1 - dt a) of a velocity field, for walls at rest.
  template <class Step>
  Vector3<Scalar> apply(const Step& step, const Scalar* records, Index i) const noexcept {
    const Scalar* own = records + 4 * i;
    const Vector3<Scalar> v(own[0], own[1], own[2]);
    Vector3<Scalar> result = v + pair_friction(step, records, i);
    for_each_wall(step, i, [&](Scalar rate, const Vector3<Scalar>& normal, const Vector3<Scalar>&) {
      result += rate * tangential(v, normal);
    });
    return result;
  }

  template <class Step>
  Vector3<Scalar> pair_friction(const Step& step, const Scalar* records, Index i) const noexcept {
    const Scalar* own = records + 4 * i;
    const B own_x(own[0]), own_y(own[1]), own_z(own[2]);
    B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
    step.neighbors.for_each_batch(i, [&](const auto& pair) {
      const auto other = gather3(records, pair.neighbor);
      const B approach = (own_x - other.x) * pair.x + (own_y - other.y) * pair.y + (own_z - other.z) * pair.z;
      const B push = B::load(&weight_[pair.slot]) * approach;
      x = multiply_add(push, pair.x, x);
      y = multiply_add(push, pair.y, y);
      z = multiply_add(push, pair.z, z);
    });
    return {sum(x), sum(y), sum(z)};
  }

  /// Calls f(rate times dt [-], unit normal, wall velocity) for each wall that holds particle i.
  template <class Step, class Function>
  void for_each_wall(const Step& step, Index i, Function&& f) const noexcept {
    const auto* contacts = step.walls.contacts_of(i);
    for (int k = 0; k < step.walls.contact_count[i]; ++k) {
      const Scalar steepness = contacts[k].gradient.norm();
      if (contacts[k].friction > 0 && steepness > 0) {
        f(kinematic_viscosity * step.time_step * contacts[k].friction,
          Vector3<Scalar>(contacts[k].gradient / steepness), contacts[k].velocity);
      }
    }
  }

  static Vector3<Scalar> tangential(const Vector3<Scalar>& v, const Vector3<Scalar>& normal) noexcept {
    return v - v.dot(normal) * normal;
  }

  int iterations_ = 0;
  std::vector<Scalar> weight_{};     ///< per pair, aligned with the list's index
  std::vector<Scalar> direction_{};  ///< records of four
  Growable<Scalar, 3> change_{}, residual_{}, image_{};
  Reduction<double> reduction_{};
};

}  // namespace decant::inline DECANT_TARGET
