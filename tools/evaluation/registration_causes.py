#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether the notes of a refused registration name what is wrong with the images: a cropped field, metal, a broken bone; and whether one
that is not refused warns of a part that its pose does not explain.

  tools/evaluation/registration_causes.py --cases 6 --rows causes.jsonl --doc docs/registration.md
  tools/evaluation/registration_causes.py --kinds mirrored,patient --cases 12 --rows causes.jsonl

Knees, images and volumes are those of tools/evaluation/registration_protocol.py and registration_anywhere.py; the femur is registered from
a start within 5 mm of the true pose.
  right           nothing is wrong
  mirrored, patient   the CT exchanged left for right, or one of twelve other knees'
  absent_femur    images of the same knee without its femur
  fracture        the femur's joint end, up to 38 mm from the joint line, moved by 5 mm and turned by 8 degrees in any direction
  fracture_shaft  the same up to 55 mm: what remains of the shaft is short
  metal           a plate of 60 x 12 x 3 mm on the femur and four screws of 3.8 mm, 8000 HU
  metal_steel     the same, 20,000 HU
  cropped         round fields of 25, 30 or 42 mm radius at the joint, black beyond; the cameras are given
Notes stand in a refusal alone. What is not refused on its own, of `right`, the fractures and metal, is registered again with a limit of
0.1 micrometres, which refuses it; whether it warned of a part is that of the first registration. Motion of a broken bone: rms over the shorter part, found and true. The
pose of a fracture that is not refused is compared with that of the joint end.

--rows keeps what is done; the same command goes on after an interruption. Needs NumPy. Exit code 1 if a whole bone without metal
is named, in whole images, as broken or as under metal, or warned of."""
import argparse
import functools
import json
import math
import pathlib
import shutil
import sys

import numpy as np

import bone_ct
import evaluation_rows
import registration_anywhere as anywhere
import registration_protocol as protocol

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "drills"))
import falsify_images  # noqa: E402

CUT_MM = {"fracture": 38, "fracture_shaft": 55}
METAL_HU = {"metal": 8000, "metal_steel": 20000}
FORCED = ("right", *CUT_MM, *METAL_HU)
CONTROLS = ("right", "mirrored", "patient", "absent_femur")
KINDS = CONTROLS + (*CUT_MM, *METAL_HU, "cropped")
OF_ALL_REFUSED = "0.0001"  # mm
FRACTURE_MM, FRACTURE_DEG, FRACTURE_CENTRE = 5, 8, np.array([0, 0, 20.0])
FIELDS = ((0, 30), (-15, 42), (10, 25))  # of the cropped ones: its middle, mm from 5 mm above the joint line, and radius at the bone


def rms(vectors):
    return math.sqrt(np.mean(np.sum(vectors**2, axis=1)))


def points_of(knee):
    """L, P, S of all voxels."""
    return np.stack(np.broadcast_arrays(knee.l, knee.p, knee.s), axis=-1)


class Fracture:
    """The femur's joint end up to a cut, moved."""

    def __init__(self, subject, kind):
        rng = np.random.default_rng([subject, CUT_MM[kind]])
        unit = lambda vector: vector / np.linalg.norm(vector)  # noqa: E731
        self.rotation = protocol.rotation(math.radians(FRACTURE_DEG) * unit(rng.standard_normal(3)))
        self.shift = FRACTURE_MM * unit(rng.standard_normal(3))
        self.knee = bone_ct.Knee(subject)
        self.end = self.knee.femur & (self.knee.s < CUT_MM[kind])

    def moved(self, points):
        return (points - FRACTURE_CENTRE) @ self.rotation.T + FRACTURE_CENTRE + self.shift

    def moved_back(self, points):
        return (points - FRACTURE_CENTRE - self.shift) @ self.rotation + FRACTURE_CENTRE

    def hu(self):
        hu = np.where(self.end, bone_ct.MUSCLE, self.knee.hu)
        near = np.where(self.end.any(axis=(1, 2)))[0]
        slab = slice(max(0, near[0] - 20), near[-1] + 20)
        at = (self.moved_back(points_of(self.knee)[slab].reshape(-1, 3)) - bone_ct.LOW) / bone_ct.VOXEL_MM
        low = np.floor(at).astype(int)
        value, weight = np.zeros(len(at)), np.zeros(len(at))
        for corner in np.ndindex(2, 2, 2):
            place = np.clip(low + corner, 0, np.array(bone_ct.SIZE) - 1)
            index = place[:, 2], place[:, 1], place[:, 0]
            share = np.prod(np.where(corner, at - low, 1 - at + low), axis=1) * self.end[index]
            value += share * self.knee.hu[index]
            weight += share
        moved = (value + (1 - weight) * bone_ct.MUSCLE).reshape(hu[slab].shape)
        hu[slab] = np.where(weight.reshape(moved.shape) > 0.02, moved, hu[slab])
        return hu

    def end_error_mm(self, found, pose):
        """rms of a pose found over the moved end; `pose`: of what did not move."""
        end = points_of(self.knee)[self.end]
        return rms(protocol.placed(found, end) - protocol.placed(pose, self.moved(end)))

    def motion_mm(self, cut_mm):
        """rms over the shorter part of a femur cut at a height as the note states it."""
        points = points_of(self.knee)[self.knee.femur]
        height = points[:, 2]
        beyond = height.max() - cut_mm < cut_mm - height.min()
        part = points[(height > cut_mm) == beyond]
        return rms((self.moved_back(part) if beyond else self.moved(part)) - part)


def with_plate(knee, metal_hu):
    """A plate along the femur's lateral side from 12 to 72 mm above the joint line, and four screws through it."""
    begin, end, p, length = 12.0, 72.0, 2.0, 34.0
    row = np.argmin(abs(knee.p.ravel() - p))
    heights = knee.s.ravel()
    on = np.where((heights > begin) & (heights < end) & knee.femur_itself[:, row].any(axis=1))[0]
    side = [knee.l.ravel()[np.where(knee.femur_itself[k, row])[0].max()] for k in on]
    slope, at_joint = np.polyfit(heights[on], side, 1)
    off = knee.l - (slope * knee.s + at_joint)
    metal = (off > 0) & (off < 3) & (abs(knee.p - p) < 6) & (knee.s > begin) & (knee.s < end)
    for height in begin + np.array([8, 22, 38, 52]):
        surface = slope * height + at_joint
        metal |= ((knee.p - p) ** 2 + (knee.s - height) ** 2 < 1.9**2) & (knee.l < surface + 4) & (knee.l > surface - length)
    return np.where(metal, metal_hu, knee.hu)


def write_damaged(path, subject, kind):
    """The volume of a subject's images, unless it exists."""
    if path.exists():
        return
    hu = with_plate(bone_ct.Knee(subject), METAL_HU[kind]) if kind in METAL_HU else Fracture(subject, kind).hu()
    part = path.with_suffix(".part")
    bone_ct.write_nrrd(part, np.clip(np.rint(hu), -1024, 30000).astype(np.int16))
    part.rename(path)


def cropped(bodies, case, folder, pose, number):
    """The case with round fields and, as few balls remain, the cameras."""
    cameras, _ = bodies.cameras(case, folder / "calibrated")
    if not cameras:
        sys.exit(f"{case}: not calibrated")
    made = folder / "cropped"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir()
    above_mm, radius_mm = FIELDS[number % len(FIELDS)]
    views = []
    for i, (camera, camera_pose, image) in enumerate(cameras):
        middle = protocol.placed(camera_pose, protocol.placed(pose, np.array([[0, 0, 5.0 + above_mm]])))[0]
        u, v = (np.array(camera["K"]) @ middle)[:2] / middle[2]
        radius = radius_mm * camera["K"][0][0] / middle[2]
        dicom = falsify_images.Dicom(case / image["image"])
        width, height = dicom.size
        rows, columns = np.mgrid[:height, :width]
        grey = np.array(dicom.pixels()).reshape(height, width)
        dicom.set_pixels(np.where((columns - u) ** 2 + (rows - v) ** 2 > radius**2, 0, grey).astype("<u2")).write(made / image["image"])
        name = f"camera{i}.json"
        (made / name).write_text(json.dumps({**camera, "R": camera_pose[:3, :3].tolist(), "t": camera_pose[:3, 3].tolist()}))
        views.append({**image, "camera": name})
    (made / "case.json").write_text(json.dumps({"format": "helicarm-case/1", "views": views}))
    return made


def named(result):
    """What the notes name: {cause: figures of its first note}."""
    causes = {}
    for note in result.get("notes", []):
        for cause, key in (("cropped", "outside_share"), ("metal", "metal_mm"), ("broken", "from_end_mm")):
            if note["code"] == "wrong_model" and key in note.get("figures", {}):
                causes.setdefault(cause, note["figures"])
    return causes


def warns_of_part(result):
    return any(warning["code"] == "wrong_model" and "agreement_elsewhere" in warning.get("figures", {}) for warning in result.get("warnings", []))


def add_truth(row, fracture, result, pose):
    if result.get("world_from_model"):
        row["end_mm"] = fracture.end_error_mm(np.array(result["world_from_model"]), pose)
    if "broken" in row["named"]:
        row["moved_mm"] = fracture.motion_mm(row["named"]["broken"]["z_mm"])


def row_of(bodies, kind, number):
    rng = np.random.default_rng([number, KINDS.index(kind), 63])
    body = bodies.body
    subject = body.subject(number)
    if kind in CUT_MM or kind in METAL_HU:
        write_damaged(bodies.volumes(subject) / f"{kind}.nrrd", subject, kind)
        case = bodies.simulated(number, of=kind)
    else:
        case = bodies.simulated(number, of="without_femur" if kind == "absent_femur" else "true")
    pose = np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])
    folder = bodies.folder / f"causes-{kind}-{number}"
    folder.mkdir(exist_ok=True)
    if kind == "cropped":
        case = cropped(bodies, case, folder, pose, number)
    files = body.files(bodies.volumes(body.other(number) if kind == "patient" else subject), kind)
    distance = rng.uniform(0, 5)
    start = protocol.start_at(pose, body.targets, distance, rng, body.arm_mm)
    model = {"name": body.model, "start": {"world_from_model": start.tolist()}, **files}
    views = json.loads((case / "case.json").read_text())["views"]
    result = bodies.register(case, model, folder / "out", views)
    row = bodies.row(kind, number, distance, pose, body.targets, result) | {"forced": False, "warns_of_part": warns_of_part(result)}
    if row["decision"] != "refuse" and kind in FORCED:
        bodies.run("register", folder / "work", "--out", folder / "forced", "--max-error", OF_ALL_REFUSED)
        result = json.loads((folder / "forced/registration.json").read_text())["models"][0]
        row["forced"] = result["decision"] == "refuse"
    row["named"] = named(result)
    if kind in CUT_MM:
        add_truth(row, Fracture(subject, kind), result, pose)
    if not bodies.keep:
        shutil.rmtree(folder)
    return row


def is_false(row):
    return row["kind"] in CONTROLS and (row.get("warns_of_part", False) or bool({"metal", "broken"} & row["named"].keys()))


def table(rows):
    lines = ["| images or model | cases | refused | not refused: warned of a part | refused by a limit for the purpose | named as cropped | as metal | as broken | "
             "moved, mm: found, median | true | turned, degrees: found, median | true |", "| --- |" + " --- |" * 11]
    for kind in KINDS:
        own = [row for row in rows if row["kind"] == kind]
        if not own:
            continue
        count = lambda cause: sum(cause in row["named"] for row in own)  # noqa: E731
        broken = [row for row in own if "moved_mm" in row]
        figures = lambda values, digits=1: protocol.figures(values, (50,), digits)  # noqa: E731
        found = lambda key: figures([row["named"]["broken"][key] for row in broken])  # noqa: E731
        cells = [kind, len(own), sum(row["decision"] == "refuse" for row in own),
                 sum(row.get("warns_of_part", False) for row in own) if kind in FORCED else "-",
                 sum(row["forced"] for row in own) if kind in FORCED else "-", count("cropped"), count("metal"), count("broken"),
                 *found("moved_mm"), *figures([row["moved_mm"] for row in broken]), *found("turned_deg"),
                 FRACTURE_DEG if broken else "-"]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    kept = [row["end_mm"] for row in rows if "end_mm" in row and row["decision"] != "refuse"]
    if kept:
        lines += ["", f"Fractures that are not refused on their own: {len(kept)}; their poses' error over the joint end, as moved: median "
                      f"{np.median(kept):.2f} mm, largest {max(kept):.2f} mm."]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--cases", type=int, default=6, help="of each kind (default: 6)")
    parser.add_argument("--kinds", default=",".join(KINDS), help=f"some of {','.join(KINDS)}; default: all")
    parser.add_argument("--threads", type=int, default=0)
    evaluation_rows.add_options(parser)
    arguments = parser.parse_args()
    kinds = arguments.kinds.split(",")
    if unknown := [kind for kind in kinds if kind not in KINDS]:
        parser.error(f"--kinds: {', '.join(unknown)}: there are {', '.join(KINDS)}")
    rows = evaluation_rows.Rows(arguments.rows, ("kind", "number"))
    with evaluation_rows.folder_of(arguments.keep) as folder:
        bodies = protocol.Protocol(anywhere.Knees(), arguments, folder)
        for number in range(arguments.cases):
            rows.gather(functools.partial(row_of, bodies), [(kind, number) for kind in kinds])
            bodies.discard(number)
    print(table(rows.rows))
    if arguments.doc:
        evaluation_rows.renew(arguments.doc, table(rows.rows), "<!-- registration causes -->", "<!-- end of the registration causes -->")
    return any(map(is_false, rows.rows))


if __name__ == "__main__":
    sys.exit(main())
