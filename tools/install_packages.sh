#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian packages that the given lists name and the system lacks: tools/install_packages.sh build test
# One that is listed as "?name" is left out, with a line, where it cannot be installed.
set -euo pipefail
cd "$(dirname "$0")/.."

missing=() optional=()
for list in "$@"; do
  while read -r package; do
    name=${package#\?}
    dpkg-query -W -f '${Status}' "$name" 2>/dev/null | grep -q 'install ok installed' && continue
    if [ "$name" = "$package" ]; then missing+=("$name"); else optional+=("$name"); fi
  done < "packages/$list.txt"
done
[ $((${#missing[@]} + ${#optional[@]})) -eq 0 ] && exit 0

left_out() { echo "Left out: ${optional[*]} ($1)" >&2; }
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    [ ${#missing[@]} -eq 0 ] && { left_out "installing requires root or sudo"; exit 0; }
    echo "These packages are missing, and installing them requires root or sudo: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
as_root+=(env DEBIAN_FRONTEND=noninteractive)
install() { "${as_root[@]}" apt-get install -y -qq --no-install-recommends "$@" >/dev/null; }
echo "Installing $((${#missing[@]} + ${#optional[@]})) packages: ${missing[*]} ${optional[*]}" >&2
if [ ${#missing[@]} -gt 0 ]; then
  "${as_root[@]}" apt-get update -qq
  install "${missing[@]}"
fi
if [ ${#optional[@]} -gt 0 ]; then
  install "${optional[@]}" 2>/dev/null || left_out "apt-get could not install them"
fi
