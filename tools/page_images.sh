#!/usr/bin/env bash
# Pictures of every page of the desktop application in every state, at 1280 x 800 and 1920 x 1080, dark and light, with
# usual and large text, and of its dialogs: tools/page_images.sh [FOLDER] [FILTER]; needs a built gui_window_test and
# xvfb-run. Of your own cases: HELICARM_CASES=CASE:CASE tools/page_images.sh FOLDER GivenCases
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-build/page_images}
mkdir -p "$folder"
HELICARM_PICTURES=$(realpath "$folder") xvfb-run -a -s "-screen 0 1920x1080x24" build/bin/gui_window_test \
  --gtest_filter="WindowImages.${2:-*}:-*Text*:*Tab*"
echo "$(find "$folder" -name '*.png' | wc -l) pictures in $folder"
