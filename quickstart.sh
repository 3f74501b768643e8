#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# From a bare machine to a liquid that is kept in step with a camera: installs what is missing, builds three programs in
# build/, tracks the small recording of a pour in examples/data, replays a motion with which a robot carried a cylinder
# of water beside what was measured, and names the effect that is hidden in another pour. Arguments go to `track` in
# place of that recording, and nothing else is done: ./quickstart.sh --help
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")"
./cmake/install_dependencies.sh
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDECANT_BUILD_TESTS=OFF -DDECANT_BUILD_EXAMPLES=ON \
  -DDECANT_BUILD_BENCHMARKS=OFF
cmake --build build --target track replay_motion find_missing_effect

results=build/quickstart
mkdir -p "$results"
if (($# > 0)); then
  exec build/examples/track "$@"
fi
echo
echo "A pour, seen by a camera: simulation alone, and corrected by what the camera sees"
build/examples/track examples/data/pour_cup --corrector open_loop,map_filter_mended,default --no-forecasts \
  --json "$results/track.json" --report "$results/track.html"

echo
echo "A cylinder of water, carried by a robot: simulated and measured height"
motion=TRD_2D_0.3m_2.4s_270deg
build/examples/replay_motion --poses "examples/data/pose_$motion.csv" --heights "examples/data/height_$motion.csv" \
  --radius-mm 49 --depth-mm 78 --spacing-mm 5 --json "$results/replay.json" --report "$results/replay.html" \
  --vtk "$results/vtk"

echo
echo "A pour that the simulation does not go along with: what does it lack? (coarse, one to two minutes)"
build/examples/find_missing_effect --learn examples/data/pour_hidden_effect/a --held-out examples/data/pour_hidden_effect/b \
  --spacing-mm 8 --draws 16 --json "$results/missing_effect.json" --report "$results/missing_effect.html"
