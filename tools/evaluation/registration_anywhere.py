#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Registers a modelled knee's bones, other bones, or a patient's head, without a start, their volumes turned at random, and wrong ones.

  tools/evaluation/registration_anywhere.py --cases 20 --rows anywhere.jsonl
  tools/evaluation/registration_anywhere.py --bones --cases 20 --rows bones.jsonl
  tools/evaluation/registration_anywhere.py --head --cases 20 --rows head.jsonl

Knees, head and images are those of tools/evaluation/registration_protocol.py, vertebra, hip and wrist those of examples/bones (the
wrist by a window of all its bones). Each case's volume and mask are
turned by a rotation that is uniform over all of them, so that any orientation occurs. Right kinds: femur, tibia, vertebra, hip, wrist,
head. Wrong ones: `mirrored` (femur), `mirrored_tibia`, `mirrored_vertebra`, ..., `patient` (the femur of one of twelve other
knees), `patient_tibia`, `absent_femur` (images of the same knee without its femur: the other bone is all there is),
`absent_tibia`. Error: rms over the corners of a box of 40 mm about the bone's end, of other bones over the planned screw's ends and
points 20 mm from the seed of its segmentation, of the head over points of the skull. False accept: not refused, and the error over
2 mm or the kind wrong. Exit code 1 if there is one. --rows keeps what is done; the same command goes on after an interruption. Needs
NumPy."""
import argparse
import functools
import itertools
import json
import math
import pathlib
import shutil
import sys

import numpy as np

import bone_ct
import evaluation_rows
import head_ct
import registration_bodies
import registration_protocol as protocol

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples/bones"))
import bones  # noqa: E402

RIGHT = ("femur", "tibia")
WRONG = ("mirrored", "mirrored_tibia", "patient", "patient_tibia", "absent_femur", "absent_tibia")
OF_HEAD = ("head", "mirrored_head")
OF_BONES = tuple(kind for bone in bones.BODIES for kind in (bone, f"mirrored_{bone}"))
KINDS = RIGHT + WRONG + OF_HEAD + OF_BONES
NAMES = ("femur", "tibia", "head", *bones.BODIES)
END_MM = {"femur": (0, 5, 20.0), "tibia": (0, 5, -20.0)}
OTHERS = 12


class Knees(registration_bodies.Knees):
    of_anywhere, window_hu = RIGHT + WRONG, None

    def other(self, number):
        return 4 + number % OTHERS

    def write(self, folder, subject):
        super().write(folder, subject)
        knee = bone_ct.Knee(subject)
        for name, mask in (("femur", knee.femur), ("tibia", knee.tibia)):
            bone_ct.write_nrrd(folder / f"without_{name}.nrrd", bone_ct.rounded(np.where(mask, bone_ct.MUSCLE, knee.hu)))

    def targets_of(self, bone):
        return np.array(END_MM[bone]) + registration_bodies.TARGETS


class Heads(registration_bodies.Heads):
    of_anywhere, window_hu = OF_HEAD, head_ct.WINDOW_HU

    def targets_of(self, _):
        return self.targets


class Bone:
    """One of examples/bones; the wrist as the how-to registers it."""

    def __init__(self, name):
        self.name, self.of_anywhere = name, (name, f"mirrored_{name}")
        self.window_hu = bones.WRIST_HU if name == "wrist" else None

    def subject(self, _):
        return 0

    def write(self, folder, _):
        folder.mkdir()
        hu, scan, seed, plan = bones.hounsfield(self.name)
        bones.write_nrrd(folder / "true.nrrd", hu)
        mask = bones.BODIES[self.name][0](bones.Space())[0] < 0
        for side, turned in (("scan", slice(None)), ("mirrored", slice(None, None, -1))):
            bones.write_nrrd(folder / f"{side}.nrrd", scan[:, :, turned])
            bones.write_nrrd(folder / f"{'' if side == 'scan' else 'mirrored_'}{self.name}.nrrd", mask[:, :, turned])
        self.targets = np.vstack([*plan, np.array(seed) + 20 * np.vstack([np.eye(3), -np.eye(3)])])

    def targets_of(self, _):
        return self.targets


def random_rotation(rng):
    q = rng.standard_normal(4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def turn_nrrd(source, target, rotation):
    """Copies a file of bone_ct.write_nrrd with its patient frame turned."""
    header, voxels = source.read_bytes().split(b"\n\n", 1)
    lines = header.decode().split("\n")
    row = lambda vector: "(" + ",".join(f"{value:.12g}" for value in vector) + ")"  # noqa: E731
    vectors = lambda line: [np.array(json.loads(f"[{word.strip('()')}]")) for word in line.split(": ")[1].split()]  # noqa: E731
    for i, line in enumerate(lines):
        if line.startswith(("space directions", "space origin")):
            lines[i] = line.split(":")[0] + ": " + " ".join(row(rotation @ vector) for vector in vectors(line))
    target.write_bytes("\n".join(lines).encode() + b"\n\n" + voxels)


def files_of(bodies, kind, number):
    """The model's volume and mask, and the model's other keys of case.json."""
    body = bodies.body
    side = "mirrored" if "mirrored" in kind else "scan"
    volumes = bodies.volumes(body.other(number) if "patient" in kind else body.subject(number))
    volume = {"volume": volumes / f"{side}.nrrd"}
    if body.window_hu:
        return volume, {"window_hu": body.window_hu}
    return {**volume, "mask": volumes / f"{'mirrored_' if side == 'mirrored' else ''}{bone_of(kind)}.nrrd"}, {}


def bone_of(kind):
    return next((name for name in NAMES if kind.endswith(name)), "femur")


def row_of(bodies, kind, number):
    rng = np.random.default_rng([number, KINDS.index(kind), 9])
    bone = bone_of(kind)
    case = bodies.simulated(number, of=f"without_{bone}" if "absent" in kind else "true")
    rotation = random_rotation(rng)
    folder = bodies.folder / f"anywhere-{kind}-{number}"
    folder.mkdir(exist_ok=True)
    files, keys = files_of(bodies, kind, number)
    model = {"name": bone, "scale_sigma": 0, **keys}
    for name, path in files.items():
        turn_nrrd(path, folder / f"{name}.nrrd", rotation)
        model[name] = folder / f"{name}.nrrd"
    views = json.loads((case / "case.json").read_text())["views"]
    result = bodies.register(case, model, folder / "out", views)
    row = {"kind": kind, "number": number, "decision": result["decision"], "code": (result.get("failure") or {}).get("code"),
           "seconds": result.get("seconds")}
    if kind == bone and result.get("world_from_model"):
        truth = np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])
        found = np.array(result["world_from_model"])
        points = bodies.body.targets_of(bone)
        errors = protocol.placed(found, points @ rotation.T) - protocol.placed(truth, points)
        row["error_mm"] = math.sqrt(np.mean(np.sum(errors**2, axis=1)))
    shutil.rmtree(folder)
    return row


def is_false(row):
    return row["decision"] != "refuse" and row.get("error_mm", math.inf) > 2


def table(rows):
    lines = ["| model | cases | right | refused | false accepts | error median | max | seconds median | 95 % |", "| --- |" + " --- |" * 8]
    for kind in KINDS:
        own = [row for row in rows if row["kind"] == kind]
        if not own:
            continue
        kept = [row["error_mm"] for row in own if row["decision"] != "refuse" and "error_mm" in row]
        seconds = [row["seconds"] for row in own if row["seconds"] is not None]
        cells = [kind, len(own), sum(error <= 2 for error in kept) if kind == bone_of(kind) else "-", sum(row["decision"] == "refuse" for row in own),
                 sum(map(is_false, own)), *protocol.figures(kept, (50, 100)), *protocol.figures(seconds, (50, 95), 1)]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--cases", type=int, default=10, help="of each kind (default: 10)")
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER", help="the first case's number (default: 0)")
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--bones", action="store_true", help="vertebra, hip and wrist of examples/bones instead of the knees")
    other.add_argument("--head", nargs="?", const="", metavar="PATH",
                        help="the head instead of the knees; PATH of Cranium.inv3, default: where its package installs it")
    parser.add_argument("--kinds", help=f"some of {','.join(KINDS)}; default: all that the body has")
    parser.add_argument("--threads", type=int, default=0)
    evaluation_rows.add_options(parser)
    arguments = parser.parse_args()
    if arguments.head is not None:
        name, bodies = ", head", [Heads(arguments.head or None)]
    elif arguments.bones:
        name, bodies = ", bones", [Bone(bone) for bone in bones.BODIES]
    else:
        name, bodies = "", [Knees()]
    if arguments.first:
        name += f" from {arguments.first}"
    own = [kind for body in bodies for kind in body.of_anywhere]
    kinds = arguments.kinds.split(",") if arguments.kinds else own
    if unknown := [kind for kind in kinds if kind not in own]:
        parser.error(f"--kinds: {', '.join(unknown)}: there are {', '.join(own)}")
    rows = evaluation_rows.Rows(arguments.rows, ("kind", "number"))
    with evaluation_rows.folder_of(arguments.keep) as folder:
        protocols = [protocol.Protocol(body, arguments, folder) for body in bodies]
        for number, of_body in itertools.product(range(arguments.first, arguments.first + arguments.cases), protocols):
            own = [(kind, number) for kind in of_body.body.of_anywhere if kind in kinds]
            rows.gather(functools.partial(row_of, of_body), own)
            of_body.discard(number)
    print(table(rows.rows))
    if arguments.doc:
        evaluation_rows.renew(arguments.doc, table(rows.rows), f"<!-- registration anywhere{name} -->",
                              f"<!-- end of the registration anywhere{name} -->")
    return any(map(is_false, rows.rows))


if __name__ == "__main__":
    sys.exit(main())
