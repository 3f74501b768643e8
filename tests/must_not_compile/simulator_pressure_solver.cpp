// SPDX-License-Identifier: MIT
// A pressure solver without memory of its last step, in a bundle of parts.
// expect: Parts::PressureSolver must model decant::PressureSolver, see <decant/pressure/concept.hpp>
// expect: solver.memory()
#include <cstdint>
#include <limits>
#include <span>

#include <decant/simulation/simulator.hpp>

struct NoPressure {
  using Scalar = double;
  static constexpr double search_margin = 0;
  struct Memory {
    void reorder(std::span<const std::uint32_t>) {}
    void clear() {}
  };
  template <class Step>
  void begin_step(const Step&, decant::PressureReport&) noexcept {}
  template <class Step>
  void solve(const Step&, decant::PressureReport&) noexcept {}
  template <class Step>
  double largest_step(const Step&) const noexcept {
    return std::numeric_limits<double>::infinity();
  }
#ifdef DECANT_TWIN
  Memory& memory() noexcept { return memory_; }

 private:
  Memory memory_;
#endif
};

struct MyParts : decant::DefaultParts<double> {
  using PressureSolver = NoPressure;
};
static_assert(sizeof(decant::Simulator<MyParts>) > 0);
