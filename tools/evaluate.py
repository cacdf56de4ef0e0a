#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs helicarm over a folder of cases with known truth and writes how well it did as a Markdown table.

    tools/evaluate.py CASES [--method best|paper] [--out table.md] [--helicarm build/bin/helicarm]

A case is a folder with case.json and truth.json, as `helicarm simulate` writes them or as rendered by another program
(`pair.targets_world` and per view `calibrator`). Cases are grouped by the letters at the start of their names.
"""

import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent


def balls_of(truth, view):
    """Label -> raw pixel of the image of the ball's centre."""
    if "views" in truth:
        found = next(v for v in truth["views"] if v["name"] == view)
        return {b["name"]: b["raw"] for b in found["balls"]}
    return {b["name"]: b["raw"] for b in truth[view]["calibrator"] if b.get("present", True)}


def places_of(truth):
    """Name -> true place in the calibrator of everything that may be located, the check points of the case first."""
    if "pair" in truth:
        return truth["pair"].get("targets_world") or truth["pair"].get("click_points_world") or {}
    places = {}
    for view in truth["views"]:
        for kind in ("targets", "tunnel_points"):
            places.update({p["name"]: p["xyz_mm"] for p in view[kind]})
    return places


def run(helicarm, case, method):
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([helicarm, "run", case, "--out", out, "--method", method, "--no-report", "--quiet"],
                              capture_output=True, text=True)
        result = pathlib.Path(out) / "result.json"
        return done, json.loads(result.read_text()) if result.exists() else None


def measure(result, truth):
    row = {"balls": 0, "right": 0, "squares": [], "tre": [], "predicted": []}
    for view in result["views"]:
        real = balls_of(truth, view["name"])
        for ball in view["fiducials"]:
            if ball["status"] != "used":
                continue
            row["balls"] += 1
            error = math.dist(ball["uv_raw"], real[ball["label"]]) if ball["label"] in real else math.inf
            if error < 3:
                row["right"] += 1
                row["squares"].append(error**2)
    for point in result["points"]:
        place = places_of(truth).get(point["name"])
        if place and point["xyz_mm"]:
            row["tre"].append(math.dist(point["xyz_mm"], place))
            row["predicted"].append(math.sqrt(sum(point["covariance_mm2"][i][i] for i in range(3))))
    row["fre"] = (result["accuracy"]["fre_mm"] or {}).get("mean")
    row["ms"] = result["timing_ms"]["total"]
    return row


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def text(value, digits=3):
    return "–" if value is None else f"{value:.{digits}f}"


def figures(row):
    """The table's columns of one case."""
    rms = math.sqrt(mean(row["squares"])) if row["squares"] else None
    predicted = math.sqrt(mean([p**2 for p in row["predicted"]])) if row["predicted"] else None
    return [rms, row["fre"], mean(row["tre"]), max(row["tre"], default=None), predicted, row["ms"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("--method", choices=["best", "paper"], default="best")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    arguments = parser.parse_args()

    lines = ["| case | labels right | ball centre px rms | FRE mm | TRE mm mean | TRE mm max | predicted mm rms | ms |",
             "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    groups = {}
    for case in sorted(p.parent for p in arguments.cases.glob("*/truth.json") if (p.parent / "case.json").exists()):
        done, result = run(arguments.helicarm, str(case), arguments.method)
        if result is None or result["status"] != "ok":
            reason = result["failure"]["code"] if result else f"exit {done.returncode}: {done.stderr.strip()}"
            lines.append(f"| {case.name} | {reason} | – | – | – | – | – | – |")
            continue
        row = measure(result, json.loads((case / "truth.json").read_text()))
        numbers = figures(row)
        group = re.match(r"[A-Za-z]*", case.name).group() or case.name
        groups.setdefault(group, []).append((row, numbers))
        lines.append(f"| {case.name} | {row['right']} of {row['balls']} | " +
                     " | ".join(text(n) for n in numbers[:5]) + f" | {text(numbers[5], 0)} |")
    for group, rows in groups.items():
        right, balls = (sum(row[key] for row, _ in rows) for key in ("right", "balls"))
        columns = [mean([numbers[i] for _, numbers in rows]) for i in range(6)]
        columns[3] = max((n[3] for _, n in rows if n[3] is not None), default=None)
        lines.append(f"| **{group}** ({len(rows)}) | {right} of {balls} | " +
                     " | ".join(text(n) for n in columns[:5]) + f" | {text(columns[5], 0)} |")
    table = "\n".join(lines) + "\n"
    if arguments.out:
        arguments.out.write_text(table)
    print(table, end="")
    return 0 if groups else 1


if __name__ == "__main__":
    sys.exit(main())
