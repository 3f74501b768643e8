#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# From a bare machine to a simulation beside its measurement: installs what is missing, builds one example in build/
# and replays a motion with which a robot carried a cylinder of water. Arguments go to
# replay_motion in place of that motion: ./quickstart.sh --help
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")"
./cmake/install_dependencies.sh
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDECANT_BUILD_TESTS=OFF -DDECANT_BUILD_EXAMPLES=ON \
  -DDECANT_BUILD_BENCHMARKS=OFF
cmake --build build --target replay_motion

results=build/replay
mkdir -p "$results"
motion=TRD_2D_0.3m_2.4s_270deg
if (($# == 0)); then
  set -- --poses "examples/data/pose_$motion.csv" --heights "examples/data/height_$motion.csv" \
    --radius-mm 49 --depth-mm 78 --spacing-mm 5 --json "$results/result.json" --report "$results/report.html" --vtk "$results/vtk"
fi
build/examples/replay_motion "$@"
