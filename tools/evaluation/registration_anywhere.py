#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Registers a modelled knee's bones without a start, their volumes turned at random, and wrong ones.

  tools/evaluation/registration_anywhere.py --cases 20 --rows anywhere.jsonl

Knees and images are those of tools/evaluation/registration_protocol.py. Each case's volume and mask are turned by a rotation
that is uniform over all of them, so that any orientation occurs. Right kinds: femur, tibia. Wrong ones: `mirrored` (femur), `mirrored_tibia`,
`patient` (another knee's femur), `patient_tibia`. Error: rms over the corners of a box of 40 mm about the bone's end.
False accept: not refused, and the error over 2 mm or the kind wrong. Exit code 1 if there is one. --rows keeps what is done; the
same command goes on after an interruption. Needs NumPy."""
import argparse
import json
import math
import pathlib
import shutil
import sys
import tempfile

import numpy as np

import registration_protocol as protocol

RIGHT = ("femur", "tibia")
WRONG = ("mirrored", "mirrored_tibia", "patient", "patient_tibia")
MARKS = "<!-- registration anywhere -->", "<!-- end of the registration anywhere -->"
END_MM = {"femur": (0, 5, 20.0), "tibia": (0, 5, -20.0)}


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


def row_of(knees, kind, number):
    rng = np.random.default_rng([number, (RIGHT + WRONG).index(kind), 9])
    body, case = knees.body, knees.simulated(number)
    bone = "tibia" if "tibia" in kind else "femur"
    volumes = knees.volumes(body.subject(number, other="patient" in kind))
    side = "mirrored" if "mirrored" in kind else "scan"
    files = {"volume": volumes / f"{side}.nrrd", "mask": volumes / f"{'mirrored_' if side == 'mirrored' else ''}{bone}.nrrd"}
    rotation = random_rotation(rng)
    folder = knees.folder / f"anywhere-{kind}-{number}"
    folder.mkdir(exist_ok=True)
    model = {"name": bone, "scale_sigma": 0}
    for name, path in files.items():
        turn_nrrd(path, folder / f"{name}.nrrd", rotation)
        model[name] = folder / f"{name}.nrrd"
    views = json.loads((case / "case.json").read_text())["views"]
    result = knees.register(case, model, folder / "out", views)
    row = {"kind": kind, "number": number, "decision": result["decision"], "code": (result.get("failure") or {}).get("code"),
           "seconds": result.get("seconds")}
    if kind in RIGHT and result.get("world_from_model"):
        truth = np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])
        found = np.array(result["world_from_model"])
        points = np.array(END_MM[bone]) + protocol.TARGETS
        errors = protocol.placed(found, points @ rotation.T) - protocol.placed(truth, points)
        row["error_mm"] = math.sqrt(np.mean(np.sum(errors**2, axis=1)))
    shutil.rmtree(folder)
    return row


def is_false(row):
    return row["decision"] != "refuse" and (row["kind"] in WRONG or row.get("error_mm", math.inf) > 2)


def table(rows):
    lines = ["| model | cases | right | refused | false accepts | error median | max | seconds median | 95 % |", "| --- |" + " --- |" * 8]
    for kind in RIGHT + WRONG:
        own = [row for row in rows if row["kind"] == kind]
        if not own:
            continue
        kept = [row["error_mm"] for row in own if row["decision"] != "refuse" and "error_mm" in row]
        seconds = [row["seconds"] for row in own if row["seconds"] is not None]
        cells = [kind, len(own), sum(error <= 2 for error in kept) if kind in RIGHT else "-", sum(row["decision"] == "refuse" for row in own),
                 sum(map(is_false, own)), *protocol.figures(kept, (50, 100)), *protocol.figures(seconds, (50, 95), 1)]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--cases", type=int, default=10, help="of each kind (default: 10)")
    parser.add_argument("--kinds", default=",".join(RIGHT + WRONG))
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--rows", type=pathlib.Path, help="JSON lines of all cases; those it holds are not run again")
    parser.add_argument("--doc", type=pathlib.Path, help="renews the table between the marks of that document")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the simulated cases (default: a temporary one)")
    arguments = parser.parse_args()
    rows = protocol.rows_in(arguments.rows)
    done = {(row["kind"], row["number"]) for row in rows}
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        knees = protocol.Protocol(protocol.Knees(), arguments, folder)
        for number in range(arguments.cases):
            for kind in arguments.kinds.split(","):
                if (kind, number) in done:
                    continue
                rows.append(row_of(knees, kind, number))
                print(json.dumps(rows[-1]), flush=True)
                if arguments.rows:
                    with arguments.rows.open("a") as out:
                        out.write(json.dumps(rows[-1]) + "\n")
    print(table(rows))
    if arguments.doc:
        protocol.renew(arguments.doc, table(rows), *MARKS)
    return any(map(is_false, rows))


if __name__ == "__main__":
    sys.exit(main())
