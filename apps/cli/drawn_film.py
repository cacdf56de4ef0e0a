# SPDX-License-Identifier: Apache-2.0
"""Images of discs of two bodies in motion before two cameras, drawn by area sampling: shared by the tests of `track`."""

import csv
import json
import math
import pathlib
import shutil
import struct
import tempfile
import unittest
import zlib

from program import run

SIZE, FOCUS, DISTANCE, RADIUS, FRAMES = 160, 1600, 800, 1.0, 12
# Rows: camera axes in the world.
CAMERAS = {"A": ((1, 0, 0), (0, 0, -1), (0, 1, 0)), "B": ((0, -1, 0), (0, 0, -1), (1, 0, 0))}
BODIES = {"jaw": {"J1": (-14, 3, 5), "J2": (8, -12, -9), "J3": (3, 11, 14), "J4": (-6, -7, -16)},
          "skull": {"S1": (15, 6, 22), "S2": (-20, -14, 24), "S3": (22, 18, -2)}}


def place(body, xyz, frame):
    x, y, z = xyz
    if body == "skull":
        return x + 0.3 * frame, y, z
    angle = 0.02 * frame
    return (x * math.cos(angle) - z * math.sin(angle), y + 0.5 * frame, x * math.sin(angle) + z * math.cos(angle))


def project(axes, point):
    arm = [p + DISTANCE * a for p, a in zip(point, axes[2])]
    x, y, z = (sum(a * b for a, b in zip(axis, arm)) for axis in axes)
    return FOCUS * x / z + (SIZE - 1) / 2, FOCUS * y / z + (SIZE - 1) / 2


def image(axes, frame, bright, hidden=(), gaps=False):
    grey = [[120.0] * SIZE for _ in range(SIZE)]
    for row in range(SIZE if gaps else 0):  # bright, as between bones
        for column in range(SIZE):
            if row % 8 < 3 and column % 8 < 3 and abs(row - SIZE / 2) > 56:
                grey[row][column] += 50
    for body, markers in BODIES.items():
        for name, xyz in markers.items():
            if name in hidden:
                continue
            u, v = project(axes, place(body, xyz, frame))
            radius = RADIUS * FOCUS / DISTANCE
            for row in range(int(v - radius - 1), int(v + radius + 3)):
                for column in range(int(u - radius - 1), int(u + radius + 3)):
                    if 0 <= row < SIZE and 0 <= column < SIZE:
                        inside = sum((column + (i - 3.5) / 8 - u) ** 2 + (row + (k - 3.5) / 8 - v) ** 2 < radius ** 2
                                     for i in range(8) for k in range(8)) / 64
                        grey[row][column] += (80 if bright else -80) * inside
    rows = []
    for v in range(SIZE):
        noise = [((u * 7919 + v * 104729 + frame * 1299709) % 1009) / 1009 * 6 - 3 for u in range(SIZE)]
        rows.append(b"\0" + bytes(min(255, max(0, round(g + n))) for g, n in zip(grey[v], noise)))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(b"".join(rows))) + chunk(b"IEND", b""))


def make_case(folder, bright=False, hidden=lambda view, frame: (), gaps=False):
    folder.mkdir()
    views, picks = [], []
    for name, axes in CAMERAS.items():
        middle = (SIZE - 1) / 2
        (folder / f"{name}.json").write_text(json.dumps({
            "K": [[FOCUS, 0, middle], [0, FOCUS, middle], [0, 0, 1]], "R": axes,
            "t": [sum(a * DISTANCE * b for a, b in zip(axis, axes[2])) for axis in axes], "image_size": [SIZE, SIZE]}))
        offset = 100 if name == "B" else 0
        for frame in range(1, FRAMES + 1):
            (folder / f"{name}_{frame + offset:04d}.png").write_bytes(
                image(axes, frame, bright, hidden(name, frame), gaps))
        views.append({"name": name, "image": name + "_{frame:04d}.png", "camera": f"{name}.json",
                      "frame_offset": offset})
        for body, markers in BODIES.items():
            for marker, xyz in markers.items():
                u, v = project(axes, place(body, xyz, 1))
                picks.append({"name": marker, "view": name, "frame": 1, "uv": [round(u + 0.7), round(v - 0.6)]})
    case = {"format": "helicarm-case/2", "views": views, "markers": {"diameter_mm": 2 * RADIUS}, "picks": picks,
            "bodies": [{"name": body, "markers": list(markers)} for body, markers in BODIES.items()]}
    (folder / "case.json").write_text(json.dumps(case))
    return case


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


class DrawnFilm(unittest.TestCase):
    """A case of such images in `root / "case"`, followed into `root / "out"`; J1 is hidden in B in frames 5 to 7."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        cls.case = make_case(cls.root / "case", hidden=lambda view, frame: ("J1",) if view == "B" and 5 <= frame <= 7
                             else ())
        cls.done = run("track", cls.root / "case", "--frames", f"1-{FRAMES}", "--out", cls.root / "out", "--json")
        assert cls.done.returncode == 0, cls.done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def changed(self, name, change):
        folder = self.root / name
        shutil.copytree(self.root / "case", folder)
        case = json.loads(json.dumps(self.case))
        change(case, folder)
        (folder / "case.json").write_text(json.dumps(case))
        return folder

    def track(self, folder, out="refused", frames=f"1-{FRAMES}", *options):
        return run("track", folder, "--frames", frames, "--out", self.root / out, *options)

    def check_places(self, out):
        for row in table(out / "markers.csv"):
            body = "jaw" if row["name"][0] == "J" else "skull"
            truth = place(body, BODIES[body][row["name"]], int(row["frame"]))
            off = math.dist([float(row[f"{axis}_mm"]) for axis in "xyz"], truth)
            self.assertLess(off, 0.15, row)
