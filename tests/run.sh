#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what is missing, builds everything and runs every test but those labelled `long` (a quarter of an hour).
# Ends with the line `N passed, N failed`; the exit status is 0 only if there are tests and all of them passed.
# Environment: DECANT_TEST_JOBS, how many compilers and tests run side by side (all cores unless given; fewer compilers
# where memory is short);
# DECANT_SHARED_DATA_DIR, a folder of measurements that some tests compare with, ../shared/data if there is one;
# DECANT_BUILD_DIR, build/ unless given; CI=true makes warnings errors and builds the benchmarks, too.
# Arguments go to ctest instead: ./tests/run.sh -L long, ./tests/run.sh -LE 'slow|long'
set -uo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
jobs=${DECANT_TEST_JOBS:-$(nproc)}
# a compiler takes up to 5 GB
compilers=$(awk '/^MemAvailable/ { print int($2 / 1024 / 5000) }' /proc/meminfo 2>/dev/null || echo "$jobs")
compilers=$((compilers < 1 ? 1 : compilers > jobs ? jobs : compilers))
build=${DECANT_BUILD_DIR:-build}
for_ci=OFF
if [[ ${CI:-} == true ]]; then
  for_ci=ON
fi

give_up() {
  echo "$1" >&2
  echo "0 passed, 1 failed"
  exit 1
}

./cmake/install_dependencies.sh catch2 browser mpi || give_up "The tests did not start."
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDECANT_BUILD_TESTS=ON -DDECANT_BUILD_EXAMPLES=ON \
  -DDECANT_BUILD_BENCHMARKS="$for_ci" -DDECANT_WARNINGS_AS_ERRORS="$for_ci" \
  -DDECANT_SHARED_DATA_DIR="${DECANT_SHARED_DATA_DIR:-}" || give_up "Configuring failed."
cmake --build "$build" --parallel "$compilers" || give_up "Building failed."

if (($# == 0)); then
  set -- --label-exclude '^long$'
fi
results=$build/test-results.xml
rm -f "$results"
ctest --test-dir "$build" --output-on-failure --no-tests=error --parallel "$jobs" --output-junit "$PWD/$results" "$@"
status=$?
[[ -s $results ]] || give_up "No tests ran."

# the counts stand in the attributes of <testsuite>
count() {
  tr '\n\t' '  ' <"$results" | grep -o '<testsuite [^>]*>' | grep -o " $1=\"[0-9]*\"" | head -n 1 | tr -dc 0-9
}
tests=$(count tests)
skipped=$(($(count skipped) + $(count disabled)))
failed=$(count failures)
passed=$((tests - skipped - failed))
if ((skipped > 0)); then
  echo "$skipped skipped"
fi
if ((passed == 0 && failed == 0)); then
  give_up "No tests ran."
fi
echo "$passed passed, $failed failed"
((status == 0 && failed == 0))
