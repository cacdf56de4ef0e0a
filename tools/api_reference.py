#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reference pages from what the code says of itself: tools/api_reference.py python|cpp OUT

python: docstrings of the package helicarm, which must be importable. cpp: the /// comments of the headers.
"""
import inspect
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
CPP_MODULE = re.compile(r"foreach\(module IN ITEMS ([\w\s]+)\)")
DECLARATION_ENDS = re.compile(r"[;{]\s*(///<.*)?$")


def python_entry(name, thing, level):
    lines = [f"{'#' * level} `{name}`", ""]
    doc = inspect.getdoc(thing) or ""
    signature, _, rest = doc.partition("\n")
    if isinstance(thing, property):
        return f"- `{name}`: {doc.replace(chr(10), ' ')}" if doc else f"- `{name}`"
    if "(" in signature and "->" in signature:
        lines += ["```", re.sub(r"helicarm\._helicarm\.|_helicarm\.", "", signature), "```", ""]
        doc = rest.strip()
    return "\n".join([*lines, "```text" if "\n  " in doc else "", doc, "```" if "\n  " in doc else ""])


def python_reference():
    import helicarm
    from helicarm import figures
    lines = ["# Python package", "", inspect.getdoc(helicarm), ""]
    for name in sorted(n for n in helicarm.__all__ if n != "figures"):
        thing = getattr(helicarm, name)
        lines += [python_entry(name, thing, 2), ""]
        if not inspect.isclass(thing):
            continue
        members = {m: v for m, v in vars(thing).items() if not m.startswith("_")}
        lines += [python_entry(m, v, 3) for m, v in members.items() if isinstance(v, property)] + [""]
        for member, value in members.items():
            if not isinstance(value, property):
                lines += [python_entry(f"{name}.{member}", getattr(thing, member), 3), ""]
    lines += ["## `helicarm.figures`", "", inspect.getdoc(figures), ""]
    for name, thing in vars(figures).items():
        if inspect.isfunction(thing) and not name.startswith("_"):
            lines += [f"### `figures.{name}`", "", "```", f"{name}{inspect.signature(thing)}", "```", "",
                      inspect.getdoc(thing), ""]
    return "\n".join(lines) + "\n"


def documented(header):
    """[(comment, declaration)] of a header's /// comments at namespace level."""
    found, comment, declaration = [], [], []
    for line in header.read_text(encoding="utf-8").splitlines():
        if declaration:
            declaration.append(line)
        elif line.startswith("///"):
            comment.append(line.removeprefix("///").strip())
            continue
        elif comment and line.strip():
            declaration = [line]
        if declaration:
            opened = declaration[0].startswith(("struct", "class", "enum"))
            done = line.startswith("};") or line.endswith("};") or (opened and line.endswith(";") and len(declaration) == 1) \
                if opened else DECLARATION_ENDS.search(line)
            if done:
                text = "\n".join(declaration)
                if not opened:
                    text = re.sub(r"\s*\{[^{}]*$", ";", text)
                found.append((" ".join(comment), text))
                comment, declaration = [], []
        elif not line.strip():
            comment = []
    return found


def cpp_reference():
    modules = CPP_MODULE.search((ROOT / "CMakeLists.txt").read_text()).group(1).split()
    lines = ["# C++ library", "", "Modules bottom to top, each a target `helicarm::NAME` and a folder of headers. Made from the headers'",
             "comments by `tools/api_reference.py`.", ""]
    for module in modules:
        folder = ROOT / "src" / "helicarm" / module
        lines += [f"## {module}", ""]
        for header in sorted(folder.rglob("*.h")):
            if header.stem.endswith("_test") or not (entries := documented(header)):
                continue
            lines += [f"### `{header.relative_to(ROOT / 'src')}`", ""]
            for comment, declaration in entries:
                lines += [comment.replace("<", "&lt;"), "", "```cpp", declaration, "```", ""]
    return "\n".join(lines) + "\n"


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in ("python", "cpp"):
        sys.exit(__doc__)
    out = pathlib.Path(sys.argv[2])
    out.write_text(python_reference() if sys.argv[1] == "python" else cpp_reference(), encoding="utf-8")


if __name__ == "__main__":
    main()
