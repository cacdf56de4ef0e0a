#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Widths of balls and a wire in reconstructions of simulated runs, by plastimatch's FDK (`sweep --check FDK`): a table.

  tools/evaluation/sweep_reconstruction.py                        four seeds of each C-arm and field
  tools/evaluation/sweep_reconstruction.py --seeds 1 --frames 60  fewer
  tools/evaluation/sweep_reconstruction.py --doc docs/sweep.md    renews the table between the marks of that document

The calibrator is udcsc with a steel wire of 1 mm along its axis. Of a flat panel the cameras of truth.json are compared
too; rectified pixels of an intensifier are not those of its truth. Needs plastimatch."""
import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from evaluate import renew

GROUPS = [("flat panel, phantom alone", ["--kind", "flat", "--no-knee"]), ("flat panel, knee", ["--kind", "flat"]),
          ("intensifier with plate, knee", [])]


def calibrator():
    """Eq. 9 at t = pi/6 + k pi/2, and a wire."""
    balls = []
    for k in range(12):
        t = math.pi / 6 + k * math.pi / 2
        r, z = 60 - 30 * t / (7 * math.pi), 87.5 * t / (7 * math.pi)
        balls.append({"label": f"P{k + 1}", "xyz_mm": [r * math.cos(t), r * math.sin(t), z], "diameter_mm": 4})
    wire = {"name": "wire", "xyz_mm": [12, -9, 25], "kind": "line_end", "diameter_mm": 1, "directions": [[0, 0, 1]],
            "length_mm": 40}
    return {"name": "cone with a wire", "balls": balls, "targets": [wire]}


def true_cameras(case, flat):
    """A file for --against; none of an intensifier."""
    if not flat:
        return []
    truth = json.loads((case / "truth.json").read_text())
    lines = ["view," + ",".join(f"p{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))]
    for view in truth["views"]:
        lines.append(",".join([view["name"], *(repr(x) for row in view["camera"]["projection"] for x in row)]))
    (case / "true.csv").write_text("\n".join(lines) + "\n")
    return ["--against", case / "true.csv"]


def run_of(options, seed, a):
    """`check` of sweep.json, or the reason."""
    with tempfile.TemporaryDirectory() as made:
        case, out = Path(made) / "case", Path(made) / "out"
        (Path(made) / "calibrator.json").write_text(json.dumps(calibrator()))
        simulate = [a.helicarm, "simulate", case, "--run", a.frames, "--arc", a.arc, "--flex", a.flex, "--size", a.size,
                    "--seed", seed, "--calibrator", Path(made) / "calibrator.json", "--quiet", *options]
        for command in (lambda: simulate, lambda: [a.helicarm, "sweep", case, "--out", out, "--check", "FDK", "--quiet",
                                                   *true_cameras(case, "flat" in options)]):
            done = subprocess.run([str(word) for word in command()], capture_output=True, text=True)
            if done.returncode:
                return None, done.stderr.strip().split("\n")[-1]
        found = json.loads((out / "sweep.json").read_text())
    return found["check"], None if found["check"] else found["warnings"][-1]["message"]


def ratios(targets, over, under):
    return [t[over] / t[under] for t in targets if t[over] and t[under]]


def cells(values, percent):
    if not values:
        return " | "
    if percent:
        return f"{100 * (median(values) - 1):+.1f} % | {100 * (max(values, key=lambda x: abs(x - 1)) - 1):+.1f} %"
    return f"{median(values):.2f} | {min(values):.2f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helicarm", default="build/bin/helicarm")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=301)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--arc", type=float, default=200)
    parser.add_argument("--flex", type=float, default=3)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--doc", type=Path)
    a = parser.parse_args()
    lines = [f"{a.seeds} runs each of {a.frames} images of {a.size} x {a.size} over {a.arc:g} degrees, sag up to {a.flex:g} mm.", "",
             "| C-arm and field | target | number | against the true cameras, median | farthest | ideal circle, times as wide, "
             "median | least |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for name, options in GROUPS:
        targets = []
        for seed in range(a.first_seed, a.first_seed + a.seeds):
            check, why = run_of(options, seed, a)
            if not check:
                print(f"{name}, seed {seed}: {why}", file=sys.stderr, flush=True)
                continue
            targets += check["targets"]
        for kind, chosen in (("balls", [t for t in targets if t["diameter_mm"]]), ("wire", [t for t in targets if not t["diameter_mm"]])):
            seen = [t for t in chosen if t["width_mm"]]
            lines.append(f"| {name} | {kind} | {len(seen)} of {len(chosen)} | {cells(ratios(chosen, 'width_mm', 'other_width_mm'), True)} | "
                         f"{cells(ratios(chosen, 'circle_width_mm', 'width_mm'), False)} |")
            print(lines[-1], file=sys.stderr, flush=True)
    table = "\n".join(lines)
    print(table)
    if a.doc:
        renew(a.doc, "sweep_reconstruction.py", [table])


if __name__ == "__main__":
    main()
