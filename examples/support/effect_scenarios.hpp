// SPDX-License-Identifier: MIT
#pragma once

/// The pours in which an effect is hidden: containers, pans, motions and cameras, and what a robot recorded of the
/// poses. All of that depends on the scenario alone and not on what is hidden in it, so that simulations of a scenario
/// serve all recordings of it.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/body_shape.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>

#include "pour_twin.hpp"
#include "twin.hpp"

namespace example {

/// A container with the places that effects need, in its own frame: turned about y, it pours over its lip toward +x.
struct EffectContainer {
  decant::BodyShape shape{};
  decant::Vector3<double> lip = decant::Vector3<double>::Zero();  ///< [m]
  std::vector<Eigen::Vector2d>
      inner{};        ///< outline of its inside in the plane of the lip: (distance from axis, height)
  bool neck = false;  ///< air gets in past the liquid only with difficulty

  /// Of the inner wall below the lip, at a share of the container's height: 0 at the floor, 1 at the lip.
  decant::Vector3<double> wall_below_lip(double share) const {
    const double height = share * lip.z();
    double distance = lip.x();
    for (std::size_t k = 1; k < inner.size(); ++k) {
      const Eigen::Vector2d &a = inner[k - 1], &b = inner[k];
      if (a.y() <= height && height <= b.y() && b.y() > a.y()) {
        distance = std::lerp(a.x(), b.x(), (height - a.y()) / (b.y() - a.y()));
        break;
      }
    }
    return {distance, 0, height};
  }
};

/// Throws std::invalid_argument for a name that there is not.
inline EffectContainer effect_container(const std::string& name) {
  const double wall = 0.003;
  const auto turned = [&](std::vector<Eigen::Vector2d> inner, bool neck) {
    const Eigen::Vector2d rim = inner.back();
    return EffectContainer{turned_container(inner, wall).mesh(), {rim.x(), 0, rim.y()}, std::move(inner), neck};
  };
  const auto cup = [&](double floor_radius, double rim_radius, double height) {
    return turned({{0, 0}, {floor_radius, 0}, {rim_radius, height}}, false);
  };
  const auto box = [&](double half_length, double half_width, double height, bool by_the_corner) {
    const decant::BoxInside room{
        {-half_length, -half_width, 0}, {half_length, half_width, height}, wall, decant::Face::PositiveZ};
    double reach = half_length;
    decant::BodyShape shape = room;
    if (by_the_corner) {
      decant::TriangleMesh mesh = room.mesh();
      for (decant::Vector3<double>& vertex : mesh.vertices) {
        vertex = Eigen::AngleAxisd(std::atan2(half_width, half_length), Eigen::Vector3d::UnitZ()) * vertex;
      }
      reach = std::hypot(half_length, half_width);
      shape = mesh;
    }
    return EffectContainer{shape, {reach, 0, height}, {{0, 0}, {reach, 0}, {reach, height}}, false};
  };
  if (name == "tumbler")
    return cup(0.032, 0.034, 0.100);
  if (name == "cone_cup")
    return cup(0.026, 0.042, 0.100);
  if (name == "mug")
    return cup(0.040, 0.040, 0.080);
  if (name == "jug")
    return cup(0.040, 0.031, 0.105);
  if (name == "bottle")
    return turned(bottle_outline(), true);
  if (name == "flask")
    return turned({{0, 0}, {0.038, 0}, {0.042, 0.008}, {0.0205, 0.085}, {0.0195, 0.110}}, true);
  if (name == "beaker")
    return box(0.028, 0.028, 0.100, false);
  if (name == "beaker_by_corner")
    return box(0.028, 0.028, 0.100, true);
  if (name == "tub")
    return box(0.042, 0.030, 0.072, false);
  decant::expects(name == "bowl", "effect_container: name", "one of the list", name);
  const decant::Bowl bowl{0.065, 0.055, wall};
  std::vector<Eigen::Vector2d> inner;
  const double radius = (bowl.rim_radius * bowl.rim_radius + bowl.depth * bowl.depth) / (2 * bowl.depth);
  for (int k = 0; k <= 12; ++k) {
    const double height = bowl.depth * k / 12;
    inner.emplace_back(std::sqrt(height * (2 * radius - height)), height);
  }
  return {bowl.mesh(), {bowl.rim_radius, 0, bowl.depth}, std::move(inner), false};
}

/// What is poured into; its floor is at height 0.
struct EffectPan {
  enum class Form { Round, Square, Basin };
  Form form = Form::Round;
  double radius = 0.1;   ///< inner, at the rim; half of a square's side [m]
  double height = 0.04;  ///< inner [m]

  /// The place on the floor below a point of the pan's frame [m].
  decant::Vector3<double> floor_below(const decant::Vector3<double>& x) const {
    const double ball = (radius * radius + height * height) / (2 * height);  // that a basin is cut from
    const double rise = form == Form::Basin ? ball - std::sqrt(ball * ball - x.head<2>().squaredNorm()) : 0;
    return {x.x(), x.y(), rise};
  }

  decant::BodyShape shape() const {
    const double wall = 0.003;
    switch (form) {
      case Form::Square:
        return decant::BoxInside{{-radius, -radius, 0}, {radius, radius, height}, wall, decant::Face::PositiveZ};
      case Form::Basin:
        return decant::Bowl{radius, height, wall}.mesh();
      default:
        return decant::CylinderInside{radius, height, wall, decant::Face::PositiveZ};
    }
  }
};

/// A moment of a pour's plan; between two of them the container turns smoothly.
struct TiltKnot {
  double time;      ///< [s]
  double tilt_deg;  ///< 0: upright
};

/// One pour as it was planned.
struct PourPlan {
  std::string container;
  double fill = 0.6;         ///< of what the container holds upright
  double duration = 3;       ///< [s]
  double lip_height = 0.2;   ///< above the pan's floor [m]
  double lip_behind = 0.07;  ///< how far the lip is on this side of the pan's middle [m]
  std::vector<TiltKnot> tilt{};
};

/// What may be recorded of a scenario beside the one that is learnt from and the one that is predicted.
inline constexpr std::size_t further_interactions = 4;

/// "a" for the one to learn from, "b" for the one to be predicted, then those that may be recorded next.
inline std::string interaction_letter(std::size_t which) { return std::string(1, static_cast<char>('a' + which)); }

/// Two pours into one pan, seen by one camera: one to learn from, one to be predicted.
struct EffectScenario {
  EffectPan pan{};
  double heading_deg = 0;  ///< where the pour goes, from +x toward +y
  double camera_deg = 0;   ///< where the camera is, from -y toward +x
  std::array<PourPlan, 2> pours{};

  decant::Vector3<double> ahead() const {
    const double angle = heading_deg * std::numbers::pi / 180;
    return {std::cos(angle), std::sin(angle), 0};
  }
  decant::Vector3<double> across() const { return decant::Vector3<double>::UnitZ().cross(ahead()); }
  /// One of the two, or another from the first one's container: from higher, in jerks, slowly, of less liquid. Throws
  /// std::out_of_range for what is none of them.
  PourPlan pour(std::size_t which) const {
    if (which < pours.size()) {
      return pours[which];
    }
    PourPlan plan = pours[0];
    const TiltKnot first = plan.tilt.front(), last = plan.tilt.back();
    const auto tilted = [&](double time_share, double tilt_share) {
      return TiltKnot{std::lerp(first.time, last.time, time_share),
                      std::lerp(first.tilt_deg, last.tilt_deg, tilt_share)};
    };
    switch (which) {
      case 2:
        plan.lip_height += 0.06;
        plan.lip_behind += 0.012;  // what falls longer gets farther
        break;
      case 3:
        plan.tilt = {first, tilted(0.3, 0.7), tilted(0.45, 0.4), tilted(0.8, 1)};
        break;
      case 4:
        plan.tilt.back().time = std::lerp(first.time, last.time, 1.3);
        plan.duration += 0.3 * (last.time - first.time);
        break;
      case 5:
        plan.fill *= 0.75;
        break;
      default:
        throw std::out_of_range("EffectScenario::pour: expected one of six");
    }
    return plan;
  }
  /// Where the lip is kept in a pour [m], but for a hand's tremor.
  decant::Vector3<double> lip(std::size_t which) const {
    const PourPlan plan = pour(which);
    return decant::Vector3<double>(0, 0, plan.lip_height) - plan.lip_behind * ahead();
  }
  /// About where the jets of both pours are at a share of their height, 0 at the pan, 1 at the lip [m]. Liquid leaves
  /// about level, and falls ahead of the lip by some 9 cm: the plans are such that it lands in the pan.
  decant::Vector3<double> jet(double share) const {
    const decant::Vector3<double> lips = 0.5 * (lip(0) + lip(1));
    decant::Vector3<double> place = lips + 0.085 * std::sqrt(1 - share) * ahead();
    place.z() = share * lips.z();
    return place;
  }
};

/// Those from which a method may be developed come first, those that it is reported on after these.
inline const std::vector<EffectScenario>& effect_scenarios() {
  using Form = EffectPan::Form;
  static const std::vector<EffectScenario> scenarios{
      {{Form::Round, 0.085, 0.045},
       0,
       0,
       {{{"tumbler", 0.60, 2.7, 0.20, 0.075, {{0.25, 35}, {1.9, 105}}},
         {"tumbler", 0.72, 3.0, 0.23, 0.085, {{0.25, 20}, {1.4, 80}, {2.0, 82}, {2.8, 30}}}}}},
      {{Form::Round, 0.100, 0.040},
       10,
       20,
       {{{"cone_cup", 0.62, 2.8, 0.17, 0.080, {{0.25, 20}, {2.0, 110}}},
         {"cone_cup", 0.52, 3.0, 0.22, 0.080, {{0.25, 25}, {1.0, 70}, {1.4, 70}, {2.2, 112}}}}}},
      {{Form::Round, 0.105, 0.045},
       180,
       -15,
       {{{"bottle", 0.65, 3.2, 0.16, 0.080, {{0.25, 50}, {1.6, 105}, {3.0, 118}}},
         {"bottle", 0.52, 3.0, 0.20, 0.090, {{0.25, 60}, {1.2, 120}, {2.6, 120}}}}}},
      {{Form::Square, 0.088, 0.045},
       -12,
       10,
       {{{"beaker", 0.60, 2.8, 0.18, 0.080, {{0.25, 30}, {2.1, 102}}},
         {"beaker_by_corner", 0.66, 3.1, 0.22, 0.080, {{0.25, 25}, {1.5, 88}, {2.0, 70}, {2.8, 100}}}}}},
      {{Form::Round, 0.110, 0.045},
       0,
       -25,
       {{{"bowl", 0.50, 2.8, 0.16, 0.080, {{0.25, 5}, {1.9, 85}}},
         {"tumbler", 0.58, 2.9, 0.21, 0.070, {{0.25, 40}, {1.2, 85}, {2.4, 108}}}}}},
      {{Form::Basin, 0.130, 0.070},
       195,
       15,
       {{{"mug", 0.56, 2.8, 0.19, 0.095, {{0.25, 30}, {1.9, 100}}},
         {"mug", 0.50, 3.0, 0.20, 0.095, {{0.25, 30}, {1.3, 72}, {2.4, 108}}}}}},
      {{Form::Round, 0.095, 0.050},
       -15,
       -10,
       {{{"flask", 0.66, 3.2, 0.16, 0.080, {{0.25, 45}, {1.5, 105}, {2.8, 122}}},
         {"flask", 0.78, 3.0, 0.21, 0.085, {{0.25, 35}, {1.4, 100}, {2.2, 100}}}}}},
      {{Form::Round, 0.105, 0.040},
       170,
       25,
       {{{"jug", 0.52, 2.9, 0.22, 0.085, {{0.25, 35}, {2.0, 104}}},
         {"jug", 0.60, 3.1, 0.17, 0.075, {{0.25, 25}, {1.2, 75}, {1.8, 75}, {2.6, 110}}}}}},
      {{Form::Square, 0.095, 0.045},
       8,
       -20,
       {{{"tub", 0.60, 2.7, 0.20, 0.080, {{0.25, 20}, {1.9, 92}}},
         {"mug", 0.55, 3.0, 0.18, 0.070, {{0.25, 28}, {1.1, 82}, {1.6, 70}, {2.5, 105}}}}}},
  };
  return scenarios;
}
inline constexpr std::size_t scenarios_to_develop = 5;

/// How a container was recorded to move, and what is known of it between frames.
class RecordedMotion {
 public:
  /// @param which of the scenario's pours.
  RecordedMotion(std::size_t scenario, std::size_t which)
      : plan_(effect_scenarios().at(scenario).pour(which)),
        lip_in_body_(effect_container(plan_.container).lip),
        lip_(effect_scenarios()[scenario].lip(which)),
        heading_(effect_scenarios()[scenario].heading_deg * std::numbers::pi / 180),
        jitter_(static_cast<std::uint32_t>(1000 + 10 * scenario + which)) {
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(jitter_);
    };
    for (std::size_t axis = 0; axis < tremor_.size(); ++axis) {
      for (Wave& wave : tremor_[axis]) {
        wave.frequency = between(0.5, 5);
        wave.size = (axis < 3 ? 0.0008 : 0.006) / std::sqrt(wave.frequency) * between(0.5, 1);
        wave.phase = between(0, 2 * std::numbers::pi);
      }
    }
  }

  const PourPlan& plan() const { return plan_; }

  /// World from body as the hand moved by the recording's clock [s], without the jitter of single frames. At rest until
  /// a quarter of a second has passed.
  decant::Pose smooth(double time) const {
    const auto ease = [](double u) {
      u = std::clamp(u, 0.0, 1.0);
      return u * u * (3 - 2 * u);
    };
    double tilt = plan_.tilt.front().tilt_deg;
    for (std::size_t k = 1; k < plan_.tilt.size(); ++k) {
      const TiltKnot &from = plan_.tilt[k - 1], &to = plan_.tilt[k];
      tilt += (to.tilt_deg - from.tilt_deg) * ease((time - from.time) / (to.time - from.time));
    }
    const double calm = ease((time - plan_.tilt.front().time) / 0.5);  // liquid starts at rest
    const auto shake = [&](std::size_t axis) {
      double sum = 0;
      for (const Wave& wave : tremor_[axis]) {
        sum += wave.size * std::sin(2 * std::numbers::pi * wave.frequency * time + wave.phase);
      }
      return calm * sum;
    };
    const Eigen::Quaterniond turn =
        Eigen::AngleAxisd(heading_ + shake(5), Eigen::Vector3d::UnitZ()) *
        Eigen::AngleAxisd(tilt * std::numbers::pi / 180 + shake(4), Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(shake(3), Eigen::Vector3d::UnitX());
    return {turn, lip_ + decant::Vector3<double>(shake(0), shake(1), shake(2)) - turn * lip_in_body_};
  }

  /// What the tracker says of the next frame, from the first one on: off by 0.2 mm and 0.1 degrees at most.
  decant::Pose next_recorded(double time) {
    const double share = std::uniform_real_distribution<double>(0, 1)(jitter_);
    return off_by(smooth(time), 0.2 * share, 0.1 * share, jitter_);
  }

 private:
  struct Wave {
    double size = 0, frequency = 0, phase = 0;
  };

  PourPlan plan_;
  decant::Vector3<double> lip_in_body_, lip_;
  double heading_;
  std::mt19937 jitter_;
  std::array<std::array<Wave, 3>, 6> tremor_{};  // x, y, z [m], then turns about x, y, z [rad]
};

/// 640 x 480, 40 degrees above the horizon, 0.85 m from between pan and lip.
inline decant::PinholeCamera effect_camera() { return {950, 950, 319.5, 239.5, 640, 480}; }
inline decant::Pose effect_camera_from_world(const EffectScenario& scenario) {
  const double elevation = 40 * std::numbers::pi / 180, side = scenario.camera_deg * std::numbers::pi / 180;
  const decant::Vector3<double> target(0, 0, 0.09);
  const decant::Vector3<double> toward(std::cos(elevation) * std::sin(side), -std::cos(elevation) * std::cos(side),
                                       std::sin(elevation));
  return looking_at(target + 0.85 * toward, target);
}

}  // namespace example
