// SPDX-License-Identifier: MIT
// One program, compiled in part for any processor and in part for newer ones: each part has a simulator of its own, and
// all of them are right.

#include "catch.hpp"
#include "targets/run.hpp"

namespace {

/// Twelve layers of 10 mm at rest: half of the depth high, and rho g h / 2 in the mean.
void require_at_rest(const TargetRun& run) {
  CAPTURE(run.simulator, run.lanes, run.half);
  CHECK(run.height == Approx(0.06).margin(0.002));
  CHECK(run.pressure == Approx(998.2 * 9.81 * 0.06).epsilon(0.03));
  CHECK(run.speed < 0.02);
  CHECK(run.compression < 2e-3);
}

}  // namespace

TEST_CASE("targets: built without flags, water stands") {
  const TargetRun run = run_without_flags();
  require_at_rest(run);
#if defined(__x86_64__)
  CHECK(run.lanes == 4);
  CHECK_FALSE(run.half);
#endif
}

TEST_CASE("targets: built for AVX2, water stands") {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("f16c")) {
    const TargetRun run = run_with_avx2();
    require_at_rest(run);
    CHECK(run.lanes == 8);
    CHECK(run.half);
    // with one name for both, the linker would keep one of them, and calls from elsewhere would find the wrong widths
    CHECK(run.simulator != run_without_flags().simulator);
    return;
  }
#endif
  WARN("this processor has no AVX2: not run");
}

TEST_CASE("targets: built as the other tests are, water stands") { require_at_rest(run_as_built()); }
