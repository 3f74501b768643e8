// SPDX-License-Identifier: MIT
#pragma once

/// One law of a concept, tried on a part. The suites in decant/testing/ return these, free of any test framework, so
/// that users can run them over parts of their own.

#include <sstream>
#include <string>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// A law holds if `error` is at most `bound`; NaN does not hold.
struct Law {
  std::string statement;  ///< what has to be true, in words
  double error = 0;       ///< how far the part is off, in the units that the statement names
  double bound = 0;       ///< how far it may be off

  bool holds() const { return error <= bound; }

  /// One line for a test's output.
  std::string text() const {
    std::ostringstream line;
    line << statement << ": error " << error << (holds() ? " <= " : ", allowed is ") << bound;
    return line.str();
  }
};

}  // namespace decant::inline DECANT_TARGET::testing
