// SPDX-License-Identifier: MIT
#pragma once

/// Memory for results that are written before they are read: grows, never shrinks, and is not touched when it is set
/// aside, so that room to spare costs addresses and not memory.

#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// An array that starts at a cache line and whose contents are lost when it grows.
template <class Value>
requires std::is_trivially_copyable_v<Value>
class Scratch {
 public:
  Scratch() = default;
  Scratch(const Scratch& other) { *this = other; }
  Scratch& operator=(const Scratch& other) {
    if (this != &other) {
      require(other.capacity_);
      if (other.capacity_ > 0) {
        std::memcpy(static_cast<void*>(data()), other.data(), other.capacity_ * sizeof(Value));
      }
    }
    return *this;
  }
  Scratch(Scratch&& other) noexcept : values_(std::move(other.values_)), capacity_(std::exchange(other.capacity_, 0)) {}
  Scratch& operator=(Scratch&& other) noexcept {
    values_ = std::move(other.values_);
    capacity_ = std::exchange(other.capacity_, 0);
    return *this;
  }
  ~Scratch() = default;

  /// Makes room for `count` values; returns true if that took new memory.
  bool require(std::size_t count) {
    if (count <= capacity_) {
      return false;
    }
    values_.reset();
    capacity_ = 0;
    const std::size_t room = count + count / 8;  // a liquid that grows drop by drop should not allocate at each drop
    values_.reset(static_cast<Value*>(::operator new(room * sizeof(Value), alignment)));
    capacity_ = room;
    return true;
  }

  std::size_t capacity() const noexcept { return capacity_; }
  Value* data() noexcept { return values_.get(); }
  const Value* data() const noexcept { return values_.get(); }
  Value& operator[](std::size_t i) noexcept { return values_.get()[i]; }
  const Value& operator[](std::size_t i) const noexcept { return values_.get()[i]; }

 private:
  static constexpr std::align_val_t alignment{64};
  struct Free {
    void operator()(Value* values) const noexcept { ::operator delete(values, alignment); }
  };
  std::unique_ptr<Value, Free> values_;
  std::size_t capacity_ = 0;
};

}  // namespace decant::inline DECANT_TARGET::detail
