# SPDX-License-Identifier: Apache-2.0
"""Bodies of places that XMALab measured, against its transforms of them: motion.py --published."""
import csv
import json
import subprocess
import sys

import numpy as np

from motion_scene import AXES, DIAMETER, DISTANCE, FOCUS, SIZE, add_ball, blurred, png, projected, rms, table, track
from rotations import rotation


def published_rows(path, scale):
    """Numbers of a file of XMALab, (frames, columns), and its heading."""
    with open(path, newline="") as file:
        heading, *rows = csv.reader(file)
    return heading, scale * np.array([[float(x) for x in row] for row in rows])


def kept_run(program, folder, out, frames, places, names):
    """A run whose images were found exactly where the places are: only its estimates are made anew."""
    track(program, folder, out, frames)
    lines = [(out / "sights.csv").read_text().split("\n")[0]]
    for f, points in enumerate(places):
        uv = [projected(view, points)[0] for view in range(2)]
        lines += [f"{f + 1},{name},cam{view + 1},{uv[view][m][0]:.12g},{uv[view][m][1]:.12g},0.05,2,40,120,0"
                  for m, name in enumerate(names) for view in range(2)]
    (out / "sights.csv").write_text("\n".join(lines) + "\n")
    done = track(program, folder, out, frames, "--resume")[0]
    if done.returncode:
        sys.exit(done.stderr)


def rigid_fit(body, places):
    """world_from_body of least squares of the places (Kabsch)."""
    left, _, right = np.linalg.svd((body - body.mean(0)).T @ (places - places.mean(0)))
    rotation = (left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right).T
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, places.mean(0) - rotation @ body.mean(0)
    return pose


def image_fit(body, places, cameras):
    """world_from_body whose images lie nearest to those of the places."""
    pose = rigid_fit(body, places)
    for _ in range(4):
        information, gradient = np.zeros((6, 6)), np.zeros(6)
        for at, seen in zip((np.c_[body, np.ones(len(body))] @ pose.T)[:, :3], places):
            by_step = np.hstack([np.cross(np.eye(3), at - pose[:3, 3]).T, np.eye(3)])
            for focal, rotation, shift in cameras:
                x, y, z = rotation @ at + shift
                by_place = np.array([[focal[0] / z, 0, -focal[0] * x / z**2], [0, focal[1] / z, -focal[1] * y / z**2]]) @ rotation
                information += (by_place @ by_step).T @ by_place @ by_step
                gradient += (by_place @ by_step).T @ by_place @ (seen - at)
        step = np.linalg.solve(information, gradient)
        pose[:3, :3] = rotation(step[:3]) @ pose[:3, :3]
        pose[:3, 3] += step[3:]
    return pose


def mean_shape(places):
    """Of a body's places in all frames, each fitted to it."""
    shape = places[0]
    for _ in range(20):
        poses = [rigid_fit(shape, at) for at in places]
        shape = np.mean([(at - pose[:3, 3]) @ pose[:3, :3] for at, pose in zip(places, poses)], 0)
    return shape


def differences(theirs, ours, body):
    """Of a body's markers by two series of transforms (frames, markers, 3), up to the body's place in its own frame."""
    moved = ours @ np.c_[body, np.ones(len(body))].T
    return (theirs @ np.mean(np.linalg.inv(theirs) @ moved, 0) - moved)[:, :3].transpose(0, 2, 1)


def imported_cameras(a, middle):
    cameras = []
    for path in a.cameras or []:
        done = subprocess.run([a.helicarm, "import", path, "--unit", "cm" if a.unit_mm == 10 else "mm", "--json"], check=True,
                              capture_output=True, text=True)
        camera = json.loads(done.stdout)
        rotation = np.array(camera["R"])
        cameras.append((np.diag(camera["K"])[:2], rotation, np.array(camera["t"]) + rotation @ middle))
    return cameras


def published_table(a, root):
    """Bodies of published places against the transforms that XMALab computed of them, up to the place of each body in its own frame."""
    heading, numbers = published_rows(a.published[0], a.unit_mm)
    names = [column.rsplit("_", 1)[0] for column in heading[::3]]
    places = numbers.reshape(len(numbers), -1, 3)
    middle = places.mean((0, 1))
    places -= middle
    columns, poses = published_rows(a.published[1], 1)
    bodies = [column.split("_")[0] for column in columns[::16]]
    of_body = dict(zip(bodies, np.array_split(range(len(names)), len(bodies))))
    folder, out = root / "published", root / "published-out"
    folder.mkdir()
    blank = png(np.full((SIZE, SIZE), 150, np.uint8))
    views, picks = [], []
    for view, axes in enumerate(AXES):
        name = f"cam{view + 1}"
        shade = np.zeros((SIZE, SIZE))
        uv, mm = projected(view, places[0])
        for at, scale in zip(uv, mm):
            add_ball(shade, at, DIAMETER / 2 * scale, 1.1 * DIAMETER, 5)
        (folder / f"{name}_0001.png").write_bytes(png(np.rint(blurred(np.exp(-shade), 0.7) * 150).astype(np.uint8)))
        for f in range(2, len(places) + 1):
            (folder / f"{name}_{f:04d}.png").write_bytes(blank)
        middle_px = (SIZE - 1) / 2
        (folder / f"{name}.json").write_text(json.dumps({"K": [[FOCUS, 0, middle_px], [0, FOCUS, middle_px], [0, 0, 1]], "R": axes.tolist(),
                                                         "t": [0, 0, DISTANCE], "image_size": [SIZE, SIZE]}))
        views.append({"name": name, "image": name + "_{frame:04d}.png", "camera": name + ".json"})
        picks += [{"name": n, "view": name, "frame": 1, "uv": list(map(float, at))} for n, at in zip(names, uv)]
    (folder / "case.json").write_text(json.dumps({
        "format": "helicarm-case/2", "views": views, "markers": {"diameter_mm": DIAMETER}, "picks": picks,
        "bodies": [{"name": body, "markers": [names[m] for m in of]} for body, of in of_body.items()]}))
    kept_run(a.helicarm, folder, out, len(places), places, names)
    cameras = imported_cameras(a, middle)
    lines = ["| body | frames | centre, mm rms | largest | markers, mm rms | places by least squares: markers | images by least squares: markers |",
             "| --- | --- | --- | --- | --- | --- | --- |"]
    for b, body in enumerate(bodies):
        theirs = poses[:, 16 * b:16 * b + 16].reshape(-1, 4, 4).transpose(0, 2, 1).copy()
        theirs[:, :3, 3] = a.unit_mm * theirs[:, :3, 3] - middle
        ours = np.tile(np.eye(4), (len(places), 1, 1))
        for row in table(out / "bodies.csv"):
            if row["body"] == body:
                ours[int(row["frame"]) - 1] = [[float(row[f"m{i}{k}"]) for k in range(1, 5)] for i in range(1, 5)]
        of = places[:, of_body[body]]
        off = differences(theirs, ours, of[0])
        centres = np.linalg.norm(off.mean(1), axis=1)
        shape = mean_shape(of)
        by_places = differences(theirs, np.array([rigid_fit(shape, at) for at in of]), shape)
        by_images = differences(theirs, np.array([image_fit(shape, at, cameras) for at in of]), shape) if cameras else None
        lines.append(f"| {body} | {len(places)} | {np.sqrt(np.mean(centres ** 2)):.4f} | {centres.max():.4f} | {rms(off):.4f} | "
                     f"{rms(by_places):.4f} | {'' if by_images is None else f'{rms(by_images):.4f}'} |")
    return lines
