#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renews the tables of docs/accuracy.md: the estimators against the statistical bound, and the effect of wrong
assumptions about a ball's image.

    tools/evaluation/accuracy.py [--groups 10000] [--balls 1000] [--seed 1] [--only limit|centres]
"""

import argparse
import csv
import subprocess
import tempfile
from pathlib import Path

from evaluate import renew

ROOT = Path(__file__).resolve().parents[2]
PLACES = ["centre", "50 mm lateral", "100 mm lateral", "150 mm axial"]


WORDS = ("model", "place", "point", "group", "situation")


def rows_of(helicarm, study, groups, seed):
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([helicarm, "study", study, "--groups", str(groups), "--seed", str(seed), "--out", out],
                       check=True, stdout=subprocess.DEVNULL)
        with open(Path(out) / f"{study}.csv", newline="") as file:
            return [{key: value if key in WORDS else float(value) if value else None for key, value in row.items()}
                    for row in csv.DictReader(file)]


def spread(values, digits):
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def efficiency(rows):
    yield "| model | balls | error over bound | position of the largest ratio | DLT over bound | failures |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for model in dict.fromkeys(row["model"] for row in rows):
        for balls in (8, 12, 20):
            some = [row for row in rows if row["model"] == model and row["balls"] == balls]
            worst = max(some, key=lambda row: row["ratio"])
            yield (f"| {model} | {balls} | {spread([row['ratio'] for row in some], 2)} | {worst['place']}, "
                   f"{worst['point']} pixel, {worst['sigma_px']:g} px | {spread([row['dlt_ratio'] for row in some], 2)} | "
                   f"{sum(row['failures'] for row in some) / 8:.0f} of {sum(row['trials'] for row in some) / 8:.0f} |")


def coverage(rows):
    yield "| model | noise px | covered by the 95 % ellipsoid: inside (centre, 50 mm) | outside (100 mm, 150 mm) |"
    yield "| --- | --- | --- | --- |"
    for model in dict.fromkeys(row["model"] for row in rows):
        for sigma in (0.1, 0.5, 1.0, 2.34):
            some = [row for row in rows if row["model"] == model and row["sigma_px"] == sigma]
            parts = [[100 * row["coverage"] for row in some if row["place"] in places]
                     for places in (PLACES[:2], PLACES[2:])]
            yield f"| {model} | {sigma:g} | {spread(parts[0], 1)} % | {spread(parts[1], 1)} % |"


def far(rows):
    yield "| noise px | bound mm | with the machine's history mm | DLT mm | DLT over history |"
    yield "| --- | --- | --- | --- | --- |"
    for row in rows:
        if row["model"] == "machine" and row["balls"] == 12 and row["place"] == PLACES[3] and row["point"] == "noisy":
            yield (f"| {row['sigma_px']:g} | {row['bound_mm']:.3f} | {row['error_mm']:.3f} | {row['dlt_mm']:.3f} | "
                   f"{row['dlt_mm'] / row['error_mm']:.1f} |")


def centres(rows):
    def number(value, digits, unit=""):
        return "" if value is None else f"{value:.{digits}f}{unit}"

    yield ("| | | rms error px | over bound | bias px | predicted sigma px | error over sigma | covered at 95 % | "
           "fitted radius | refused |")
    yield "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    for row in rows:
        radius = "" if row["radius_bias"] is None else f"{100 * row['radius_bias']:+.1f} %"
        yield (f"| {row['group']} | {row['situation']} | {number(row['rms_px'], 3)} | {number(row['ratio'], 2)} | "
               f"{number(row['bias_px'], 3)} | {number(row['sigma_px'], 3)} | {number(row['z'], 2)} | "
               f"{number(100 * row['coverage'], 1, ' %')} | {radius} | {row['refused']:.0f} of {row['balls']:.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", type=int, default=10000, help="number of trials per setting of the limit study")
    parser.add_argument("--balls", type=int, default=1000, help="number of balls per situation of the centres study")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=["limit", "centres"])
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    options = parser.parse_args()
    page = ROOT / "docs/accuracy.md"
    if options.only != "centres":
        rows = rows_of(options.helicarm, "limit", options.groups, options.seed)
        for marker, lines in (("efficiency", efficiency(rows)), ("coverage", coverage(rows)), ("far", far(rows))):
            renew(page, marker, list(lines))
        print(f"renewed {page.relative_to(ROOT)} from {options.groups} trials of each setting, seed {options.seed}")
    if options.only != "limit":
        renew(page, "centres", list(centres(rows_of(options.helicarm, "centres", options.balls, options.seed))))
        print(f"renewed {page.relative_to(ROOT)} from {options.balls} balls of each situation, seed {options.seed}")


if __name__ == "__main__":
    main()
