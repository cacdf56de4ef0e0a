#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renews the tables of "Measured phantom" in docs/accuracy.md: `helicarm phantom measure` on simulated phantoms whose
balls are off by N(0, 0.3 mm) per axis and one by 3 mm, and on a real image intensifier data set where its folder is given.

    tools/evaluation/accuracy_phantom.py [--cases 8] [--seed 1] [--real FOLDER]

FOLDER holds POSE_beads.dcm and POSE_plate.dcm for the poses centred, orbit15, orbit30, tilt15, tilt30. Needs NumPy.
"""

import argparse
import json
import random
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from evaluate import renew

ROOT = Path(__file__).resolve().parents[2]
POSES = ["centred", "orbit15", "orbit30", "tilt15", "tilt30"]
PAIRS = [("orbit30", "tilt30"), ("orbit30", "tilt15"), ("orbit15", "tilt30"), ("centred", "tilt30")]
CHI2_3_95 = 7.815
TARGET_SETS = 4  # choices of five balls as targets, for each pair of real poses


def write(path, value):
    path.write_text(json.dumps(value))


def balls_of(calibrator):
    return np.array([ball["xyz_mm"] for ball in calibrator["balls"]])


def fitted(points, places, scaled):
    """The similarity (or rigid) map of points onto places, as a function, and its scale."""
    p, q = points.mean(0), places.mean(0)
    u, s, vt = np.linalg.svd((places - q).T @ (points - p))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ sign @ vt
    scale = np.trace(np.diag(s) @ sign) / ((points - p) ** 2).sum() if scaled else 1.0
    return lambda x: scale * (x - p) @ rotation.T + q, scale, rotation


class Runner:
    def __init__(self, helicarm):
        self.helicarm = helicarm

    def result(self, out, *arguments):
        done = subprocess.run([self.helicarm, *map(str, arguments), "--out", str(out), "--quiet"], capture_output=True,
                              text=True)
        if done.returncode not in (0, 3):
            raise SystemExit(done.stderr)
        return json.loads((out / "result.json").read_text())

    def targets(self, folder, case, calibrator, targets):
        """Of check targets located with a calibrator file: error, whether it is in its 95 % region, predicted rms."""
        write(folder / "with.json", dict(calibrator, targets=targets))
        write(folder / "run.json", dict(case, calibrator="with.json"))
        result = self.result(folder / "run", "run", folder / "run.json", "--no-report")
        rows = []
        places = {target["name"]: np.array(target["xyz_mm"]) for target in targets}
        for point in result.get("points", []):
            if point["xyz_mm"] is None or point["name"] not in places:
                continue
            off = np.array(point["xyz_mm"]) - places[point["name"]]
            rows.append((np.linalg.norm(off), off @ np.linalg.solve(point["covariance_mm2"], off) < CHI2_3_95,
                         np.sqrt(np.trace(point["covariance_mm2"]))))
        return rows


def carried(targets, points, places, scaled):
    """Check targets in the frame in which `points` are at `places`."""
    onto, _, turn = fitted(points, places, scaled)
    return [dict(t, xyz_mm=onto(np.array([t["xyz_mm"]]))[0].tolist(),
                 **({"directions": (np.array(t["directions"]) @ turn.T).tolist()} if t.get("directions") else {}))
            for t in targets]


def simulated_case(runner, folder, kind, angles, seed):
    named = [f"V{i}:{orbit},{tilt}" for i, (orbit, tilt) in enumerate(angles)] + ["AP:0,0", "LAT:90,0"]
    subprocess.run([runner.helicarm, "simulate", str(folder), "--kind", kind, "--seed", str(seed), "--no-knee", "--quiet",
                    *(argument for view in named for argument in ("--view", view))], check=True)
    true = json.loads((folder / "calibrator.json").read_text())
    case = json.loads((folder / "case.json").read_text())
    rng = random.Random(seed)
    nominal = json.loads(json.dumps(dict(true, name="nominal", targets=[])))
    for ball in nominal["balls"]:
        ball["xyz_mm"] = [x + rng.gauss(0, 0.3) for x in ball["xyz_mm"]]
    slipped = rng.randrange(len(nominal["balls"]))
    nominal["balls"][slipped]["xyz_mm"][rng.randrange(3)] += 3
    write(folder / "nominal.json", nominal)
    write(folder / "views.json", dict(case, calibrator="nominal.json", views=case["views"][:len(angles)]))
    places = balls_of(true)
    distance = np.linalg.norm(places[0] - places[2]) + rng.gauss(0, 0.05)
    result = runner.result(folder / "measured", "phantom", "measure", folder / "views.json", "--distance",
                           f"P1,P3={distance}")
    if result["status"] != "ok" or len(result["balls"]) != len(true["balls"]):
        return None
    measured = json.loads((folder / "measured/calibrator.json").read_text())
    onto, scale, _ = fitted(balls_of(measured), places, True)
    rigid, _, turn = fitted(balls_of(measured), places, False)
    inside = [e @ np.linalg.solve(turn @ np.array(ball["covariance_mm2"]) @ turn.T, e) < CHI2_3_95
              for e, ball in zip(rigid(balls_of(measured)) - places, measured["balls"])]
    pair = dict(case, views=case["views"][len(angles):])
    kept = [i for i in range(len(places)) if i != slipped]

    def located(file, used=slice(None), scaled=False):
        return runner.targets(folder, pair, file, carried(true["targets"], places[used], balls_of(file)[used], scaled))

    tre = {"nominal": located(nominal, kept), "measured": located(measured), "true": located(true),
           "scale known": located(measured, scaled=True)}
    return {"off": onto(balls_of(measured)) - places, "scale": abs(1 / scale - 1) / measured["scale_sigma"],
            "inside": inside, "tre": tre, "ms": result["timing_ms"]["after_detection"]}


# Orbit and tilt of each view, degrees.
ARRANGEMENTS = {
    "3": [(15 * i, 10 * (i % 2)) for i in range(3)],
    "6": [(15 * i, 10 * (i % 2)) for i in range(6)],
    "6, tilted both ways": [(20 * i, 15 * (-1) ** i) for i in range(6)],
    "10": [(10 * i, 10 * (i % 2)) for i in range(10)],
}


def simulated(runner, cases, seed):
    def rms(values):
        return f"{np.sqrt(np.mean(np.square(values))):.3f}" if values else "refused"

    yield ("| receiver | views | measured | rms of the centres mm | scale error over sigma, rms | in the 95 % regions | "
           "TRE nominal | measured | as predicted | scale known | true mm | in the 95 % regions | after detection ms |")
    yield "|" + " --- |" * 13
    for kind, words in (("accuracy", "intensifier"), ("flat", "flat panel")):
        for views, angles in ARRANGEMENTS.items():
            found = []
            for i in range(cases):
                with tempfile.TemporaryDirectory() as folder:
                    found.append(simulated_case(runner, Path(folder), kind, angles, seed + i))
            done = [case for case in found if case]
            if not done:
                yield f"| {words} | {views} | 0 of {cases} |" + " |" * 10
                continue
            centres = np.sqrt(np.mean([np.sum(case["off"] ** 2) / len(case["off"]) / 3 for case in done]))
            inside = [x for case in done for x in case["inside"]]
            tre = {name: [row for case in done for row in case["tre"][name]] for name in done[0]["tre"]}
            errors = {name: rms([error for error, _, _ in rows]) for name, rows in tre.items()}
            yield (f"| {words} | {views} | {len(done)} of {cases} | {centres:.4f} | "
                   f"{np.sqrt(np.mean([case['scale'] ** 2 for case in done])):.2f} | {100 * np.mean(inside):.0f} % | "
                   f"{errors['nominal']} | {errors['measured']} | {rms([p for _, _, p in tre['measured']])} | "
                   f"{errors['scale known']} | {errors['true']} | "
                   f"{100 * np.mean([ok for _, ok, _ in tre['measured']]):.0f} % of {len(tre['measured'])} | "
                   f"{np.median([case['ms'] for case in done]):.0f} |")


def real_case(folder, source, poses):
    return {"format": "helicarm-case/1", "calibrator": None, "diameters_mm": [5.4, 3.2], "plate": "plate.json",
            "views": [{"name": pose, "image": f"{pose}_beads.dcm", "plate_image": f"{pose}_plate.dcm", "mirrored": False}
                      for pose in poses]}


def measured_real(runner, folder, poses):
    write(folder / "views.json", real_case(folder, None, poses))
    result = runner.result(folder / "measured", "phantom", "measure", folder / "views.json", "--from-scratch")
    if result["status"] != "ok":
        return None, result
    # Its scale is arbitrary: the pair that is worth measuring is taken as 100 mm.
    pair = result["worth_measuring"]
    return json.loads((folder / "measured/calibrator.json").read_text()), dict(result, pair=pair)


def real(runner, source):
    yield "| phantom measured from | balls | rms px | left out px, largest | targets' TRE mean mm | largest | in the 95 % regions |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in source.glob("*.dcm"):
            shutil.copy(path, folder)
        write(folder / "plate.json", {"name": "perforated", "kind": "holes", "lattice": "hexagonal", "pitch_mm": 3.175,
                                      "diameter_mm": 2.0, "dots_xy_mm": None, "height_above_receiver_mm": None})
        for words, sets in (("all five poses", [POSES]),
                            ("the other three poses", [[p for p in POSES if p not in pair] for pair in PAIRS])):
            rows, balls, rms, left = [], [], [], []
            for index, poses in enumerate(sets):
                calibrator, result = measured_real(runner, folder, poses)
                if not calibrator:
                    yield f"| {', '.join(poses)} | {result['failure']['code']} | | | | | |"
                    continue
                balls.append(len(result["balls"]))
                rms.append(result["reprojection_rms_px"])
                left += [view["left_out_rms_px"] for view in result["views"] if view["left_out_rms_px"]]
                rng = random.Random(1)
                for pair in [PAIRS[index]] if len(sets) > 1 else PAIRS:
                    for _ in range(TARGET_SETS):
                        chosen = rng.sample(range(len(calibrator["balls"])), 5)
                        some = [ball for i, ball in enumerate(calibrator["balls"]) if i in chosen]
                        targets = [{"name": "T" + ball["label"], "xyz_mm": ball["xyz_mm"], "kind": "ball",
                                    "diameter_mm": ball["diameter_mm"]} for ball in some]
                        rest = dict(calibrator, balls=[b for i, b in enumerate(calibrator["balls"]) if i not in chosen])
                        case = {k: v for k, v in real_case(folder, source, pair).items() if k != "diameters_mm"}
                        rows += runner.targets(folder, case, rest, targets)
            if rows:
                errors = [error for error, _, _ in rows]
                yield (f"| {words} | {min(balls)} to {max(balls)} | {max(rms):.3f} | {max(left, default=0):.3f} | "
                       f"{np.mean(errors):.3f} | {max(errors):.3f} | {100 * np.mean([ok for _, ok, _ in rows]):.0f} % of {len(rows)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=8, help="simulated cases of each row")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--real", type=Path, help="folder of the real images; without it their table stays as it is")
    parser.add_argument("--only", choices=["simulated", "real"])
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    options = parser.parse_args()
    page, runner = ROOT / "docs/accuracy.md", Runner(options.helicarm)
    if options.only != "real":
        renew(page, "phantom-simulated", list(simulated(runner, options.cases, options.seed)))
    if options.real and options.only != "simulated":
        renew(page, "phantom-real", list(real(runner, options.real.resolve())))
    print(f"renewed {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
