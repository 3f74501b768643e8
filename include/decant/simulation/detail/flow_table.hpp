// SPDX-License-Identifier: MIT
#pragma once

/// Flow over time as inlets and outlets take it: a table, linear between its entries and zero outside.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::detail {

using FlowTable = std::vector<std::pair<double, double>>;  ///< (time [s], flow [m^3/s])

/// Throws std::invalid_argument in the name of `who` unless times increase and flows are >= 0, all finite.
inline void expects_flow(const std::string& who, const FlowTable& table) {
  for (std::size_t k = 0; k < table.size(); ++k) {
    expects(std::isfinite(table[k].first) && (k == 0 || table[k].first > table[k - 1].first),
            who + ": time [s] of the flow", "finite and increasing", table[k].first);
    expects(table[k].second >= 0 && std::isfinite(table[k].second), who + ": flow [m^3/s]", ">= 0 and finite",
            table[k].second);
  }
}

/// Between entries k - 1 and k [m^3/s].
inline double flow_between(const FlowTable& table, std::size_t k, double time) noexcept {
  const double t = (time - table[k - 1].first) / (table[k].first - table[k - 1].first);
  return table[k - 1].second + t * (table[k].second - table[k - 1].second);
}

/// At a time [m^3/s].
inline double flow_at(const FlowTable& table, double time) noexcept {
  if (table.empty() || time < table.front().first || time > table.back().first) {
    return 0;
  }
  for (std::size_t k = 1; k < table.size(); ++k) {
    if (time <= table[k].first) {
      return flow_between(table, k, time);
    }
  }
  return table.back().second;
}

/// The integral of the flow from `begin` to `end` [m^3], exact.
inline double flow_volume(const FlowTable& table, double begin, double end) noexcept {
  double volume = 0;
  for (std::size_t k = 1; k < table.size(); ++k) {
    const double from = std::max(begin, table[k - 1].first), to = std::min(end, table[k].first);
    if (from < to) {
      volume += (to - from) * flow_between(table, k, from + 0.5 * (to - from));
    }
  }
  return volume;
}

}  // namespace decant::inline DECANT_TARGET::detail
