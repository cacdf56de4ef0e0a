#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds targets with ninja, and says the share that is done and about how long the rest takes.

  tools/build_progress.py FOLDER TARGET ...

An object that does not exist yet counts by the bytes of the sources that it compiles. The time left follows from the
objects that are done; where a compiler cache serves many, it is too long at first.
"""
import os
import pathlib
import re
import subprocess
import sys
import time

STEP = re.compile(r"\[(\d+)/(\d+)\] (.*)")
OBJECT = re.compile(r"(\S+)/CMakeFiles/([^/\s]+\.dir)/(\S+)\.o$")
UNIT_BYTES = 20_000  # what the headers of a unit count


def weight(folder, path):
    """Of an object: bytes of the sources that its unit includes."""
    words = OBJECT.match(path)
    if not words:
        return UNIT_BYTES
    unit = folder / words[1] / "CMakeFiles" / words[2] / words[3]
    if not unit.is_file():
        file = folder.parent / words[1] / words[3]
        return UNIT_BYTES + (file.stat().st_size if file.is_file() else 0)
    included = map(pathlib.Path, re.findall(r'#include "(.+?)"', unit.read_text()))
    return UNIT_BYTES + sum(file.stat().st_size for file in included if file.is_file())


def missing_objects(folder, targets):
    """The weights of the objects that the targets need and that do not exist yet."""
    commands = subprocess.run(["ninja", "-C", str(folder), "-t", "commands", *targets], capture_output=True, text=True).stdout
    paths = set(re.findall(r" -o (\S+\.o) ", commands))
    return {path: weight(folder, path) for path in paths if not (folder / path).exists()}


def in_words(seconds):
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def main():
    folder, targets = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    missing = missing_objects(folder, targets)
    total = sum(missing.values())
    on_screen = sys.stderr.isatty()
    begin, done = time.monotonic(), 0
    with subprocess.Popen(["ninja", "-C", str(folder), *targets], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env={**os.environ, "NINJA_STATUS": "[%f/%t] "}) as build:
        for line in build.stdout:
            step = STEP.match(line)
            if not step:
                if not line.startswith(("ninja: Entering", "ninja: no work")):
                    print(("\n" if on_screen else "") + line, end="", file=sys.stderr)
                continue
            done += missing.pop(step[3].rsplit(" ", 1)[-1], 0)
            share = done / total if total else int(step[1]) / max(1, int(step[2]))
            left = (time.monotonic() - begin) * (1 - share) / max(share, 1e-9)
            rest = f", about {in_words(left)} left" if 0.05 < share < 1 else ""
            text = f"[{100 * share:3.0f} %{rest}] {step[3]}"
            if on_screen:
                print(f"\r\x1b[K{text[:100]}", end="", file=sys.stderr, flush=True)
            else:
                print(text, file=sys.stderr, flush=True)
    if on_screen and total:
        print(file=sys.stderr)
    sys.exit(build.returncode)


if __name__ == "__main__":
    main()
