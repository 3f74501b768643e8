// SPDX-License-Identifier: MIT
#pragma once

/// Filling a container with liquid at rest (Schenck and Fox 2017, section on initialisation): by volume, by fraction of
/// what it holds, or to a level, found by search on the number of particles.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/cavity.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/simulator.hpp>

namespace decant::inline DECANT_TARGET {

/// How much.
struct FillAmount {
  enum class Kind { Fraction, Volume, Level };
  Kind kind;
  double value;

  /// Of the volume below the rim, 0 .. 1.
  static FillAmount fraction(double share) { return {Kind::Fraction, share}; }
  /// [m^3], at most what the container holds.
  static FillAmount volume(double cubic_metres) { return {Kind::Volume, cubic_metres}; }
  /// Height of the free surface above the cavity's lowest point [m].
  static FillAmount level(double height) { return {Kind::Level, height}; }
};

/// What came of it.
struct FillReport {
  Index particles = 0;  ///< that were added
  double volume = 0;    ///< theirs [m^3]
  double capacity = 0;  ///< of the container below its rim, as it stands [m^3]
  double level = 0;     ///< of the settled free surface above the cavity's lowest point [m]
  int settled = 0;      ///< how many fillings were tried and settled
};

/// Height of the free surface of the liquid in a cavity above the cavity's lowest point [m]: half a spacing above the
/// median of the highest particles over squares of one spacing. NaN if there is no liquid in it.
template <class Scalar>
double free_surface_level(const FluidState<Scalar>& fluid, const Cavity& cavity, const Pose& world_from_body,
                          const Vector3<double>& up_in_body, double spacing) {
  const Pose body_from_world = world_from_body.inverse();
  const Vector3<double> across = up_in_body.unitOrthogonal();
  const Vector3<double> along = up_in_body.cross(across);
  std::map<std::pair<long, long>, double> tops;
  for (Index i = 0; i < fluid.size(); ++i) {
    const Vector3<double> x = body_from_world * Vector3<double>(fluid.position.col(i).template cast<double>());
    if (!cavity.contains(x)) {
      continue;
    }
    const std::pair<long, long> square{std::lround(x.dot(across) / spacing), std::lround(x.dot(along) / spacing)};
    const double height = x.dot(up_in_body) - cavity.bottom_height();
    const auto [place, is_new] = tops.try_emplace(square, height);
    place->second = std::max(place->second, height);
  }
  if (tops.empty()) {
    return std::nan("");
  }
  std::vector<double> heights;
  for (const auto& top : tops) {
    heights.push_back(top.second);
  }
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return *middle + 0.5 * spacing;
}

namespace detail {

/// The lowest `count` places of a lattice in the cavity that stays off the walls; the lattice is as wide as one
/// particle spacing, or narrower where that is needed for `count` particles to fit below `level`.
inline PointArray<double> places_in(const Cavity& cavity, const BoundingVolumeHierarchy& surface,
                                    const Vector3<double>& up, double level, Index count, double spacing) {
  const Vector3<double> across = std::abs(up.x()) < 0.9
                                     ? Vector3<double>((Vector3<double>::UnitX() - up.x() * up).normalized())
                                     : up.unitOrthogonal();
  const Vector3<double> along = up.cross(across);
  const Eigen::AlignedBox3d bounds = surface.bounds();
  const Vector3<double> center = bounds.center();
  const Vector3<double> half = 0.5 * bounds.sizes();
  std::vector<std::pair<double, Vector3<double>>> places;
  for (double width = spacing;; width *= 0.98) {
    places.clear();
    const auto reach_across = static_cast<long>(std::ceil(half.dot(across.cwiseAbs()) / width));
    const auto reach_along = static_cast<long>(std::ceil(half.dot(along.cwiseAbs()) / width));
    const auto enough = static_cast<std::size_t>(count);
    const double bottom = cavity.bottom_height();
    const double foot = bottom - center.dot(up);
    // from the bottom up, and no farther than needed: a little liquid in a large tank takes little time
    const auto wanted = [&] { return places.size() < enough; };
    for (long k = 0; wanted() && bottom + (static_cast<double>(k) + 0.5) * width <= cavity.rim_height(); ++k) {
      for (long j = -reach_along; wanted() && j <= reach_along; ++j) {
        for (long i = -reach_across; wanted() && i <= reach_across; ++i) {
          const double height = (static_cast<double>(k) + 0.5) * width;
          const Vector3<double> x = center + (foot + height) * up + (static_cast<double>(i) + 0.5) * width * across +
                                    (static_cast<double>(j) + 0.5) * width * along;
          if (cavity.contains(x) && !surface.closest_point(x, 0.45 * width)) {
            places.emplace_back(height, x);
          }
        }
      }
    }
    if ((places.size() >= enough && (enough == 0 || places[enough - 1].first <= level + 0.5 * width)) ||
        width < 0.7 * spacing) {
      break;
    }
  }
  if (static_cast<Index>(places.size()) < count) {
    return {};
  }
  PointArray<double> result(3, count);
  for (Index k = 0; k < count; ++k) {
    result.col(k) = places[static_cast<std::size_t>(k)].second;
  }
  return result;
}

}  // namespace detail

/// Fills a body that stands still or is held at its pose of this moment; what is settled is at rest relative to it.
/// A level is met within a quarter of a spacing where the number of particles allows it.
/// Throws std::invalid_argument if the body holds no liquid as it stands, or not as much, or if that would make more
/// than most_particles.
template <class Parts>
FillReport fill(Simulator<Parts>& simulator, BodyId body, const FillAmount& amount) {
  using Scalar = typename Parts::Scalar;
  expects(body < simulator.bodies().size(), "fill: body", "one that was added", body);
  const SimulatorSettings& settings = simulator.settings();
  expects(settings.gravity.norm() > 0, "fill: gravity [m/s^2]", "other than zero: which way is up?", 0);
  const auto& container = simulator.bodies()[body];
  const Pose pose = container.motion.at(simulator.time());
  const Vector3<double> up = pose.rotation.conjugate() * Vector3<double>(-settings.gravity.normalized());
  const double spacing = settings.spacing;
  const Cavity cavity(container.surface, up);
  const std::string name = "fill: body '" + container.name + "': ";

  expects(!cavity.empty(), name + "shape", "one that holds liquid as it stands", "no cavity");

  FillReport report;
  report.capacity = cavity.volume();
  double volume = amount.value;
  switch (amount.kind) {
    case FillAmount::Kind::Fraction:
      expects(amount.value >= 0 && amount.value <= 1, name + "fraction", "0 .. 1", amount.value);
      volume = amount.value * report.capacity;
      break;
    case FillAmount::Kind::Volume:
      break;
    case FillAmount::Kind::Level:
      expects(amount.value >= 0 && amount.value <= cavity.rim_height() - cavity.bottom_height(), name + "level [m]",
              "between 0 and the rim", amount.value);
      volume = cavity.volume_below(cavity.bottom_height() + amount.value);
      break;
  }
  expects(volume >= 0 && volume <= report.capacity * (1 + 1e-9), name + "volume [m^3]",
          "between 0 and what it holds below its rim", volume);

  const double particle_volume = spacing * spacing * spacing;
  const double in_all = static_cast<double>(simulator.fluid().size()) + volume / particle_volume;
  expects(in_all <= most_particles, name + "number of particles in all", "at most 1e8 at this spacing", in_all);
  auto count = static_cast<Index>(std::llround(volume / particle_volume));
  const auto most = static_cast<Index>(std::llround(std::min(report.capacity / particle_volume, most_particles)));
  const auto place = [&](Index n) {
    const double level =
        cavity.height_of(std::min(static_cast<double>(n) * particle_volume, report.capacity)) - cavity.bottom_height();
    const PointArray<double> in_body = detail::places_in(cavity, *container.surface, up, level, n, spacing);
    expects(in_body.cols() == n, name + "number of particles", "few enough to fit into it at this spacing", n);
    PointArray<Scalar> position(3, n);
    for (Index k = 0; k < n; ++k) {
      position.col(k) = (pose * Vector3<double>(in_body.col(k))).template cast<Scalar>();
    }
    simulator.add_particles(position, PointArray<Scalar>::Zero(3, n), body);
    simulator.settle();
    ++report.settled;
    report.level = free_surface_level(simulator.fluid(), cavity, pose, up, spacing);
    report.particles = n;
    report.volume = static_cast<double>(n) * particle_volume;
  };
  const auto before = simulator.snapshot();
  place(count);
  if (amount.kind == FillAmount::Kind::Level && count > 0) {
    // The settled surface tells how much is missing; each new count lies between those known to be too few and too
    // many.
    Index too_few = 0, too_many = most + 1;
    for (int round = 0; round < 5 && std::abs(report.level - amount.value) > 0.25 * spacing; ++round) {
      (report.level < amount.value ? too_few : too_many) = count;
      const double area =
          (cavity.volume_below(std::min(cavity.bottom_height() + amount.value + spacing, cavity.rim_height())) -
           cavity.volume_below(cavity.bottom_height() + amount.value - spacing)) /
          (2 * spacing);
      const auto missing = static_cast<Index>(std::llround((amount.value - report.level) * area / particle_volume));
      const Index next = std::clamp(count + missing, too_few + 1, std::max(too_few + 1, too_many - 1));
      if (next == count || too_many - too_few <= 1) {
        break;
      }
      count = next;
      simulator.restore(before);
      place(count);
    }
  }
  return report;
}

}  // namespace decant::inline DECANT_TARGET
