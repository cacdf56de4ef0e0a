#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the layers of the source: which module may include which, no include of apps or studies below them, a licence in every file.

Run from anywhere; prints each breach as file:line and exits 1 if there is one.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent

USES = re.compile(r"\bhelicarm_module\((\w+)[^)]*?\bUSES ([a-z_\s]+)")
TEST_USES = re.compile(r"\bTEST_USES ([a-z_\s]+)")


def modules():
    """Folders of src/helicarm bottom to top, as the root's CMakeLists.txt lists them, each with the folders it may include:
    what its own CMakeLists.txt USES, and what these use."""
    listed = re.search(r"foreach\(module IN ITEMS([^)]*)\)", (ROOT / "CMakeLists.txt").read_text())[1].split()
    of_target, used = {}, {}
    for folder in listed:
        used[folder] = set()
        for path in sorted((ROOT / "src" / "helicarm" / folder).rglob("CMakeLists.txt")):
            for target, names in USES.findall(path.read_text()):
                of_target[target] = folder
                used[folder] |= set(names.split())
    allowed = {}
    for folder in listed:
        direct = {of_target.get(name, name) for name in used[folder]} - {folder}
        allowed[folder] = direct.union(*(allowed.get(other, set()) for other in direct))
    return allowed


MODULES = modules()
FOR_TESTS = {"core", "simulation"}

SOURCES = {".h", ".cc", ".py"}
LICENCE = "SPDX-License-Identifier: Apache-2.0"
INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]')


def includes(path):
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if found := INCLUDE.match(line):
            yield number, found.group(1)


def breaches_of_layers(module, path):
    allowed = {module, *MODULES[module]}
    if path.stem.endswith("_test"):
        allowed |= FOR_TESTS
        for cmake in (ROOT / "src" / "helicarm" / module).rglob("CMakeLists.txt"):
            for names in TEST_USES.findall(cmake.read_text()):
                allowed |= set(names.split())
        if list(MODULES).index(module) > list(MODULES).index("virtual_devices"):
            allowed.add("virtual_devices")
    for number, included in includes(path):
        parts = included.split("/")
        if "apps" in parts or parts[0] in ("cli", "studies"):
            yield f"{path.relative_to(ROOT)}:{number}: src must not include apps or studies ({included})"
        elif parts[0] == "helicarm" and parts[1] not in allowed:
            yield f"{path.relative_to(ROOT)}:{number}: {module} must not include {parts[1]} ({included})"
        elif ".." in parts:
            yield f"{path.relative_to(ROOT)}:{number}: includes are relative to src/, without .. ({included})"


def breaches_of_order():
    """A module that uses one below it in the list, and rows of CONTRIBUTING.md that are not the list."""
    listed = list(MODULES)
    for at, module in enumerate(listed):
        for later in sorted(MODULES[module] - set(listed[:at])):
            yield f"src/helicarm/{module}/CMakeLists.txt: USES {later}, which is not above it in the root's CMakeLists.txt"
    rows = re.findall(r"^\| `(\w+)/(?:\w+/)?` \|", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE)
    if list(dict.fromkeys(rows)) != listed:
        yield f"CONTRIBUTING.md: the table of modules differs from the list in CMakeLists.txt: {' '.join(listed)}"


def breaches():
    yield from breaches_of_order()
    for folder in sorted((ROOT / "src" / "helicarm").iterdir()):
        if not folder.is_dir():
            continue
        if folder.name not in MODULES:
            yield f"{folder.relative_to(ROOT)}: not in the list of modules of CMakeLists.txt"
            continue
        for path in sorted(p for p in folder.rglob("*") if p.suffix in SOURCES):
            yield from breaches_of_layers(folder.name, path)
    for top in ("src", "studies", "apps", "tools", "tests", "benchmarks", "fuzz", "python"):
        for path in sorted(p for p in (ROOT / top).rglob("*") if p.suffix in SOURCES):
            if LICENCE not in "\n".join(path.read_text(encoding="utf-8").splitlines()[:2]):
                yield f"{path.relative_to(ROOT)}:1: the line \"{LICENCE}\" is missing"


if __name__ == "__main__":
    found = list(breaches())
    print("\n".join(found), file=sys.stderr, end="\n" if found else "")
    sys.exit(1 if found else 0)
