#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Program and Python package with the libraries that they need, as a relocatable archive and as a wheel, for Linux with
# Debian 12's glibc (2.36) or a later one, into build/archive: tools/archive.sh [BUILD_FOLDER]
# A folder that holds program and Python module is taken as it is; without one, build/package is built, for any x86-64.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install_packages.sh build python archive
if [ $# -eq 0 ]; then
  tools/install_packages.sh gui
  echo "Building for any x86-64 (build/package) ..." >&2
  cmake --preset package >/dev/null
  cmake --build --preset package --target helicarm helicarm_python >&2
fi
build=$(realpath "${1:-build/package}")
option() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
version=$(option CMAKE_PROJECT_VERSION)
if [ "$(option HELICARM_PORTABLE)" = ON ]; then machine=x86_64 tag=manylinux_2_36_x86_64; else machine=x86_64-v3 tag=linux_x86_64; fi
name=helicarm-$version-linux-$machine
module=$(echo "$build"/python/helicarm/_helicarm.*.so)
for needed in "$build/bin/helicarm" "$module"; do
  [ -f "$needed" ] || { echo "$needed is missing: build helicarm and helicarm_python" >&2; exit 1; }
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Libraries that every system has, in versions that may be newer there.
of_the_system='^(linux-vdso|ld-linux-x86-64|libc|libm|libmvec|libpthread|libdl|librt|libresolv|libutil|libstdc\+\+|libgcc_s)\.so'
# FILE ...: lines "NAME PATH" of the other libraries that they need.
libraries_of() {
  local found
  found=$(ldd "$@")
  if grep 'not found' <<<"$found" >&2; then exit 1; fi
  awk '$2 == "=>" {print $1, $3}' <<<"$found" | sort -u | grep -vE "$of_the_system"
}

# FOLDER FILE ...: the libraries of FILEs go to FOLDER; FILEs find them there. Each gets a name of its own by its content, as two
# libraries of one name cannot be loaded into one process (Python's OpenSSL, another OpenCV).
bundle() {
  local folder=$1 file name path renames=() new needed
  shift
  mkdir -p "$folder"
  local -A names=()
  libraries_of "$@" >"$work/needed"
  while read -r name path; do
    new=${name%%.so*}-$(sha256sum "$path" | cut -c1-8).so${name#*.so}
    names[$name]=$new
    cp -L "$path" "$folder/$new"
    chmod u+w "$folder/$new"
    realpath "$path" >>"$work/bundled"
  done <"$work/needed"
  for file in "$@" "$folder"/*; do
    renames=()
    for needed in $(patchelf --print-needed "$file"); do
      [ -z "${names[$needed]:-}" ] || renames+=(--replace-needed "$needed" "${names[$needed]}")
    done
    # One change a call: patchelf 0.14 confuses the versions of symbols when it makes several.
    [ ${#renames[@]} -eq 0 ] || patchelf "${renames[@]}" "$file"
    patchelf --set-rpath "\$ORIGIN/$(realpath -m --relative-to="$(dirname "$file")" "$folder")" "$file"
    [ "$(dirname "$file")" != "$folder" ] || patchelf --set-soname "$(basename "$file")" "$file"
  done
}

# FOLDER: copyright of each bundled library, and of what is compiled in as headers.
licences() {
  local package
  mkdir -p "$1"
  cp LICENSE "$1/helicarm"
  cp -rL /usr/share/common-licenses "$1"
  { sort -u "$work/bundled" | sed 's,^/usr/lib/,/lib/,; p; s,^/lib/,/usr/lib/,' | xargs dpkg-query -S 2>/dev/null | cut -d: -f1 || true
    printf '%s\n' libdcmtk17 libasio-dev libcli11-dev libeigen3-dev libexpected-dev librandom123-dev nlohmann-json3-dev pybind11-dev
  } | sort -u | while read -r package; do
    cp -L "/usr/share/doc/$package/copyright" "$1/$package"
    dpkg-query -W -f '${Package} ${Version}, source ${source:Package} ${source:Version}\n' "$package" | head -1 >>"$1/VERSIONS"
  done
  cat >"$1/README" <<END
helicarm is under the Apache License 2.0 (the file helicarm). The libraries beside it are those of Debian 12, unchanged but for the
names under which they find each other. VERSIONS lists the packages, whose sources are at https://snapshot.debian.org; the other files
are their copyright notices, which refer to the texts in common-licenses. Parts of SuiteSparse, which Ceres uses, are under the GPL, version 2 or later: whoever passes this archive
on does so under the GPL, version 3.
END
}

root=$work/$name
mkdir -p "$root/bin" "$root/lib" "$root/share/helicarm" "$root/python"
install -s "$build/bin/helicarm" "$root/lib/helicarm"
cp -r "$build/python/helicarm" "$root/python/helicarm"
rm -rf "$root/python/helicarm/__pycache__"
strip --strip-unneeded "$root/python/helicarm/$(basename "$module")"
bundle "$root/lib/bundled" "$root/lib/helicarm" "$root/python/helicarm/$(basename "$module")"
# DCMTK looks for its data dictionary at a fixed place.
dictionary=$(ls /usr/share/libdcmtk*/dicom.dic)
cp "$dictionary" "$root/share/helicarm/"
ln -s ../../share/helicarm/dicom.dic "$root/python/helicarm/dicom.dic"
cat >"$root/bin/helicarm" <<'END'
#!/bin/sh
root=$(dirname "$(dirname "$(readlink -f "$0")")")
export DCMDICTPATH="${DCMDICTPATH:-$root/share/helicarm/dicom.dic}"
exec "$root/lib/helicarm" "$@"
END
chmod +x "$root/bin/helicarm"
tools/cli_reference.py "$build/bin/helicarm" man "$root/share/man/man1"
tools/cli_reference.py "$build/bin/helicarm" completion "$root/share/bash-completion/completions/helicarm"
cp -r README.md CHANGELOG.md LICENSE docs "$root"
cp -r packaging/slicer "$root/share/helicarm/slicer"
licences "$root/licences"

mkdir -p build/archive
rm -f build/archive/*.tar.gz build/archive/*.whl
tar --owner=0 --group=0 --numeric-owner --sort=name -C "$work" -czf "build/archive/$name.tar.gz" "$name"

: >"$work/bundled"
HELICARM_BUILD_FOLDER=$build /usr/bin/python3 -m pip wheel -q --no-build-isolation --no-deps -w "$work/plain" .
rm -rf build/lib build/bdist.*
/usr/bin/python3 -m wheel unpack -d "$work/wheel" "$work"/plain/helicarm-*.whl >/dev/null
wheel=$work/wheel/helicarm-$version
strip --strip-unneeded "$wheel/helicarm/$(basename "$module")"
bundle "$wheel/helicarm.libs" "$wheel/helicarm/$(basename "$module")"
cp "$dictionary" "$wheel/helicarm/"
licences "$wheel/helicarm-$version.dist-info/licences"
sed -i "s/^Tag: \(.*\)-[^-]*$/Tag: \1-$tag/" "$wheel/helicarm-$version.dist-info/WHEEL"
/usr/bin/python3 -m wheel pack -d build/archive "$wheel" >/dev/null
ls build/archive/*
