// SPDX-License-Identifier: MIT
#pragma once

/// The rigid bodies of a scene: what they are made of, where they are, what the liquid feels of them, and the guard
/// that keeps the liquid on its side of their walls.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <decant/boundary/body_shape.hpp>
#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/concept.hpp>
#include <decant/boundary/half_space.hpp>
#include <decant/boundary/mesh_report.hpp>
#include <decant/boundary/mesh_wall.hpp>
#include <decant/boundary/solid_parts.hpp>
#include <decant/boundary/swept_contact.hpp>
#include <decant/boundary/wall_function.hpp>
#include <decant/boundary/wall_state.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/kernel/cubic_spline.hpp>

namespace decant::inline DECANT_TARGET {

/// A set of rigid bodies, each with a pose at any time.
/// MeshWallType decides how the liquid feels meshes: MeshWall (shadow integrals) or SampledWall (boundary particles).
/// Copies share the bodies' immutable surfaces and grids.
template <class ScalarType, class MeshWallType = MeshWall>
class RigidBodies {
 public:
  using Scalar = ScalarType;

  struct Body {
    std::string name{};
    std::shared_ptr<const BodyShape> shape{};
    std::shared_ptr<const BoundingVolumeHierarchy> surface{};
    std::shared_ptr<const std::variant<MeshWallType, SolidParts>> wall{};
    PoseTrack motion{};
    Slip slip = Slip::Free;
    Eigen::AlignedBox3d bounds{};         ///< in the body's frame [m]
    std::vector<std::string> warnings{};  ///< what is wrong with its mesh, one line each (boundary/mesh_report.hpp)
    Pose before{}, after{};               ///< at the ends of the current step
    RigidVelocity velocity{};             ///< between them
    double reach = 0;                     ///< the farthest that any point of the body moves between them [m]
    double fastest = 0;                   ///< the speed of its bounds' fastest corner [m/s]
    Eigen::Isometry3d from_world_before =
        Eigen::Isometry3d::Identity();  ///< inverse of `before`, ready for many points
    Eigen::Isometry3d from_world_after = Eigen::Isometry3d::Identity();
  };

  /// Wall integrals are prepared for the kernel and particle spacing that are given. The number that is returned counts
  /// up from 0. A mesh is looked over first: throws std::invalid_argument, one line, if it is empty, not finite, or of
  /// a size that makes no sense at this spacing; what else is wrong with it is in the body's warnings.
  template <class Kernel>
  BodyId add(std::string name, BodyShape shape, PoseTrack motion, Slip slip, double smoothing_length, double spacing,
             Threads threads) {
    Body body;
    body.name = std::move(name);
    body.motion = std::move(motion);
    body.slip = slip;
    give_shape<Kernel>(body, std::move(shape), smoothing_length, spacing, threads);
    bodies_.push_back(std::move(body));
    return static_cast<BodyId>(bodies_.size() - 1);
  }

  /// Gives a body another shape; all else of it stays. Takes and throws what add does.
  template <class Kernel>
  void replace_shape(BodyId body, BodyShape shape, double smoothing_length, double spacing, Threads threads) {
    Body other = bodies_[body];
    give_shape<Kernel>(other, std::move(shape), smoothing_length, spacing, threads);
    bodies_[body] = std::move(other);
  }

  std::size_t size() const noexcept { return bodies_.size(); }
  const Body& operator[](BodyId body) const { return bodies_[body]; }
  void set_motion(BodyId body, PoseTrack motion) { bodies_[body].motion = std::move(motion); }

  /// Takes all bodies to [time, time + time_step] [s].
  void set_interval(double time, double time_step) noexcept {
    duration_ = time_step;
    for (Body& body : bodies_) {
      body.before = body.motion.at(time);
      if (time_step > 0) {
        body.after = body.motion.at(time + time_step);
        body.velocity = velocity_between(body.before, body.after, time_step);
      } else {
        body.after = body.before;
        body.velocity = {};
      }
      body.from_world_before = isometry(body.before.inverse());
      body.from_world_after = isometry(body.after.inverse());
      body.reach = body.fastest = 0;
      // rigid displacements and velocities are affine in the place, so they are largest at a corner of the box
      for (int corner = 0; corner < 8; ++corner) {
        const Vector3<double> x = body.bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
        body.reach = std::max(body.reach, (body.after * x - body.before * x).norm());
        body.fastest = std::max(body.fastest, body.velocity.at(body.before * x).norm());
      }
    }
  }

  /// Largest speed of any particle relative to any body, at the body's point that is nearest to the particle within its
  /// bounds, over the current interval; relative to the world if nothing moves or there is no body [m/s]. What has left
  /// the scene, far from all bodies, does not count: else a spilled drop would shorten everybody's sub-steps for as
  /// long as it falls. NaN if any velocity is.
  double largest_relative_speed(const FluidState<Scalar>& fluid, Threads threads,
                                Reduction<double>& reduction) const noexcept {
    const bool all_move = !bodies_.empty() && std::all_of(bodies_.begin(), bodies_.end(), moves);
    double fastest = 0;
    for (const Body& body : bodies_) {
      fastest = std::max(fastest, body.fastest);
    }
    return reduction.over(
        fluid.size(), threads, 0.0,
        [&](Index begin, Index end) {
          double largest = 0;
          const auto take = [&largest](double speed) { largest = speed <= largest ? largest : speed; };  // NaN stays
          for (Index i = begin; i < end; ++i) {
            const Vector3<double> v = fluid.velocity.col(i).template cast<double>();
            if (v.norm() + fastest <= largest) {
              continue;  // whatever it is near
            }
            const Vector3<double> x = fluid.position.col(i).template cast<double>();
            if (v.squaredNorm() > largest * largest && has_left(x, v)) {
              continue;
            }
            if (!all_move) {
              take(v.norm());
            }
            for (const Body& body : bodies_) {
              if (moves(body)) {
                const Vector3<double> x_in_body = body.from_world_before * x;
                const Vector3<double> nearest = x_in_body.cwiseMax(body.bounds.min()).cwiseMin(body.bounds.max());
                take((v - body.velocity.at(body.before * nearest)).norm());
              }
            }
          }
          return largest;
        },
        [](double a, double b) { return b <= a ? a : b; });
  }

  /// Fills `walls` for particles at `position` 3xN [m], with the bodies as they stand at the start of the interval.
  /// @param spacing particle spacing [m].
  void sample(const ConstPointsView<Scalar>& position, double spacing, Threads threads,
              WallState<Scalar>& walls) const noexcept {
    walls.resize(position.cols());
    parallel_for(position.cols(), threads, [&](Index i) { sample_particle(i, position.col(i), spacing, walls); });
  }

  /// As sample, for the particles with again[i] != 0 only: what `walls` has of the others is right.
  /// @param again N entries.
  void sample_again(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> again, double spacing,
                    Threads threads, WallState<Scalar>& walls) const noexcept {
    parallel_for(position.cols(), threads, [&](Index i) {
      if (again[static_cast<std::size_t>(i)] != 0) {
        sample_particle(i, position.col(i), spacing, walls);
      }
    });
  }

  /// True if some wall stands between two points of the world at the start of the interval.
  bool separated(const Vector3<Scalar>& a, const Vector3<Scalar>& b, const WallContact<Scalar>* contacts,
                 int contact_count) const noexcept {
    for (int k = 0; k < contact_count; ++k) {
      const Body& body = bodies_[contacts[k].body];
      if (body.surface->any_hit(body.from_world_before * Vector3<double>(a.template cast<double>()),
                                body.from_world_before * Vector3<double>(b.template cast<double>()))) {
        return true;
      }
    }
    return false;
  }

  /// Moves particles that are inside of a body's material to the nearest place outside of it, `clearance` [m] off its
  /// surface, and to rest relative to it. For a body that is put where liquid is. @return how many were moved.
  Index push_out(BodyId body_id, double clearance, FluidState<Scalar>& fluid, Threads threads = {1}) const {
    const Body& body = bodies_[body_id];
    const Pose body_from_world = body.before.inverse();
    std::atomic<Index> moved{0};
    parallel_for(fluid.size(), threads, [&](Index i) {
      const Vector3<double> x = body_from_world * fluid.position.col(i).template cast<double>();
      if (!body.bounds.contains(x) || !body.surface->inside_material(x)) {
        return;
      }
      if (const auto near = body.surface->closest_point(x, body.bounds.diagonal().norm())) {
        const Vector3<double> out =
            near->distance > 1e-12 ? Vector3<double>((near->point - x) / near->distance) : near->normal;
        fluid.position.col(i) = (body.before * (near->point + clearance * out)).template cast<Scalar>();
        fluid.velocity.col(i).setZero();
        moved.fetch_add(1, std::memory_order_relaxed);
      }
    });
    return moved;
  }

  /// Bends the steps of particles that would cross a wall or come nearer to it than `clearance` [m]. Particles go from
  /// `before` (3xN [m]) to fluid.position (changed) while the bodies move through the interval; those that were bent
  /// lose the part of their velocity that points into the wall. `walls` is as sampled at `before`.
  GuardReport guard(const ConstPointsView<Scalar>& before, double clearance, Threads threads,
                    const WallState<Scalar>& walls, FluidState<Scalar>& fluid) const noexcept {
    if (bodies_.empty()) {
      return {};
    }
    std::atomic<Index> slid{0}, stopped{0}, lost{0};
    parallel_for(before.cols(), threads, [&](Index i) {
      switch (guard_particle(i, before, clearance, walls, fluid)) {
        case Outcome::Free:
          break;
        case Outcome::Slid:
          slid.fetch_add(1, std::memory_order_relaxed);
          break;
        case Outcome::Stopped:
          stopped.fetch_add(1, std::memory_order_relaxed);
          break;
        case Outcome::Lost:
          lost.fetch_add(1, std::memory_order_relaxed);
          break;
      }
    });
    return {slid, stopped, lost};
  }

 private:
  template <class Kernel>
  void give_shape(Body& body, BodyShape shape, double smoothing_length, double spacing, Threads threads) {
    half_space_ = HalfSpace::of<Kernel>(smoothing_length);
    reach_ = WallFunction::of<Kernel>(smoothing_length, spacing).reach();
    body.shape = std::make_shared<const BodyShape>(std::move(shape));
    body.surface = std::make_shared<const BoundingVolumeHierarchy>(body.shape->mesh);
    body.warnings.clear();
    if (body.shape->parts.empty()) {
      body.warnings = warnings_about(body, spacing);
      body.wall = std::make_shared<const std::variant<MeshWallType, SolidParts>>(
          MeshWallType::template of<Kernel>(*body.surface, smoothing_length, spacing, threads));
    } else {
      body.wall = std::make_shared<const std::variant<MeshWallType, SolidParts>>(
          SolidParts::of<Kernel>(body.shape->parts, smoothing_length, spacing));
    }
    body.bounds = body.surface->bounds();
  }

  enum class Outcome { Free, Slid, Stopped, Lost };

  /// A body's share of one particle's support, in the world frame.
  struct Share {
    BodyId body = 0;
    double amount = 0;
    double distance = 0;
    Vector3<double> gradient = Vector3<double>::Zero();
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    Vector3<double> normal = Vector3<double>::Zero();
    Vector3<double> point = Vector3<double>::Zero();
  };

  /// Farther from every body than it travels in the interval, and by much more than walls are felt.
  bool has_left(const Vector3<double>& x, const Vector3<double>& v) const noexcept {
    const double least = 20 * reach_ + v.norm() * duration_;
    return !bodies_.empty() && std::all_of(bodies_.begin(), bodies_.end(), [&](const Body& body) {
      const double distance = least + body.reach;
      return body.bounds.squaredExteriorDistance(body.from_world_before * x) > distance * distance;
    });
  }

  static bool moves(const Body& body) noexcept { return body.motion.samples().size() > 1; }

  static Eigen::Isometry3d isometry(const Pose& pose) noexcept {
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    result.linear() = pose.rotation.toRotationMatrix();
    result.translation() = pose.translation;
    return result;
  }

  void sample_particle(Index i, const Vector3<Scalar>& place, double spacing, WallState<Scalar>& walls) const noexcept {
    const Vector3<double> x = place.template cast<double>();
    std::array<Share, WallState<Scalar>::max_contacts> near;
    std::size_t count = 0;
    const double reach = reach_;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Body& body = bodies_[b];
      const Vector3<double> x_in_body = body.from_world_before * x;
      if (!(body.bounds.squaredExteriorDistance(x_in_body) < reach * reach)) {
        continue;
      }
      WallSample sample;
      if (!std::visit([&](const auto& wall) { return wall.sample(x_in_body, sample); }, *body.wall)) {
        continue;
      }
      Share share;
      share.body = static_cast<BodyId>(b);
      share.amount = sample.share;
      share.distance = sample.distance;
      const Eigen::Matrix3d turn = body.from_world_before.linear().transpose();
      share.gradient = turn * sample.gradient;
      share.moment = turn * sample.moment * turn.transpose();
      const double steepness = share.gradient.norm();
      if (steepness > 0) {
        share.normal = -share.gradient / steepness;
      }
      share.point = x - share.distance * share.normal;
      std::size_t place_in_row = std::min(count, near.size() - 1);
      if (count == near.size() && share.distance >= near.back().distance) {
        continue;
      }
      count = std::min(count + 1, near.size());
      for (; place_in_row > 0 && share.distance < near[place_in_row - 1].distance; --place_in_row) {
        near[place_in_row] = near[place_in_row - 1];
      }
      near[place_in_row] = share;
    }
    if (count == 0) {
      leave_free(i, walls);
    } else {
      combine(i, near, count, spacing, walls);
    }
  }

  /// No wall is felt.
  void leave_free(Index i, WallState<Scalar>& walls) const noexcept {
    walls.share[i] = walls.flux[i] = 0;
    walls.gradient.col(i).setZero();
    walls.moment.col(i).setZero();
    walls.distance[i] = static_cast<Scalar>(reach_);
    walls.contact_count[i] = 0;
  }

  /// Bodies together: shares add up, but what is hidden behind a nearer body does not count.
  void combine(Index i, std::array<Share, WallState<Scalar>::max_contacts>& near, std::size_t count, double spacing,
               WallState<Scalar>& walls) const noexcept {
    double amount = 0, flux = 0;
    Vector3<double> gradient = Vector3<double>::Zero();
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    WallContact<Scalar>* contacts = walls.contacts_of(i);
    for (std::size_t k = 0; k < count; ++k) {
      double weight = 1;
      for (std::size_t nearer = 0; nearer < k; ++nearer) {
        const double ahead = (near[k].point - near[nearer].point).dot(near[nearer].normal);
        weight *= std::clamp(ahead / (0.1 * spacing), 0.0, 1.0);
      }
      const Body& body = bodies_[near[k].body];
      const Vector3<double> share = weight * near[k].gradient;
      // at the particle: liquid that turns with its vessel feels no friction, though the wall, farther out, is faster
      const Vector3<double> velocity = body.velocity.at(near[k].point + near[k].distance * near[k].normal);
      amount += weight * near[k].amount;
      gradient += share;
      moment += weight * near[k].moment;
      flux += share.dot(velocity);
      WallContact<Scalar>& contact = contacts[k];
      contact.body = near[k].body;
      contact.distance = static_cast<Scalar>(near[k].distance);
      contact.gradient = share.template cast<Scalar>();
      contact.velocity = velocity.template cast<Scalar>();
      // The pull of a plane at distance a is 2 slope / a. Below a quarter spacing the particle is in the wall's own
      // layer and the quotient would only measure rounding.
      const double distance = std::max(near[k].distance, 0.25 * spacing);
      contact.friction = body.slip == Slip::Free
                             ? Scalar(0)
                             : static_cast<Scalar>(weight * 2 * half_space_.slope(near[k].distance) / distance);
    }
    walls.share[i] = static_cast<Scalar>(amount);
    walls.gradient.col(i) = gradient.template cast<Scalar>();
    Eigen::Index entry = 0;
    for (Eigen::Index row = 0; row < 3; ++row) {
      for (Eigen::Index column = row; column < 3; ++column) {
        walls.moment(entry++, i) = static_cast<Scalar>(moment(row, column));
      }
    }
    walls.flux[i] = static_cast<Scalar>(flux);
    walls.distance[i] = static_cast<Scalar>(near[0].distance);
    walls.contact_count[i] = static_cast<std::uint8_t>(count);
  }

  Outcome guard_particle(Index i, const ConstPointsView<Scalar>& before, double clearance,
                         const WallState<Scalar>& walls, FluidState<Scalar>& fluid) const noexcept {
    const Vector3<double> x0 = before.col(i).template cast<double>();
    Vector3<double> x1 = fluid.position.col(i).template cast<double>();
    // looked-up distances may be off by a fraction of a grid cell; a tenth covers that
    const double room = 0.9 * static_cast<double>(walls.distance[i]) - clearance;
    Outcome outcome = Outcome::Free;
    const Body* touched = nullptr;
    constexpr int most_rounds = 3;
    for (int round = 0;; ++round) {
      bool changed = false;
      const double travel = (x1 - x0).norm();
      for (const Body& body : bodies_) {
        if (travel + body.reach < room) {
          continue;
        }
        const Vector3<double> start = body.from_world_before * x0;
        Vector3<double> end = body.from_world_after * x1;
        const Vector3<double> step = end - start;
        if (room > 0 && step.squaredNorm() < room * room) {
          continue;
        }
        if (!body.bounds.intersects(Eigen::AlignedBox3d(start.cwiseMin(end).array() - clearance,
                                                        start.cwiseMax(end).array() + clearance))) {
          continue;
        }
        const SweptResult result = keep_on_side(*body.surface, start, end, clearance);
        if (result != SweptResult::Free) {
          x1 = body.after * end;
          changed = true;
          touched = &body;
          outcome = std::max(outcome, result == SweptResult::Slid ? Outcome::Slid : Outcome::Stopped);
        }
      }
      if (!changed || round + 1 == most_rounds || bodies_.size() == 1) {
        if (changed && bodies_.size() > 1 && crosses_any(x0, x1)) {
          outcome = Outcome::Lost;
        }
        break;
      }
    }
    if (outcome != Outcome::Free) {
      // The wall takes the speed toward it and gives none: what it moved the particle by is not motion.
      const Vector3<double> push = x1 - fluid.position.col(i).template cast<double>();
      const double length = push.norm();
      if (length > 0) {
        const Vector3<double> normal = push / length;
        const Vector3<double> wall = touched->velocity.at(x0);
        const Vector3<double> velocity = fluid.velocity.col(i).template cast<double>();
        const double approach = (velocity - wall).dot(normal);
        if (approach < 0) {
          fluid.velocity.col(i) = (velocity - approach * normal).template cast<Scalar>();
        }
      }
      fluid.position.col(i) = x1.template cast<Scalar>();
    }
    return outcome;
  }

  bool crosses_any(const Vector3<double>& x0, const Vector3<double>& x1) const noexcept {
    return std::any_of(bodies_.begin(), bodies_.end(), [&](const Body& body) {
      return body.surface->any_hit(body.from_world_before * x0, body.from_world_after * x1);
    });
  }

  static std::vector<std::string> warnings_about(const Body& body, double spacing) {
    MeshReport report = inspect(body.shape->mesh, spacing);
    if (!report.refusals.empty()) {
      throw std::invalid_argument("body '" + body.name + "': " + report.refusals.front());
    }
    return std::move(report.warnings);
  }

  std::vector<Body> bodies_{};
  HalfSpace half_space_{};  ///< of the simulation's kernel
  double reach_ = 0;        ///< of walls [m]
  double duration_ = 0;     ///< of the interval [s]
};

static_assert(Boundary<RigidBodies<float>, CubicSpline<float>>);
static_assert(Boundary<RigidBodies<double>, CubicSpline<double>>);

}  // namespace decant::inline DECANT_TARGET
