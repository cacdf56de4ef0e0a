#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the library from a build folder and builds examples/cpp on it by find_package and by pkg-config, for any
# x86-64 whatever the library was built for: tools/check_install.sh [BUILD_FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."

build=${1:-build}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cmake --install "$build" --component dev --prefix "$folder/usr" >/dev/null
cmake -S examples/cpp -B "$folder/example" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder/usr" >/dev/null
cmake --build "$folder/example" >/dev/null
"$folder/example/locate_point"
"$folder/example/own_tracker"
# Nothing of the source or build tree may be named in what was installed.
if grep -rlF -e "$PWD" "$folder/usr" --include='*.cmake' --include='*.pc' --include='*.h'; then
  echo "These installed files name this folder." >&2
  exit 1
fi
pc=$(dirname "$(find "$folder/usr" -name helicarm.pc)")
flags=$(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs --static helicarm)
# shellcheck disable=SC2086
g++ examples/cpp/locate_point.cc -o "$folder/by_pkg_config" $flags
"$folder/by_pkg_config" >/dev/null
# As a part of another project: neither tests nor warnings nor an instruction set are forced on it.
mkdir "$folder/user"
cat >"$folder/user/CMakeLists.txt" <<END
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES CXX)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
add_subdirectory($PWD helicarm)
add_executable(user $PWD/examples/cpp/locate_point.cc)
target_link_libraries(user PRIVATE helicarm::localization helicarm::phantom)
END
cmake -S "$folder/user" -B "$folder/user/build" -G Ninja >/dev/null
python3 - "$folder/user/build/compile_commands.json" <<'END'
import json, sys
units = json.load(open(sys.argv[1]))
own = [u["command"] for u in units if u["file"].endswith("locate_point.cc")]
assert len(own) == 1 and not any(w in own[0] for w in ("-Werror", "-march", "-Wall", "-fno-")), own
assert not any("-march" in u["command"] or "-Werror" in u["command"] for u in units)
assert not any(u["file"].endswith("_test.cc") for u in units)
print("add_subdirectory: nothing is forced on its user")
END
