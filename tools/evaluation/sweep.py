#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs of `simulate --run` through `sweep`, against their truth: a table.

  tools/evaluation/sweep.py                        eight seeds of each C-arm and field (about an hour on two cores)
  tools/evaluation/sweep.py --seeds 2 --frames 40  fewer
  tools/evaluation/sweep.py --doc docs/sweep.md    renews the table between the marks of that document

A source lies within its region where its error e and covariance C in sweep.json give e' C^-1 e <= 7.815 (three degrees of
freedom, 95 %). Frames of a run share the phantom's and the path's errors: the interval is Wilson's with each run as a
cluster. Needs NumPy."""
import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy

from coverage import interval
from evaluate import renew

GROUPS = [("flat panel, phantom alone", ["--kind", "flat", "--no-knee"]), ("flat panel, knee", ["--kind", "flat"]),
          ("intensifier with plate, phantom alone", ["--no-knee"]), ("intensifier with plate, knee", [])]
LIMIT = 7.815


def run_of(helicarm, options, seed, a):
    """Rows (error mm, within, reprojection px, wrong) of the accepted frames, frames refused, and seconds of sweep."""
    with tempfile.TemporaryDirectory() as made:
        case, out = Path(made) / "case", Path(made) / "out"
        simulate = [helicarm, "simulate", case, "--run", a.frames, "--arc", a.arc, "--flex", a.flex, "--jitter", a.jitter,
                    "--size", a.size, "--seed", seed, "--quiet", *options]
        begin = 0
        for command in (simulate, [helicarm, "sweep", case, "--out", out, "--quiet"]):
            begin = time.monotonic()
            done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
            if done.returncode:
                return [], a.frames, time.monotonic() - begin, done.stderr.strip().split("\n")[-1]
        seconds = time.monotonic() - begin
        truth, found = json.loads((case / "truth.json").read_text()), json.loads((out / "sweep.json").read_text())
    rows = []
    for frame in found["frames"]:
        if not frame["projection"]:
            continue
        error = numpy.subtract(frame["source_mm"], truth["views"][frame["frame"] - 1]["source_mm"])
        held = error @ numpy.linalg.solve(numpy.array(frame["source_covariance_mm2"]), error) <= LIMIT
        rows.append((numpy.linalg.norm(error), bool(held), frame["reprojection_rms_px"]))
    return rows, len(found["frames"]) - len(rows), seconds, None


def line_of(name, runs):
    rows = [row for run in runs for row in run[0]]
    refused, seconds = sum(run[1] for run in runs), numpy.mean([run[2] for run in runs])
    if not rows:
        return f"| {name} | {len(runs)} | 0 | {refused} | | | | | {seconds:.0f} |"
    p, low, high, _ = interval([(sum(row[1] for row in run[0]), len(run[0])) for run in runs if run[0]])
    errors, pixels = [row[0] for row in rows], [row[2] for row in rows]
    return (f"| {name} | {len(runs)} | {len(rows)} | {refused} | {numpy.median(errors):.2f} | {numpy.percentile(errors, 95):.2f} | "
            f"{100 * p:.1f} % ({100 * low:.0f} to {100 * high:.0f}) | {numpy.median(pixels):.3f} | {seconds:.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helicarm", default="build/bin/helicarm")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first-seed", type=int, default=101)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--arc", type=float, default=200)
    parser.add_argument("--flex", type=float, default=3)
    parser.add_argument("--jitter", type=float, default=0.03)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--doc", type=Path)
    a = parser.parse_args()
    lines = [f"{a.seeds} runs each of {a.frames} images of {a.size} x {a.size} over {a.arc:g} degrees, sag up to {a.flex:g} mm, jitter "
             f"{a.jitter:g} mm per axis.", "",
             "| C-arm and field | runs | accepted images | refused | source error, median (mm) | 95 % of images (mm) | "
             "within the 95 % region | reprojection, median (px) | seconds a run |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, options in GROUPS:
        runs = []
        for seed in range(a.first_seed, a.first_seed + a.seeds):
            runs.append(run_of(a.helicarm, options, seed, a))
            if runs[-1][3]:
                print(f"{name}, seed {seed}: {runs[-1][3]}", file=sys.stderr, flush=True)
        lines.append(line_of(name, runs))
        print(lines[-1], file=sys.stderr, flush=True)
    table = "\n".join(lines)
    print(table)
    if a.doc:
        renew(a.doc, "sweep.py", [table])


if __name__ == "__main__":
    main()
