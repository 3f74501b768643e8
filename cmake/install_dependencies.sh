#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Sees to it that everything is there that decant's own programs are built from: installs the missing apt packages
# where it may, else says which they are and ends with status 1. Arguments: further apt packages to look for; and two
# that nothing stops without: `browser`, Chromium, in which reports are tested, and `mpi`, Open MPI, with which
# simulations run in several processes.
# DECANT_DEPENDENCIES=skip in the environment leaves all this out, for machines that have things by other means.
set -euo pipefail

if [[ ${DECANT_DEPENDENCIES:-} == skip ]]; then
  exit 0
fi
if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "This is no Debian or Ubuntu: decant needs g++ 11 or newer (or clang++), CMake 3.22, Ninja, Eigen 3.4," \
    "nlohmann_json, libpng and CLI11; nanoflann and MPI if they are there; Catch2 for the tests. Going on with what there is." >&2
  exit 0
fi

missing=()
need() { missing+=("$1"); }
packages=()
wished=()   # packages that nothing stops without
without=()  # and what is left out then
for package in "$@"; do
  if [[ $package == browser ]]; then
    if ! command -v chromium >/dev/null && ! command -v chromium-browser >/dev/null &&
      ! command -v google-chrome >/dev/null; then
      wished+=(chromium)
      without+=("reports are not tested in a browser")
    fi
  elif [[ $package == mpi ]]; then
    if ! command -v mpicxx >/dev/null || ! command -v mpirun >/dev/null; then
      wished+=("libopenmpi-dev openmpi-bin")
      without+=("simulations are not tested in several processes")
    fi
  else
    packages+=("$package")
  fi
done
# tools may come from elsewhere than a package
command -v "${CXX:-c++}" >/dev/null || need g++
command -v cmake >/dev/null || need cmake
command -v ninja >/dev/null || need ninja-build
for package in libeigen3-dev libnanoflann-dev nlohmann-json3-dev libpng-dev libcli11-dev "${packages[@]}"; do
  state=$(dpkg-query --show --showformat '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $state == installed ]] || need "$package"
done
if ((${#missing[@]} == 0 && ${#wished[@]} == 0)); then
  exit 0
fi

as_root=()
if ((EUID != 0)); then
  as_root=(sudo)
  # without a terminal nobody can type a password
  if ! command -v sudo >/dev/null || { [[ ! -t 0 || -n ${CI:-} ]] && ! sudo -n true 2>/dev/null; }; then
    if ((${#missing[@]} == 0)); then
      for k in "${!wished[@]}"; do
        echo "No ${wished[k]}: ${without[k]}. To have that: sudo apt-get install ${wished[k]}" >&2
      done
      exit 0
    fi
    echo "These packages are missing, and installing them takes an administrator:" >&2
    echo "  sudo apt-get install ${missing[*]}" >&2
    exit 1
  fi
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
update() { "${as_root[@]}" apt-get update; }
install() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"; }
# the list of packages may be out of date or empty
if ((${#missing[@]} > 0)); then
  echo "Installing ${missing[*]}"
  if ! { update && install "${missing[@]}"; } >"$log" 2>&1; then
    tail -n 15 "$log" >&2
    echo "Installing failed. Missing: ${missing[*]}" >&2
    exit 1
  fi
fi
for k in "${!wished[@]}"; do
  echo "Installing ${wished[k]}"
  read -ra names <<<"${wished[k]}"
  # Ubuntu has Chromium as a snap only, which not every machine can run
  if ! { update && install "${names[@]}"; } >"$log" 2>&1; then
    echo "Installing ${wished[k]} failed: ${without[k]}." >&2
  fi
done
