#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps replaced words out of documents, comments, messages and identifiers.

Markdown: text outside code spans, fenced blocks and generated tables. C++ and Python: comments, docstrings and string
literals that contain a space, and the subwords of identifiers. Prints FILE:LINE: "WORD": REPLACEMENT; exits 1 if any.
"""

import io
import re
import subprocess
import sys
import tokenize
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
    r"beats?": "heartbeat",
    r"the print": "the publication",
    r"as printed": "as published",
    r"printed recipe": "published recipe, paper method",
    r"dearest": "slowest, most expensive",
    r"lock-outs?": "whether other peers are served",
    r"told to end": "stopped",
}
IN_SOURCES = {
    r"desk": "controller",
    r"believe[sd]?": "accept, assume",
    r"in vain": "timeout",
    r"misses (?:its|their|the)": "distance, residual",
    r"comes? out otherwise|came out otherwise": "differs on recomputation",
    r"virtual (?:operating )?rooms?": "virtual devices",
    r"false (?:blobs?|discs?)": "outliers",
    r"error bars?": "confidence region",
}
SUBWORDS = {
    "theatre": "scene",
    "sieve": "hypothesis filter",
    "sighting": "image point",
    "sightings": "image points",
    "desk": "controller",
    "strewn": "uniform",
    "belie": "inconsistent",
    "belied": "inconsistent",
    "picture": "image",
    "pictures": "images",
}
# Fixed by a JSON key, an option or the answers of virtual-or.
ALLOWED_NAMES = {"picture"}
ALLOWED_TEXTS = re.compile(r'shot |f?"shot (?:AP|LAT|\{view\})"')

PATTERN = re.compile(r"(?<![\w.-])(" + "|".join(REPLACED) + r")(?![\w-])", re.IGNORECASE)
SOURCE_PATTERN = re.compile(r"(?<![\w.-])(" + "|".join(REPLACED | IN_SOURCES) + r")(?![\w-])", re.IGNORECASE)
CODE = re.compile(r"`[^`]*`|\]\([^)]*\)")
MARKER = re.compile(r"<!-- (/?)[\w-]+ -->")  # around what a script renews
CPP = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | R"(?P<delimiter>[^(\s]*)\((?P<raw>.*?)\)(?P=delimiter)"
      | "(?P<text>(?:[^"\\\n]|\\.)*)"
      | '(?:[^'\\\n]|\\.)+'
      | (?P<include>\#\s*include[^\n]*)
      | (?P<number>\d(?:'?[\w.])*)
      | (?P<name>[A-Za-z_]\w*)""",
    re.VERBOSE | re.DOTALL,
)
SUBWORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def term_of(word, replaced):
    return next(use for pattern, use in replaced.items() if re.fullmatch(pattern, word, re.IGNORECASE))


def in_document(text):
    """(line, word, replacement) of a Markdown text."""
    fenced = generated = False
    for number, line in enumerate(text.splitlines(), 1):
        if marker := MARKER.match(line):
            generated = not marker[1]
        elif line.lstrip().startswith("```"):
            fenced = not fenced
        elif not fenced and not generated:
            for found in PATTERN.finditer(CODE.sub("", line)):
                yield number, found[1], term_of(found[1], REPLACED)


def parts_of_cpp(text):
    """(line, kind, content); kind is prose or name."""
    line = at = 0
    for token in CPP.finditer(text):
        line, at = line + text.count("\n", at, token.start()), token.start()
        kind = token.lastgroup
        if kind == "name":
            yield line + 1, "name", token[0]
        elif kind == "comment":
            yield line + 1, "prose", token[0]
        elif kind == "text" and " " in token["text"]:
            yield line + 1, "prose", token["text"].replace(r"\n", "  ")
        elif token["raw"] is not None:
            yield line + 1, "prose", token["raw"]


def parts_of_python(text):
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield token.start[0], "name", token.string
        elif token.type == tokenize.COMMENT or token.type == tokenize.STRING and " " in token.string:
            yield token.start[0], "prose", token.string


def in_source(parts):
    """(line, word, replacement) of a source's parts."""
    for number, kind, content in parts:
        if kind == "prose" and not ALLOWED_TEXTS.fullmatch(content):
            plain = re.sub(r'`[^`]*`|\\?"\w+\\?"', lambda quoted: re.sub(r"[^\n]", " ", quoted[0]), content)
            for found in SOURCE_PATTERN.finditer(plain):
                yield (number + plain.count("\n", 0, found.start()), found[1],
                       term_of(found[1], REPLACED | IN_SOURCES))
        elif kind == "name" and content not in ALLOWED_NAMES:
            for subword in SUBWORD.findall(content):
                if subword.lower() in SUBWORDS:
                    yield number, content, SUBWORDS[subword.lower()]


def breaches(root, name):
    text = (root / name).read_text(encoding="utf-8")
    if name.endswith(".md"):
        found = in_document(text)
    elif name.endswith(".py"):
        found = in_source(parts_of_python(text))
    else:
        found = in_source(parts_of_cpp(text))
    for number, word, use in found:
        yield f'{name}:{number}: "{word}": write {use}'


def main():
    root = Path(__file__).resolve().parent.parent
    names = subprocess.run(["git", "ls-files", "*.md", "*.h", "*.cc", "*.py"], cwd=root, check=True,
                           capture_output=True, text=True).stdout.split()
    found = [breach for name in names if name != "tools/check_words.py" for breach in breaches(root, name)]
    print("\n".join(found) if found else "no replaced words in documents and sources")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
