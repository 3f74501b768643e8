// SPDX-License-Identifier: MIT
#pragma once

/// Masks and coverages that sums over pixels are tried on.

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <decant/core/image.hpp>

namespace decant_test {

struct NamedMask {
  std::string name;
  decant::Mask mask;
  bool about_the_cut = false;  ///< thin arcs of 100 px radius, made to show where a cut is not exact
};

/// 240 x 260 pixels: the kernel's cut of 100 px fits in, and reaches beyond the border from nearly everywhere.
inline std::vector<NamedMask> masks() {
  using decant::Index;
  using decant::Mask;
  constexpr Index rows = 240, columns = 260;
  std::vector<NamedMask> all;
  const auto add = [&](const std::string& name, auto&& liquid, bool about_the_cut = false) {
    Mask mask(rows, columns);
    for (Index v = 0; v < rows; ++v) {
      for (Index u = 0; u < columns; ++u) {
        mask(v, u) = liquid(u, v) ? 255 : 0;
      }
    }
    all.push_back({name, mask, about_the_cut});
  };
  std::mt19937 generator(4);
  const auto chance = [&generator](double share) {
    return [&generator, share](Index, Index) { return std::bernoulli_distribution(share)(generator); };
  };
  const auto radius = [](Index u, Index v) {
    return std::hypot(static_cast<double>(u - 130), static_cast<double>(v - 120));
  };
  add("all liquid", [](Index, Index) { return true; });
  add("one pixel", [](Index u, Index v) { return u == 131 && v == 122; });
  add("one pixel in a corner", [](Index u, Index v) { return u == 0 && v == 0; });
  add("one pixel in the other corner", [](Index u, Index v) { return u == columns - 1 && v == rows - 1; });
  add("four corners", [](Index u, Index v) { return (u < 3 || u > 255) && (v < 3 || v > 235); });
  add("half plane", [](Index u, Index) { return u < 97; });
  add("oblique half plane", [](Index u, Index v) { return 2 * u + 3 * v > 500; });
  add("one row", [](Index, Index v) { return v == 57; });
  add("one column at the border", [](Index u, Index) { return u == 259; });
  add("chess board", [](Index u, Index v) { return (u + v) % 2 == 0; });
  add("stripes as wide as nodes are apart", [](Index u, Index) { return u % 4 < 2; });
  add("every fourth pixel", [](Index u, Index v) { return u % 4 == 1 && v % 4 == 3; });
  add("blob", [&](Index u, Index v) { return radius(u, v) < 40; });
  add("salt", chance(0.01));
  add("noise", chance(0.5));
  add(
      "ring", [&](Index u, Index v) { return radius(u, v) > 100 && radius(u, v) < 101; }, true);
  add(
      "ring right inside", [&](Index u, Index v) { return radius(u, v) > 99 && radius(u, v) <= 100; }, true);
  add(
      "half ring", [&](Index u, Index v) { return u > 130 && radius(u, v) > 100 && radius(u, v) < 101; }, true);
  add(
      "half ring right inside", [&](Index u, Index v) { return v > 120 && radius(u, v) > 99 && radius(u, v) <= 100; },
      true);
  return all;
}

/// Counts as particles give them: most pixels none, some many; of a quarter of the pixels a fraction.
inline decant::Image<float> some_coverage(decant::Index rows, decant::Index columns, unsigned seed) {
  std::mt19937 generator(seed);
  decant::Image<float> coverage(rows, columns);
  for (decant::Index k = 0; k < coverage.size(); ++k) {
    const unsigned draw = generator() % 16;
    coverage.data()[k] = draw < 8 ? 0.0f : draw < 12 ? static_cast<float>(draw) : 0.1f * static_cast<float>(draw);
  }
  return coverage;
}

}  // namespace decant_test
