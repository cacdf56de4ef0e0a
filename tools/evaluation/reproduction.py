#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renews the tables and figures of docs/reproduction.md, the paper's experiments.

    tools/evaluation/reproduction.py [--seed 1] [--only operation]

The figures that are X-ray images need Pillow.
"""

import argparse
import csv
import functools
import json
import math
import shutil
import subprocess
import tempfile
from pathlib import Path

from evaluate import renew

ROOT = Path(__file__).resolve().parents[2]
STUDY_FIGURES = {"number": "5.svg", "uniformity": "6.svg", "location": "7.svg", "biplane": "table-1.svg",
                 "calibration": "14.svg", "rectification": "9-11.svg", "design": "design.svg"}


def figure(name):
    return ROOT / "docs" / f"paper-{name}"


def study(options, name, *more):
    """The table and the JSON that the command writes."""
    return written(options.helicarm, options.seed, name, *more)


def output(helicarm, *arguments):
    return subprocess.run([helicarm, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


@functools.lru_cache
def written(helicarm, seed, name, *more):
    with tempfile.TemporaryDirectory() as out:
        subprocess.run([helicarm, "study", name, "--seed", str(seed), "--out", out, "--quiet", *more],
                       check=True)
        if name in STUDY_FIGURES and more in ((), ("--surface", "helix")):
            shutil.copy(Path(out) / f"{name}.svg", figure(STUDY_FIGURES[name]))
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


def balls_and_tracker(options):
    """Mean errors of the biplane calibrator by its number of balls and the tracker's noise in rotation."""
    balls, degrees = (8, 12, 32), (0, 0.05, 0.1, 0.2, 0.3)
    cells = [("fre", "ray", "FRE"), ("on_biplane", "ray", "on the biplane"), ("centre", "intersection", "centre of UDCSC"),
             ("on_udcsc", "intersection", "on UDCSC")]
    yield "| balls | tracker, degrees | " + " | ".join(head for *_, head in cells) + " |"
    yield "| ---: | ---: |" + " ---: |" * len(cells)
    printed = None
    for number in balls:
        for angle in degrees:
            rows, _ = study(options, "biplane", "--balls", str(number), "--tracker-deg", str(angle))
            found = {(row["points"], row["measure"]): row for row in rows if row["calibrator"] == "biplane"}
            chosen = [found[points, measure] for points, measure, _ in cells]
            printed = [f"{float(row['printed_mean']):.2f}" for row in chosen]
            yield f"| {number} | {angle} | " + " | ".join(f"{float(row['mean']):.2f}" for row in chosen) + " |"
    yield "| published | | " + " | ".join(printed) + " |"


def biplane_images(options):
    """Table 1's biplane half from images, and Fig. 13: the first test's images with both calibrators."""
    with tempfile.TemporaryDirectory() as out:
        output(options.helicarm, "study", "biplane-images", "--seed", options.seed, "--out", out, "--quiet")
        result = json.loads(Path(out, "biplane-images.json").read_text())
        output(options.helicarm, "run", f"{out}/biplane-case", "--out", f"{out}/run", "--quiet")
        beside([opened(f"{out}/run/{view}_overlay.png") for view in ("AP", "LAT")], figure("13.jpg"), 560)
    yield "| points | by | max | min | mean | RMS |"
    yield "| --- | --- | ---: | ---: | ---: | ---: |"
    for row in result["rows"]:
        for key, name in (("printed_mm", "published"), ("paper_mm", "paper method"), ("best_mm", "best method")):
            values = " | ".join(f"{row[key][kind]:.2f}" for kind in ("max", "min", "mean", "rms"))
            yield f"| {POINTS[row['points']]} | {name} | {values} |"


def biplane(options):
    rows, _ = study(options, "biplane")
    yield "| calibrator | points | measure | max | min | mean | RMS |"
    yield "| --- | --- | --- | ---: | ---: | ---: | ---: |"
    for row in rows:
        values = [f"{float(row[kind]):.2f}" + (f" ({float(row['printed_' + kind]):.2f})" if row["printed_" + kind] else "")
                  for kind in ("max", "min", "mean", "rms")]
        yield f"| {row['calibrator']} | {row['points']} | {row['measure']} | " + " | ".join(values) + " |"


BENCH = ("--tolerance", "0.2", "--click", "1")
POINTS = {"fre": "FRE", "centre": "centre", "on_udcsc": "on UDCSC", "targets": "five targets", "whole": "all 17 points"}


def calibration(options):
    ideal, bench = (study(options, "calibration", *more)[1]["rows"] for more in ((), BENCH))
    text = lambda row: " | ".join("" if row[kind] is None else f"{row[kind]:.2f}" for kind in ("max", "min", "mean", "rms"))  # noqa: E731
    yield "| points | by | max | min | mean | RMS |"
    yield "| --- | --- | ---: | ---: | ---: | ---: |"
    for row, same in zip(ideal, bench):
        name = POINTS.get(row["points"], row["points"])
        if row["points"] in POINTS:
            yield f"| {name} | published | {text(row['printed_mm'])} |"
        yield f"| {name} | paper method | {text(row['paper_mm'])} |"
        yield f"| {name} | paper method, bench | {text(same['paper_mm'])} |"
        yield f"| {name} | best method | {text(row['best_mm'])} |"
        yield f"| {name} | best method, bench | {text(same['best_mm'])} |"


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


def grids(options):
    """100 intensifiers, each with one grid at another distance; crossings against their true places."""
    yield ("| mm from the receiver | images | crossings in the field | of these found | error px: mean | largest | "
           "rectified px: mean | largest | largest within the dots |")
    yield "| --- |" + " ---: |" * 8
    bands = {"25 to 66": [], "67 to 108": [], "109 to 150": [], "all": []}
    for number in range(100):
        distance = 25 + number * 37 % 126
        image = grid_image(options.helicarm, 100 * options.seed + number, distance)
        bands[list(bands)[(distance - 25) // 42]].append(image)
        bands["all"].append(image)
    for band, images in bands.items():
        errors = [error for image in images for error in image["errors"]]
        rectified = [error for image in images for error in image["rectified"]]
        within = [error for image in images for error in image["within"]]
        yield (f"| {band} | {len(images)} | {sum(i['in_field'] for i in images)} | {sum(i['found'] for i in images)} | "
               f"{sum(errors) / len(errors):.3f} | {max(errors):.3f} | {sum(rectified) / len(rectified):.3f} | "
               f"{max(rectified):.2f} | {max(within):.2f} |")


def grid_image(helicarm, seed, distance):
    """Errors of the crossings found in one simulated image, px."""
    call = functools.partial(output, helicarm)
    with tempfile.TemporaryDirectory() as folder:
        call("simulate", folder, "--kind", "grid", "--seed", seed, "--distance", distance, "--quiet")
        call("rectify", f"{folder}/PLATE.dcm", "--plate", f"{folder}/plate.json", "--out", folder, "--quiet")
        map_ = json.loads(Path(folder, "map.json").read_text())
        crossings = json.loads(call("rectify", f"{folder}/GRID.dcm", "--map", f"{folder}/map.json", "--test-grid", 20,
                                    "--json"))["crossings"]
        truth = json.loads(Path(folder, "truth.json").read_text())["views"][1]["crosses"]
    low, high = map_["hull"]
    nearest = [min(truth, key=lambda cross: math.dist(cross["raw"], found["uv_raw"])) for found in crossings]
    seen = {cross["name"] for cross in truth if cross["visibility"] in ("clear", "hidden")}
    return {"in_field": len(seen),
            "found": len(seen & {cross["name"] for cross in nearest}),
            "errors": [math.dist(cross["raw"], found["uv_raw"]) for cross, found in zip(nearest, crossings)],
            "rectified": [found["rectified_error_px"] for found in crossings],
            "within": [found["rectified_error_px"] for found in crossings
                       if all(l <= x <= h for l, x, h in zip(low, found["uv"], high))]}


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
    columns = [result[kind][end] for kind in ("table", "in_xrays") for end in ("start", "end")]
    yield "| mm | true distance: start points | end points | Eq. 17: start points | end points | published: start | end |"
    yield "| --- |" + " ---: |" * 6
    for name, printed in paper.items():
        yield f"| {name} | " + " | ".join(f"{column[name]:.2f}" for column in columns) + f" | {printed[0]} | {printed[1]} |"
    every = result["table"]["all"]
    attempts = ", ".join(str(case["attempts"]) for case in result["cases"])
    yield (f"| all {every['n']}: mean {every['mean']:.2f}, RMS {every['rms']:.2f}, predicted "
           f"{result['predicted_rms_mm']:.2f}; {result['covered']} within their 95 % ellipses; attempts per case: {attempts} "
           "| | | | | | |")


def drawings(options):
    """Figs. 1, 4 and 8."""
    call = functools.partial(output, options.helicarm)
    call("phantom", "export", "--plate", "--svg", figure("1.svg"), "--quiet")
    call("phantom", "design", "--knee", "60,58.33", "--svg", figure("4.svg"), "--quiet")
    call("phantom", "export", "--svg", figure("8.svg"), "--quiet")


def plate_stages(options):
    """Fig. 2."""
    with tempfile.TemporaryDirectory() as folder:
        output(options.helicarm, "simulate", folder, "--seed", 3, "--quiet")
        output(options.helicarm, "rectify", f"{folder}/AP.dcm", "--plate", "plate48", "--method", "paper", "--stages",
               "--out", f"{folder}/out", "--quiet")
        part = (250, 60, 762, 572)  # of 1024 pixels a side; the edges are enlarged
        beside([opened(f"{folder}/out/stage-{name}.png").resize((1024, 1024)).crop(part)
                for name in ("raw", "median", "edges", "circles", "inpainted")], figure("2.jpg"), 320)


def overlays(options):
    """Fig. 12 (calibrator and check targets), Figs. 16 and 17 (balls at the tunnels' ends, plan, tool)."""
    for kind, name in (("accuracy", "12.jpg"), ("tunnels", "16-17.jpg")):
        with tempfile.TemporaryDirectory() as folder:
            output(options.helicarm, "simulate", f"{folder}/case", "--kind", kind, "--seed", 3, "--quiet")
            output(options.helicarm, "run", f"{folder}/case", "--out", f"{folder}/out", "--quiet")
            beside([opened(f"{folder}/out/{view}_overlay.png") for view in ("AP", "LAT")], figure(name), 560)


def grid_panels(options):
    """Fig. 9 b and c: crossings (x) and ideal positions (squares) in the raw image, crossings in the rectified one."""
    from PIL import ImageDraw
    with tempfile.TemporaryDirectory() as folder:
        call = functools.partial(output, options.helicarm)
        call("simulate", folder, "--kind", "grid", "--seed", 3, "--distance", 45, "--quiet")
        call("rectify", f"{folder}/PLATE.dcm", "--plate", f"{folder}/plate.json", "--out", folder, "--quiet")
        crossings = json.loads(call("rectify", f"{folder}/GRID.dcm", "--map", f"{folder}/map.json", "--test-grid", 20,
                                    "--json"))["crossings"]
        call("rectify", f"{folder}/GRID.dcm", "--map", f"{folder}/map.json", "--out", folder, "--quiet")
        panels = [pixels_of(f"{folder}/GRID.dcm"), pixels_of(f"{folder}/rectified.dcm")]
    for panel, place in zip(panels, ("uv_raw", "uv")):
        pen = ImageDraw.Draw(panel)
        for crossing in crossings:
            u, v = crossing[place]
            pen.line((u - 9, v - 9, u + 9, v + 9), fill="#ff4040", width=3)
            pen.line((u - 9, v + 9, u + 9, v - 9), fill="#ff4040", width=3)
            if place == "uv_raw":
                u, v = crossing["ideal_uv_raw"]
                pen.rectangle((u - 11, v - 11, u + 11, v + 11), outline="#30c0ff", width=3)
    beside(panels, figure("9.jpg"), 560)


def opened(path):
    from PIL import Image
    return Image.open(path).convert("RGB")


def pixels_of(dicom, side=1024):
    """An image that the program wrote: uncompressed 16-bit pixels end the file."""
    from array import array
    from PIL import Image
    values = array("H", Path(dicom).read_bytes()[-2 * side * side:])
    most = max(values)
    return Image.frombytes("L", (side, side), bytes(round(255 * (value / most) ** 0.5) for value in values)).convert("RGB")


def beside(images, path, side):
    from PIL import Image
    sheet = Image.new("RGB", (side * len(images), side))
    for i, image in enumerate(images):
        sheet.paste(image.resize((side, side), Image.LANCZOS), (side * i, 0))
    sheet.save(path, quality=80, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    parser.add_argument("--only", help="renew one table: number, uniformity, ..., operation")
    options = parser.parse_args()
    page = ROOT / "docs/reproduction.md"
    for table in (number, uniformity, location, design, rectification, rectification_ratios, grids, calibration, biplane,
                  balls_and_tracker, biplane_images, operation):
        if options.only in (None, table.__name__):
            renew(page, table.__name__, list(table(options)))
    for draw in (drawings, plate_stages, grid_panels, overlays):
        if options.only in (None, draw.__name__):
            draw(options)
    print(f"renewed {page.relative_to(ROOT)}, seed {options.seed}")


if __name__ == "__main__":
    main()
