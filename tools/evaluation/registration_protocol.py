#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Registers a modelled knee's femur, or a patient's head, in simulated images from perturbed starts and with wrong input.

  tools/evaluation/registration_protocol.py --starts 200 --jobs 4 --doc docs/registration.md
  tools/evaluation/registration_protocol.py --head --starts 200 --jobs 4 --doc docs/registration.md
  tools/evaluation/registration_protocol.py --kinds mirrored,tibia --cases 10 --keep folder

Knees and their CTs are those of tools/evaluation/bone_ct.py. The head is the CT of Debian's package invesalius-examples (apt-get install
invesalius-examples), registered by a bone window without mask. The registered volume is blurred, has noise, and the head's also has
another grid and the CT's headrest, which is not rendered. Images and calibration come from the program (`simulate`, whose rays,
attenuation, blur and scatter are not the registration's). The head is larger than the field and surrounds the calibrator.

Right cases: a start whose mean displacement of the targets is 0 to 20 mm, every 20 cases in each bin of 1 mm once (van de Kraats
2005). mTRE: mean over 14 targets, for the knee the corners and face centres of a box of 40 mm about the femur's end, for the head
points of the skull within 60 mm of the CT's centre, as far from each other as possible. Success: not refused, and mTRE below 1 or
2 mm. False accept: not refused, and mTRE above 2 mm. False refusal: refused, and mTRE below 1 mm. Capture range: end of the last
1 mm bin up to which every bin has 95 % successes at 2 mm. Seconds: of the registration, without calibration.
Wrong cases, from a start within 5 mm of the best guess:
  patient    another knee's CT          mirrored   the CT exchanged left for right     tibia   tibia for femur
  moved      3 mm between the images, across both central rays    hidden  3 mm within their plane
  scaled     voxels 3 % larger          camera     one view's calibration off by 2 mm along the leg
`patient` and `tibia` are kinds of the knee alone. With --surface the models are surfaces of the bones' masks (tools/evaluation/bone_surface.py).
One view (`one_view`, right input): error and predicted sigma along the view's central ray, and both views' sigma there.
A wrong case that is accepted is a false accept; `hidden` cannot be seen, its error is compared with the covariance.

Long runs: --jobs registers several cases at once, each by a process with one thread; poses do not depend on it, seconds do. --rows
keeps what is done; the same command goes on after an interruption. Needs NumPy. Exit code 1 if a visible wrong case is accepted."""
import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import threading

import numpy as np

import evaluation_rows
from registration_bodies import KINDS, Heads, Knees, Surfaces
from rotations import rotation

VISIBLE = ("patient", "mirrored", "tibia", "moved", "scaled", "camera")
CHI2_95 = 7.815
BINS = 20  # of 1 mm


def moved(pose, centre, shift, vector):
    """The pose turned about `centre` (world) and shifted."""
    result = pose.copy()
    result[:3, :3] = rotation(vector) @ pose[:3, :3]
    result[:3, 3] = rotation(vector) @ (pose[:3, 3] - centre) + centre + shift
    return result


def placed(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def start_at(pose, targets, distance, rng, arm_mm=30):
    """A start whose mean displacement of the targets is `distance`, shift and rotation in random proportion. `arm_mm`: the
    targets' distance from their centre."""
    centre = placed(pose, targets).mean(axis=0)
    shift, vector = rng.standard_normal(3), rng.standard_normal(3)
    shift *= rng.uniform(0.2, 1) / np.linalg.norm(shift)
    vector *= rng.uniform(0.2, 1) / np.linalg.norm(vector) / arm_mm
    low, high = 0.0, 100.0
    for _ in range(60):
        factor = (low + high) / 2
        start = moved(pose, centre, factor * shift, factor * vector)
        error = np.linalg.norm(placed(start, targets) - placed(pose, targets), axis=1).mean()
        low, high = (factor, high) if error < distance else (low, factor)
    return moved(pose, centre, low * shift, low * vector)


def made(folder, make):
    """`folder`, filled by `make` unless it exists; an interrupted run leaves no half of it."""
    if not folder.exists():
        part = folder.with_name(f"{folder.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        make(part)
        part.rename(folder)
    return folder


class Protocol:
    def __init__(self, body, arguments, folder):
        self.body, self.program, self.threads, self.folder = body, arguments.program, arguments.threads, folder
        self.keep = arguments.keep is not None
        self.lock, self.locks = threading.Lock(), {}

    def run(self, *words):
        done = subprocess.run([self.program, *map(str, words), "--quiet", "--threads", str(self.threads)], capture_output=True,
                              text=True, check=False)
        if done.returncode not in (0, 3):
            sys.exit(f"{' '.join(map(str, words))}\n{done.stderr}")

    def volumes(self, subject):
        """Folder of a subject's volumes."""
        with self.lock:
            return made(self.folder / f"{self.body.name}{subject}", lambda folder: self.body.write(folder, subject))

    def simulated(self, number, shift=(0, 0, 0), of="true"):
        """Case folder, the same for every kind. `shift`: of the body along L, P, S. `of`: one of the subject's volumes."""
        centre = ",".join(f"{-s:g}" for s in shift)
        volume = self.volumes(self.body.subject(number)) / f"{of}.nrrd"
        folder = self.folder / f"{self.body.name}-{of}-{number}{''.join(f'_{s:g}' for s in shift)}"
        with self.lock:
            own = self.locks.setdefault(folder, threading.Lock())
        with own:
            return made(folder, lambda case: self.run("simulate", case, "--kind", "flat", "--seed", 100 + number, "--ct", volume,
                                                      f"--ct-centre={centre}"))

    def cameras(self, case, out):
        """Views' cameras as calibrated, with the image of each; and the failure if there are none."""
        self.run("run", case, "--out", out)
        result = json.loads((out / "result.json").read_text())
        given = json.loads((case / "case.json").read_text())["views"]
        cameras = []
        for view, image in zip(result["views"], given):
            if not (view.get("camera_from_calibrator") and view.get("intrinsics")):
                return [], result["failure"]
            pose, k = np.array(view["camera_from_calibrator"]), view["intrinsics"]
            cameras.append(({"K": [[k["fx_px"], 0, k["u0"]], [0, k["fy_px"], k["v0"]], [0, 0, 1]]}, pose, image))
        return cameras, result["failure"]

    def register(self, case, model, out, views):
        work = out.with_name("work")
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(case, work)
        case_json = json.loads((case / "case.json").read_text())
        model = dict(model)
        for name in ("volume", "mask", "surface"):
            if name in model:
                file = f"{name}{model[name].suffix}"
                os.link(model[name], work / file)
                model[name] = file
        (work / "case.json").write_text(json.dumps({**case_json, "views": views, "models": [model]}))
        self.run("register", work, "--out", out)
        result = json.loads((out / "registration.json").read_text())
        return result["models"][0] if result["models"] else {"decision": "refuse", "failure": result["failure"]}

    def discard(self, number):
        """Removes the simulated cases of a number, unless they are kept."""
        if not self.keep:
            for case in self.folder.glob(f"{self.body.name}-*-{number}_*"):
                shutil.rmtree(case)

    def case(self, kind, number):
        """The row of one case, in a folder of its own."""
        folder = self.folder / f"{self.body.name}-{kind}-{number}"
        folder.mkdir(exist_ok=True)
        row = self.row_of(folder, kind, number)
        if not self.keep:
            shutil.rmtree(folder, ignore_errors=True)
        return row

    def row_of(self, folder, kind, number):
        rng = np.random.default_rng([number, KINDS.index(kind)])
        targets = self.body.targets
        case = self.simulated(number)
        pose = np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])
        model = {"name": self.body.model, "scale_sigma": self.body.scale_sigma,
                 **self.body.files(self.volumes(self.body.subject(number, other=kind == "patient")), kind)}
        guess = pose.copy()
        if kind == "tibia":
            guess[:3, 3] += pose[:3, :3] @ [0, 0, 55.0]
        if kind in ("moved", "hidden"):
            other = self.simulated(number, {"moved": (0, 0, 3), "hidden": (3, 0, 0)}[kind])
            mixed = folder / "mixed"
            shutil.rmtree(mixed, ignore_errors=True)
            shutil.copytree(case, mixed)
            shutil.copy(other / "LAT.dcm", mixed / "LAT.dcm")
            case = mixed
        # Every 20 starts have each bin once; further ones meet the next subject in each bin.
        distance = (number + number // BINS) % BINS + rng.uniform() if kind == "right" else rng.uniform(0, 5)
        start = start_at(guess, targets, distance, rng, self.body.arm_mm)
        model["start"] = {"world_from_model": start.tolist()}
        cameras, failure = self.cameras(case, folder / "calibrated") if kind in ("camera", "one_view") else ([], None)
        if kind == "camera" and cameras:
            case = self.shifted_camera(case, cameras, folder / "camera")
        views = json.loads((case / "case.json").read_text())["views"]
        if kind == "camera" and not cameras:
            result = {"decision": "refuse", "failure": failure}
        else:
            result = self.register(case, model, folder / "out", views[:1] if kind == "one_view" else views)
        row = self.row(kind, number, distance, pose, targets, result)
        if kind == "one_view" and cameras:
            ray = cameras[0][1][2, :3]
            row |= self.along(ray, pose, targets, result)
            both = self.along(ray, pose, targets, self.register(case, model, folder / "both", views))
            row["both_sigma_mm"] = both.get("sigma_mm")
        return row

    def along(self, ray, pose, targets, result):
        """Along a direction of the world: error of the targets' centre, and its sigma."""
        if not result.get("covariance"):
            return {}
        found, centre = np.array(result["world_from_model"]), np.array(result["centre_mm"])
        at = placed(found, targets).mean(axis=0)
        covariance = self.of_point(np.array(result["covariance"]), at - centre)
        return {"error_mm": float(ray @ (at - placed(pose, targets).mean(axis=0))), "sigma_mm": math.sqrt(ray @ covariance @ ray)}

    @staticmethod
    def shifted_camera(case, cameras, changed):
        shutil.rmtree(changed, ignore_errors=True)
        changed.mkdir()
        views = []
        for i, (camera, pose, image) in enumerate(cameras):
            pose = pose.copy()
            if i == 1:
                pose[:3, 3] += pose[:3, :3] @ [2.0, 0, 0]  # along the leg
            name = f"camera{i}.json"
            (changed / name).write_text(json.dumps({**camera, "R": pose[:3, :3].tolist(), "t": pose[:3, 3].tolist()}))
            shutil.copy(case / image["image"], changed / image["image"])
            views.append({**image, "camera": name})
        (changed / "case.json").write_text(json.dumps({"format": "helicarm-case/1", "views": views}))
        return changed

    def row(self, kind, number, distance, pose, targets, result):
        row = {"body": self.body.name, "kind": kind, "number": number, "start_mm": distance, "decision": result["decision"] or "refuse",
               "code": (result.get("failure") or {}).get("code"), "seconds": result.get("seconds"),
               "warnings": [w["code"] for w in result.get("warnings", [])]}
        if result.get("world_from_model"):
            found = np.array(result["world_from_model"])
            errors = placed(found, targets) - placed(pose, targets)
            row["mtre_mm"] = float(np.linalg.norm(errors, axis=1).mean())
            if result.get("covariance"):
                covariance, centre = np.array(result["covariance"]), np.array(result["centre_mm"])
                row["rms_mm"] = float(np.sqrt((errors**2).sum(axis=1).mean()))
                row["predicted_mm"] = float(np.sqrt(np.mean([np.trace(self.of_point(covariance, p - centre))
                                                             for p in placed(found, targets)])))
                row["inside"] = float(np.mean([e @ np.linalg.solve(self.of_point(covariance, p - centre), e) < CHI2_95
                                               for e, p in zip(errors, placed(found, targets))]))
        return row

    @staticmethod
    def of_point(covariance, arm):
        x, y, z = arm
        jacobian = np.hstack([[[0, z, -y], [-z, 0, x], [y, -x, 0]], np.eye(3)])
        return jacobian @ covariance @ jacobian.T


def figures(values, percentiles=(50, 95, 100), digits=2):
    return [f"{np.percentile(values, q):.{digits}f}" for q in percentiles] if values else ["-"] * len(percentiles)


def is_within(row, limit, refused_too=False):
    return (refused_too or row["decision"] != "refuse") and row.get("mtre_mm", math.inf) < limit


def capture_range_mm(rows, refused_too=False):
    for low in range(BINS):
        own = [is_within(row, 2, refused_too) for row in rows if low <= row["start_mm"] < low + 1]
        if not own or np.mean(own) < 0.95:
            return low
    return BINS


def right_table(right):
    lines = ["| start | cases | mTRE median | 95 % | max | success 1 mm | 2 mm | refused | false accepts | false refusals | "
             "in the 95 % region | seconds median | 95 % |", "| --- |" + " --- |" * 12]
    for low, high in ((0, 5), (5, 10), (10, 15), (15, 20), (0, 20)):
        own = [row for row in right if low <= row["start_mm"] < high]
        kept = [row for row in own if row["decision"] != "refuse"]
        inside = [row["inside"] for row in kept if "inside" in row]
        share = lambda limit: f"{sum(is_within(row, limit) for row in own)} of {len(own)}"  # noqa: E731
        false_refusals = sum(row["decision"] == "refuse" and is_within(row, 1, True) for row in own)
        cells = [f"{low} to {high} mm", len(own), *figures([row["mtre_mm"] for row in kept]), share(1), share(2),
                 len(own) - len(kept), sum(row["mtre_mm"] > 2 for row in kept), false_refusals,
                 f"{100 * np.mean(inside):.0f} %" if inside else "-",
                 *figures([row["seconds"] for row in own if row["seconds"] is not None], (50, 95), 1)]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    refused = sorted(row["code"] for row in right if row["decision"] == "refuse")
    counts = ", ".join(f"{code} {refused.count(code)}" for code in dict.fromkeys(refused))
    warned = sum(row["decision"] == "warn" for row in right)
    stated = [row for row in right if row["decision"] != "refuse" and "predicted_mm" in row]
    if stated:
        rms, predicted = (np.sqrt(np.mean([row[key] ** 2 for row in stated])) for key in ("rms_mm", "predicted_mm"))
        lines += ["", f"Errors of the targets, rms: {rms:.3f} mm; predicted: {predicted:.3f} mm."]
    return lines + ["", f"Capture range: {capture_range_mm(right)} mm; of the poses found, refused or not: "
                        f"{capture_range_mm(right, True)} mm. Warned: {warned}. Refused: {counts or 'none'}.", ""]


def tables(rows):
    """{part: text} of the parts that have rows: the right cases, and the others."""
    rows = sorted(rows, key=lambda row: (KINDS.index(row["kind"]), row["number"]))
    right = [row for row in rows if row["kind"] == "right"]
    lines = []
    wrong = [kind for kind in KINDS[1:-1] if any(row["kind"] == kind for row in rows)]
    if wrong:
        lines += ["| wrong | cases | refused | warned | accepted | codes |", "| --- | --- | --- | --- | --- | --- |"]
    for kind in wrong:
        own = [row for row in rows if row["kind"] == kind]
        count = lambda decision: sum(row["decision"] == decision for row in own)  # noqa: E731
        codes = sorted({row["code"] or ",".join(row["warnings"]) or "-" for row in own})
        lines.append(f"| {kind} | {len(own)} | {count('refuse')} | {count('warn')} | {count('accept')} | {', '.join(codes)} |")
    single = [row for row in rows if row["kind"] == "one_view" and "sigma_mm" in row and row.get("both_sigma_mm")]
    kept = [row for row in single if row["decision"] != "refuse"]
    if kept:
        count = lambda decision: sum(row["decision"] == decision for row in single)  # noqa: E731
        errors, sigmas, both = (np.array([row[name] for row in kept]) for name in ("error_mm", "sigma_mm", "both_sigma_mm"))
        lines += ["", "| one view | refused | warned | accepted | not refused: error along its ray, rms | mean | predicted sigma, median | "
                  "both views' sigma, median | within 1.96 sigma |", "| --- |" + " --- |" * 8,
                  f"| {len(single)} cases | {count('refuse')} | {count('warn')} | {count('accept')} | {np.sqrt(np.mean(errors**2)):.2f} mm | "
                  f"{np.mean(errors):+.2f} mm | {np.median(sigmas):.2f} mm | {np.median(both):.3f} mm | "
                  f"{np.sum(abs(errors) < 1.96 * sigmas)} of {len(kept)} |"]
    parts = {"right": right_table(right) if right else [], "wrong": lines}
    return {part: "\n".join(text).strip() for part, text in parts.items() if text}


def marks_of(body, part):
    return f"<!-- registration protocol, {body}, {part} -->", f"<!-- end of the registration protocol, {body}, {part} -->"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--head", nargs="?", const="", metavar="PATH",
                        help="the head instead of the knees; PATH of Cranium.inv3, default: where its package installs it")
    parser.add_argument("--surface", action="store_true", help="surfaces of the knees' masks instead of their volumes")
    parser.add_argument("--starts", type=int, default=20, help="right cases (default: 20)")
    parser.add_argument("--cases", type=int, default=10, help="of each wrong kind (default: 10)")
    parser.add_argument("--kinds", help=f"some of {','.join(KINDS)}; default: all that the body has")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once (default: 1)")
    parser.add_argument("--threads", type=int, help="of each case; 0: all cores (default: 0 for one job, 1 for several)")
    evaluation_rows.add_options(parser)
    arguments = parser.parse_args()
    if arguments.threads is None:
        arguments.threads = 0 if arguments.jobs == 1 else 1
    body = Heads(arguments.head or None) if arguments.head is not None else Surfaces() if arguments.surface else Knees()
    kinds = arguments.kinds.split(",") if arguments.kinds else body.kinds
    if unknown := [kind for kind in kinds if kind not in body.kinds]:
        parser.error(f"--kinds: {', '.join(unknown)}: the {body.name} has {', '.join(body.kinds)}")
    rows = evaluation_rows.Rows(arguments.rows, ("kind", "number"), lambda row: row.get("body", "knee") == body.name)
    jobs = [(kind, number) for kind in kinds for number in range(arguments.starts if kind == "right" else arguments.cases)]
    with evaluation_rows.folder_of(arguments.keep) as folder:
        rows.gather(Protocol(body, arguments, folder).case, jobs, arguments.jobs)
    for part, table in tables(rows.rows).items():
        print(table, end="\n\n")
        if arguments.doc:
            evaluation_rows.renew(arguments.doc, table, *marks_of(body.name, part))
    return any(row["kind"] in VISIBLE and row["decision"] == "accept" for row in rows.rows)


if __name__ == "__main__":
    sys.exit(main())
