#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Registers a case's model from perturbed starts and prints where they end.

The case gives its model one start, "world_from_model"; it counts as the reference unless --reference names a JSON file with
a 4x4 matrix. Starts: uniform within +-MM and +-DEG per axis about the model's centre, by a fixed seed. A line for each
start, then the share within 1 and 2 mm of the reference, the spread, decisions and seconds. Python's standard library only.
"""

import argparse
import json
import math
import pathlib
import random
import shutil
import statistics
import subprocess
import tempfile


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(len(b))) for j in range(len(b[0]))] for i in range(len(a))]


def place(pose, point):
    return [sum(pose[i][j] * point[j] for j in range(3)) + pose[i][3] for i in range(3)]


def turned(vector):
    angle = math.sqrt(sum(v * v for v in vector)) or 1e-12
    x, y, z = (v / angle for v in vector)
    c, s, t = math.cos(angle), math.sin(angle), 1 - math.cos(angle)
    return [[c + x * x * t, x * y * t - z * s, x * z * t + y * s], [y * x * t + z * s, c + y * y * t, y * z * t - x * s],
            [z * x * t - y * s, z * y * t + x * s, c + z * z * t]]


def moved(pose, centre, shift, vector):
    """The pose turned about `centre` (world) and shifted."""
    turn = turned(vector)
    rotation = times(turn, [row[:3] for row in pose[:3]])
    arm = [[pose[i][3] - centre[i]] for i in range(3)]
    offset = times(turn, arm)
    return [rotation[i] + [offset[i][0] + centre[i] + shift[i]] for i in range(3)] + [[0, 0, 0, 1]]


def difference(a, b, centre):
    """Distance (mm) at the centre and angle (degrees) between two poses."""
    inverse = [[a[j][i] for j in range(3)] for i in range(3)]
    local = [sum(inverse[i][j] * (centre[j] - a[j][3]) for j in range(3)) for i in range(3)]
    trace = sum(a[i][j] * b[i][j] for i in range(3) for j in range(3))
    return math.dist(place(a, local), place(b, local)), math.degrees(math.acos(max(-1, min(1, (trace - 1) / 2))))


def registered(program, case, json_case, out, threads):
    (case / "case.json").write_text(json.dumps(json_case))
    subprocess.run([program, "register", case, "--out", out, "--quiet", "--threads", str(threads)], check=False)
    return json.loads((out / "registration.json").read_text())["models"][0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=pathlib.Path)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--mm", type=float, default=10)
    parser.add_argument("--deg", type=float, default=10)
    parser.add_argument("--reference", type=pathlib.Path)
    parser.add_argument("--threads", type=int, default=0)
    arguments = parser.parse_args()
    given = json.loads((arguments.case / "case.json").read_text())
    start = given["models"][0]["start"]["world_from_model"]
    reference = json.loads(arguments.reference.read_text()) if arguments.reference else start
    draw = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "case"
        shutil.copytree(arguments.case, copy)
        out = pathlib.Path(folder) / "out"
        centre = registered(arguments.program, copy, given, out, arguments.threads)["centre_mm"]
        ends = []
        for number in range(arguments.starts):
            angles = [math.radians(draw.uniform(-arguments.deg, arguments.deg)) for _ in range(3)]
            shift = [draw.uniform(-arguments.mm, arguments.mm) for _ in range(3)]
            given["models"][0]["start"] = {"world_from_model": moved(reference, centre, shift, angles)}
            model = registered(arguments.program, copy, given, out, arguments.threads)
            ends.append((*difference(reference, model["world_from_model"], centre), model["decision"], model["seconds"]))
            print("{:3d}  {:7.3f} mm  {:6.3f} deg  {}  {:.1f} s".format(number, *ends[-1]), flush=True)
    distances = [end[0] for end in ends]
    print(f"{sum(d <= 1 for d in distances)} of {len(ends)} within 1 mm, {sum(d <= 2 for d in distances)} within 2 mm; "
          f"median {statistics.median(distances):.3f} mm, largest {max(distances):.3f} mm; "
          f"{sum(end[2] != 'refuse' for end in ends)} not refused; median {statistics.median(e[3] for e in ends):.1f} s")


if __name__ == "__main__":
    main()
