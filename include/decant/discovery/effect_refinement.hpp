// SPDX-License-Identifier: MIT
#pragma once

/// The strength of an effect, and its place where it has one, by runs around what the dictionary says.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/nuisance_space.hpp>

namespace decant::inline DECANT_TARGET {

/// A guess of strengths, places, times and speeds of one or more effects as one vector: of each effect its components,
/// then its place's three coordinates [m], its window's finite ends [s] and its speed [m/s], if it has any that are
/// looked for. Places and times are looked for around the effect's own ones; around the guess's where the effect has no
/// time, but beats.
class EffectPoint {
 public:
  /// Takes one more effect. @param effect has to outlive the point. @param number of it among the model's effects.
  /// @param guess to begin with. @param least_step by component, >= 0: strengths less far off would not tell; 0 for all
  /// if it is empty. Throws std::invalid_argument for another number of components.
  void add(const Effect& effect, std::size_t number, const AppliedEffect& guess,
           const Eigen::VectorXd& least_step = {}) {
    const auto components = static_cast<Eigen::Index>(effect.components.size());
    expects(guess.strength.size() == components, "EffectPoint: strength", "a number for each component",
            guess.strength.size());
    expects(least_step.size() == 0 || least_step.size() == components, "EffectPoint: least steps",
            "a number for each component", least_step.size());
    Part part{&effect, number, value_.size(), components};
    part.least_step = least_step.size() > 0 ? least_step : Eigen::VectorXd::Zero(components);
    const Vector3<double> place = guess.place.value_or(effect.place.value_or(Vector3<double>::Zero()));
    const TimeWindow window = guess.window.value_or(effect.window.value_or(TimeWindow{}));
    const bool is_usual = effect.window && (std::isfinite(effect.window->from) || std::isfinite(effect.window->until));
    part.window = is_usual ? *effect.window : window;
    part.coordinates = effect.place && effect.place_tolerance > 0 ? 3 : 0;
    const bool timed = effect.window && effect.window_tolerance > 0;
    part.begins = timed && std::isfinite(window.from) ? 1 : 0;
    part.ends = timed && std::isfinite(window.until) ? 1 : 0;
    part.speeds = effect.fastest > 0 ? 1 : 0;
    value_.conservativeResize(value_.size() + part.size());
    fineness_.resize(static_cast<std::size_t>(value_.size()), 1);
    value_.segment(part.begin, components) = guess.strength;
    if (part.coordinates > 0) {
      value_.segment<3>(part.place()) = place;
    }
    if (part.begins > 0) {
      value_[part.time()] = window.from;
    }
    if (part.ends > 0) {
      value_[part.time() + part.begins] = window.until;
    }
    if (part.speeds > 0) {
      value_[part.speed()] = guess.speed.value_or(effect.speed);
    }
    parts_.push_back(part);
  }

  Eigen::Index size() const noexcept { return value_.size(); }
  const Eigen::VectorXd& value() const noexcept { return value_; }
  std::size_t effects() const noexcept { return parts_.size(); }
  /// Which numbers of the vector are an effect's strength: the first one, and how many.
  std::pair<Eigen::Index, Eigen::Index> strength_of(std::size_t part) const {
    return {parts_.at(part).begin, parts_.at(part).components};
  }
  AppliedEffect applied(std::size_t part) const {
    const Part& of = parts_.at(part);
    AppliedEffect result{of.number, value_.segment(of.begin, of.components)};
    if (of.coordinates > 0) {
      result.place = value_.segment<3>(of.place());
    }
    if (of.begins + of.ends > 0) {
      result.window = *of.effect->window;
      result.window->from = of.begins > 0 ? value_[of.time()] : result.window->from;
      result.window->until = of.ends > 0 ? value_[of.time() + of.begins] : result.window->until;
    }
    if (of.speeds > 0) {
      result.speed = value_[of.speed()];
    }
    return result;
  }

  /// Whether a number is part of a place, a time or a speed, rather than of a strength.
  bool is_where_or_when(Eigen::Index k) const { return k >= part_of(k).place(); }

  /// How far off a number is tried to see what it changes.
  double step(Eigen::Index k) const {
    const Part& of = part_of(k);
    if (k >= of.speed()) {
      return 0.2 * of.effect->fastest * fineness_[static_cast<std::size_t>(k)];
    }
    if (k >= of.place()) {
      const double tolerance = k >= of.time() ? of.effect->window_tolerance : of.effect->place_tolerance;
      return 0.4 * tolerance * fineness_[static_cast<std::size_t>(k)];
    }
    const EffectComponent& component = of.effect->components[static_cast<std::size_t>(k - of.begin)];
    return std::max({0.3 * std::abs(value_[k] - component.base), 0.05 * (component.high - component.low),
                     of.least_step[k - of.begin]});
  }
  /// The range of a number: of a strength see EffectComponent::limits.
  std::pair<double, double> range(Eigen::Index k) const {
    const Part& of = part_of(k);
    if (k >= of.speed()) {
      return {0, of.effect->fastest};
    }
    if (k >= of.time()) {
      const bool end = of.begins == 0 || k > of.time();
      const double middle = end ? of.window.until : of.window.from;
      return {middle - of.effect->window_tolerance, middle + of.effect->window_tolerance};
    }
    if (k >= of.place()) {
      const double middle = (*of.effect->place)[k - of.place()];
      return {middle - of.effect->place_tolerance, middle + of.effect->place_tolerance};
    }
    return of.effect->components[static_cast<std::size_t>(k - of.begin)].limits();
  }
  /// The same with an effect elsewhere, kept in its range. @param place [m]; the effect has one that is looked for.
  EffectPoint with_place(std::size_t part, const Vector3<double>& place) const {
    const Part& of = parts_.at(part);
    expects(of.coordinates > 0, "EffectPoint: place", "of an effect whose place is looked for", place.transpose());
    EffectPoint other = *this;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      other = other.with(of.place() + axis, place[axis]);
    }
    return other;
  }
  /// The same with one number changed, kept in its range.
  EffectPoint with(Eigen::Index k, double value) const {
    EffectPoint other = *this;
    const auto [low, high] = range(k);
    other.value_[k] = std::clamp(value, low, high);
    return other;
  }

  /// Tries a number of a place, a time or a speed half as far off from now on.
  void refine(Eigen::Index k) { fineness_.at(static_cast<std::size_t>(k)) *= 0.5; }
  /// Such a number stays where it is from now on: its step is none.
  void hold(Eigen::Index k) { fineness_.at(static_cast<std::size_t>(k)) = 0; }
  bool is_held(Eigen::Index k) const { return fineness_.at(static_cast<std::size_t>(k)) == 0; }
  /// How many numbers are not held.
  std::size_t moving() const {
    return fineness_.size() - static_cast<std::size_t>(std::count(fineness_.begin(), fineness_.end(), 0.0));
  }

  /// With all numbers as multiples of a ten-millionth of their range. Sums differ in their last digit with where memory
  /// lies; a search that goes on from a journal has to ask for the very runs that it has.
  EffectPoint rounded() const {
    EffectPoint other = *this;
    for (Eigen::Index k = 0; k < size(); ++k) {
      const auto [low, high] = range(k);
      const double grid = 1e-7 * (high - low);
      other.value_[k] = grid > 0 ? grid * std::round(value_[k] / grid) : value_[k];
    }
    return other;
  }

  ModelRun run(std::uint32_t seed) const {
    ModelRun result{{}, seed, false};
    for (std::size_t part = 0; part < parts_.size(); ++part) {
      result.effects.push_back(applied(part));
    }
    return result;
  }

 private:
  struct Part {
    const Effect* effect;
    std::size_t number;
    Eigen::Index begin, components, coordinates = 0, begins = 0, ends = 0, speeds = 0;  ///< how many of each it has
    Eigen::VectorXd least_step{};
    TimeWindow window{};  ///< about when

    Eigen::Index size() const noexcept { return components + coordinates + begins + ends + speeds; }
    Eigen::Index place() const noexcept { return begin + components; }
    Eigen::Index time() const noexcept { return place() + coordinates; }
    Eigen::Index speed() const noexcept { return time() + begins + ends; }
  };

  const Part& part_of(Eigen::Index k) const {
    std::size_t part = 0;
    while (part + 1 < parts_.size() && k >= parts_[part + 1].begin) {
      ++part;
    }
    return parts_.at(part);
  }

  std::vector<Part> parts_{};
  Eigen::VectorXd value_{};
  std::vector<double> fineness_{};  ///< by number: the step, over the one to begin with; that of strengths is 1
};

/// What a recording's simulations say around a point. Features are as they are, not standardised.
struct RefinementView {
  const NuisanceSpace* space = nullptr;
  Eigen::VectorXd middle{};          ///< at the point
  Eigen::MatrixXd slope{};           ///< p x size of the point: what a change of one unit does
  Eigen::MatrixXd below{}, above{};  ///< p x size of the point: one step off in each of its numbers
  Eigen::VectorXd chaos{};           ///< by number: how large a slope is by chaos alone, as a distance; none if empty
  double side_chaos = 0;             ///< how much farther off than the middle those below and above are by chaos alone
};

/// Whether what a number changes is more than so many times what chaos makes of slopes, in all recordings together.
inline bool tells(const std::vector<RefinementView>& views, Eigen::Index number, double enough = 2) {
  double energy = 0, chaos = 0;
  for (const RefinementView& view : views) {
    energy += view.space->distance(view.space->standardised_difference(view.slope.col(number)));
    chaos += view.chaos.size() > 0 ? view.chaos[number] : 0;
  }
  return energy > enough * chaos;
}

/// By how much a point has to move so that a model that is linear around it comes nearest to features of all recordings
/// together: a step of Gauss and Newton. @param features of each of the views' recordings, or of what stands for it.
/// No place, time or speed moves more than two of its steps, no strength more than four, which effects are closer to
/// linear in; nor does any leave its range.
/// @param without_chaos takes what is chaos in slopes off their squares, up to two thirds in each direction. Chaos
/// makes steps shorter. That holds back what slopes hardly tell, as ridge regression does; but how far estimates
/// scatter would seem to be less than it is (Fuller, Measurement Error Models, 1987, section 1.2).
inline Eigen::VectorXd refinement(const EffectPoint& at, const std::vector<RefinementView>& views,
                                  const std::vector<Eigen::VectorXd>& features, bool without_chaos = false) {
  expects(!views.empty() && features.size() == views.size(), "refinement: features", "those of each recording",
          features.size());
  const Eigen::Index size = at.size();
  Eigen::MatrixXd curvature = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd answer = Eigen::VectorXd::Zero(size), chaos = Eigen::VectorXd::Zero(size), unit(size);
  for (Eigen::Index k = 0; k < size; ++k) {
    unit[k] = at.step(k);
  }
  for (std::size_t which = 0; which < views.size(); ++which) {
    const RefinementView& view = views[which];
    const Eigen::VectorXd off = view.space->standardised_difference(features[which] - view.middle);
    std::vector<Eigen::VectorXd> slope;
    for (Eigen::Index k = 0; k < size; ++k) {
      slope.push_back(view.space->standardised_difference(unit[k] * view.slope.col(k)));
    }
    for (Eigen::Index i = 0; i < size; ++i) {
      answer[i] += view.space->inner(off, slope[static_cast<std::size_t>(i)]);
      for (Eigen::Index j = 0; j < size; ++j) {
        curvature(i, j) += view.space->inner(slope[static_cast<std::size_t>(i)], slope[static_cast<std::size_t>(j)]);
      }
      chaos[i] += view.chaos.size() > 0 ? unit[i] * unit[i] * view.chaos[i] : 0;
    }
  }
  // what changes nothing stays where it is, and so does a place, a time or a speed that changes no more than chaos does
  for (Eigen::Index k = 0; k < size; ++k) {
    if (at.is_where_or_when(k) && !tells(views, k)) {
      curvature.row(k).setZero();
      curvature.col(k).setZero();
      answer[k] = 0;
    }
  }
  curvature.diagonal().array() += 1e-2 * curvature.diagonal().maxCoeff() + 1e-12;
  Eigen::VectorXd move;
  if (without_chaos) {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> chaotic(Eigen::MatrixXd(chaos.asDiagonal()),
                                                                            curvature);
    const Eigen::VectorXd left = 1 - chaotic.eigenvalues().array().min(2.0 / 3);
    move = chaotic.eigenvectors() * (chaotic.eigenvectors().transpose() * answer).cwiseQuotient(left);
  } else {
    move = curvature.ldlt().solve(answer);
  }
  for (Eigen::Index k = 0; k < size; ++k) {
    const auto [low, high] = at.range(k);
    const double most = at.is_where_or_when(k) ? 2 : 4;
    move[k] = std::clamp(at.value()[k] + unit[k] * std::clamp(move[k], -most, most), low, high) - at.value()[k];
  }
  return move;
}

}  // namespace decant::inline DECANT_TARGET
