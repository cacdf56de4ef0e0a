#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tunnels planned in a CT beside tunnels of picked balls, in the same simulated images: errors and predictions.

  tools/evaluation/registration_tunnels.py --cases 20 --jobs 4 --doc docs/registration.md
  tools/evaluation/registration_tunnels.py --cases 2 --keep folder

The images are those of an operation (`simulate --kind tunnels`): an image intensifier with plate, 3 mm balls at both ends of a femoral
and a tibial tunnel, tracker with noise, tool. The knee is the modelled one of tools/evaluation/bone_ct.py (four knees in turn), rendered from its
CT; the balls' places in the CT are known from truth.json and are the plan's ends, a 3D Slicer line for each bone. The registered
CT is blurred and has noise, its size is exact (`scale_sigma` 0), each bone has a mask and starts from the true pose, displaced within 10 mm and turned within 10 degrees.
The CT does not hold the balls. `run` locates the picked balls and registers both bones.

Every end's error against the truth in the calibrator's frame and in the tool's (after tracker, bone and tool readings), the rms that
its covariance predicts, and the share inside its 95 % region. Ends of a refused registration are not counted and listed as refused.
--jobs measures several cases at once, each with one thread; --rows keeps what is done, and the same command goes on after an
interruption. Needs NumPy. Exit code 1 if an end that is not refused is off by more than 2 mm in the calibrator's frame."""
import argparse
import json
import os
import shutil
import subprocess
import sys
import threading

import numpy as np

import bone_ct
import evaluation_rows
from registration_protocol import CHI2_95, made, moved, placed

BONES = {"femur": ("FS", "FE"), "tibia": ("TS", "TE")}
CENTRES = {"femur": np.array([0, 5, 25.0]), "tibia": np.array([0, 5, -35.0])}
FRAMES = {"calibrator": ("xyz_mm", "covariance_mm2"), "tool": ("in_tool", "covariance_in_tool_mm2")}
MOST_ERROR_MM = 2
MARKS = "<!-- registration tunnels -->", "<!-- end of the registration tunnels -->"


def line_of(name, ends):
    """A line of 3D Slicer's markups."""
    points = [{"id": str(i + 1), "label": f"{name}-{i + 1}", "position": end.tolist(), "positionStatus": "defined"}
              for i, end in enumerate(ends)]
    return {"@schema": "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
                       "markups-schema-v1.0.3.json#",
            "markups": [{"type": "Line", "name": name, "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": points}]}


def within(rng, length):
    """A vector of random direction, no longer than `length`."""
    vector = rng.standard_normal(3)
    return vector * length * rng.uniform() ** (1 / 3) / np.linalg.norm(vector)


class Operations:
    def __init__(self, arguments, folder):
        self.options, self.folder, self.lock = arguments, folder, threading.Lock()

    def run(self, *words, refusable=False):
        done = subprocess.run([self.options.program, *map(str, words), "--quiet", "--threads", str(self.options.threads)],
                              capture_output=True, text=True, check=False)
        if done.returncode != 0 and not (refusable and done.returncode == 3):
            sys.exit(f"{' '.join(map(str, words))}\n{done.stderr}")

    def volumes(self, seed):
        def make(folder):
            folder.mkdir()
            knee = bone_ct.Knee(seed)
            bone_ct.write_nrrd(folder / "true.nrrd", bone_ct.rounded(knee.hu))
            bone_ct.write_nrrd(folder / "ct.nrrd", bone_ct.rounded(knee.scanned()))
            for name in BONES:
                bone_ct.write_nrrd(folder / f"{name}.nrrd", getattr(knee, name).astype(np.uint8))
        with self.lock:
            return made(self.folder / f"knee{seed}", make)

    def prepared(self, number, case):
        """Simulates the case and adds models with plans; returns the truth."""
        volumes, rng = self.volumes(number % 4), np.random.default_rng([number, 31])
        self.run("simulate", case, "--kind", "tunnels", "--seed", self.options.seed + number, "--ct", volumes / "true.nrrd")
        truth = json.loads((case / "truth.json").read_text())
        pose = np.array(truth["ct"]["calibrator_from_patient"])
        ends = {point["name"]: np.array(point["in_calibrator"]) for point in truth["navigation"]["points"]}
        given = json.loads((case / "case.json").read_text())
        given["models"] = []
        os.link(volumes / "ct.nrrd", case / "ct.nrrd")
        for bone, names in BONES.items():
            os.link(volumes / f"{bone}.nrrd", case / f"{bone}.nrrd")
            plan = line_of(f"planned_{bone}", [placed(np.linalg.inv(pose), ends[name]) for name in names])
            (case / f"{bone}.mrk.json").write_text(json.dumps(plan, indent=1))
            start = moved(pose, placed(pose, CENTRES[bone]), within(rng, 10), within(rng, np.radians(10)))
            given["models"].append({"name": bone, "volume": "ct.nrrd", "mask": f"{bone}.nrrd", "moves_with": bone, "scale_sigma": 0,
                                    "start": {"world_from_model": start.tolist()}, "plan": f"{bone}.mrk.json"})
        (case / "case.json").write_text(json.dumps(given, indent=1))
        return truth

    def case(self, number):
        """Rows of the case's four ends, picked and planned."""
        case, out = self.folder / f"case{number}", self.folder / f"out{number}"
        for old in (case, out):
            shutil.rmtree(old, ignore_errors=True)
        truth = self.prepared(number, case)
        self.run("run", case, "--out", out, refusable=True)
        result, registered = (json.loads((out / f"{name}.json").read_text()) for name in ("result", "registration"))
        true = {point["name"]: {"calibrator": point["in_calibrator"], "tool": point["in_tool"]}
                for point in truth["navigation"]["points"]}
        picked = {point["name"]: point for point in result["points"]}
        models = {model["name"]: model for model in registered["models"]}
        rows = []
        for bone, names in BONES.items():
            model = models.get(bone) or {"decision": "refuse", "failure": registered["failure"], "points": []}
            planned = {point["name"]: point for point in model["points"]}
            for name, end in zip(names, ("start", "end")):
                common = {"number": number, "bone": bone, "end": end}
                point = picked.get(name) or {}
                refused = (point.get("reason") or (result["failure"] or {}).get("code")) if not point.get("xyz_mm") else None
                rows.append({**common, "by": "picked", "decision": "refuse" if refused else "accept", "codes": [refused] if refused
                             else [], **self.errors(point, true[name])})
                codes = [(model["failure"] or {}).get("code")] if model["failure"] else [w["code"] for w in model["warnings"]]
                rows.append({**common, "by": "planned", "decision": model["decision"] or "refuse", "codes": codes,
                             "seconds": model.get("seconds"), **self.errors(planned.get(f"planned_{bone}_{end}") or {}, true[name])})
        if not self.options.keep:
            shutil.rmtree(case)
            shutil.rmtree(out)
        return rows

    @staticmethod
    def errors(point, true):
        row = {}
        for frame, (place, covariance) in FRAMES.items():
            if not point.get(place):
                continue
            error = np.array(point[place]) - true[frame]
            row[f"error_{frame}_mm"] = float(np.linalg.norm(error))
            if point.get(covariance):
                matrix = np.array(point[covariance])
                row[f"predicted_{frame}_mm"] = float(np.sqrt(np.trace(matrix)))
                row[f"inside_{frame}"] = bool(error @ np.linalg.solve(matrix, error) < CHI2_95)
        return row


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def cells_of(rows, frame):
    """Error rms, 95 %, max, predicted rms, share inside."""
    errors = [row[f"error_{frame}_mm"] for row in rows if f"error_{frame}_mm" in row]
    stated = [row for row in rows if f"predicted_{frame}_mm" in row]
    predicted, inside = (["-"], ["-"]) if not stated else \
        ([f"{rms([row[f'predicted_{frame}_mm'] for row in stated]):.2f}"],
         [f"{sum(row[f'inside_{frame}'] for row in stated)} of {len(stated)}"])
    measured = [f"{value:.2f}" for value in (rms(errors), np.percentile(errors, 95), max(errors))] if errors else ["-"] * 3
    return measured + predicted + inside


def table_of(rows):
    lines = ["| tunnel end | ends | refused | calibrator: error rms | 95 % | max | predicted rms | inside 95 % "
             "| tool: error rms | 95 % | max | predicted rms | inside 95 % |", "| --- |" + " ---: |" * 12]
    groups = [(bone, end) for bone in BONES for end in ("start", "end")] + [(None, None)]
    for bone, end in groups:
        for by in ("picked", "planned"):
            own = [row for row in rows if row["by"] == by and bone in (None, row["bone"]) and end in (None, row["end"])]
            kept = [row for row in own if row["decision"] != "refuse"]
            cells = [f"{bone or 'all'} {end or 'ends'}, {'picked' if by == 'picked' else 'planned in the CT'}", len(own),
                     len(own) - len(kept), *cells_of(kept, "calibrator"), *cells_of(kept, "tool")]
            lines.append(f"| {' | '.join(map(str, cells))} |")
    models = [row for row in rows if row["by"] == "planned" and row["end"] == "start"]
    count = lambda decision: sum(row["decision"] == decision for row in models)  # noqa: E731
    codes = sorted({code for row in models for code in row["codes"]})
    seconds = [row["seconds"] for row in models if row.get("seconds") is not None]
    times = f"; seconds: median {np.median(seconds):.1f}, 95 % {np.percentile(seconds, 95):.1f}" if seconds else ""
    unstated = any("predicted_tool_mm" not in row for row in rows if row["decision"] != "refuse" and row["by"] == "planned")
    note = " -: registration.json states no covariance in the tool's frame." if unstated else ""
    return "\n".join(lines + ["", f"Registrations: {len(models)}; accepted {count('accept')}, warned {count('warn')}, refused "
                                  f"{count('refuse')}; codes: {', '.join(codes) or 'none'}{times}.{note}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--cases", type=int, default=4, help="operations (default: 4)")
    parser.add_argument("--seed", type=int, default=300, help="of the first operation (default: 300)")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once (default: 1)")
    parser.add_argument("--threads", type=int, help="of each case; 0: all cores (default: 0 for one job, 1 for several)")
    evaluation_rows.add_options(parser, "ends")
    arguments = parser.parse_args()
    if arguments.threads is None:
        arguments.threads = 0 if arguments.jobs == 1 else 1
    rows = evaluation_rows.Rows(arguments.rows, ("number",))
    with evaluation_rows.folder_of(arguments.keep) as folder:
        rows.gather(Operations(arguments, folder).case, [(number,) for number in range(arguments.cases)], arguments.jobs)
    table = table_of(sorted(rows.rows, key=lambda row: row["number"]))
    print(table)
    if arguments.doc:
        evaluation_rows.renew(arguments.doc, table, *MARKS)
    return any(row["decision"] != "refuse" and row.get("error_calibrator_mm", 0) > MOST_ERROR_MM for row in rows.rows)


if __name__ == "__main__":
    sys.exit(main())
