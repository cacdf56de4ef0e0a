#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Attacks on the calibrator's file and on the labels: outcome, actual error and reported error of the worst point.

  tools/drills/falsify_labels.py [--cases FOLDER] [--repeat N]     the table of attacks on calibrators' files
  tools/drills/falsify_labels.py --real MAKER --seeds 0-999        labels on real images: MAKER SEED OUT makes a case, whose
                                                            expected.json holds each ball's raw pixel in each view
  tools/drills/falsify_labels.py --printed 0.3 --repeat 100        phantoms whose balls scatter: refusals and coverage

Without --cases, cases are simulated. A row is wrong if the real error exceeds the claim and nothing warns of it, unless
no data can show it and a note says so. `rows(helicarm)` yields (attack, outcome, actual error mm, reported error mm)."""
import argparse
import json
import math
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "evaluation"))
from evaluate import is_covered, places_of  # noqa: E402

HELICARM = str(Path(__file__).resolve().parents[2] / "build/bin/helicarm")


def moved(factors):
    """The file's coordinates times a factor per axis; diameters stay."""
    def change(calibrator, _):
        for ball in calibrator["balls"]:
            ball["xyz_mm"] = [x * f for x, f in zip(ball["xyz_mm"], factors)]
    return change


def whole(factor):
    """Coordinates and diameters times a factor: a wrong unit."""
    def change(calibrator, _):
        moved([factor] * 3)(calibrator, _)
        for ball in calibrator["balls"]:
            ball["diameter_mm"] *= factor
    return change


def scattered(sigma_mm, declared_mm=None):
    def change(calibrator, seed):
        draw = random.Random(f"scatter {seed}")
        for ball in calibrator["balls"]:
            ball["xyz_mm"] = [x + draw.gauss(0, sigma_mm) for x in ball["xyz_mm"]]
        if declared_mm:
            calibrator["tolerance_mm"] = declared_mm
    return change


def one_off(distance_mm):
    def change(calibrator, seed):
        draw = random.Random(f"one off {seed}")
        ball = draw.choice(calibrator["balls"])
        direction = [draw.gauss(0, 1) for _ in range(3)]
        ball["xyz_mm"] = [x + distance_mm * d / math.hypot(*direction) for x, d in zip(ball["xyz_mm"], direction)]
    return change


def relabelled(calibrator, seed):
    draw = random.Random(f"relabelled {seed}")
    a, b = draw.sample(calibrator["balls"], 2)
    a["xyz_mm"], b["xyz_mm"] = b["xyz_mm"], a["xyz_mm"]
    a["diameter_mm"], b["diameter_mm"] = b["diameter_mm"], a["diameter_mm"]


def stated_mirrored(change):
    """The case also states that all images are mirrored."""
    def both(calibrator, seed):
        change(calibrator, seed)
    both.of_views = {"mirrored": True}
    return both


# Name, change, and the note that states what no data can show.
ATTACKS = [
    ("calibrator's file mirrored (x to -x)", moved([-1, 1, 1])),
    ("calibrator's file mirrored (z to -z)", moved([1, 1, -1])),
    ("calibrator's file mirrored (x to -x), and the case states mirrored images", stated_mirrored(moved([-1, 1, 1])),
     "ambiguous_handedness"),
    ("coordinates times 1.02, diameters true", moved([1.02] * 3), "scale_unverified"),
    ("coordinates times 1.1, diameters true", moved([1.1] * 3)),
    ("coordinates times 0.9, diameters true", moved([0.9] * 3)),
    ("coordinates and diameters times 1.02", whole(1.02), "scale_unverified"),
    ("calibrator strained: z times 1.005", moved([1, 1, 1.005])),
    ("calibrator strained: x times 1.003", moved([1.003, 1, 1]), "scale_unverified"),
    ("balls scatter by 0.1 mm, declared", scattered(0.1, 0.1)),
    ("balls scatter by 0.3 mm, declared", scattered(0.3, 0.3)),
    ("balls scatter by 0.1 mm, not declared", scattered(0.1)),
    ("balls scatter by 0.2 mm, not declared", scattered(0.2)),
    ("one ball 1 mm off", one_off(1)),
    ("one ball 3 mm off", one_off(3)),
    ("labels of two balls exchanged in the file", relabelled),
]


def run(helicarm, folder):
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([helicarm, "run", str(folder), "--out", out, "--no-report", "--quiet"],
                              capture_output=True, text=True)
        path = Path(out) / "result.json"
        return json.loads(path.read_text()) if path.exists() else {"failure": {"code": done.stderr.strip()[:80]}}


def attacked(case, target, change, seed):
    """A copy of a case with its calibrator's file changed; images are links."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for file in case.iterdir():
        (shutil.copy(file, target) if file.suffix == ".json" else shutil.copyfile(file, target / file.name))
    described = json.loads((case / "case.json").read_text())
    calibrator = json.loads((case / described["calibrator"]).read_text())
    change(calibrator, seed)
    for view in described["views"]:
        view.update(getattr(change, "of_views", {}))
    (target / "case.json").write_text(json.dumps(described))
    calibrator["name"] = "attacked"  # a built-in's name with other coordinates is warned of anyway
    (target / described["calibrator"]).write_text(json.dumps(calibrator))
    return target


def error_and_claim(result, truth):
    """Of the point whose error exceeds its claim by the largest factor."""
    places = places_of(truth)
    pairs = [(math.dist(p["xyz_mm"], places[p["name"]]), p["error_95_mm"]) for p in result["points"]
             if p["xyz_mm"] and p["name"] in places]
    return max(pairs, key=lambda pair: pair[0] / max(pair[1], 1e-9), default=(math.nan, math.nan))


def kinds(entries):
    """Code and subject of warnings: one of the same code about another point counts as another."""
    return {(w["code"], " ".join(w["message"].split()[:3])) for w in entries}


def judged(result, untouched, truth, unseen):
    if result["failure"]:
        return f"refused: {result['failure']['code']}", math.nan, math.nan
    error, claim = error_and_claim(result, truth)
    new = sorted({code for code, _ in kinds(result["warnings"]) - kinds(untouched["warnings"])})
    if new:
        return "warned: " + ", ".join(new), error, claim
    if error <= claim:
        return "bound holds", error, claim
    if unseen and any(note["code"] == unseen for note in result["notes"]):
        return f"note: {unseen} (no data can show it)", error, claim
    return "**not seen**", error, claim


def simulated(helicarm, folder, seeds=(1, 2)):
    """Of kind tunnels: their points are picked, and no check target gives the attack away."""
    cases = []
    for seed in seeds:
        subprocess.run([helicarm, "simulate", str(folder / f"t{seed}"), "--seed", str(seed), "--kind", "tunnels",
                        "--quiet"], check=True, capture_output=True)
        cases.append(folder / f"t{seed}")
    return cases


def rows_of(helicarm, cases, work, repeat=1):
    for case in cases:
        truth = json.loads((case / "truth.json").read_text())
        untouched = run(helicarm, case)
        for name, change, *note in ATTACKS:
            unseen = note[0] if note else ""
            for seed in range(repeat):
                result = run(helicarm, attacked(case, work / "attacked", change, seed))
                yield f"{name} ({case.name})", *judged(result, untouched, truth, unseen)


def rows(helicarm=HELICARM):
    with tempfile.TemporaryDirectory() as made:
        yield from rows_of(helicarm, simulated(helicarm, Path(made)), Path(made))


def printed(helicarm, cases, work, sigma_mm, declared_mm, repeat):
    """Refusals, and how many points lie in their 95 % ellipsoid."""
    refused, inside, count, errors = Counter(), 0, 0, []
    for case in cases:
        places = places_of(json.loads((case / "truth.json").read_text()))
        for seed in range(repeat):
            result = run(helicarm, attacked(case, work / "attacked", scattered(sigma_mm, declared_mm), seed))
            if result["failure"]:
                refused[result["failure"]["code"]] += 1
                continue
            for point in result["points"]:
                if point["xyz_mm"] and point["name"] in places:
                    error = [x - y for x, y in zip(point["xyz_mm"], places[point["name"]])]
                    errors.append(math.hypot(*error))
                    inside += is_covered(error, point["covariance_mm2"])
                    count += 1
    print(f"scatter {sigma_mm} mm, declared {declared_mm}: {len(cases) * repeat} runs, refused {dict(refused)}, "
          f"{inside} of {count} points in their 95 % ellipsoid, error mean {sum(errors) / max(1, count):.3f} mm")


def real(helicarm, maker, seeds, work):
    """Labels on real images. The distortion map of each plate image is computed once."""
    maps = {}

    def map_of(plate_image, plate):
        key = (plate_image.stat().st_size, plate_image.read_bytes()[-65536:])
        if key not in maps:
            out = work / f"map{len(maps)}"
            subprocess.run([helicarm, "rectify", str(plate_image), "--plate", str(plate), "--out", str(out), "--quiet"],
                           check=True, capture_output=True)
            maps[key] = out / "map.json"
        return maps[key]

    def one(seed):
        folder = work / f"real{seed}"
        subprocess.run([sys.executable, str(maker), str(seed), str(folder)], check=True, capture_output=True)
        expected = json.loads((folder / "expected.json").read_text())
        (folder / "expected.json").unlink()
        case = json.loads((folder / "case.json").read_text())
        for view in case["views"]:
            shutil.copy(map_of(folder / view.pop("plate_image"), folder / "plate.json"), folder / f"{view['name']}.map.json")
            view["map"] = f"{view['name']}.map.json"
        (folder / "case.json").write_text(json.dumps(case))
        result = run(helicarm, folder)
        shutil.rmtree(folder)
        if result["failure"]:
            return seed, "refused", result["failure"]["code"]
        wrong = [f"{view['name']}/{ball['label']}" for view in result["views"] for ball in view["fiducials"]
                 if ball["status"] == "used" and math.dist(ball["uv_raw"], expected[view["name"]][ball["label"]]) > 3]
        return seed, "wrong" if wrong else "right", " ".join(wrong)

    first, _, last = seeds.partition("-")
    numbers = range(int(first), int(last or first) + 1)
    outcomes = [one(numbers[0]), *ThreadPoolExecutor(2).map(one, numbers[1:])]
    for seed, outcome, detail in outcomes:
        if outcome != "right":
            print(seed, outcome, detail)
    print(dict(Counter(outcome for _, outcome, _ in outcomes)))
    return any(outcome == "wrong" for _, outcome, _ in outcomes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=Path, help="folder of cases with truth.json")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--printed", type=float, metavar="MM", help="only phantoms whose balls scatter with this standard deviation, mm")
    parser.add_argument("--undeclared", action="store_true", help="with --printed: the file states no tolerance")
    parser.add_argument("--real", type=Path, metavar="MAKER")
    parser.add_argument("--seeds", default="0-119")
    parser.add_argument("--helicarm", default=HELICARM)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        work = Path(made)
        if options.real:
            sys.exit(real(options.helicarm, options.real, options.seeds, work))
        cases = (sorted(p.parent for p in options.cases.glob("*/truth.json") if (p.parent / "case.json").exists())
                 if options.cases else simulated(options.helicarm, work))
        if options.printed:
            printed(options.helicarm, cases, work, options.printed, None if options.undeclared else options.printed,
                    options.repeat)
            return
        print("| attack | outcome | actual error mm | reported mm (95 %) |", "| --- | --- | --- | --- |", sep="\n")
        wrong = False
        for name, outcome, error, claim in rows_of(options.helicarm, cases, work, options.repeat):
            number = lambda x: "-" if math.isnan(x) else f"{x:.3f}"  # noqa: E731
            print(f"| {name} | {outcome} | {number(error)} | {number(claim)} |", flush=True)
            wrong |= outcome.startswith("**")
        sys.exit(wrong)


if __name__ == "__main__":
    main()
