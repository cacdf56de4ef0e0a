#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Configures and builds the release into build/: with AVX2 and FMA where the processor has them, else portable.
# tools/build.sh [-DOPTION=VALUE ...] [TARGET ...]
set -euo pipefail
cd "$(dirname "$0")/.."

options=() targets=()
for word in "$@"; do
  case "$word" in -D*) options+=("$word") ;; *) targets+=("$word") ;; esac
done
preset=portable
if grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo; then preset=release; fi
echo "Building ($preset) ..." >&2
cmake --preset "$preset" "${options[@]}" >build-configure.log 2>&1 || { cat build-configure.log >&2; exit 1; }
mv build-configure.log build/configure.log
# Share done, steps done of all.
export NINJA_STATUS=${NINJA_STATUS:-"[%p %f/%t] "}
cmake --build build --target "${targets[@]:-all}" >&2
