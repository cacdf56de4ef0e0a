#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Unpacks archive and wheel on a minimal Debian system, which has none of the libraries, and runs them there:
# tools/check_archive.sh [FOLDER_OF_ARCHIVES]
# Needs root, and a Debian mirror (MIRROR=http://...). SUITE=trixie: on another release; the Python package where its version is
# that of the build.
set -euo pipefail
cd "$(dirname "$0")/.."

archives=$(realpath "${1:-build/archive}")
mirror=${MIRROR:-http://deb.debian.org/debian}
tools/install_packages.sh archive
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mmdebstrap --quiet --variant=apt "${SUITE:-bookworm}" "$root" "$mirror"
cp /etc/resolv.conf "$root/etc/resolv.conf"
# With /proc, by which a program finds its libraries; it is mounted for this command only.
inside() {
  unshare --mount sh -c 'root=$1; shift; mount --bind /proc "$root/proc" && exec chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    LC_ALL=C.UTF-8 HOME=/root DEBIAN_FRONTEND=noninteractive "$@"' sh "$root" "$@"
}

if inside dpkg-query -W -f '${Package}\n' | grep -E '^lib(opencv|dcmtk|ceres|fmt|tiff|charls|openjp2|png)'; then
  echo "The system has libraries that the archive should bring along." >&2
  exit 1
fi
# To any place, and called by a link.
mkdir "$root/a place"
tar -xzf "$archives"/helicarm-*.tar.gz -C "$root/a place"
ln -s "/a place/$(ls "$root/a place")/bin/helicarm" "$root/usr/bin/helicarm"
inside helicarm --version
inside sh -c 'cd /tmp && helicarm demo --quiet && test -s helicarm-demo/result/report.html && echo "demo: report written"'
inside sh -c 'cd /tmp && helicarm export helicarm-demo/case --as opencv --out exported --quiet && ls exported/*.yml >/dev/null'
inside sh -c 'cd /tmp && helicarm import "$(ls exported/*.yml | head -1)" --json >/dev/null && echo "OpenCV: camera read back"'
# Ceres.
inside sh -c 'cd /tmp && views="" && for i in 0 1 2 3 4 5; do views="$views --view V$i:$((25 * i - 60)),$((10 * (i % 2)))"; done
  helicarm simulate phantom --seed 3 --size 512 --no-knee $views --quiet
  helicarm phantom measure phantom --distance P1,P3=113.1 --out measured --quiet && echo "phantom: measured"'

inside sh -c 'apt-get update -qq && apt-get install -y -qq -o Dpkg::Use-Pty=0 --no-install-recommends python3-numpy python3-venv >/dev/null'
if ! ls "$archives"/helicarm-*-"$(inside python3 -c 'import sys; print("cp%d%d" % sys.version_info[:2])')"-*.whl >/dev/null 2>&1; then
  echo "Program works on a minimal system; no wheel for its Python." >&2
  exit 0
fi
cp "$archives"/helicarm-*.whl "$root/tmp"
cat >"$root/tmp/points.py" <<'END'
import sys, helicarm
assert sys.argv[1] in helicarm.__file__, helicarm.__file__
helicarm.simulate_case("/tmp/by-python", seed=3, size=512)
result = helicarm.run_case("/tmp/by-python")
assert len(result.points) > 0
print(f"{sys.argv[1]}: {len(result.points)} points, {helicarm.__version__}")
END
inside sh -c "cd '/a place'/* && PYTHONPATH=\$PWD/python python3 /tmp/points.py 'a place'"
inside sh -c 'python3 -m venv --system-site-packages /tmp/venv && /tmp/venv/bin/pip install -q --no-index --no-deps /tmp/helicarm-*.whl'
inside /tmp/venv/bin/python /tmp/points.py venv
echo "Archive and wheel work on a minimal system." >&2
