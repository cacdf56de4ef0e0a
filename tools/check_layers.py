#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the layers of the source: which module may include which, no include of apps below apps, a licence in every file.

Run from anywhere; prints each breach as file:line and exits 1 if there is one.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Bottom to top: each module with the other modules it may include.
MODULES = {
    "core": "",
    "geometry": "core",
    "phantom": "core geometry",
    "image": "core",
    "xray": "core geometry image",
    "detection": "core geometry image xray",
    "rectification": "core geometry image phantom xray detection",
    "fiducials": "core geometry image phantom xray detection rectification",
    "calibration": "core geometry phantom rectification fiducials",
    "localization": "core geometry image phantom xray detection rectification fiducials calibration",
    "measures": "core geometry phantom calibration",
    "guidance": "core geometry image phantom xray detection rectification fiducials calibration localization",
    "verification": "core geometry image phantom xray detection rectification fiducials calibration localization guidance",
    "volume": "core geometry image xray",
    "registration": "core geometry image phantom xray detection rectification fiducials calibration localization volume",
    "simulation": "core geometry image phantom xray volume",
    "devices": "core geometry image xray",
    "virtual_devices": "core geometry image phantom xray volume simulation devices",
    "session": "core",
    "pipeline": "core geometry image phantom xray detection rectification fiducials calibration localization guidance"
                  " verification volume simulation",
    "report": "core geometry image phantom xray detection rectification fiducials calibration localization guidance"
              " verification volume simulation pipeline",
    "case_registration": "core geometry image phantom xray detection rectification fiducials calibration localization guidance"
                         " volume registration pipeline report",
    "phantom_calibration": "core geometry image phantom xray detection rectification fiducials calibration localization"
                           " pipeline report",
    "operation": "core geometry image phantom xray detection rectification fiducials calibration localization guidance"
                 " verification devices session pipeline report",
    "rehearsal": "core geometry image phantom xray volume simulation devices virtual_devices session pipeline operation"
                 " guidance verification report",
    "study": "core geometry image phantom xray detection rectification fiducials calibration localization guidance"
             " verification volume simulation pipeline report",
}
FOR_TESTS = {"core", "simulation"}

SOURCES = {".h", ".cc", ".py"}
LICENCE = "SPDX-License-Identifier: Apache-2.0"
INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]')


def includes(path):
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if found := INCLUDE.match(line):
            yield number, found.group(1)


def breaches_of_layers(module, path):
    allowed = {module, *MODULES[module].split()}
    if path.stem.endswith("_test"):
        allowed |= FOR_TESTS
        if list(MODULES).index(module) > list(MODULES).index("virtual_devices"):
            allowed.add("virtual_devices")
    for number, included in includes(path):
        parts = included.split("/")
        if "apps" in parts or included.startswith("cli/"):
            yield f"{path.relative_to(ROOT)}:{number}: src must not include apps ({included})"
        elif parts[0] == "helicarm" and parts[1] not in allowed:
            yield f"{path.relative_to(ROOT)}:{number}: {module} must not include {parts[1]} ({included})"
        elif ".." in parts:
            yield f"{path.relative_to(ROOT)}:{number}: includes are relative to src/, without .. ({included})"


def breaches():
    for folder in sorted((ROOT / "src" / "helicarm").iterdir()):
        if not folder.is_dir():
            continue
        if folder.name not in MODULES:
            yield f"{folder.relative_to(ROOT)}: not a module of {pathlib.Path(__file__).name}"
            continue
        for path in sorted(p for p in folder.rglob("*") if p.suffix in SOURCES):
            yield from breaches_of_layers(folder.name, path)
    for top in ("src", "apps", "tools", "tests", "benchmarks", "fuzz", "python"):
        for path in sorted(p for p in (ROOT / top).rglob("*") if p.suffix in SOURCES):
            if LICENCE not in "\n".join(path.read_text(encoding="utf-8").splitlines()[:2]):
                yield f"{path.relative_to(ROOT)}:1: the line \"{LICENCE}\" is missing"


if __name__ == "__main__":
    found = list(breaches())
    print("\n".join(found), file=sys.stderr, end="\n" if found else "")
    sys.exit(1 if found else 0)
