// SPDX-License-Identifier: MIT
#include <decant/coverage/mask_cleaning.hpp>

#include <algorithm>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "catch.hpp"

namespace {

using namespace decant;

Mask random_mask(Index rows, Index columns, double share, unsigned seed) {
  std::mt19937 generator(seed);
  std::bernoulli_distribution liquid(share);
  Mask mask(rows, columns);
  for (Index k = 0; k < mask.size(); ++k) {
    mask.data()[k] = liquid(generator) ? 180 : 90;
  }
  return mask;
}

Mask voted(const Mask& mask, int window) {
  Mask result(mask.rows(), mask.cols());
  for (Index v = 0; v < mask.rows(); ++v) {
    for (Index u = 0; u < mask.cols(); ++u) {
      int votes = 0, voters = 0;
      for (Index y = v - window / 2; y <= v + window / 2; ++y) {
        for (Index x = u - window / 2; x <= u + window / 2; ++x) {
          if (y >= 0 && y < mask.rows() && x >= 0 && x < mask.cols()) {
            ++voters;
            votes += mask(y, x) >= 128 ? 1 : 0;
          }
        }
      }
      result(v, u) = 2 * votes > voters ? 255 : 0;
    }
  }
  return result;
}

// By flood fill with a stack, pixel by pixel.
Mask without_small(Mask mask, std::size_t smallest) {
  Image<int> seen = Image<int>::Zero(mask.rows(), mask.cols());
  for (Index v = 0; v < mask.rows(); ++v) {
    for (Index u = 0; u < mask.cols(); ++u) {
      if (mask(v, u) == 0 || seen(v, u) != 0) {
        continue;
      }
      std::vector<std::pair<Index, Index>> region{{v, u}};
      seen(v, u) = 1;
      for (std::size_t k = 0; k < region.size(); ++k) {
        const auto [row, column] = region[k];
        for (Index y = std::max<Index>(0, row - 1); y <= std::min(mask.rows() - 1, row + 1); ++y) {
          for (Index x = std::max<Index>(0, column - 1); x <= std::min(mask.cols() - 1, column + 1); ++x) {
            if (mask(y, x) != 0 && seen(y, x) == 0) {
              seen(y, x) = 1;
              region.push_back({y, x});
            }
          }
        }
      }
      if (region.size() < smallest) {
        for (const auto& [row, column] : region) {
          mask(row, column) = 0;
        }
      }
    }
  }
  return mask;
}

}  // namespace

TEST_CASE("The vote and the dropping of regions are those of the definition") {
  unsigned seed = 1;
  for (const double share : {0.0, 0.05, 0.3, 0.42, 0.6, 1.0}) {
    for (const auto& [rows, columns] :
         {std::pair<Index, Index>{1, 1}, {2, 3}, {1, 40}, {40, 1}, {33, 50}, {30, 300}, {3, 513}}) {
      const Mask raw = random_mask(rows, columns, share, seed++);
      for (const int window : {1, 3, 5, 15}) {
        for (const int smallest : {0, 2, 10, 60}) {
          const Mask expected = without_small(voted(raw, window), static_cast<std::size_t>(smallest));
          MaskCleaning cleaning(window, smallest);
          for (const int threads : {1, 2, 4}) {
            Mask clean = Mask::Constant(rows, columns, 33);
            cleaning.apply(raw, clean, Threads{threads});
            INFO(rows << " x " << columns << ", share " << share << ", window " << window << ", smallest " << smallest);
            CHECK((clean == expected).all());
          }
        }
      }
    }
  }
}

TEST_CASE("Regions that meet late are one") {
  // combs, spirals and a W: what looks like several regions from above is one further down
  const auto cleaned = [](const std::vector<std::string>& rows, int smallest) {
    Mask raw(static_cast<Index>(rows.size()), static_cast<Index>(rows[0].size()));
    for (Index v = 0; v < raw.rows(); ++v) {
      for (Index u = 0; u < raw.cols(); ++u) {
        raw(v, u) = rows[static_cast<std::size_t>(v)][static_cast<std::size_t>(u)] == '#' ? 255 : 0;
      }
    }
    Mask clean(raw.rows(), raw.cols());
    MaskCleaning(1, smallest).apply(raw, clean);
    return (clean > 0).count();
  };
  const std::vector<std::string> comb = {"#.#.#.#.#", "#.#.#.#.#", "#########"};
  CHECK(cleaned(comb, 19) == 19);
  CHECK(cleaned(comb, 20) == 0);
  const std::vector<std::string> corners = {"#...#...#", ".#.#.#.#.", "..#...#.."};
  CHECK(cleaned(corners, 9) == 9);
  CHECK(cleaned(corners, 10) == 0);
  const std::vector<std::string> spiral = {"#######", "#.....#", "#.###.#", "#.#...#", "#.#####", "#......", "#######"};
  CHECK(cleaned(spiral, 31) == 31);
  CHECK(cleaned(spiral, 32) == 0);
  const std::vector<std::string> apart = {"##.##", ".....", "##.##"};
  CHECK(cleaned(apart, 2) == 8);
  CHECK(cleaned(apart, 3) == 0);
}

TEST_CASE("Cleaning a part of a larger image leaves the rest alone") {
  Mask image = random_mask(60, 70, 0.5, 9);
  const Mask raw = image;
  MaskCleaning cleaning(3, 5);
  cleaning.apply(raw.block(5, 7, 30, 40), image.block(20, 10, 30, 40));
  CHECK((image.block(20, 10, 30, 40) == without_small(voted(raw.block(5, 7, 30, 40), 3), 5)).all());
  CHECK((image.topRows(20) == raw.topRows(20)).all());
  CHECK((image.leftCols(10) == raw.leftCols(10)).all());
}

TEST_CASE("Settings of the cleaning that make no sense are refused") {
  for (const int window : {-1, 0, 2, 17}) {
    CHECK_THROWS_WITH(MaskCleaning(window),
                      decant_test::contains("MaskCleaning: window_px [px] must be odd and 1 to 15, got"));
  }
  CHECK_THROWS_WITH(MaskCleaning(3, -1), "MaskCleaning: smallest_px [px] must be >= 0, got -1");
}
