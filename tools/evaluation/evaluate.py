#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs `helicarm run` on every case of a folder that has a truth.json, and compares labels, fiducial centres, FRE and TRE
with it.

  tools/evaluation/evaluate.py FOLDER [--method best|paper ...] [--helicarm build/bin/helicarm]
  tools/evaluation/evaluate.py --simulate 4 --readme README.md     simulates cases first, and renews the README's tables
  tools/evaluation/evaluate.py FOLDER --rendered docs/accuracy.md  renews the table of cases rendered by another program

Cases are sub-folders. Groups go by the first letter of a case's name. TRE is the mean distance of the located check
points (T1, T2, ...) from their true positions; of the tunnels' balls FS, FE, TS, TE if there are no such points or the
case's name begins with n. Folders of kind grid have a separate table: the distance of the crossings from the ideal grid,
raw and rectified by the image of the plate."""
import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path


def distance(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)))


def places_of(truth):
    """Name -> true position in the calibrator's frame, from either layout of truth.json."""
    pair = truth.get("pair", truth)
    places = {}
    for key in ("targets_world", "click_points_world", "targets_in_calibrator", "points_in_calibrator"):
        value = pair.get(key) or {}
        if isinstance(value, dict):
            places.update({k: v for k, v in value.items() if isinstance(v, list)})
    for view in truth.get("views", []):  # layout of helicarm simulate
        for point in view["targets"] + view["tunnel_points"]:
            places[point["name"]] = point["xyz_mm"]
    return places


def balls_of(truth, view):
    of_view = truth.get(view) or next((v for v in truth.get("views", []) if v.get("name") == view), None)
    balls = (of_view or {}).get("calibrator") or (of_view or {}).get("balls") or []
    return {b.get("name", b.get("label")): b["raw"] for b in balls if b.get("raw")}


def is_covered(error, covariance):
    """Whether the 95 % ellipsoid of a covariance contains an error (chi-square, three degrees of freedom)."""
    a, b, c = covariance
    cross = lambda p, q: [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
    dot = lambda p, q: sum(x * y for x, y in zip(p, q))
    solution = [dot(cross(b, c), error), dot(cross(c, a), error), dot(cross(a, b), error)]
    return dot(error, solution) / dot(a, cross(b, c)) < 7.8147


def judge(folder, result, truth):
    squares, wrong = [], 0
    for view in result["views"]:
        true_balls = balls_of(truth, view["name"])
        for ball in view["fiducials"]:
            if ball["status"] == "used" and ball["label"] in true_balls:
                error = distance(ball["uv_raw"], true_balls[ball["label"]])
                squares.append(error * error)
                wrong += error > 5
    places = places_of(truth)
    checks = [p["name"] for p in result["points"] if p["name"][0] == "T" and p["name"][1:].isdigit()]
    if folder.name.startswith("n") or not checks:
        checks = ["FS", "FE", "TS", "TE"]
    located = [p for p in result["points"] if p["name"] in checks and p["name"] in places and p["xyz_mm"]]
    errors = [distance(p["xyz_mm"], places[p["name"]]) for p in located]
    covered = sum(is_covered([x - y for x, y in zip(p["xyz_mm"], places[p["name"]])], p["covariance_mm2"])
                  for p in located)
    return {
        "wrong": wrong,
        "balls": len(squares),
        "ball_px": math.sqrt(sum(squares) / len(squares)) if squares else math.nan,
        "fre": result["accuracy"]["fre_mm"]["mean"],
        "tre": sum(errors) / len(errors) if errors else math.nan,
        "tre_max": max(errors, default=math.nan),
        "n": len(errors),
        "covered": covered,
        "ms": result["timing_ms"]["total"],
    }


def run(helicarm, folder, method):
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([helicarm, "run", str(folder), "--out", out, "--method", method, "--no-report", "--quiet"],
                              capture_output=True, text=True)
        path = Path(out) / "result.json"
        if not path.exists():
            return None, done.stderr.strip()
        return json.loads(path.read_text()), done.stderr.strip()


def simulate(helicarm, folder, count):
    """Cases of every kind, `count` seeds each: a(ccuracy), t(unnels), f(lat panel), h(ard: with faults)."""
    kinds = {"a": ["--kind", "accuracy"], "t": ["--kind", "tunnels"], "f": ["--kind", "flat"],
             "h": ["--kind", "tunnels", "--fault", "wires", "--fault", "decoys", "--fault", "mirrored"]}
    for letter, options in kinds.items():
        for seed in range(1, count + 1):
            subprocess.run([helicarm, "simulate", str(folder / f"{letter}{seed:02}"), "--seed", str(seed), "--quiet",
                            *options], check=True)


def evaluate(helicarm, cases, method):
    """Rows of the cases, and their results by group."""
    lines = ["| case | labels wrong | balls | fiducial centre px rms | FRE mm mean | TRE mm mean | TRE mm max | points | in 95 % | ms |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    groups = defaultdict(list)
    for case in cases:
        result, message = run(helicarm, case, method)
        if result is None or result["status"] != "ok":
            code = result["failure"]["code"] if result else message
            lines.append(f"| {case.name} | refused: {code} | | | | | | | | |")
            continue
        row = judge(case, result, json.loads((case / "truth.json").read_text()))
        groups[case.name[0]].append(row)
        lines.append(f"| {case.name} | {row['wrong']} | {row['balls']} | {row['ball_px']:.3f} | {row['fre']:.4f} | "
                     f"{row['tre']:.4f} | {row['tre_max']:.4f} | {row['n']} | {row['covered']} | {row['ms']:.0f} |")
    return lines, groups


def evaluate_grids(helicarm, grids):
    """Rows of the grid images: distance of the crossings from the ideal grid, raw and rectified (Eq. 15)."""
    yield "| grid | image | crossings | raw px mean | raw px max | rectified px mean | rectified px max |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    call = lambda *arguments: subprocess.run([helicarm, "rectify", *map(str, arguments)],  # noqa: E731
                                             capture_output=True, text=True)
    for grid in grids:
        with tempfile.TemporaryDirectory() as out:
            done = call(grid / "PLATE.dcm", "--plate", grid / "plate.json", "--out", out, "--quiet")
            truth = json.loads((grid / "truth.json").read_text())
            images = [view["name"] for view in truth["views"]] if "views" in truth else list(truth)
            for name in (name for name in images if name != "PLATE"):
                if done.returncode == 0:
                    measured = call(grid / f"{name}.dcm", "--map", Path(out) / "map.json", "--test-grid", "20", "--json")
                if done.returncode or measured.returncode:
                    yield f"| {grid.name} | {name} | refused: {(done if done.returncode else measured).stderr.strip()} | | | | |"
                    continue
                answer = json.loads(measured.stdout)
                raw, rectified = answer["raw"], answer["rectified"]
                yield (f"| {grid.name} | {name} | {answer['n']} | {raw['mean_px']:.3f} | {raw['max_px']:.3f} | "
                       f"{rectified['mean_px']:.3f} | {rectified['max_px']:.3f} |")


GROUP_HEAD = ["| method | group | cases | labels wrong | fiducial centre px rms | FRE mm mean | TRE mm mean | TRE mm max | in 95 % ellipsoid |",
              "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]


def group_lines(method, groups):
    for name, rows in sorted(groups.items()):
        mean = lambda key: sum(r[key] for r in rows) / len(rows)  # noqa: E731
        yield (f"| {method} | {name} | {len(rows)} | {sum(r['wrong'] for r in rows)} | {mean('ball_px'):.3f} | "
               f"{mean('fre'):.4f} | {mean('tre'):.4f} | {max(r['tre_max'] for r in rows):.4f} | "
               f"{sum(r['covered'] for r in rows)} of {sum(r['n'] for r in rows)} |")


def renew(readme, marker, lines):
    text = readme.read_text()
    begin, end = f"<!-- {marker} -->", f"<!-- /{marker} -->"
    head, rest = text.split(begin)
    readme.write_text(head + begin + "\n" + "\n".join(lines) + "\n" + end + rest.split(end)[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--simulate", type=int, metavar="N", help="simulate N cases of each kind instead of a folder")
    parser.add_argument("--readme", type=Path, help="file whose tables between the accuracy and speed markers are renewed")
    parser.add_argument("--rendered", type=Path, help="file whose table between the rendered markers is renewed")
    parser.add_argument("--method", action="append", choices=["best", "paper"])
    parser.add_argument("--helicarm", default=str(Path(__file__).resolve().parents[2] / "build/bin/helicarm"))
    options = parser.parse_args()
    if (options.folder is None) == (options.simulate is None):
        parser.error("give a folder, or --simulate N")
    with tempfile.TemporaryDirectory() as made:
        folder = options.folder or Path(made)
        if options.simulate:
            simulate(options.helicarm, folder, options.simulate)
        cases = sorted(p.parent for p in folder.glob("*/case.json") if (p.parent / "truth.json").exists())
        grids = sorted(p.parent for p in folder.glob("*/GRID*.dcm") if (p.parent / "truth.json").exists())
        grids = list(dict.fromkeys(grids))
        grid_lines = list(evaluate_grids(options.helicarm, grids)) if grids else []
        if grids:
            print("", *grid_lines, sep="\n")
        if not cases and grids:
            return
        if not cases:
            sys.exit(f"{folder}: no sub-folder with truth.json and either case.json or GRID.dcm")
        summary, speed = list(GROUP_HEAD), ["| method | cases | median ms | slowest ms |", "| --- | --- | --- | --- |"]
        for method in options.method or ["best", "paper"]:
            lines, groups = evaluate(options.helicarm, cases, method)
            print(f"\n### --method {method}\n", *lines, sep="\n")
            summary += group_lines(method, groups)
            times = sorted(row["ms"] for rows in groups.values() for row in rows)
            speed.append(f"| {method} | {len(times)} | {times[len(times) // 2]:.0f} | {times[-1]:.0f} |")
    print("", *summary, "", *speed, sep="\n")
    if options.rendered:
        renew(options.rendered, "rendered", summary + [""] * bool(grid_lines) + grid_lines)
    if options.readme:
        renew(options.readme, "accuracy", summary)
        renew(options.readme, "speed", speed)


if __name__ == "__main__":
    main()
