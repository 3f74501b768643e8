// SPDX-License-Identifier: MIT
#pragma once

/// Closes the small gaps that a silhouette drawn from particles has and liquid has not.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Morphological closing of a mask with a disc: grows the liquid by a radius and shrinks it back. Gaps and holes that
/// the disc does not fit into are filled, everything else keeps its outline, and no liquid is lost. Pixels beyond the
/// image's border are taken for empty, and nothing happens at the border itself. Works on bits, 64 pixels at a time.
class GapClosing {
 public:
  /// @param gap_px closes gaps up to this width [px], 0 (does nothing) to 64; an odd number acts as the even one above
  /// it, since the disc, of radius gap_px / 2, reaches as far to either side. Tracker chooses
  /// it by how large particles look. Throws std::invalid_argument.
  explicit GapClosing(int gap_px = 4) {
    half_width_.reserve(widest_px / 2 + 1);
    set_gap_px(gap_px);
  }

  static constexpr int widest_px = 64;

  /// As on construction. Does not allocate.
  void set_gap_px(int gap_px) {
    expects(gap_px >= 0 && gap_px <= widest_px, "GapClosing: gap_px [px]", "0 to 64", gap_px);
    gap_px_ = gap_px;
    radius_ = (gap_px + 1) / 2;
    half_width_.clear();
    for (int dv = 0; dv <= radius_; ++dv) {
      int half = radius_;
      while (half * half + dv * dv > radius_ * radius_) {
        --half;
      }
      half_width_.push_back(half);
    }
  }

  int gap_px() const noexcept { return gap_px_; }  ///< [px]

  /// Closes the gaps of a mask that is empty outside of `box`; what the closing adds is inside of it as well, and
  /// pixels there are 0 or mask_liquid afterwards. Allocates only if the box is larger than ever before.
  void apply(MaskView mask, const PixelBox& box, Threads threads = {}) noexcept {
    const PixelBox within = box.intersection(PixelBox::of(mask));
    if (radius_ == 0 || within.empty()) {
      return;
    }
    // room for what grows beyond the box before it shrinks back
    const Index rows = within.height() + 2 * radius_;
    words_ = static_cast<std::size_t>(within.width() + 2 * radius_ + 63) / 64;
    const std::size_t size = static_cast<std::size_t>(rows) * words_;
    if (original_.size() < size) {
      original_.resize(size);
      grown_.resize(size);
    }
    parallel_ranges(rows, threads, rows_per_range, [&](Index begin, Index end) {
      for (Index row = begin; row < end; ++row) {
        pack(mask, within, row);
      }
    });
    parallel_ranges(rows, threads, rows_per_range, [&](Index begin, Index end) {
      for (Index row = begin; row < end; ++row) {
        gather(original_, rows, row, 0, bits(grown_, row));
      }
    });
    parallel_ranges(within.height(), threads, rows_per_range, [&](Index begin, Index end) {
      for (Index row = begin; row < end; ++row) {
        // shrinking the liquid is growing what is not liquid
        gather(grown_, rows, row + radius_, ~Word{0}, bits(original_, row + radius_));
        unpack(mask, within, row);
      }
    });
  }

 private:
  using Word = std::uint64_t;
  static constexpr Index rows_per_range = 16;

  Word* bits(std::vector<Word>& image, Index row) noexcept {
    return image.data() + static_cast<std::size_t>(row) * words_;
  }

  void pack(const MaskView& mask, const PixelBox& box, Index row) noexcept {
    Word* const to = bits(original_, row);
    std::fill(to, to + words_, Word{0});
    const Index v = row - radius_;
    if (v < 0 || v >= box.height()) {
      return;
    }
    const std::uint8_t* const from = &mask(box.v_begin + v, box.u_begin);
    for (int u = 0; u < box.width(); ++u) {
      const auto place = static_cast<std::size_t>(u + radius_);
      to[place / 64] |= Word{is_liquid(from[u])} << (place % 64);
    }
  }

  void unpack(MaskView& mask, const PixelBox& box, Index row) noexcept {
    const Word* const from = bits(original_, row + radius_);
    std::uint8_t* const to = &mask(box.v_begin + row, box.u_begin);
    for (int u = 0; u < box.width(); ++u) {
      const auto place = static_cast<std::size_t>(u + radius_);
      to[u] = (from[place / 64] >> (place % 64) & 1u) != 0 ? mask_liquid : std::uint8_t{0};
    }
  }

  // One row of `from` grown by the disc; with `flip` all ones, from's complement is grown and the result complemented.
  void gather(const std::vector<Word>& from, Index rows, Index row, Word flip, Word* to) const noexcept {
    std::fill(to, to + words_, Word{0});
    for (Index dv = -radius_; dv <= radius_; ++dv) {
      const Index other = row + dv;
      if (other < 0 || other >= rows) {
        continue;
      }
      const Word* const source = from.data() + static_cast<std::size_t>(other) * words_;
      const int half = half_width_[static_cast<std::size_t>(dv < 0 ? -dv : dv)];
      for (std::size_t k = 0; k < words_; ++k) {
        const Word here = source[k] ^ flip;
        const Word left = k > 0 ? source[k - 1] ^ flip : Word{0};
        const Word right = k + 1 < words_ ? source[k + 1] ^ flip : Word{0};
        Word sum = here;
        for (int shift = 1; shift <= half; ++shift) {
          sum |= here << shift | left >> (64 - shift) | here >> shift | right << (64 - shift);
        }
        to[k] |= sum;
      }
    }
    for (std::size_t k = 0; k < words_; ++k) {
      to[k] ^= flip;
    }
  }

  int gap_px_;
  int radius_;                   // of the disc [px]
  std::vector<int> half_width_;  // of the disc's rows, from the middle on
  std::size_t words_ = 0;        // per row
  std::vector<Word> original_, grown_;
};

}  // namespace decant::inline DECANT_TARGET
