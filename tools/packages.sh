#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the Debian packages for any amd64 machine into build/package/*.deb: tools/packages.sh [-DOPTION=VALUE ...]
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh build gui python
echo "Building the packages (portable, without tests) ..." >&2
cmake --preset package "$@" >/dev/null
cmake --build --preset package >&2
cmake --build build/package --target helicarm_pages >&2
rm -f build/package/*.deb
(cd build/package && cpack -G DEB >cpack.log || { cat cpack.log >&2; exit 1; })
ls build/package/*.deb
