#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Attacks on the inputs of simulated cases: the answer of helicarm, the actual error and the reported one.

  tools/drills/falsify.py                          prints the table
  tools/drills/falsify.py --doc docs/faults.md     and renews it between the marks of that document
  tools/drills/falsify.py --cases FOLDER           also attacks every case of a folder that has a truth.json (printed only)
  tools/drills/falsify.py --only motion            those whose name contains a word

Each attack changes a copy of a case. A row shows one of the points that the attack changed: that of the largest actual
error if there is a warning, else that of the largest ratio of actual to reported error (95 %). A warning counts only if
the untouched case does not give it, and a point's own warning only for that point. A row is wrong (exit code 1) if an
error exceeds the reported one without a warning, unless the attack is marked "no data can show it" and the result
carries the note that is named there. tools/drills/falsify_labels.py, where it is present, adds the attacks on labels and
phantoms."""
import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

from falsify_attacks import SEEDS
from falsify_cases import ATTACKS, Bench, Row, attacked


def kind_of(folder):
    case = json.loads((folder / "case.json").read_text())
    if case.get("plate") is None:
        return "flat"
    return "tunnels" if any(p["name"] == "FE" for p in case.get("picks", [])) else "accuracy"


def rows_of(bench, folders, word):
    for folder in folders:
        kind = kind_of(folder)
        for entry in ATTACKS:
            if entry[1] != kind or word not in entry[0]:
                continue
            try:
                yield attacked(bench, folder, entry)
            except (ValueError, KeyError, StopIteration, TypeError) as error:  # compressed, no such ball or pick
                print(f"{folder.name}: {entry[0]}: not possible: {error!r}", file=sys.stderr)


def label_rows(bench, word):
    """Of tools/drills/falsify_labels.py, where it is present: (attack, outcome, actual error mm, reported error mm)."""
    try:
        import falsify_labels
    except ImportError:
        return
    for name, outcome, error, claim in falsify_labels.rows(bench.helicarm):
        if word in name:
            yield Row(name, "labels", outcome, error, claim, outcome.startswith("**"))


def table(rows):
    def number(value):
        return "-" if value is None or math.isnan(value) else f"{value:.3f}"
    yield "| attack | case | outcome | actual error mm | reported mm (95 %) | |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for r in rows:
        yield f"| {r.attack} | {r.case} | {r.outcome} | {number(r.error)} | {number(r.claim)} | {r.mark} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--doc", type=Path, help="document whose table between the marks is renewed")
    parser.add_argument("--cases", type=Path, help="folder of further cases with truth.json")
    parser.add_argument("--only", default="", help="attacks whose name contains this")
    parser.add_argument("--helicarm", default=str(Path(__file__).resolve().parents[2] / "build/bin/helicarm"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        bench = Bench(options.helicarm, Path(made))
        simulated = [bench.simulated(kind, SEEDS[kind][0]) for kind in SEEDS]
        rows = list(rows_of(bench, simulated, options.only)) + list(label_rows(bench, options.only))
        lines = list(table(rows))
        print(*lines, sep="\n", flush=True)
        if options.doc:
            text, begin, end = options.doc.read_text(), "<!-- falsify -->", "<!-- /falsify -->"
            options.doc.write_text(text.split(begin)[0] + begin + "\n" + "\n".join(lines) + "\n" + end + text.split(end)[1])
        if options.cases:
            folders = sorted(p.parent for p in options.cases.glob("*/case.json") if (p.parent / "truth.json").exists())
            more = list(rows_of(bench, folders, options.only))
            print("", *table(more), sep="\n")
            rows += more
    wrong = [r for r in rows if r.wrong]
    print(f"\n{len(rows)} rows, {len(wrong)} with an error beyond the reported one and no warning", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
