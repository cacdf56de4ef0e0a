#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""CPU seconds (user + system) that a cold build takes, without ccache: tools/build_time.py [TARGET ...]

Builds into build/cold, which it deletes first, and prints the slowest translation units. Elapsed time depends on what
else runs; CPU seconds hardly do. TARGET: helicarm-first-demo (what ./run shows first), helicarm, all, ...
"""
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
LOG = "HELICARM_BUILD_TIME_LOG"


def launch(command):
    code = subprocess.run(command).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(os.environ[LOG], "a") as log:
        log.write(f"{used.ru_utime + used.ru_stime:.2f} {command[-1]}\n")
    return code


def main():
    if os.environ.get(LOG):
        return launch(sys.argv[1:])
    folder = ROOT / "build" / "cold"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    environment = {**os.environ, LOG: str(folder / "times.txt")}
    subprocess.run(["cmake", "--preset", "release", "-B", folder, f"-DCMAKE_CXX_COMPILER_LAUNCHER={__file__}"], cwd=ROOT,
                   check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", folder, "--target", *(sys.argv[1:] or ["helicarm-first-demo"])], check=True,
                   env=environment, stdout=sys.stderr)
    units = [line.split() for line in (folder / "times.txt").read_text().splitlines()]
    for seconds, unit in sorted(units, key=lambda one: -float(one[0]))[:12]:
        print(f"{float(seconds):7.1f} s  {re.sub(r'.*/(src|apps|python|CMakeFiles)/', '', unit)}")
    print(f"{sum(float(seconds) for seconds, _ in units):7.1f} s  compiling {len(units)} units")


if __name__ == "__main__":
    sys.exit(main())
