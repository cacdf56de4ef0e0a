#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Table 2's operation with virtual devices, with tunnels of picked balls beside tunnels planned in a CT, by robot and by hand.

  tools/evaluation/operations.py --cases 40 --jobs 2 --rows operations.jsonl --doc docs/devices.md

Each operation is `helicarm operate --cases 1` with a seed of its own: a femur and a tibia, images over DICOM, a tracker over OpenIGTLink, a
UR5 or a drill in a virtual person's hand, over the real protocols. --ct registers both bones of a CT and guides to lines in it. Both
bones move after the images. Seeds are the same for all rows of the table, so that tracker and bones have the same errors.

True: distance of the ball at the tunnel's end from the tool's axis, which holds what robot or person leave. Measured against true: how
far the position that tracker and images state is off, across the tool's axis; predicted: the root mean square that its
covariance states; inside: the true position lies in the stated 95 % ellipse. Interval: of the share, 95 % (Clopper and Pearson).
An operation that a busy machine ends (late messages, an image or poses that do not come in time) is repeated up to twice. Refused: what
ended one then, or at once, such as `uncertain`, two standard deviations over the tolerance.
--rows keeps what is done; the same command goes on after an interruption. Exit code 1 if an end is off by more than 2.5 mm. Needs SciPy."""
import argparse
import functools
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np
from scipy.stats import beta

import evaluation_rows

KINDS = {("robot", "picks"): "robot, picked", ("robot", "ct"): "robot, planned in the CT",
         ("drill", "picks"): "drill by hand, picked", ("drill", "ct"): "drill by hand, planned in the CT"}
MOST_MM = 2.5
MOST_ATTEMPTS = 3
BUSY = ("stale_state", "stale_pose", "no_pose", "robot_stopped", "not_connected", "usage: AP: no image", "usage: LAT: no image")
MARKS = "<!-- operations -->", "<!-- end of the operations -->"


def operation(options, folder, tool, plan, seed):
    """Rows of one operation's ends, or its refusal."""
    for attempt in range(1, MOST_ATTEMPTS + 1):
        rows = carried_out(options, folder, tool, plan, seed)
        if not any(words in rows[0].get("failure", "") for words in BUSY):
            break
    return [{**row, "attempts": row.get("attempts", 1) + attempt - 1} for row in rows]


def carried_out(options, folder, tool, plan, seed):
    out = folder / f"{tool}-{plan}-{seed}"
    shutil.rmtree(out, ignore_errors=True)
    words = [options.program, "operate", "--cases", "1", "--seed", str(seed), "--size", str(options.size), "--threads", "1", "--quiet",
             "--out", str(out), *(["--ct"] if plan == "ct" else []), *(["--by-hand"] if tool == "drill" else [])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    common = {"tool": tool, "plan": plan, "seed": seed}
    if done.returncode:
        row = {**common, "failure": (done.stderr.strip().splitlines() or ["no message"])[-1]}
        shutil.rmtree(out, ignore_errors=True)
        return [row]
    result = json.loads((out / "operate.json").read_text())
    case = result["cases"][0]
    shutil.rmtree(out)
    return [{**common, **{key: end[key] for key in ("name", "true_mm", "off_mm", "predicted_mm", "covered")},
             "attempts": case["attempts"], "replans": case["replans"]} for end in result["ends"]]


def interval(inside, count):
    low = beta.ppf(0.025, inside, count - inside + 1) if inside else 0
    high = beta.ppf(0.975, inside + 1, count - inside) if inside < count else 1
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def table_of(rows):
    lines = ["| tool, plan | operations | ends | true: rms | 95 % | max | measured against true: rms | predicted | inside 95 % | interval |"
             " repeated | refused |", "| --- |" + " ---: |" * 11]
    for kind, words in [*KINDS.items(), (None, "all")]:
        own = [row for row in rows if kind in (None, (row["tool"], row["plan"]))]
        ends = [row for row in own if "true_mm" in row]
        if not ends:
            continue
        true, off = [row["true_mm"] for row in ends], [row["off_mm"] for row in ends]
        inside = sum(row["covered"] for row in ends)
        seeds = {(row["tool"], row["plan"], row["seed"]): row["attempts"] for row in ends}
        lines.append(f"| {words} | {len(seeds)} | {len(ends)} | {rms(true):.2f} | {np.percentile(true, 95):.2f} | {max(true):.2f} | "
                     f"{rms(off):.2f} | {rms([row['predicted_mm'] for row in ends]):.2f} | {inside} ({100 * inside / len(ends):.0f} %) | "
                     f"{interval(inside, len(ends))} | {sum(seeds.values()) - len(seeds)} | {sum('failure' in row for row in own)} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--cases", type=int, default=4, help="operations of each kind (default: 4)")
    parser.add_argument("--seed", type=int, default=1, help="of the first operation (default: 1)")
    parser.add_argument("--size", type=int, default=512, help="pixels per side: 512 or 1024 (default: 512)")
    parser.add_argument("--jobs", type=int, default=1, help="operations at once (default: 1)")
    evaluation_rows.add_options(parser, "ends", keeps=False)
    options = parser.parse_args()
    rows = evaluation_rows.Rows(options.rows, ("tool", "plan", "seed"))
    jobs = [(*kind, seed) for seed in range(options.seed, options.seed + options.cases) for kind in KINDS]
    with tempfile.TemporaryDirectory() as folder:
        rows.gather(functools.partial(operation, options, pathlib.Path(folder)), jobs, options.jobs)
    table = table_of(rows.rows)
    print(table)
    if options.doc:
        evaluation_rows.renew(options.doc, table, *MARKS)
    return any(row.get("true_mm", 0) > MOST_MM for row in rows.rows)


if __name__ == "__main__":
    sys.exit(main())
