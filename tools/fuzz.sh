#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the fuzz targets with Clang and runs each of them, one after the other: tools/fuzz.sh [SECONDS] [TARGET ...]
# Prints a table (docs/faults.md keeps one); fails when a target finds something, whose input is in build/fuzz/findings.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=60
if [[ "${1:-}" =~ ^[0-9]+$ ]]; then
  seconds=$1
  shift
fi
tools/install_packages.sh build test fuzz
cmake --preset fuzz >/dev/null
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  mapfile -t targets < <(find fuzz -name '*_fuzz.cc' -printf '%f\n' | sed 's/_fuzz\.cc$//' | sort)
fi
cmake --build build/fuzz --target "${targets[@]/#/fuzz_}" >&2

work=build/fuzz/runs
mkdir -p "$work" build/fuzz/findings
# Files that a target reads are small and many: in memory, where there is such a place.
[ -d /dev/shm ] && export TMPDIR=/dev/shm
export UBSAN_OPTIONS=print_stacktrace=1

found=0
echo "| target | seconds | executions | edges | findings |"
echo "| --- | --- | --- | --- | --- |"
for target in "${targets[@]}"; do
  program=build/fuzz/bin/fuzz_$target corpus=$work/$target log=$work/$target.log words=$work/$target.words
  "$program" --seeds "$corpus" "$words"
  finding=none dictionary=() begun=$SECONDS
  [ -s "$words" ] && dictionary=(-dict="$words")
  nice -n 10 "$program" "$corpus" "${dictionary[@]}" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
    -malloc_limit_mb=1024 -max_len=65536 -print_funcs=0 -print_final_stats=1 -artifact_prefix="build/fuzz/findings/$target-" \
    > "$log" 2>&1 || {
    found=1
    finding=$(grep -m1 -oE 'broken promise: .*|SUMMARY: .*|runtime error: .*' "$log" || echo "see $log")
  }
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  edges=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)
  echo "| $target | $((SECONDS - begun)) | ${executions:-0} | ${edges:-0} | $finding |"
done
exit $found
