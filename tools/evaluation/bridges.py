#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tunnels with planted bridges of -2 to 6 mm in the CTs of modelled knees: bridge and breach against the truth.

  tools/evaluation/bridges.py --knees 200 --rows bridges.jsonl --doc docs/registration.md

Each knee (tools/evaluation/bone_ct.py, a shape of its own) has one tunnel of 5 to 9 mm in its femur, along the surface at a random place,
half of them blind. The CT is blurred and has noise; the mask is the voxels whose centre lies in the shape, and these grown by a voxel. The truth is the least distance from the axis of points
on the surface of the shape from which the CT was made, less the radius; a place is taken only where that is beside the tunnel, 12 mm or more from its
openings, so that it does not depend on what counts as an opening. A breach is missed where the wall is outside and none is stated (95 %),
false where it is not outside. --rows keeps what is done; the same command goes on after an interruption. Needs NumPy and the Python
package (PYTHONPATH=build/python). Exit code 1 if a breach is missed."""
import argparse
import sys

import numpy as np

import bone_ct
import evaluation_rows
import helicarm

MARKS = "<!-- bridges -->", "<!-- end of the bridges -->"
LOW_MM, HIGH_MM = -2, 6
OPENING_MM = 12
TRIES = 300  # of places for one bridge
VOXEL_MM = bone_ct.VOXEL_MM
BEYOND_MM = 1e3  # value outside the grid


def surface_of(distance):
    """Points of the shape's surface, 0.8 mm apart or less, and its outward normals: voxels beside it, moved onto it."""
    s, p, l = np.nonzero(np.abs(distance[2:-2, 2:-2, 2:-2]) < 1.5 * VOXEL_MM)
    s, p, l = s + 2, p + 2, l + 2
    gradient = np.stack([distance[s, p, l + 1] - distance[s, p, l - 1], distance[s, p + 1, l] - distance[s, p - 1, l],
                         distance[s + 1, p, l] - distance[s - 1, p, l]], 1) / (2 * VOXEL_MM)
    steepness = np.linalg.norm(gradient, axis=1)
    normals = gradient / steepness[:, None]
    points = bone_ct.LOW + VOXEL_MM * np.stack([l, p, s], 1)
    points = points - normals * (distance[s, p, l] / steepness)[:, None]
    points = points - normals * (values_at(distance, points) / steepness)[:, None]
    on_surface = np.abs(values_at(distance, points)) < 0.02 * steepness  # not beside a ridge
    return points[on_surface], normals[on_surface]


def values_at(array, points):
    """Trilinear, of a (S, P, L) array at (n, 3) places L, P, S; BEYOND_MM where the grid ends."""
    at = (points - bone_ct.LOW) / VOXEL_MM
    low = np.floor(at).astype(int)
    inside = np.all((low >= 0) & (low < np.array(bone_ct.SIZE) - 1), axis=1)
    low, share = np.where(inside[:, None], low, 0), at - low
    total = 0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share), axis=1)
        l, p, s = (low + corner).T
        total = total + weight * array[s, p, l]
    return np.where(inside, total, BEYOND_MM)


def bridge_of(distance, surface, axis, along, diameter):
    """(bridge, its depth, where the line enters and leaves) of a tunnel through the place `axis`, from which depths count; None where that
    is outside the bone, too near to an opening, the line enters or leaves where the CT ends, or the bridge depends on what counts as an
    opening."""
    steps = np.arange(-90, 90, 0.25)
    outside = steps[values_at(distance, axis + steps[:, None] * along) >= 0]
    before, behind = outside[outside <= 0], outside[outside >= 0]
    if not len(before) or not len(behind) or before[-1] > -OPENING_MM or behind[0] < OPENING_MM:
        return None
    if values_at(distance, axis + np.array([[before[-1]], [behind[0]]]) * along).max() == BEYOND_MM:
        return None
    depth = (surface - axis) @ along
    beside = np.linalg.norm(surface - axis - depth[:, None] * along, axis=1) - diameter / 2
    near = (depth > before[-1] + 4) & (depth < behind[0] - 4)
    bridge, at = beside[near].min(), depth[near][beside[near].argmin()]
    if abs(at) > 4 or beside[near & (np.abs(depth) > 6)].min() < bridge + 0.5:
        return None
    return float(bridge), at, before[-1], behind[0]


def planted(distance, rng):
    """Start, end, diameter and true bridge of a tunnel; `distance`: the bone's implicit shape, negative inside."""
    surface, normals = surface_of(distance)
    near_joint = np.flatnonzero(np.abs(surface[:, 2]) < 45)
    for attempt in range(3000):
        if attempt % TRIES == 0:
            diameter, wanted = rng.uniform(5, 9), rng.uniform(LOW_MM, HIGH_MM)
        chosen = rng.choice(near_joint)
        normal = normals[chosen]
        along = np.cross(normal, rng.standard_normal(3))
        along /= np.linalg.norm(along)
        axis = surface[chosen] - normal * (diameter / 2 + wanted)
        found = bridge_of(distance, surface, axis, along, diameter)
        if found:
            axis -= normal * (wanted - found[0])
            found = bridge_of(distance, surface, axis, along, diameter)
        if not found or abs(found[0] - wanted) > 0.5:
            continue
        bridge, at, before, behind = found
        end = at + 8 if rng.uniform() < 0.5 and behind - at > 16 else behind + 5
        return axis + (before - 5) * along, axis + end * along, float(diameter), bridge
    return None


def grown(mask):
    """By a voxel along each axis."""
    larger = mask.copy()
    for axis in range(3):
        for step in (-1, 1):
            larger |= np.roll(mask, step, axis)
    return larger


MASKS = {"the bone's voxels": lambda mask: mask, "grown by a voxel": grown}


def row_of(number):
    knee = bone_ct.Knee(1000 + number)
    tunnel = planted(knee.femur_shape, np.random.default_rng([number, 43]))
    if tunnel is None:
        return {"knee": number, "none": True}
    start, end, diameter, truth = tunnel
    affine = np.diag([VOXEL_MM, VOXEL_MM, VOXEL_MM, 1.0])
    affine[:3, 3] = bone_ct.LOW
    volume = helicarm.Volume(bone_ct.rounded(knee.scanned()).transpose(2, 1, 0), affine, frame="LPS")
    row = {"knee": number, "truth_mm": truth, "diameter_mm": diameter}
    for name, change in MASKS.items():
        model = {"volume": volume, "mask": change(knee.femur_itself).transpose(2, 1, 0)}
        found = helicarm.check_tunnels(model, {"tunnel": (start, end)}, diameter_mm=diameter)["tunnel"]
        row[name] = {key: found[key] for key in ("bridge_mm", "bridge_sigma_mm", "breach", "at_mm")}
    return row


def table(rows):
    lines = ["| mask | knees | bridge, rms error | mean | largest | stated sigma, rms | breaches missed | others refused |", "| --- " * 8 + "|"]
    all_missed = 0
    for name in MASKS:
        error = np.array([row[name]["bridge_mm"] - row["truth_mm"] for row in rows])
        out = [row[name] for row in rows if row["truth_mm"] < 0]
        whole = [row[name] for row in rows if row["truth_mm"] >= 0]
        missed, falsely = sum(not each["breach"] for each in out), sum(each["breach"] for each in whole)
        sigma = np.sqrt(np.mean([row[name]["bridge_sigma_mm"]**2 for row in rows]))
        lines.append(f"| {name} | {len(rows)} | {np.sqrt(np.mean(error**2)):.2f} mm | {error.mean():+.2f} mm | {np.abs(error).max():.2f} mm | "
                     f"{sigma:.2f} mm | {missed} of {len(out)} | {falsely} of {len(whole)} |")
        all_missed += missed
    return "\n".join(lines), all_missed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--knees", type=int, default=200)
    evaluation_rows.add_options(parser, "knees", keeps=False)
    arguments = parser.parse_args()
    rows = evaluation_rows.Rows(arguments.rows, ("knee",))
    rows.gather(row_of, [(number,) for number in range(arguments.knees)])
    text, missed = table([row for row in rows.rows if not row.get("none")])
    print(text)
    if arguments.doc:
        evaluation_rows.renew(arguments.doc, text, *MARKS)
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
