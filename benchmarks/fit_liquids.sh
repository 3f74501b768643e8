#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Records pours of liquids with a hidden viscosity (another solver, kernel and spacing than the model's, poses and masks
# with noise), fits it to three of them with fit_liquid, scores the fit on a fourth, and prints CSV: a row for each
# viscosity, the true one and what was found.
#   benchmarks/fit_liquids.sh FOLDER [MODEL_SPACING_MM=6] [VISCOSITY...]
# Recordings and results are kept in FOLDER: a run that was stopped goes on where it was. Viscosities [m^2/s] are of
# 1e-6 1e-5 1e-4 3e-4 1e-3, all of them unless some are named.
# Environment: DECANT_RECORD_POUR and DECANT_FIT_LIQUID, the programs, in build/examples unless given; OMP_NUM_THREADS.
set -euo pipefail
export LC_ALL=C

if (($# < 1)); then
  sed -n '3,9s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=$1 spacing=${2:-6}
all=(1e-6 1e-5 1e-4 3e-4 1e-3)
wanted=("${@:3}")
if ((${#wanted[@]} == 0)); then
  wanted=("${all[@]}")
fi
record=${DECANT_RECORD_POUR:-$root/build/examples/record_pour}
fit=${DECANT_FIT_LIQUID:-$root/build/examples/fit_liquid}
for program in "$record" "$fit"; do
  if [[ ! -x $program ]]; then
    echo "$program is not there: build the examples, or name it in the environment" >&2
    exit 2
  fi
done
mkdir -p "$folder/unfinished"

# record_one VISCOSITY FILL SEED: leaves the recording's folder in `recording`
record_one() {
  recording=$folder/nu_${1}_cup_${2}_$3
  if [[ ! -d $recording ]]; then
    # elsewhere until it is whole
    local part=$folder/unfinished/${recording##*/}
    rm -rf "$part"
    "$record" --out "$part" --fill "0.$2" --seed "$3" --viscosity "$1" --spacing-mm 4 --seconds 3 >&2
    mv "$part" "$recording"
  fi
}

# figure FILE KEY: the first number of that name
figure() {
  sed -n "s/^ *\"$2\": \([-+.0-9e]*\),\{0,1\}$/\1/p" "$1" | head -n 1
}

echo "true_nu,nu,from,to,told,best_first_nu,best_first_evaluations,surrogate_evaluations,learn_before,learn_after,held_out_before,held_out_after,seconds"
for nu in "${wanted[@]}"; do
  which=-1
  for k in "${!all[@]}"; do
    if [[ ${all[k]} == "$nu" ]]; then which=$k; fi
  done
  if ((which < 0)); then
    echo "viscosity $nu is none of ${all[*]}" >&2
    exit 2
  fi
  seed=$((401 + 10 * which))  # odd: the position-based reality
  learn=()
  for pour in "60 $seed" "75 $((seed + 2))" "90 $((seed + 4))"; do
    read -r fill number <<<"$pour"
    record_one "$nu" "$fill" "$number"
    learn+=("$recording")
  done
  record_one "$nu" 70 $((seed + 6))
  json=$folder/fit_${nu}_${spacing}mm.json
  if [[ ! -s $json ]]; then
    "$fit" --learn "${learn[@]}" --held-out "$recording" --method both --most-evaluations 16 --spacing-mm "$spacing" \
      --threads "${OMP_NUM_THREADS:-0}" --journal "$folder/fit_${spacing}mm.journal" --json "$json.part" >"$folder/fit_${nu}_${spacing}mm.log"
    mv "$json.part" "$json"
  fi
  # keys are in alphabetical order: held_out, learn, method, parameters, searches
  interval=$(sed -n '/"parameters": {/,$p' "$json" | awk '/"interval_90"/ { getline a; getline b; gsub(/[ ,]/, "", a); gsub(/[ ,]/, "", b); print a "," b; exit }')
  told=$(sed -n '/"parameters": {/,$p' "$json" | sed -n 's/^ *"told": \([a-z]*\),*$/\1/p' | head -n 1)
  value=$(sed -n '/"parameters": {/,$p' "$json" | sed -n 's/^ *"value": \([-+.0-9e]*\),*$/\1/p' | head -n 1)
  best=$(sed -n '/"searches": {/,$p' "$json" | awk '/"best": {/ { getline a; sub(/.*: /, "", a); print a; exit }')
  learn_json=$(sed -n '/^ "learn": {/,$p' "$json")
  echo "$nu,$value,$interval,$told,$best,$(figure "$json" best_first),$(figure "$json" surrogate),$(figure <(echo "$learn_json") before),$(figure <(echo "$learn_json") after),$(figure "$json" before),$(figure "$json" after),$(figure "$json" seconds)"
done
rmdir "$folder/unfinished" 2>/dev/null || true
