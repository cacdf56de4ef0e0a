#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Checks the C++ files with clang-tidy (.clang-tidy): all of them, those changed since a commit, or the given ones.
# tools/tidy.sh [--changed [COMMIT] | FILE ...]
set -euo pipefail
cd "$(dirname "$0")/.."

case "${1:-}" in
  --changed) mapfile -t files < <(git diff --name-only --diff-filter=d "${2:-HEAD}" -- '*.cc') ;;
  "") mapfile -t files < <(git ls-files '*.cc') ;;
  -*) echo "usage: tools/tidy.sh [--changed [COMMIT] | FILE ...]" >&2; exit 2 ;;
  *) files=("$@") ;;
esac
# Compiled in other builds only, or as the body of a precompiled header.
skipped='^(benchmarks/|examples/|studies/small_studies.cc|cmake/precompiled.cc|fuzz/)'
mapfile -t files < <(printf '%s\n' "${files[@]}" | grep '\.cc$' | grep -Ev "$skipped" || true)
[ ${#files[@]} -eq 0 ] && exit 0

# A build by Clang without precompiled headers. It is configured, never built.
cmake --preset release -B build/tidy -DCMAKE_CXX_COMPILER=clang++-16 -DHELICARM_UNITY=OFF -DHELICARM_GUI=ON -DHELICARM_PYTHON=ON -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON \
  >build-tidy.log 2>&1 || { cat build-tidy.log >&2; exit 1; }
mv build-tidy.log build/tidy/configure.log

# MPI's compiler flags are strange to clang.
check() { clang-tidy-16 -p build/tidy --quiet --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-unused-command-line-argument "$1" 2>/dev/null ||
  { echo "$1: clang-tidy has findings" >&2; return 1; }; }
export -f check
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c 'check "$1"' _
