// SPDX-License-Identifier: MIT
#pragma once

/// Liquid that leaves: through a hole, into a material, into the air.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <decant/boundary/concept.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/detail/flow_table.hpp>

namespace decant::inline DECANT_TARGET {

/// Which of the particles within an outlet's radius go first.
enum class OutletOrder {
  Nearest,  ///< those nearest to its position: a hole
  Evenly,   ///< any, all as likely as each other: liquid that is absorbed, or that evaporates
};

/// What an outlet is asked to do. Places and velocities are in the frame of `body` and move with it.
struct OutletSettings {
  std::optional<BodyId> body{};                        ///< none: the world's frame
  Vector3<double> position = Vector3<double>::Zero();  ///< centre of the opening [m]
  double radius = 0.01;  ///< liquid this near to the position can go out [m], > 0, may be infinite. Walls do not shield
                         ///< it. Below one spacing there is often no particle so near.
  std::vector<std::pair<double, double>> flow{};  ///< (time [s], flow [m^3/s]), linear between, 0 outside
  OutletOrder order = OutletOrder::Nearest;
  std::optional<Vector3<double>> exit{};  ///< where liquid that went out goes on, beyond the wall and at least half a
                                          ///< spacing off the position [m]; none: it is gone. Only what is nearer to
                                          ///< the position than to the exit goes out.
  Vector3<double> exit_velocity = Vector3<double>::Zero();  ///< with which it goes on, relative to the frame [m/s]
};

/// Picks the particles that leave, one whenever a particle's volume should have gone. Where there is no liquid none
/// goes, and of what should have gone no more than one particle is made up for later. The choice depends on places and
/// ids of the particles, not on their order in memory.
class Outlet {
 public:
  /// A particle that could go; the least goes first.
  struct Candidate {
    double rank = 0;
    std::uint32_t id = 0;
    std::uint32_t particle = 0;

    /// For heaps, whose first element is the greatest by this comparison.
    friend bool operator<(const Candidate& a, const Candidate& b) noexcept {
      return a.rank != b.rank ? a.rank > b.rank : a.id > b.id;
    }
  };

  /// Throws std::invalid_argument if a setting is out of range. @param spacing particle spacing [m].
  Outlet(OutletSettings settings, double spacing)
      : settings_(std::move(settings)), particle_volume_(spacing * spacing * spacing) {
    expects(settings_.position.allFinite(), "Outlet: position [m]", "finite", settings_.position.transpose());
    expects(settings_.radius > 0, "Outlet: radius [m]", "> 0", settings_.radius);
    detail::expects_flow("Outlet", settings_.flow);
    expects(settings_.exit_velocity.allFinite(), "Outlet: exit_velocity [m/s]", "finite",
            settings_.exit_velocity.transpose());
    if (settings_.exit) {
      const Vector3<double> way = *settings_.exit - settings_.position;
      expects(way.norm() >= 0.5 * spacing && way.allFinite(), "Outlet: exit [m]",
              "finite and at least half a spacing off the position", settings_.exit->transpose());
      lay_out_places(way.normalized(), spacing);
    }
  }

  /// Volume flow that is asked for at a time [m^3/s].
  double flow(double time) const noexcept { return detail::flow_at(settings_.flow, time); }

  /// Of the liquid that goes on at the exit, relative to the frame [m/s]; 0 where nothing does.
  double exit_speed(double time) const noexcept {
    return settings_.exit && flow(time) > 0 ? settings_.exit_velocity.norm() : 0;
  }

  /// Where particles can go on, in the order in which to try: the exit, then places one spacing apart around it, as
  /// many as liquid that leaves slowly may need side by side. In the settings' frame [m]; empty without an exit.
  const std::vector<Vector3<double>>& places() const noexcept { return places_; }

  /// Lets time pass from `time` to `time` + `time_step` [s]; calls leave(i) for each particle that goes out meanwhile.
  /// It returns the volume that has gone [m^3], or 0 if there is no way out now, and must not change `fluid`.
  /// @param world_from_frame of the settings' frame. @param candidates is written over; kept by the caller so that
  /// nothing is allocated once it is large enough.
  template <class Scalar, class Domain, class Leave>
  void advance(double time, double time_step, const Pose& world_from_frame, const FluidState<Scalar>& fluid,
               const Domain& domain, std::vector<Candidate>& candidates, Leave&& leave) {
    const double asked = detail::flow_volume(settings_.flow, time, time + time_step);
    pending_ += asked;
    if (!(asked > 0) || pending_ < particle_volume_) {
      return;
    }
    find_candidates(world_from_frame, fluid, domain, candidates);
    while (pending_ >= particle_volume_ && !candidates.empty()) {
      std::pop_heap(candidates.begin(), candidates.end());
      const double gone = leave(static_cast<Index>(candidates.back().particle));
      if (!(gone > 0)) {
        break;
      }
      pending_ -= gone;
      candidates.pop_back();
    }
    pending_ = std::min(pending_, particle_volume_);
  }

  const OutletSettings& settings() const noexcept { return settings_; }

 private:
  /// A disc across the way out, three spacings in radius. Liquid at rest that falls clear of its place one by one makes
  /// room for 6 ml/s at 6 mm spacing and 2 ml/s at 4 mm; 29 places do for whatever a leak may be.
  void lay_out_places(const Vector3<double>& way, double spacing) {
    const Vector3<double> across = way.unitOrthogonal();
    const Vector3<double> along = way.cross(across);
    constexpr int reach = 3;
    for (int ring = 0; ring <= reach * reach; ++ring) {
      for (int i = -reach; i <= reach; ++i) {
        for (int j = -reach; j <= reach; ++j) {
          if (i * i + j * j == ring) {
            places_.push_back(*settings_.exit + spacing * (i * across + j * along));
          }
        }
      }
    }
  }

  template <class Scalar, class Domain>
  void find_candidates(const Pose& world_from_frame, const FluidState<Scalar>& fluid, const Domain& domain,
                       std::vector<Candidate>& candidates) {
    candidates.clear();
    candidates.reserve(static_cast<std::size_t>(fluid.size()));
    const Vector3<Scalar> center = (world_from_frame * settings_.position).cast<Scalar>();
    const double farthest = settings_.radius * settings_.radius;
    // what has gone out must not go out again: beyond half-way to the exit is outside
    const Vector3<double> way =
        settings_.exit ? Vector3<double>(world_from_frame.rotation * (*settings_.exit - settings_.position))
                       : Vector3<double>(Vector3<double>::Zero());
    const double half_way = settings_.exit ? 0.5 * way.squaredNorm() : 1;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<double> offset =
          domain.separation(Vector3<Scalar>(fluid.position.col(i)), center).template cast<double>();
      const double distance_squared = offset.squaredNorm();
      if (distance_squared <= farthest && offset.dot(way) < half_way) {
        const double rank = settings_.order == OutletOrder::Nearest ? distance_squared : scattered(draws_, fluid.id[i]);
        candidates.push_back({rank, fluid.id[i], static_cast<std::uint32_t>(i)});
      }
    }
    std::make_heap(candidates.begin(), candidates.end());
    ++draws_;
  }

  /// A number that looks drawn at random, another for each draw and particle: twice the finalizer of SplitMix64
  /// (Steele, Lea and Flood 2014). One rank per particle for all draws would let new liquid go before old.
  static double scattered(std::uint64_t draw, std::uint32_t id) noexcept {
    const auto mixed = [](std::uint64_t x) {
      x += 0x9e3779b97f4a7c15ull;
      x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
      x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
      return x ^ (x >> 31);
    };
    return static_cast<double>(mixed(mixed(draw) ^ id) >> 11);  // 53 bits: exact as a double
  }

  OutletSettings settings_;
  double particle_volume_;   ///< [m^3]
  double pending_ = 0;       ///< volume that should have gone and has not [m^3]
  std::uint64_t draws_ = 0;  ///< how often candidates were ranked
  std::vector<Vector3<double>> places_{};
};

}  // namespace decant::inline DECANT_TARGET
