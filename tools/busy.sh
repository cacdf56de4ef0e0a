#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a command under CPU load (N busy loops per core): tools/busy.sh N COMMAND ...
set -euo pipefail

[ $# -ge 2 ] || { echo "usage: tools/busy.sh N COMMAND ..." >&2; exit 2; }
loops=()
for ((i = 0; i < $1 * $(nproc); ++i)); do
  bash -c 'while :; do :; done' &
  loops+=($!)
done
trap 'kill "${loops[@]}"' EXIT
"${@:2}"
