// SPDX-License-Identifier: MIT
#pragma once

/// How the fuzzers tell a finding: the program aborts.

#include <cstdlib>
#include <stdexcept>
#include <string_view>

inline void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

/// Runs parse(), which may refuse its input by std::runtime_error of one line and in no other way.
template <class Parse>
void survive(Parse&& parse) {
  try {
    parse();
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find('\n') == std::string_view::npos);
  }
}
