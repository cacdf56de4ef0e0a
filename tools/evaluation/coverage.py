#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How often the 95 % bound of a located point holds, by kind of point and receiver, on simulated cases.

  tools/evaluation/coverage.py                       200 points of each group: about 850 cases
  tools/evaluation/coverage.py --points 50           fewer; --jobs N cases at once
  tools/evaluation/coverage.py --doc docs/accuracy.md    renews the table between the marks of that document

Points near the rim are those of cases of tunnels; on a flat panel, of one with pixels of 0.15 mm, whose field they fill.
A case is one cluster: its points share a calibration. The intervals are Wilson's (95 %) with the number of points divided
by the design effect of the clusters."""
import argparse
import json
import math
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from evaluate import places_of

RECEIVERS = {"intensifier": ("accuracy", "ii-9in"), "flat panel": ("flat", "flat-panel")}
KINDS = ("ball target", "cross", "line end", "tunnel end")
PER_CASE = {"ball target": 1, "cross": 2, "line end": 2, "tunnel end": 4}
RIM = 0.75  # of half the image's width, in any view
RIM_PRESETS = {"intensifier": "ii-9in", "flat panel": "paper-sim"}  # about one point of a case is near the rim


def group_of(name):
    return {"T1": "ball target", "T2": "cross", "T3": "cross", "T4": "line end", "T5": "line end"}.get(name, "tunnel end")


def radii_of(truth):
    """Largest distance from the image's centre, as a share of half the width, of each point over the views."""
    radii = {}
    for view in truth["views"]:
        half = (view["image_size"][0] - 1) / 2
        for point in view["targets"] + view["tunnel_points"]:
            radius = math.dist(point["raw"], (half, half)) / half
            radii[point["name"]] = max(radius, radii.get(point["name"], 0))
    return radii


def measured(helicarm, kind, preset, seed):
    """Rows (kind of point, near the rim, held) of one case, or the reason of its refusal."""
    with tempfile.TemporaryDirectory() as made:
        case, out = Path(made) / "case", Path(made) / "out"
        simulate = [helicarm, "simulate", case, "--kind", kind, "--preset", preset, "--seed", seed, "--quiet", "--threads", 1]
        run = [helicarm, "run", case, "--out", out, "--no-report", "--quiet", "--threads", 1]
        for command in (simulate, run):
            done = subprocess.run([str(a) for a in command], capture_output=True, text=True)
            if done.returncode:
                return done.stderr.strip().split("\n")[-1]
        result, truth = json.loads((out / "result.json").read_text()), json.loads((case / "truth.json").read_text())
    places, radii = places_of(truth), radii_of(truth)
    return [(group_of(p["name"]), radii[p["name"]] > RIM, math.dist(p["xyz_mm"], places[p["name"]]) <= p["error_95_mm"])
            for p in result["points"] if p["xyz_mm"] and p["name"] in places and p["name"] in radii]


def interval(clusters):
    """Share held, Wilson's 95 % interval and the design effect; clusters: (held, points) of each case."""
    n, held = sum(c[1] for c in clusters), sum(c[0] for c in clusters)
    p, m = held / n, len(clusters)
    deff = 1.0
    if 0 < p < 1 and m > 1:
        between = m / (m - 1) * sum((x - p * k) ** 2 for x, k in clusters) / n ** 2
        deff = max(1.0, between / (p * (1 - p) / n))
    e, z = n / deff, 1.959964
    centre, half = (p + z * z / (2 * e)) / (1 + z * z / e), z * math.sqrt(p * (1 - p) / e + z * z / (4 * e * e)) / (1 + z * z / e)
    return p, centre - half, centre + half, deff


def line_of(receiver, group, cases):
    clusters = [(sum(held for *_, held in rows), len(rows)) for rows in cases if rows]
    if not clusters:
        return f"| {receiver} | {group} | 0 | 0 | | | |"
    p, low, high, deff = interval(clusters)
    n = sum(c[1] for c in clusters)
    return f"| {receiver} | {group} | {len(clusters)} | {n} | {100 * p:.1f} % | {100 * low:.1f} to {100 * high:.1f} % | {deff:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=200, help="of each group")
    parser.add_argument("--first-seed", type=int, default=1001)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--doc", type=Path)
    parser.add_argument("--helicarm", default=str(Path(__file__).resolve().parents[2] / "build/bin/helicarm"))
    options = parser.parse_args()
    lines = ["| receiver | point | cases | points | bound holds | 95 % interval | design effect |",
             "| --- | --- | --- | --- | --- | --- | --- |"]
    everything, refused, seed = [], [], options.first_seed

    with ThreadPoolExecutor(options.jobs) as pool:
        def submitted(of_kind, preset, count):
            nonlocal seed
            seed += count
            return [pool.submit(measured, options.helicarm, of_kind, preset, seed - count + i) for i in range(count)]

        def accepted(receiver, jobs):
            answers = [job.result() for job in jobs]
            refused.extend(f"{receiver}: {a}" for a in answers if isinstance(a, str))
            return [a for a in answers if not isinstance(a, str)]

        for receiver, (kind, preset) in RECEIVERS.items():
            cases = accepted(receiver, submitted(kind, preset, math.ceil(options.points / PER_CASE["ball target"])) +
                             submitted("tunnels", preset, math.ceil(options.points / PER_CASE["tunnel end"])))
            for group in KINDS:
                lines.append(line_of(receiver, group, [[r for r in rows if r[0] == group] for rows in cases]))
            everything += cases
            at_rim = [[r for r in rows if r[1]] for rows in cases]
            missing = options.points - sum(map(len, at_rim))
            more = accepted(receiver, submitted("tunnels", RIM_PRESETS[receiver], max(0, missing)))
            more = [[r for r in rows if r[1]] for rows in more]
            lines.append(line_of(receiver, f"farther than {RIM:g} of the radius", at_rim + more))
            everything += more
    lines.append(line_of("all", "all", everything))
    print(*lines, sep="\n")
    print(f"\n{len(refused)} refused", *refused, sep="\n", file=sys.stderr)
    if options.doc:
        text, begin, end = options.doc.read_text(), "<!-- coverage-by-point -->", "<!-- /coverage-by-point -->"
        options.doc.write_text(text.split(begin)[0] + begin + "\n" + "\n".join(lines) + "\n" + end + text.split(end)[1])


if __name__ == "__main__":
    main()
