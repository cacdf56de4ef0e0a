#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renews the tables of docs/reproduction.md, the paper's experiments.

    tools/reproduction.py [--seed 1] [--only operation]
"""

import argparse
import csv
import functools
import json
import subprocess
import tempfile
from pathlib import Path

from evaluate import renew

ROOT = Path(__file__).resolve().parent.parent


def study(options, name, *more):
    """The table and the JSON that the command writes."""
    return written(options.helicarm, options.seed, name, *more)


@functools.lru_cache
def written(helicarm, seed, name, *more):
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([helicarm, "study", name, "--seed", str(seed), "--out", out, "--quiet", *more],
                       check=True)
        with open(Path(out) / f"{name}.csv", newline="") as file:
            return list(csv.DictReader(file)), json.loads((Path(out) / f"{name}.json").read_text())


def number(options):
    rows, _ = study(options, "number")
    columns = [("fre", "calibration_pixels"), ("fre", "fresh_noise"), ("fre", "exact"), ("tre_ball", "fresh_noise"),
               ("tre_cone", "fresh_noise"), ("tre_centre", "fresh_noise")]
    median = {(row["n"], row["sigma"], row["error"], row["reading"]): float(row["median"]) for row in rows}
    heads = [f"{error}, {reading.replace('_', ' ')}" for error, reading in columns]
    yield "| balls | " + " | ".join(heads) + " | fre_max, fresh noise, sigma as rms_distance |"
    yield "| --- |" + " ---: |" * (len(columns) + 1)
    for n in dict.fromkeys(row["n"] for row in rows):
        values = [median[n, "std", *column] for column in columns] + [median[n, "rms_distance", "fre_max", "fresh_noise"]]
        yield f"| {n} | " + " | ".join(f"{value:.3f}" for value in values) + " |"


def uniformity(options):
    _, result = study(options, "uniformity")
    yield "| targets | pixels | one draw: Pearson | Spearman | mean of 100 draws: Pearson | Spearman |"
    yield "| --- | --- | ---: | ---: | ---: | ---: |"
    found = {entry["tre"]: entry for entry in result["correlations"]}
    for pixels in ("fresh_noise", "exact"):
        for place in ("ball", "cone", "centre"):
            name = f"tre_{place}_{pixels}"
            values = [found[before + name][kind] for before in ("", "mean_") for kind in ("pearson", "spearman")]
            yield f"| {place} | {pixels.replace('_', ' ')} | " + " | ".join(f"{value:.2f}" for value in values) + " |"


def location(options):
    results = [("random", study(options, "location")[1]), ("udcsc", study(options, "location", "--calibrator", "udcsc")[1])]
    distances = [entry["distance_mm"] for entry in results[0][1]["by_distance"]]
    yield "| balls | " + " | ".join(f"at {distance:g} mm" for distance in distances) + " | Spearman with distance |"
    yield "| --- |" + " ---: |" * (len(distances) + 1)
    for name, result in results:
        values = [f"{entry['fresh_noise']:.2f} ({entry['exact']:.2f})" for entry in result["by_distance"]]
        yield f"| {name} | " + " | ".join(values) + f" | {result['spearman_with_distance']:.2f} |"


def biplane(options):
    rows, _ = study(options, "biplane")
    yield "| calibrator | points | measure | max | min | mean | RMS |"
    yield "| --- | --- | --- | ---: | ---: | ---: | ---: |"
    for row in rows:
        values = [f"{float(row[kind]):.2f}" + (f" ({float(row['printed_' + kind]):.2f})" if row["printed_" + kind] else "")
                  for kind in ("max", "min", "mean", "rms")]
        yield f"| {row['calibrator']} | {row['points']} | {row['measure']} | " + " | ".join(values) + " |"


def calibration(options):
    _, result = study(options, "calibration")
    yield "| points | by | max | min | mean | RMS |"
    yield "| --- | --- | ---: | ---: | ---: | ---: |"
    for row in result["rows"]:
        for key, name in (("printed_mm", "published"), ("paper_mm", "paper method"), ("best_mm", "best method")):
            yield f"| {row['points']} | {name} | " + " | ".join(f"{row[key][kind]:.2f}" for kind in ("max", "min", "mean", "rms")) + " |"


def rectification(options):
    _, result = study(options, "rectification")
    yield "| mm from the receiver | raw: mean | largest | paper method: mean | largest | best method: mean | largest |"
    yield "| --- |" + " ---: |" * 6
    for row in result["rows"]:
        if row["similarity"] == "nine":
            values = [row[image][figure] for image in ("raw", "paper", "best") for figure in ("mean_px", "max_px")]
            yield f"| {row['distance_mm']:g} | " + " | ".join(f"{v['mean']:.2f} ± {v['sd']:.2f}" for v in values) + " |"


def rectification_ratios(options):
    _, result = study(options, "rectification")
    yield "| ideal grid, raw | ideal grid, rectified | rectified by | mean error | largest error |"
    yield "| --- | --- | --- | ---: | ---: |"
    words = {"nine": "nine crosses", "all": "all crosses", "paper": "paper method", "best": "best method"}
    for row in result["ratios"]:
        names = [words[row[key]] for key in ("raw_similarity", "rectified_similarity", "picture")]
        values = [f"{row[kind]['mean']:.2f} ({row[kind]['least']:.2f} to {row[kind]['most']:.2f})" for kind in ("mean", "max")]
        yield "| " + " | ".join(names + values) + " |"


def design(options):
    yield "| surface | design | udcsc | best of the random sets | the best that keeps the rules | their median |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: |"
    for surface in ("helix", "cone", "dome"):
        _, result = study(options, "design", "--surface", surface)
        ruled = result["best_random_that_keeps_rules"]
        yield (f"| {surface} | {result['design']['tre_mm']:.3f} | {result['udcsc']['tre_mm']:.3f} | "
               f"{result['best_random']['tre_mm']:.3f} | {ruled['tre_mm'] if ruled else float('nan'):.3f} | "
               f"{result['median_random_mm']:.3f} |")


def operation(options):
    """Over sockets and in real time: two runs differ by a few 0.01 mm."""
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([options.helicarm, "operate", "--cases", "4", "--seed", str(options.seed), "--out", out, "--quiet"],
                       check=True)
        result = json.loads((Path(out) / "operate.json").read_text())
    paper = {"max": (1.55, 1.89), "min": (0.34, 0.19), "mean": (0.81, 0.88), "sd": (0.45, 0.55), "rms": (0.93, 1.04)}
    start, end = result["table"]["start"], result["table"]["end"]
    yield "| mm | start points | end points | published: start | end |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    for name, (printed_start, printed_end) in paper.items():
        yield f"| {name} | {start[name]:.2f} | {end[name]:.2f} | {printed_start} | {printed_end} |"
    every = result["table"]["all"]
    yield (f"| all {every['n']}: mean {every['mean']:.2f}, RMS {every['rms']:.2f}, predicted "
           f"{result['predicted_rms_mm']:.2f}; {result['covered']} within their 95 % ellipses | | | | |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    parser.add_argument("--only", help="renew one table: number, uniformity, ..., operation")
    options = parser.parse_args()
    page = ROOT / "docs/reproduction.md"
    for table in (number, uniformity, location, biplane, calibration, rectification, rectification_ratios, design,
                  operation):
        if options.only in (None, table.__name__):
            renew(page, table.__name__, list(table(options)))
    print(f"renewed {page.relative_to(ROOT)}, seed {options.seed}")


if __name__ == "__main__":
    main()
