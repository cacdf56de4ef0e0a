#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps words that the documents do not use any more out of them; what stands between backticks
or markers is not read."""

import re
import subprocess
import sys
from pathlib import Path

REPLACED = {
    r"pictures?": "image",
    r"shots?": "acquisition, image",
    r"sieve[sd]?": "hypothesis filter",
    r"sightings?": "image point",
    r"strewn": "uniform outliers",
    r"theatre": "simulated scene",
    r"house": "modules",
    r"belie[sd]?": "inconsistent with",
    r"at odds": "inconsistent",
    r"doubts?": "uncertainty, warning",
    r"lessons?": "what is added to the C-arm history",
    r"mend(?:s|ed|ing)?": "corrected, fixed",
    r"misprints?": "typographical error",
    r"nobody": "name the subject",
    r"hung up|hangs up": "disconnected",
    r"tells? apart|told apart": "distinguished by",
    r"drawn to": "shrunk to",
    r"by and by": "gradually",
}
PATTERN = re.compile(r"(?<![\w.-])(" + "|".join(REPLACED) + r")(?![\w-])", re.IGNORECASE)
CODE = re.compile(r"`[^`]*`|\]\([^)]*\)")
MARKER = re.compile(r"<!-- (/?)[\w-]+ -->")  # around what a script renews


def breaches(path):
    fenced = generated = False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if marker := MARKER.match(line):
            generated = not marker[1]
        elif line.lstrip().startswith("```"):
            fenced = not fenced
        elif not fenced and not generated:
            for found in PATTERN.finditer(CODE.sub("", line)):
                term = next(use for word, use in REPLACED.items() if re.fullmatch(word, found[1], re.IGNORECASE))
                yield f'{path}:{number}: "{found[1]}": write {term}'


def main():
    root = Path(__file__).resolve().parent.parent
    files = subprocess.run(["git", "ls-files", "*.md"], cwd=root, check=True, capture_output=True, text=True).stdout
    found = [breach for name in files.split() for breach in breaches(root / name)]
    print("\n".join(found) if found else "no replaced words in the documents")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
