// SPDX-License-Identifier: MIT
#pragma once

/// A picture of where a camera and a model disagree.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/io/png.hpp>

#include "overlay_pictures.hpp"

namespace example::detail {

/// How far a camera's pixels are off what is expected, over all times.
struct WhereMap {
  decant::Image<float> off{};     ///< > 0 where there is too much liquid, < 0 where there is too little; 0 elsewhere
  std::optional<double> begin{};  ///< of the heaviest disagreement [s]; nothing if there is none
  Eigen::Vector2d onset{0, 0};    ///< where it begins [px]
};

/// Of the first camera. Where there is too much at times and too little at others, that by which it is off more.
/// @param where the heaviest first. @param width, height of the picture [px].
inline WhereMap where_map(const std::vector<decant::Disagreement>& where, int width, int height) {
  decant::Image<float> more = decant::Image<float>::Zero(height, width), less = more;  // sums of squares
  WhereMap map;
  for (const decant::Disagreement& each : where) {
    if (each.camera != 0) {
      continue;
    }
    if (!map.begin) {
      map.begin = each.begin;
      map.onset = {each.onset_u, each.onset_v};
    }
    for (const decant::DisagreeingSquare& square : each.squares) {
      const decant::PixelBox box = square.box.intersection({0, 0, width, height});
      if (!box.empty()) {
        (each.unexpected ? more : less).block(box.v_begin, box.u_begin, box.height(), box.width()) +=
            static_cast<float>(square.off * square.off);
      }
    }
  }
  map.off = (more > less).select(more.sqrt(), -less.sqrt());
  return map;
}

/// The map on top of a picture of the bodies, whose edges remain. @param bodies of bodies_from_depth, of all the image.
inline decant::PalettePicture where_picture(decant::Image<std::uint8_t> bodies, const WhereMap& map) {
  constexpr int shades = 4;
  std::vector<std::array<std::uint8_t, 3>> colours = overlay_colours();
  const auto first = static_cast<std::uint8_t>(colours.size());
  for (const OverlayColour of : {observed_only, predicted_only}) {
    for (int shade = 1; shade <= shades; ++shade) {
      std::array<std::uint8_t, 3> colour{};
      for (std::size_t k = 0; k < 3; ++k) {
        colour[k] = static_cast<std::uint8_t>(255 - (255 - overlay_colours()[of][k]) * shade / shades);
      }
      colours.push_back(colour);
    }
  }
  const float most = std::max(map.off.abs().maxCoeff(), 1e-12F);
  for (decant::Index v = 0; v < bodies.rows(); ++v) {
    for (decant::Index u = 0; u < bodies.cols(); ++u) {
      const float off = map.off(v, u);
      const double from_onset =
          std::hypot(static_cast<double>(u) - map.onset.x(), static_cast<double>(v) - map.onset.y());
      if (map.begin && std::abs(from_onset - 9) < 1.5) {
        bodies(v, u) = both;
      } else if (off != 0 && bodies(v, u) != body_edge) {
        const int shade = std::clamp(static_cast<int>(std::ceil(shades * std::abs(off) / most)), 1, shades);
        bodies(v, u) = static_cast<std::uint8_t>(first + (off > 0 ? 0 : shades) + shade - 1);
      }
    }
  }
  return {std::move(bodies), std::move(colours)};
}

}  // namespace example::detail
