#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A modelled CT of a vertebra, a hip or a wrist, with a planned tunnel: no patient's, for trying the program on other bones.

  examples/bones/bones.py vertebra my-vertebra
  examples/bones/bones.py hip my-hip
  examples/bones/bones.py wrist my-wrist

writes into the folder:
  ct.nrrd         what a scanner gives, with noise (LPS, mm)
  true.nrrd       the body itself, for `helicarm simulate --ct`
  plan.mrk.json   a line of 3D Slicer: a screw in the left pedicle, a guide wire in the femoral neck, a screw in the scaphoid
  seed.txt        x,y,z of a point in the bone, for `helicarm segment --seed`

  examples/bones/bones.py vertebra my-vertebra --into my-case/case.json

copies CT, plan and the mask that `helicarm segment --out my-vertebra` wrote beside a case.json or plan.json, and adds model and tunnel
to it; in a plan.json the bone carries the marker that the virtual devices call "femur". The steps are in docs/howto.md ("A
vertebra, a hip, a wrist"). Needs NumPy."""
import argparse
import json
import pathlib
import shutil

import numpy as np

VOXEL_MM = 0.7
SIZE = (150, 150, 150)  # along L, P, S
LOW = -0.5 * VOXEL_MM * (np.array(SIZE) - 1)
AIR, FAT, MUSCLE, CORTEX = -1000, -90, 45, 1300


def field(rng, sigma_mm, voxel_mm=VOXEL_MM):
    """Noise of unit variance, correlated over sigma."""
    spectrum = np.fft.rfftn(rng.standard_normal(SIZE[::-1]))
    for axis, frequencies in enumerate((np.fft.fftfreq, np.fft.fftfreq, np.fft.rfftfreq)):
        shape = [1, 1, 1]
        shape[axis] = -1
        at = frequencies(SIZE[::-1][axis], voxel_mm).reshape(shape)
        spectrum = spectrum * np.exp(-2 * (np.pi * sigma_mm * at) ** 2)
    noise = np.fft.irfftn(spectrum, SIZE[::-1])
    return (noise / noise.std()).astype(np.float32)


class Space:
    """Signed distances, mm, on the grid: negative inside."""

    def __init__(self):
        axes = [LOW[i] + VOXEL_MM * np.arange(SIZE[i]) for i in range(3)]
        s, p, l = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij", sparse=True)
        self.axes = l, p, s

    def ellipsoid(self, centre, radii):
        q = [(axis - c) / r for axis, c, r in zip(self.axes, centre, radii)]
        return (np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2) - 1) * min(radii)

    def rod(self, begin, end, radius, end_radius=None):
        """Round; its radius changes evenly to that of the end."""
        begin, end = np.array(begin, float), np.array(end, float)
        way = end - begin
        from_begin = [axis - b for axis, b in zip(self.axes, begin)]
        share = np.clip(sum(f * w for f, w in zip(from_begin, way)) / (way @ way), 0, 1)
        off = np.sqrt(sum((f - share * w) ** 2 for f, w in zip(from_begin, way)))
        return off - (radius + share * ((end_radius or radius) - radius))


def united(*distances, soft=1.5):
    """Smooth union."""
    least = np.minimum.reduce(np.broadcast_arrays(*distances))
    return least - soft * np.log(sum(np.exp(-np.clip(d - least, 0, 30) / soft) for d in distances))


def vertebra(space):
    """A lumbar vertebra with its neighbours' end plates, seen from its own middle; anterior is negative P."""
    body = united(space.ellipsoid((0, -12, 0), (24, 17, 25)))
    s = space.axes[2]
    body = np.maximum(body, np.abs(s) - 13.5 + 0 * body)
    arch = [space.rod((side * 13, -1, 5), (side * 15, 15, 4), 4.6) for side in (-1, 1)]
    laminae = [space.rod((side * 15, 15, 4), (0, 26, -2), 4) for side in (-1, 1)]
    transverse = [space.rod((side * 15, 12, 4), (side * (37 + 2 * side), 14, 6 + side), 3.4, 2.4) for side in (-1, 1)]
    joints = [space.rod((side * 15, 14, 14), (side * 14, 16, -17), 4.5, 4) for side in (-1, 1)]
    spinous = space.rod((0, 26, -3), (1, 43, -9), 3, 4.5)
    bone = united(body, *arch, *laminae, *transverse, *joints, spinous)
    others = [np.maximum(space.ellipsoid((0, -12, side * 36), (24, 17, 25)), np.abs(s - side * 36) - 13.5) for side in (-1, 1)]
    return bone, others, (0, -12, 0), ((15.1, 17.5, 4.4), (10.6, -18, 5.6))


def hip(space):
    """A proximal femur and the socket's roof."""
    head = space.ellipsoid((-26, 0, 26), (23, 23, 23))
    neck = space.rod((-22, 0, 22), (8, 2, -8), 13, 15)
    trochanter = space.ellipsoid((17, 6, 2), (11, 16, 17))
    lesser = space.ellipsoid((-2, 12, -24), (8, 8, 9))
    shaft = space.rod((12, 2, -12), (8, 0, -80), 16, 13)
    bone = united(head, neck, trochanter, lesser, shaft, soft=2.5)
    socket = np.maximum(space.ellipsoid((-30, 0, 30), (33, 33, 33)), -space.ellipsoid((-26, 0, 26), (26, 26, 26)))
    socket = np.maximum(socket, (space.axes[0] + 30) + 0 * socket)
    return bone, [socket], (-26, 0, 26), ((26, 3, -22), (-33, 0, 33))


def wrist(space):
    """A scaphoid, bent at its waist, beside radius, lunate and capitate."""
    bone = united(space.ellipsoid((6, 2, 2), (6.5, 7, 8)), space.rod((7, 1, 4), (13, -4, 13), 4.6, 4.4),
                  space.ellipsoid((14, -5, 15), (5.5, 5, 6)), soft=1.0)
    radius = united(space.rod((5, 2, -18), (3, 4, -80), 12, 8), space.ellipsoid((15, 1, -10), (6, 7, 9)),
                    space.ellipsoid((-4, 2, -15), (10, 9, 7)))
    radius = np.maximum(radius, 2.5 - space.ellipsoid((6, 2, 4), (9, 10, 11)))
    lunate = np.maximum(space.ellipsoid((-10, 2, 0), (8.5, 9, 7)), 1.5 - bone)
    capitate = np.maximum(space.rod((-4, 0, 13), (-3, -1, 32), 6.5, 7.5), np.maximum(1.5 - bone, 1.5 - lunate))
    ulna = space.rod((-24, 5, -20), (-22, 6, -80), 7, 6)
    return bone, [radius, lunate, capitate, ulna], (7, 1, 3), ((16, -6.5, 19), (4.5, 3, -4))


WRIST_HU = (200, 3000)  # all its bones
DIAMETERS_MM = {"vertebra": 4.5, "hip": 7, "wrist": 2.4}
BODIES = {"vertebra": (vertebra, 2.0), "hip": (hip, 2.5), "wrist": (wrist, 1.0)}


def hounsfield(name):
    """The body itself, its scan, a point in the bone, and the plan."""
    space, rng = Space(), np.random.default_rng(sum(map(ord, name)))
    make, cortex_mm = BODIES[name]
    bone, others, seed, plan = make(space)
    rough = 0.35 * field(rng, 5)  # no two sides are alike
    l, p, _ = space.axes
    outside = np.sqrt((l / 50) ** 2 + (p / 49) ** 2) * 49 - 49 + 0 * bone
    hu = np.where(outside < -6, MUSCLE + 12 * field(rng, 4), np.where(outside < 0, FAT, AIR)).astype(np.float32)
    texture = field(rng, 0.9)
    for distance in (*others, bone):
        distance = distance + rough
        share = np.clip(0.5 - distance / VOXEL_MM, 0, 1)
        shell = np.clip(0.5 + (distance + cortex_mm) / VOXEL_MM, 0, 1)
        hu = (1 - share) * hu + share * (shell * CORTEX + (1 - shell) * (280 + 90 * texture))
    scan = hu + 25 * rng.standard_normal(SIZE[::-1])
    return hu, scan, seed, plan


def write_nrrd(path, hu):
    voxels = np.clip(np.rint(hu), -1024, 3000).astype("<i2")
    header = (f"NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: {SIZE[0]} {SIZE[1]} {SIZE[2]}\n"
              f"space directions: ({VOXEL_MM},0,0) (0,{VOXEL_MM},0) (0,0,{VOXEL_MM})\nendian: little\nencoding: raw\n"
              f"space origin: ({LOW[0]},{LOW[1]},{LOW[2]})\n\n")
    path.write_bytes(header.encode() + np.ascontiguousarray(voxels).tobytes())


def line(name, ends):
    points = [{"id": str(i + 1), "label": f"{name}-{i + 1}", "position": [float(x) for x in end], "positionStatus": "defined"}
              for i, end in enumerate(ends)]
    return {"@schema": "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
                       "markups-schema-v1.0.3.json#",
            "markups": [{"type": "Line", "name": name, "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": points}]}


def add_model(name, folder, into, diameter):
    """Model and tunnel for a case.json or a plan.json."""
    for file in ("ct.nrrd", "plan.mrk.json", f"{name}.nrrd"):
        shutil.copy(folder / file, into.parent / file)
    content = json.loads(into.read_text())
    mask = f"{name}.nrrd"
    # The bones of a wrist in a splint lie as in the CT: all are registered, the scaphoid holds the screw.
    body = {"window_hu": WRIST_HU, "tunnel_mask": mask} if name == "wrist" else {"mask": mask}
    model = {"name": name, "volume": "ct.nrrd", **body, "plan": "plan.mrk.json"}
    tunnel = {"name": "screw", "model": name, "line": "screw", "diameter_mm": diameter, "bridge_mm": 1}
    if content["format"].startswith("helicarm-plan"):
        content |= {"bones": [name], "picks": []}
        content["tracker"]["markers"] = {name: "femur", "tool": "tool"}
        model["moves_with"] = tunnel["bone"] = name
    content |= {"models": [model], "tunnels": [tunnel]}
    into.write_text(json.dumps(content, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bone", choices=BODIES)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--into", type=pathlib.Path, help="case.json or plan.json to which the model is added; no CT is made")
    arguments = parser.parse_args()
    if arguments.into:
        return add_model(arguments.bone, arguments.folder, arguments.into, DIAMETERS_MM[arguments.bone])
    hu, scan, seed, (start, end) = hounsfield(arguments.bone)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    write_nrrd(arguments.folder / "true.nrrd", hu)
    write_nrrd(arguments.folder / "ct.nrrd", scan)
    (arguments.folder / "plan.mrk.json").write_text(json.dumps(line("screw", (start, end)), indent=1) + "\n")
    (arguments.folder / "seed.txt").write_text(",".join(map(str, seed)) + "\n")
    print(f"{arguments.folder}: a screw of {DIAMETERS_MM[arguments.bone]} mm is planned from {start} to {end}; seed {seed}")
    return None


if __name__ == "__main__":
    main()
