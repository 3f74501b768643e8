// SPDX-License-Identifier: MIT
#pragma once

/// Per-particle storage that is an Eigen matrix to its readers and grows like std::vector, so that inlets and
/// correctors can add particles without an allocation per particle.

#include <vector>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A matrix with a fixed number of rows and one column per particle; owns its memory, which is contiguous and column
/// by column. Reads and writes as the Eigen::Map that it is. Views of it are invalidated by set_count.
template <class Scalar, int Rows>
class Growable : public Eigen::Map<std::conditional_t<Rows == 1, Eigen::Matrix<Scalar, Eigen::Dynamic, 1>,
                                                      Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>>> {
 public:
  using Matrix = std::conditional_t<Rows == 1, Eigen::Matrix<Scalar, Eigen::Dynamic, 1>,
                                    Eigen::Matrix<Scalar, Rows, Eigen::Dynamic>>;
  using Map = Eigen::Map<Matrix>;

  Growable() : Map(make_map(nullptr, 0)) {}
  Growable(const Growable& other) : Map(make_map(nullptr, 0)), storage_(other.storage_) { seat(); }
  Growable(Growable&& other) noexcept : Map(make_map(nullptr, 0)), storage_(std::move(other.storage_)) {
    seat();
    other.storage_.clear();
    other.seat();
  }
  Growable& operator=(const Growable& other) {
    if (this != &other) {
      storage_ = other.storage_;  // keeps capacity: no allocation where the counts are alike
      seat();
    }
    return *this;
  }
  Growable& operator=(Growable&& other) noexcept {
    storage_.swap(other.storage_);
    seat();
    other.seat();
    return *this;
  }
  template <class Derived>
  Growable& operator=(const Eigen::MatrixBase<Derived>& values) {
    set_count(Rows == 1 ? values.size() : values.cols());
    Map::operator=(values);
    return *this;
  }
  ~Growable() = default;

  Index count() const { return static_cast<Index>(storage_.size()) / Rows; }

  /// Keeps the first min(old, new) columns; new ones are zero.
  void set_count(Index count) {
    storage_.resize(static_cast<std::size_t>(count * Rows), Scalar(0));
    seat();
  }

  void reserve(Index count) {
    storage_.reserve(static_cast<std::size_t>(count * Rows));
    seat();
  }

 private:
  static Map make_map(Scalar* data, Index count) {
    if constexpr (Rows == 1) {
      return Map(data, count);
    } else {
      return Map(data, Rows, count);
    }
  }
  void seat() { new (static_cast<Map*>(this)) Map(make_map(storage_.data(), count())); }

  std::vector<Scalar> storage_;
};

}  // namespace decant::inline DECANT_TARGET
