#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Registers a modelled knee's femur in simulated images, from perturbed starts and with wrong input.

  tools/registration_protocol.py --starts 200 --doc docs/registration.md
  tools/registration_protocol.py --kinds mirrored,tibia --cases 10 --keep folder

The knee and its CT are those of tools/bone_ct.py; images and calibration come from the program (`simulate`, whose rays,
attenuation, blur and scatter are not the registration's). Right cases: a start whose mean displacement of the targets is
uniform from 0 to 20 mm (van de Kraats 2005). mTRE: mean over 14 targets, the corners and face centres of a box of 40 mm
about the femur's end. Wrong cases, from a start within 5 mm and 5 degrees of the best guess:
  patient    another knee's CT          mirrored   the CT exchanged left for right     tibia   tibia for femur
  moved      3 mm between the images, across both central rays    hidden  3 mm within their plane
  scaled     voxels 3 % larger          camera     one view's calibration off by 2 mm along the leg
One view (`one_view`, right input): error and predicted sigma along the view's central ray, and both views' sigma there.
A wrong case that is accepted is a false accept; `hidden` cannot be seen, its error is compared with the covariance.
Needs NumPy. Exit code 1 if a visible wrong case is accepted."""
import argparse
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import bone_ct

KINDS = ("right", "patient", "mirrored", "tibia", "moved", "hidden", "scaled", "camera", "one_view")
VISIBLE = ("patient", "mirrored", "tibia", "moved", "scaled", "camera")
TARGETS = np.array([[x, y, z] for x in (-20, 0, 20) for y in (-20, 0, 20) for z in (-20, 0, 20)
                    if abs(x) + abs(y) + abs(z) in (20, 60)], float)
CHI2_95 = 7.815


def rotation(vector):
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def moved(pose, centre, shift, vector):
    """The pose turned about `centre` (world) and shifted."""
    result = pose.copy()
    result[:3, :3] = rotation(vector) @ pose[:3, :3]
    result[:3, 3] = rotation(vector) @ (pose[:3, 3] - centre) + centre + shift
    return result


def placed(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def start_at(pose, targets, distance, rng):
    """A start whose mean displacement of the targets is `distance`, shift and rotation in random proportion."""
    centre = placed(pose, targets).mean(axis=0)
    shift, vector = rng.standard_normal(3), rng.standard_normal(3)
    shift *= rng.uniform(0.2, 1) / np.linalg.norm(shift)
    vector *= rng.uniform(0.2, 1) / np.linalg.norm(vector) / 30
    low, high = 0.0, 100.0
    for _ in range(60):
        factor = (low + high) / 2
        start = moved(pose, centre, factor * shift, factor * vector)
        error = np.linalg.norm(placed(start, targets) - placed(pose, targets), axis=1).mean()
        low, high = (factor, high) if error < distance else (low, factor)
    return moved(pose, centre, low * shift, low * vector)


class Protocol:
    def __init__(self, arguments, folder):
        self.program, self.threads, self.folder = arguments.program, arguments.threads, folder
        self.knees = {}

    def run(self, *words):
        done = subprocess.run([self.program, *map(str, words)], capture_output=True, text=True, check=False)
        if done.returncode not in (0, 3):
            sys.exit(f"{' '.join(map(str, words))}\n{done.stderr}")

    def knee(self, seed):
        """Folder of the knee's volumes."""
        if seed not in self.knees:
            folder = self.folder / f"knee{seed}"
            self.knees[seed] = folder, np.array([0, 5, 20.0]) + TARGETS
            if folder.exists():
                return self.knees[seed]
            folder.mkdir()
            knee = bone_ct.Knee(seed)
            scan = bone_ct.rounded(knee.scanned())
            bone_ct.write_nrrd(folder / "true.nrrd", bone_ct.rounded(knee.hu))
            bone_ct.write_nrrd(folder / "scan.nrrd", scan)
            bone_ct.write_nrrd(folder / "mirrored.nrrd", scan[:, :, ::-1])
            bone_ct.write_nrrd(folder / "scaled.nrrd", scan, 1.03 * bone_ct.VOXEL_MM)
            for name, mask in (("femur", knee.femur), ("tibia", knee.tibia)):
                bone_ct.write_nrrd(folder / f"{name}.nrrd", mask.astype(np.uint8))
                bone_ct.write_nrrd(folder / f"mirrored_{name}.nrrd", mask[:, :, ::-1].astype(np.uint8))
                bone_ct.write_nrrd(folder / f"scaled_{name}.nrrd", mask.astype(np.uint8), 1.03 * bone_ct.VOXEL_MM)
        return self.knees[seed]

    def simulated(self, knee, seed, shift=(0, 0, 0)):
        """Case folder, and calibrator_from_patient. `shift`: of the leg along L, P, S."""
        case = self.folder / f"case{seed}-{knee}{''.join(f'_{s:g}' for s in shift)}"
        if not case.exists():
            centre = ",".join(f"{-s:g}" for s in shift)
            self.run("simulate", case, "--kind", "flat", "--seed", seed, "--ct", self.knee(knee)[0] / "true.nrrd",
                     f"--ct-centre={centre}", "--quiet")
        return case, np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])

    def cameras(self, case, out):
        """Views' cameras as calibrated, with the image of each."""
        self.run("run", case, "--out", out, "--quiet")
        views = json.loads((out / "result.json").read_text())["views"]
        given = json.loads((case / "case.json").read_text())["views"]
        cameras = []
        for view, image in zip(views, given):
            pose, k = np.array(view["camera_from_calibrator"]), view["intrinsics"]
            cameras.append(({"K": [[k["fx_px"], 0, k["u0"]], [0, k["fy_px"], k["v0"]], [0, 0, 1]]}, pose, image))
        return cameras

    def register(self, case, model, out, views):
        work = self.folder / "work"
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(case, work)
        case_json = json.loads((case / "case.json").read_text())
        case_json["views"] = views
        case_json["models"] = [{**model, "volume": "volume.nrrd", "mask": "mask.nrrd"}]
        for name in ("volume", "mask"):
            os.link(model[name], work / f"{name}.nrrd")
        (work / "case.json").write_text(json.dumps(case_json))
        self.run("register", work, "--out", out, "--quiet", "--threads", self.threads)
        return json.loads((out / "registration.json").read_text())["models"][0]

    def case(self, kind, number):
        rng = np.random.default_rng([number, KINDS.index(kind)])
        seed, knee = 100 + number, number % 4
        folder, targets = self.knee(knee)
        case, pose = self.simulated(knee, seed)
        volume, mask = folder / "scan.nrrd", folder / "femur.nrrd"
        if kind == "patient":
            folder = self.knee(4 + number % 4)[0]
            volume, mask = folder / "scan.nrrd", folder / "femur.nrrd"
        if kind in ("mirrored", "scaled"):
            volume, mask = folder / f"{kind}.nrrd", folder / f"{kind}_femur.nrrd"
        guess = pose.copy()
        if kind == "tibia":
            mask = folder / "tibia.nrrd"
            guess[:3, 3] += pose[:3, :3] @ [0, 0, 55.0]
        if kind in ("moved", "hidden"):
            shift = {"moved": (0, 0, 3), "hidden": (3, 0, 0)}[kind]
            other = self.simulated(knee, seed, shift)[0]
            mixed = self.folder / f"mixed-{kind}{seed}"
            shutil.rmtree(mixed, ignore_errors=True)
            shutil.copytree(case, mixed)
            shutil.copy(other / "LAT.dcm", mixed / "LAT.dcm")
            case = mixed
        if kind == "camera":
            case = self.shifted_camera(case, seed)
        views = json.loads((case / "case.json").read_text())["views"]
        distance = rng.uniform(0, 20) if kind == "right" else rng.uniform(0, 5)
        model = {"name": "femur", "volume": str(volume), "mask": str(mask),
                 "start": {"world_from_model": start_at(guess, targets, distance, rng).tolist()}}
        result = self.register(case, model, self.folder / "out", views[:1] if kind == "one_view" else views)
        row = self.row(kind, number, distance, pose, targets, result)
        if kind == "one_view":
            ray = self.cameras(case, self.folder / "calibrated")[0][1][2, :3]
            row |= self.along(ray, pose, targets, result)
            both = self.along(ray, pose, targets, self.register(case, model, self.folder / "out", views))
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

    def shifted_camera(self, case, seed):
        changed = self.folder / f"camera{seed}"
        shutil.rmtree(changed, ignore_errors=True)
        changed.mkdir()
        views = []
        for i, (camera, pose, image) in enumerate(self.cameras(case, self.folder / "calibrated")):
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
        row = {"kind": kind, "number": number, "start_mm": distance, "decision": result["decision"] or "refuse",
               "code": (result.get("failure") or {}).get("code"), "seconds": result.get("seconds"),
               "warnings": [w["code"] for w in result.get("warnings", [])]}
        if result.get("world_from_model"):
            found = np.array(result["world_from_model"])
            errors = placed(found, targets) - placed(pose, targets)
            row["mtre_mm"] = float(np.linalg.norm(errors, axis=1).mean())
            if result.get("covariance"):
                covariance, centre = np.array(result["covariance"]), np.array(result["centre_mm"])
                row["inside"] = float(np.mean([e @ np.linalg.solve(self.of_point(covariance, p - centre), e) < CHI2_95
                                               for e, p in zip(errors, placed(found, targets))]))
        return row

    @staticmethod
    def of_point(covariance, arm):
        x, y, z = arm
        jacobian = np.hstack([[[0, z, -y], [-z, 0, x], [y, -x, 0]], np.eye(3)])
        return jacobian @ covariance @ jacobian.T


def figures(values):
    return [f"{np.percentile(values, q):.2f}" for q in (50, 95, 100)] if values else ["-"] * 3


def tables(rows):
    lines = []
    right = [row for row in rows if row["kind"] == "right"]
    if right:
        lines += ["| start | cases | mTRE median | 95 % | max | success 1 mm | 2 mm | refused | in the 95 % region |",
                  "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
        for low, high in ((0, 5), (5, 10), (10, 15), (15, 20), (0, 20)):
            own = [row for row in right if low <= row["start_mm"] < high]
            kept = [row for row in own if row["decision"] != "refuse"]
            errors = [row["mtre_mm"] for row in kept]
            share = lambda limit: f"{sum(e < limit for e in errors)} of {len(own)}"  # noqa: E731
            inside = [row["inside"] for row in kept if "inside" in row]
            lines.append(f"| {low} to {high} mm | {len(own)} | {' | '.join(figures(errors))} | {share(1)} | {share(2)} | "
                         f"{len(own) - len(kept)} | {f'{100 * np.mean(inside):.0f} %' if inside else '-'} |")
        kept = [row["start_mm"] for row in right if row["decision"] != "refuse" and row["mtre_mm"] > 2]
        lines += ["", f"Median {np.median([row['seconds'] for row in right]):.1f} s. Not refused and beyond 2 mm: {len(kept)}.", ""]
    wrong = [kind for kind in KINDS[1:-1] if any(row["kind"] == kind for row in rows)]
    if wrong:
        lines += ["| wrong | cases | refused | warned | accepted | codes |", "| --- | --- | --- | --- | --- | --- |"]
    for kind in wrong:
        own = [row for row in rows if row["kind"] == kind]
        count = lambda decision: sum(row["decision"] == decision for row in own)  # noqa: E731
        codes = sorted({row["code"] or ",".join(row["warnings"]) or "-" for row in own})
        lines.append(f"| {kind} | {len(own)} | {count('refuse')} | {count('warn')} | {count('accept')} | {', '.join(codes)} |")
    single = [row for row in rows if row["kind"] == "one_view" and "sigma_mm" in row and row["both_sigma_mm"]]
    if single:
        errors, sigmas, both = (np.array([row[name] for row in single]) for name in ("error_mm", "sigma_mm", "both_sigma_mm"))
        lines += ["", "| one view | decisions | error along its ray, rms | predicted sigma, median | both views' sigma, median | error over sigma, rms |",
                  "| --- | --- | --- | --- | --- | --- |",
                  f"| {len(single)} cases | {', '.join(sorted({row['decision'] for row in single}))} | {np.sqrt(np.mean(errors**2)):.2f} mm | "
                  f"{np.median(sigmas):.2f} mm | {np.median(both):.3f} mm | {np.sqrt(np.mean((errors / sigmas) ** 2)):.1f} |"]
    return "\n".join(lines)


def renew(document, table):
    begin, end = "<!-- registration protocol -->", "<!-- end of the registration protocol -->"
    text = document.read_text()
    if begin not in text or end not in text:
        sys.exit(f"{document}: the marks {begin} and {end} are missing")
    document.write_text(f"{text[:text.index(begin)]}{begin}\n{table}\n{text[text.index(end):]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--starts", type=int, default=20, help="right cases")
    parser.add_argument("--cases", type=int, default=10, help="of each wrong kind")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--rows", type=pathlib.Path, help="JSON lines of all cases; those it holds are not run again")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for cases and results (default: a temporary one)")
    parser.add_argument("--doc", type=pathlib.Path, help="renews the tables between the marks of that document")
    arguments = parser.parse_args()
    rows = [json.loads(line) for line in arguments.rows.read_text().splitlines()] \
        if arguments.rows and arguments.rows.exists() else []
    done = {(row["kind"], row["number"]) for row in rows}
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        protocol = Protocol(arguments, folder)
        for kind in arguments.kinds.split(","):
            for number in range(arguments.starts if kind == "right" else arguments.cases):
                if (kind, number) in done:
                    continue
                rows.append(protocol.case(kind, number))
                print(json.dumps(rows[-1]), flush=True)
                if arguments.rows:
                    with arguments.rows.open("a") as out:
                        out.write(json.dumps(rows[-1]) + "\n")
    table = tables(rows)
    print(table)
    if arguments.doc:
        renew(arguments.doc, table)
    return any(row["kind"] in VISIBLE and row["decision"] == "accept" for row in rows)


if __name__ == "__main__":
    sys.exit(main())
