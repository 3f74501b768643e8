#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What a model of a dam break lacks, from water levels measured at gauges: learnt from one run, checked on others. Lobovsky
# et al. 2014, J. Fluids Struct. 48, 407-434, figure 16; files named Fig16_WaterLevels_<gauge>_<run>.dat.
#   benchmarks/dam_break_gauges.sh FOLDER [SPACING_MM=15] [RESULTS=build/dam_break] [option of find_missing_effect ...]
# RESULTS gets a scene with measurements for each run of the experiment, the report (report.html) and the result.json;
# begun anew, it goes on where it stopped.
# Environment: DECANT_FIND_MISSING_EFFECT, the program, build/examples/find_missing_effect unless given; LEARN, the run to
# learn from, 4 unless given; HELD_OUT, runs to check on, "3 5 2" unless given.
set -euo pipefail
export LC_ALL=C

if (($# < 1)); then
  sed -n '3,9s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=$1 spacing=${2:-15} results=${3:-$root/build/dam_break}
shift $(($# < 3 ? $# : 3))
find=${DECANT_FIND_MISSING_EFFECT:-$root/build/examples/find_missing_effect}
if [[ ! -x $find ]]; then
  echo "$find is not there: build the examples, or name it in DECANT_FIND_MISSING_EFFECT" >&2
  exit 2
fi
mkdir -p "$results"

# Of each run, the gauges that were read in it at one another's times, up to T = 6, before the wave that has come back
# from the far wall makes runs differ by more than what they are compared for.
for run in ${LEARN:-4} ${HELD_OUT:-3 5 2}; do
  of_run=$results/run_$run
  mkdir -p "$of_run"
  cp "$root/examples/scenes/dam_break_lobovsky.json" "$of_run/scene.json"
  python3 - "$folder" "$run" >"$of_run/measurements.csv" <<'PYTHON'
import math
import pathlib
import sys

folder, run = pathlib.Path(sys.argv[1]), sys.argv[2]
height, place = 0.3, {"H1": 0.3, "H2": 0.865, "H3": 1.114, "H4": 1.3625}
series = {}
for gauge in place:
    file = folder / f"Fig16_WaterLevels_{gauge}_{run}.dat"
    if file.exists():
        rows = [line.split() for line in file.read_text().splitlines() if line.strip() and not line.startswith("#")]
        series[gauge] = [(float(row[0]) * math.sqrt(height / 9.81), float(row[1]) * height * 1000) for row in rows]
if not series:
    sys.exit(f"{folder} has no Fig16_WaterLevels_*_{run}.dat")


def at(rows, time):
    """Of a series, linearly between its samples; nothing where there are none."""
    for (t0, v0), (t1, v1) in zip(rows, rows[1:]):
        if t0 <= time <= t1:
            return f"{v0 + (v1 - v0) * (time - t0) / (t1 - t0):.2f}"
    return ""


print("t_s," + ",".join(f"level_mm@{place[gauge]},0.075" for gauge in series))
for k in range(1, 106):
    print(f"{0.01 * k:.3f}," + ",".join(at(rows, 0.01 * k) for rows in series.values()))
PYTHON
done

held_out=()
for run in ${HELD_OUT:-3 5 2}; do
  held_out+=("$results/run_$run")
done
exec "$find" --learn "$results/run_${LEARN:-4}" --held-out "${held_out[@]}" --spacing-mm "$spacing" --frames-per-second 50 \
  --journal "$results/runs_${spacing}mm.journal" --report "$results/report.html" --json "$results/result.json" "$@"
