// SPDX-License-Identifier: MIT
#pragma once

/// Where in the picture, or which sensor, and when simulation and recording disagree.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/reading_features.hpp>
#include <decant/discovery/silhouette_features.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// So many together disagree already from this share of the threshold on: chance hardly puts them side by side.
inline constexpr std::size_t many_together = 4;
inline constexpr double low_threshold = 0.75;

inline void check_deviations(std::size_t features, const Eigen::VectorXd& off, double threshold) {
  expects(off.size() == static_cast<Eigen::Index>(features), "find_disagreements: deviations", "as many as features",
          off.size());
  expects(threshold > 0, "find_disagreements: threshold", "> 0", threshold);
}

}  // namespace detail

/// A square of the picture over a window of time.
struct DisagreeingSquare {
  PixelBox box{};             ///< which may reach beyond the image's border [px]
  double begin = 0, end = 0;  ///< of the window's frames [s]
  double off = 0;             ///< from what is expected, > 0, counted in what differs anyway

  /// (u, v) [px]. Pixel coordinates are of pixels' middles.
  Eigen::Vector2d middle() const noexcept {
    return {0.5 * (box.u_begin + box.u_end) - 0.5, 0.5 * (box.v_begin + box.v_end) - 0.5};
  }
};

namespace detail {

/// Middle of squares, each as heavy as it is off.
class MiddleOfSquares {
 public:
  void add(const DisagreeingSquare& square) noexcept {
    total_ += square.off;
    const double share = square.off / total_;
    u_ += share * (square.middle().x() - u_);
    v_ += share * (square.middle().y() - v_);
  }
  double u() const noexcept { return u_; }
  double v() const noexcept { return v_; }

 private:
  double u_ = 0, v_ = 0, total_ = 0;
};

}  // namespace detail

/// Squares of the picture that touch each other in space and time, in all of which there is more liquid than expected,
/// or less. Where it begins points at the cause; where most of it is, at the consequence.
struct Disagreement {
  std::size_t camera = 0;
  bool unexpected = true;                    ///< liquid where none is expected; false: none where it is
  PixelBox box{};                            ///< of all its squares [px]
  double begin = 0, end = 0;                 ///< of its frames [s]
  double onset_u = 0, onset_v = 0;           ///< middle of what it begins with [px]
  double weight = 0;                         ///< sum of the squares of what its squares are off by
  double largest = 0;                        ///< of what they are off by
  std::vector<DisagreeingSquare> squares{};  ///< over all windows of time
};

/// @param features where and when they are.
/// @param off by feature: how far it is from what is expected, in its standard deviations where nothing is missing.
/// @param threshold beyond which a feature disagrees, > 0. Four that touch each other do already from three quarters of
/// it on, as chance hardly puts them side by side, and so does what touches one that is beyond it: things begin small.
/// @return the heaviest first; empty where it is small everywhere, though it may still be much together.
/// Throws std::invalid_argument if there are not as many as features, or the threshold is out of range.
inline std::vector<Disagreement> find_disagreements(const SilhouetteFeatures& features, const Eigen::VectorXd& off,
                                                    double threshold = 4) {
  detail::check_deviations(features.size(), off, threshold);
  const double low = detail::low_threshold * threshold;
  using Key = std::array<int, 4>;  // camera, window, row, column
  std::map<Key, std::size_t> beyond;
  for (std::size_t k = 0; k < features.size(); ++k) {
    if (std::abs(off[static_cast<Eigen::Index>(k)]) > low) {
      const SilhouetteFeatures::Place& place = features.place(k);
      beyond[{static_cast<int>(place.camera), place.window, place.row, place.column}] = k;
    }
  }
  const auto is_more = [&](std::size_t feature) { return off[static_cast<Eigen::Index>(feature)] > 0; };
  std::vector<Disagreement> found;
  while (!beyond.empty()) {
    std::vector<std::pair<Key, std::size_t>> component{*beyond.begin()};
    beyond.erase(beyond.begin());
    for (std::size_t next = 0; next < component.size(); ++next) {
      const auto [key, feature] = component[next];
      for (int around = 0; around < 27; ++around) {
        const Key other{key[0], key[1] + around % 3 - 1, key[2] + around / 3 % 3 - 1, key[3] + around / 9 - 1};
        const auto touching = beyond.find(other);
        if (touching != beyond.end() && is_more(touching->second) == is_more(feature)) {
          component.push_back(*touching);
          beyond.erase(touching);
        }
      }
    }
    const SilhouetteFeatures::Place& any = features.place(component.front().second);
    Disagreement one;
    one.camera = any.camera;
    one.unexpected = is_more(component.front().second);
    one.begin = any.begin;
    one.end = any.end;
    for (const auto& [key, feature] : component) {
      const SilhouetteFeatures::Place& place = features.place(feature);
      const double size = std::abs(off[static_cast<Eigen::Index>(feature)]);
      one.squares.push_back({place.box, place.begin, place.end, size});
      one.box = one.box.hull(place.box);
      one.begin = std::min(one.begin, place.begin);
      one.end = std::max(one.end, place.end);
      one.weight += size * size;
      one.largest = std::max(one.largest, size);
    }
    detail::MiddleOfSquares middle;
    for (const DisagreeingSquare& square : one.squares) {
      if (square.begin <= one.begin) {
        middle.add(square);
      }
    }
    one.onset_u = middle.u();
    one.onset_v = middle.v();
    if (one.largest > threshold || one.squares.size() >= detail::many_together) {
      found.push_back(one);
    }
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.weight > b.weight; });
  return found;
}

/// The earliest of disagreements; a single square is easily chance. Nothing if there is none.
/// @param only_unexpected of those of too much liquid.
inline const Disagreement* earliest(const std::vector<Disagreement>& of, bool only_unexpected = false) noexcept {
  const Disagreement* first = nullptr;
  for (const Disagreement& each : of) {
    const bool counts = (each.unexpected || !only_unexpected) && each.squares.size() > 1;
    if (counts && (first == nullptr || each.begin < first->begin)) {
      first = &each;
    }
  }
  return first;
}

/// Where and when recordings begin to be off from a model.
struct Onset {
  std::size_t camera = 0;
  double begin = 0;     ///< [s]
  double u = 0, v = 0;  ///< middle of all that is off then [px]
};

/// Of too much liquid and too little together, in the first window of time with either: what comes to one place is
/// missing in another, and its cause is between them. Nothing if there are single squares alone, which are easily
/// chance.
inline std::optional<Onset> onset(const std::vector<Disagreement>& of) noexcept {
  const Disagreement* first = earliest(of);
  if (first == nullptr) {
    return std::nullopt;
  }
  detail::MiddleOfSquares middle;
  for (const Disagreement& each : of) {
    for (const DisagreeingSquare& square : each.squares) {
      if (each.camera == first->camera && each.squares.size() > 1 && square.begin <= first->begin) {
        middle.add(square);
      }
    }
  }
  return Onset{first->camera, first->begin, middle.u(), middle.v()};
}

/// A sensor that for a while reads more than expected, or less.
struct ReadingDisagreement {
  std::size_t sensor = 0;
  bool more = true;
  double begin = 0, end = 0;  ///< of its readings [s]
  double weight = 0;          ///< sum of squares, each counted in what differs anyway
  double largest = 0;         ///< of its windows, counted in what differs anyway
  std::size_t windows = 0;    ///< of time
};

/// The same for readings: windows of one sensor that follow each other, four of which disagree already from three
/// quarters of the threshold on.
inline std::vector<ReadingDisagreement> find_disagreements(const ReadingFeatures& features, const Eigen::VectorXd& off,
                                                           double threshold = 4) {
  detail::check_deviations(features.size(), off, threshold);
  std::vector<ReadingDisagreement> found;
  for (std::size_t k = 0; k < features.size();) {
    const auto size_of = [&](std::size_t feature) { return off[static_cast<Eigen::Index>(feature)]; };
    ReadingDisagreement one{features.place(k).sensor, size_of(k) > 0, features.place(k).begin};
    while (k < features.size() && features.place(k).sensor == one.sensor &&
           (one.more ? size_of(k) : -size_of(k)) > detail::low_threshold * threshold) {
      one.end = features.place(k).end;
      one.weight += size_of(k) * size_of(k);
      one.largest = std::max(one.largest, std::abs(size_of(k)));
      ++one.windows;
      ++k;
    }
    if (one.windows == 0) {
      ++k;
    } else if (one.largest > threshold || one.windows >= detail::many_together) {
      found.push_back(one);
    }
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.weight > b.weight; });
  return found;
}

}  // namespace decant::inline DECANT_TARGET
