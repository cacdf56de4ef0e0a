#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Error of each stage, in mm at the check targets: all other stages are replaced by the ground truth.

  tools/evaluation/shares.py FOLDER [--helicarm build/bin/helicarm]
  tools/evaluation/shares.py --simulate 4 --document docs/accuracy.md    simulates cases first, and renews the document's table

Every case of FOLDER with a truth.json is run. Then both views are calibrated and the targets located again by an
independent solver (pinhole cameras, the images' nominal intrinsics as priors), with
  centres   the run's ball centres and the true map,
  map       the run's map at the true positions of balls and targets,
  picks     the run's target positions, the true map and true balls,
  all       everything from the run,
and ground truth for the rest. Groups go by the first letter of a case's name. Needs NumPy and SciPy."""
import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from evaluate import simulate

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


def ran(helicarm, folder, out):
    subprocess.run([helicarm, "run", folder, "--out", out, "--no-report", "--quiet"], capture_output=True)
    result = out / "result.json"
    return json.loads(result.read_text()) if result.exists() else None


def rectified(helicarm, view, raw, scratch):
    """Raw pixels rectified by the run's map."""
    (scratch / "map.json").write_text(json.dumps(view["rectification"]["map"]))
    rows = "\n".join(f"{u!r},{v!r}" for u, v in np.asarray(raw).tolist())
    (scratch / "raw.csv").write_text("u_px,v_px\n" + rows + "\n")
    done = subprocess.run([helicarm, "rectify", "--map", scratch / "map.json", "--points", scratch / "raw.csv", "--json"],
                          capture_output=True, text=True, check=True)
    return np.array([[p["u"], p["v"]] for p in json.loads(done.stdout)["points"]], dtype=float)


def similarity(source, target):
    """The least-squares similarity from `source` to `target`, as a function."""
    a, b = source.mean(0), target.mean(0)
    z, w = (source - a) @ [1, 1j], (target - b) @ [1, 1j]
    turn = np.vdot(z, w) / np.vdot(z, z)
    return lambda p: b + np.c_[(((p - a) @ [1, 1j]) * turn).real, (((p - a) @ [1, 1j]) * turn).imag]


def project(camera, points):
    f, u0, v0 = camera[:3]
    seen = Rotation.from_rotvec(camera[3:6]).apply(points) + camera[6:9]
    return f * seen[:, :2] / seen[:, 2:] + [u0, v0]


def calibrated(start, prior, balls, pixels, sigma):
    mean, spread = prior
    fit = least_squares(lambda c: np.r_[((project(c, balls) - pixels) / sigma[:, None]).ravel(), (c[:3] - mean) / spread],
                        start, x_scale="jac", method="trf", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return fit.x


def located(cameras, pixels, start):
    fit = least_squares(lambda x: np.concatenate([project(c, x[None])[0] - p for c, p in zip(cameras, pixels)]), start,
                        xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return fit.x


def truth_of(truth, name):
    """Ground truth of one view: camera (K, R, t), and name -> (position, ideal, raw) of balls, targets and plate."""
    of_view = truth.get(name) or next(v for v in truth["views"] if v["name"] == name)
    marks = lambda key, named="name": {str(m[named]): (m.get("world", m.get("xyz_mm")), m["ideal"], m["raw"])
                                       for m in of_view.get(key) or [] if m.get("present", True)}
    camera = of_view["camera"]
    if "camera_from_calibrator" in camera:
        pose = np.array(camera["camera_from_calibrator"])
        return {"K": np.array(camera["K"]), "R": pose[:3, :3], "t": pose[:3, 3], "balls": marks("balls"),
                "targets": {**marks("targets"), **marks("tunnel_points")}, "plate": marks("plate")}
    plate = {str(d["index"]): (None, d["ideal"], d["raw"]) for d in (of_view.get("plate") or {}).get("balls", []) if d["present"]}
    return {"K": np.array(camera["K"]), "R": np.array(camera["R"]), "t": np.array(camera["t"]),
            "balls": marks("calibrator"), "targets": marks("targets"), "plate": plate}


def errors_of(helicarm, result, truth, scratch):
    """Distances of the located targets from their true positions, by variant."""
    views = []
    for view in result["views"]:
        true = truth_of(truth, view["name"])
        seen = {f["label"]: f for f in view["fiducials"] if f["status"] == "used" and f["label"] in true["balls"]}
        points = {p["name"]: p["seen"][view["name"]] for p in result["points"]
                  if p["name"] in true["targets"] and view["name"] in p["seen"] and p["xyz_mm"]}
        column = lambda marks, names, k: np.array([marks[n][k] for n in names], dtype=float).reshape(-1, 2 if k else 3)
        raw, ideal = column(true["balls"], seen, 2), column(true["balls"], seen, 1)
        target_raw, target_ideal = column(true["targets"], points, 2), column(true["targets"], points, 1)
        across = lambda p: p
        if view["rectification"]["map"]["order"]:
            dots = true["plate"]
            into_ideal = similarity(rectified(helicarm, view, column(dots, dots, 2), scratch), column(dots, dots, 1))
            across = lambda p: into_ideal(rectified(helicarm, view, p, scratch)) if len(p) else p
        own_raw = np.array([f["uv_raw"] for f in seen.values()])
        own_target = np.array([p["uv_raw"] for p in points.values()]).reshape(-1, 2)
        side = np.array([np.sign(true["K"][0, 0]), 1])  # undo the mirroring
        camera = np.r_[true["K"][1, 1], side * true["K"][:2, 2], Rotation.from_matrix(true["R"]).as_rotvec(), true["t"]]
        width, height = view["image_size"]
        prior = (np.array([camera[0], side[0] * (width - 1) / 2, (height - 1) / 2]),
                 np.array([0.005 * camera[0], 0.05 * width, 0.05 * width]))
        views.append({
            "camera": camera, "prior": prior, "names": list(points), "balls": column(true["balls"], seen, 0),
            "places": {n: np.array(true["targets"][n][0]) for n in points},
            "sigma": np.array([f["sigma_px"] for f in seen.values()]),
            "ball": {"true": side * ideal, "centres": side * (ideal + own_raw - raw), "map": side * across(raw),
                     "all": side * across(own_raw)},
            "target": {"true": side * target_ideal, "picks": side * (target_ideal + own_target - target_raw),
                       "map": side * across(target_raw), "all": side * across(own_target)},
        })
    errors = defaultdict(list)
    common = [n for n in views[0]["names"] if all(n in v["names"] for v in views)]
    for variant in ("true", "centres", "map", "picks", "all"):
        cameras = [calibrated(v["camera"], v["prior"], v["balls"], v["ball"].get(variant, v["ball"]["true"]), v["sigma"])
                   for v in views]
        for name in common:
            pixels = [v["target"].get(variant, v["target"]["true"])[v["names"].index(name)] for v in views]
            place = views[0]["places"][name]
            errors[variant].append(np.linalg.norm(located(cameras, pixels, place) - place))
    return errors


def table(helicarm, cases, scratch):
    groups = defaultdict(lambda: defaultdict(list))
    for folder in sorted(p for p in cases.iterdir() if (p / "truth.json").exists() and (p / "case.json").exists()):
        result = ran(helicarm, folder, scratch / f"result-{folder.name}")
        if not result or result["status"] != "ok":
            continue
        for variant, errors in errors_of(helicarm, result, json.loads((folder / "truth.json").read_text()), scratch).items():
            groups[folder.name[0]][variant] += errors
    lines = ["| group | targets | centres mm | map mm | picks mm | all mm | nothing mm |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for group, errors in sorted(groups.items()):
        means = " | ".join(f"{np.mean(errors[v]):.4f}" for v in ("centres", "map", "picks", "all", "true"))
        lines.append(f"| {group} | {len(errors['all'])} | {means} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--simulate", type=int, metavar="N", help="simulate N cases of each kind instead of a folder")
    parser.add_argument("--document", type=Path, help="file whose table between the shares markers is renewed")
    parser.add_argument("--helicarm", default="build/bin/helicarm")
    given = parser.parse_args()
    if not given.folder and not given.simulate:
        parser.error("give a folder, or --simulate N")
    with tempfile.TemporaryDirectory() as scratch:
        cases = given.folder
        if given.simulate:
            cases = Path(scratch) / "cases"
            cases.mkdir()
            simulate(given.helicarm, cases, given.simulate)
        text = table(given.helicarm, cases, Path(scratch))
    if not given.document:
        print(text)
        return
    document = given.document.read_text()
    start, end = "<!-- shares -->\n", "<!-- /shares -->"
    if start not in document or end not in document:
        sys.exit(f"{given.document} has no shares markers")
    given.document.write_text(document[:document.index(start) + len(start)] + text + "\n" + document[document.index(end):])


if __name__ == "__main__":
    main()
