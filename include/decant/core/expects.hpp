// SPDX-License-Identifier: MIT
#pragma once

/// Set-up errors: one line that names the thing, says what was expected and what came.

#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

// Cold and never inlined, so that a check costs its caller one compare and one jump.
template <class Value>
[[noreturn, gnu::cold, gnu::noinline]] void refuse(std::string_view what, std::string_view expected, const Value& got) {
  std::ostringstream line;
  line.precision(9);
  line << what << " must be " << expected << ", got " << got;
  throw std::invalid_argument(line.str());
}

}  // namespace detail

/// Throws std::invalid_argument "what must be expected, got value" unless `holds`. Write `holds` so that NaN fails:
/// `x > 0`, not `!(x <= 0)`. For set-up code only; nothing in a frame loop throws.
template <class Value>
void expects(bool holds, std::string_view what, std::string_view expected, const Value& got) {
  if (!holds) [[unlikely]] {
    detail::refuse(what, expected, got);
  }
}

}  // namespace decant::inline DECANT_TARGET
