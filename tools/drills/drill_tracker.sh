#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Drill: helicarm against OpenIGTLink's own example programs, over sockets. Not part of ./test; installs Debian's
# openigtlink-examples. Usage: tools/drills/drill_tracker.sh [PROGRAM]
set -euo pipefail
cd "$(dirname "$0")/../.."
program=${1:-build/bin/helicarm}
folder=$(mktemp -d)
children=()
finish() { for child in "${children[@]}"; do kill "$child" 2>/dev/null || true; done; rm -rf "$folder"; }
trap finish EXIT

dpkg-query -W openigtlink-examples libopenigtlink-dev >/dev/null 2>&1 ||
  apt-get install -y -qq --no-install-recommends openigtlink-examples libopenigtlink-dev >/dev/null
examples=/usr/share/doc/openigtlink-examples/examples
for example in Tracker/TrackerServer Tracker/TrackerClient Receiver/ReceiveClient TrackingData/TrackingDataServer \
               TrackingData/TrackingDataClient; do
  g++ -w -I/usr/include/openigtlink "$examples/$example.cxx" -o "$folder/${example#*/}" -lOpenIGTLink -lpthread
done

# NAME CONDITION-IN-PYTHON FILE: `d` is the JSON in the file
check() {
  if python3 -c "import json, sys; d = json.load(open(sys.argv[1])); sys.exit(not ($2))" "$3"; then
    echo "ok: $1"
  else
    echo "FAILED: $1"; cat "$3"; exit 1
  fi
}
start() { "$@" >"$folder/log" 2>&1 & children+=($!); }

start "$folder/TrackerServer" 18951 20
"$program" tracker watch 127.0.0.1:18951 --seconds 4 --json >"$folder/watch.json" 2>/dev/null
check "poses of TrackerServer are accepted" "d['tools'][0]['accepted'] > 50 and not d['counters'].get('malformed')" "$folder/watch.json"

start "$folder/TrackingDataServer" 18952
"$program" tracker watch 127.0.0.1:18952 --seconds 4 --ask --json >"$folder/watch.json" 2>/dev/null
# Its tools turn by 3 to 11 degrees with each message: at the requested 60 Hz most poses are jumps.
check "TDATA of TrackingDataServer comes at the requested rate" "len(d['tools']) >= 3 and 100 < d['counters']['messages'] < 300 and all(t['accepted'] + t['rejected'].get('jump', 0) > 100 for t in d['tools'])" "$folder/watch.json"

start "$folder/TrackerServer" 18955 20
"$program" tracker record 127.0.0.1:18955 "$folder/poses.mha" --seconds 4 --json >"$folder/record.json" 2>/dev/null
check "poses of TrackerServer are recorded" "d['frames'] > 50" "$folder/record.json"

"$program" tracker replay "$folder/poses.mha" --port 18953 --seconds 5 --json >"$folder/replay.json" 2>/dev/null &
sleep 1
"$folder/ReceiveClient" 127.0.0.1 18953 >"$folder/received" 2>&1 &
children+=($!)
"$folder/TrackerClient" 127.0.0.1 18953 50 >/dev/null 2>&1 &
children+=($!)
wait "${children[-2]}" 2>/dev/null || true
sleep 1
echo "ReceiveClient read $(grep -c 'Time stamp' "$folder/received") messages"
[ "$(grep -c 'Time stamp' "$folder/received")" -gt 20 ] || { echo "FAILED: ReceiveClient"; exit 1; }
check "poses that TrackerClient sends are read" "d['counters']['messages'] > 50 and not d['counters'].get('wrong_crc')" "$folder/replay.json"

"$program" tracker replay "$folder/poses.mha" --port 18954 --tdata --seconds 4 --json >"$folder/replay.json" 2>/dev/null &
sleep 1
timeout 2 "$folder/TrackingDataClient" 127.0.0.1 18954 20 >"$folder/received" 2>&1 || true
sleep 2
check "TrackingDataClient requests and receives TDATA" "d['counters']['messages'] >= 1 and d['counters']['sent'] > 10" "$folder/replay.json"
echo "TrackingDataClient read $(grep -ci 'type\|name' "$folder/received") lines of tools"
