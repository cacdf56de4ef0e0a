#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages on a minimal Debian 12 system and runs them there: tools/check_packages.sh [FOLDER_OF_DEBS]
# Needs root, and a Debian mirror (MIRROR=http://...).
set -euo pipefail
cd "$(dirname "$0")/.."

debs=$(realpath "${1:-build/package}")
mirror=${MIRROR:-http://deb.debian.org/debian}
tools/install_packages.sh full
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mmdebstrap --quiet --variant=apt bookworm "$root" "$mirror"
mkdir "$root/debs"
cp "$debs"/*.deb "$root/debs"
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp -r examples/cpp "$root/example"
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 HOME=/root DEBIAN_FRONTEND=noninteractive "$@"; }

inside sh -c 'apt-get update -qq && apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends /debs/*.deb >/dev/null'
inside helicarm --version
inside sh -c 'cd /tmp && helicarm demo --quiet && test -s helicarm-demo/result/report.html && echo "demo: report written"'
inside sh -c 'gzip -cd /usr/share/man/man1/helicarm.1.gz 2>/dev/null || cat /usr/share/man/man1/helicarm.1' | grep -q 'SH COMMANDS'
inside bash -c '. /usr/share/bash-completion/completions/helicarm; COMP_WORDS=(helicarm dem); COMP_CWORD=1; _helicarm; test "$COMPREPLY" = demo'
inside python3 -c 'import helicarm
for point in helicarm.run_case("/tmp/helicarm-demo/case").points: print(point)'
if [ -e "$root/usr/bin/helicarm-gui" ]; then
  inside env QT_QPA_PLATFORM=offscreen timeout 5 helicarm-gui && code=0 || code=$?
  [ "$code" = 124 ] || { echo "helicarm-gui ended by itself with $code" >&2; exit 1; }
  echo "helicarm-gui: runs"
fi
inside apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends cmake g++ make >/dev/null
inside sh -c 'cmake -S /example -B /tmp/example >/dev/null && cmake --build /tmp/example >/dev/null && /tmp/example/locate_point'
echo "Packages work on a minimal system." >&2
