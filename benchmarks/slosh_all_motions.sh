#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Replays every motion of a folder (pose_<motion>.csv and height_<motion>.csv, as in examples/data) with replay_motion and
# prints CSV: a row for each motion, then the median and the worst of all, and of those during which the container stays
# upright, whose measured heights hold nothing of the tilt.
#   benchmarks/slosh_all_motions.sh FOLDER [SPACING_MM=5] [RESULTS=build/slosh]
# Results are kept in RESULTS, one JSON file for each motion and spacing; a motion that has one is not run again.
# Environment: DECANT_REPLAY_MOTION, the program, build/examples/replay_motion unless given; OMP_NUM_THREADS.
set -euo pipefail
export LC_ALL=C

if (($# < 1 || $# > 3)); then
  sed -n '3,7s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=$1 spacing=${2:-5} results=${3:-$root/build/slosh}
replay=${DECANT_REPLAY_MOTION:-$root/build/examples/replay_motion}
if [[ ! -x $replay ]]; then
  echo "$replay is not there: build the examples, or name it in DECANT_REPLAY_MOTION" >&2
  exit 2
fi
shopt -s nullglob
poses=("$folder"/pose_*.csv)
if ((${#poses[@]} == 0)); then
  echo "$folder has no pose_*.csv" >&2
  exit 2
fi
mkdir -p "$results"

# figure FILE KEY: a number of the upper level of a result
figure() {
  local value
  value=$(sed -n "s/^ *\"$2\": \([-+.0-9e]*\),\{0,1\}$/\1/p" "$1" | head -n 1)
  if [[ -z $value ]]; then
    echo "$1 has no number $2" >&2
    return 1
  fi
  echo "$value"
}

rows=$results/rows_${spacing}mm.csv
: >"$rows"
for pose in "${poses[@]}"; do
  motion=$(basename "$pose" .csv)
  motion=${motion#pose_}
  json=$results/${motion}_${spacing}mm.json
  if [[ ! -s $json ]]; then
    # under another name until it is whole
    if ! "$replay" --poses "$pose" --heights "$folder/height_$motion.csv" --radius-mm 49 --depth-mm 78 \
      --spacing-mm "$spacing" --threads "${OMP_NUM_THREADS:-0}" --json "$json.part" >"$results/$motion.log" 2>&1; then
      cat "$results/$motion.log" >&2
      exit 1
    fi
    mv "$json.part" "$json"
  fi
  row=$motion
  for key in peak_mm measured_peak_mm correlation time_shift_s decay_frequency_hz measured_frequency_hz damping_ratio \
    measured_damping_ratio particles lost wall_s; do
    number=$(figure "$json" "$key")
    row+=,$number
  done
  echo "$row" >>"$rows"
done

# the error of the peak goes behind the two peaks; medians and worst of sorted columns
awk -F, -v spacing="$spacing" '
function sort(list, n,   i, j, t) {
  for (i = 2; i <= n; ++i)
    for (j = i; j > 1 && list[j - 1] > list[j]; --j) { t = list[j]; list[j] = list[j - 1]; list[j - 1] = t }
}
function median(list, n) { sort(list, n); return n % 2 ? list[(n + 1) / 2] : (list[n / 2] + list[n / 2 + 1]) / 2 }
function summary(what, n, errors, correlations,   m) {
  if (n == 0) return
  m = median(errors, n)
  printf "# %s: %d motions at %s mm, peak off by %.1f %% in the median and %.1f %% at worst, ", what, n, spacing, m, errors[n]
  m = median(correlations, n)
  printf "correlation %.3f in the median and %.3f at worst\n", m, correlations[1]
}
BEGIN {
  print "motion,tilted,peak_mm,measured_peak_mm,error_percent,correlation,time_shift_s,frequency_hz,measured_hz," \
        "damping_ratio,measured_damping,particles,lost,wall_s"
}
{
  error = 100 * ($2 / $3 - 1)
  size = error < 0 ? -error : error
  tilted = $1 ~ /^Tilt_/
  printf "%s,%s,%.1f,%.1f,%+.1f,%.3f,%.2f,%.3f,%.3f,%.4f,%.4f,%d,%d,%.0f\n", $1, tilted ? "yes" : "no", $2, $3, error, $4, $5, \
         $6, $7, $8, $9, $10, $11, $12
  all_errors[++all] = size; all_correlations[all] = $4
  if (!tilted) { upright_errors[++upright] = size; upright_correlations[upright] = $4 }
}
END {
  summary("all", all, all_errors, all_correlations)
  summary("upright", upright, upright_errors, upright_correlations)
}' "$rows"
rm "$rows"
