#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `register --frames` with images of a body of four balls, made here. Usage: frames_test.py PROGRAM"""

import csv
import json
import math
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest
import zlib

from program import run

BALLS = (((-8, 0, 4), 7), ((9, 3, -6), 9), ((2, -9, 12), 5), ((-3, 10, -12), 4))  # centre, radius; mm
SIZE, FOCUS, DISTANCE = 96, 1000, 600
# Rows: camera axes in the world.
CAMERAS = {"A": ((1, 0, 0), (0, 0, -1), (0, 1, 0)), "B": ((0, -1, 0), (0, 0, -1), (1, 0, 0))}


def shift_at(frame):
    return 1.5 * frame, -1 * frame, 0.5 * frame * frame


def matter(origin, ray, shift):
    """Length of a ray (unit vector) within the balls."""
    total = 0
    for centre, radius in BALLS:
        arm = [c + s - o for c, s, o in zip(centre, shift, origin)]
        along = sum(a * r for a, r in zip(arm, ray))
        across = sum(a * a for a in arm) - along * along
        total += 2 * math.sqrt(max(0, radius * radius - across))
    return total


def image(axes, shift, spots=0):
    """`spots`: added to single pixels, 14 apart."""
    middle = (SIZE - 1) / 2
    origin = [-DISTANCE * axis for axis in axes[2]]
    rows = []
    for v in range(SIZE):
        row = []
        for u in range(SIZE):
            ray = [axes[0][i] * (u - middle) / FOCUS + axes[1][i] * (v - middle) / FOCUS + axes[2][i] for i in range(3)]
            length = math.sqrt(sum(r * r for r in ray))
            noise = ((u * 7919 + v * 104729) % 1009 - 504) // 8
            bright = spots if u % 14 == 3 and v % 14 == 3 else 0
            row.append(int(40000 * math.exp(-0.03 * matter(origin, [r / length for r in ray], shift))) + noise + bright)
        rows.append(struct.pack(f">{SIZE}H", *row))
    return b"".join(b"\0" + row for row in rows)


def png(rows):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 16, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def volume():
    """Voxels of 1 mm; the world's origin is in the middle."""
    side = 48
    low = -(side - 1) / 2
    voxels = [1000 if any(math.dist((x + low, y + low, z + low), centre) < radius for centre, radius in BALLS) else -1000
              for z in range(side) for y in range(side) for x in range(side)]
    header = (f"NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: {side} {side} {side}\n"
              f"space directions: (1,0,0) (0,1,0) (0,0,1)\nendian: little\nencoding: raw\nspace origin: ({low},{low},{low})\n\n")
    return header.encode() + struct.pack(f"<{side ** 3}h", *voxels)


class Frames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        (cls.root / "balls.nrrd").write_bytes(volume())
        views = []
        for name, axes in CAMERAS.items():
            k = [[FOCUS, 0, (SIZE - 1) / 2], [0, FOCUS, (SIZE - 1) / 2], [0, 0, 1]]
            (cls.root / f"{name}.json").write_text(json.dumps({"K": k, "R": axes, "t": [0, 0, DISTANCE]}))
            views.append({"name": name, "image": f"{name}_{{frame:02d}}.png", "camera": f"{name}.json"})
            for frame in range(3):
                (cls.root / f"{name}_{frame:02d}.png").write_bytes(png(image(axes, shift_at(frame))))
        start = [[1, 0, 0, 1], [0, 1, 0, -1], [0, 0, 1, 1], [0, 0, 0, 1]]
        model = {"volume": "balls.nrrd", "window_hu": [100, 3000], "start": {"world_from_model": start}}
        cls.case = {"format": "helicarm-case/1", "views": views,
                    "models": [{"name": "first", **model}, {"name": "second", **model}]}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def register(self, case, *more):
        (self.root / "case.json").write_text(json.dumps(case))
        return run("register", self.root, "--out", self.root / "out", *more)

    def table(self, name):
        with (self.root / "out" / name).open() as file:
            return list(csv.DictReader(file))

    def test_two_models_are_followed(self):
        done = self.register(self.case, "--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("3 frames", done.stdout)
        rows = self.table("registration.csv")
        self.assertEqual([(row["frame"], row["model"]) for row in rows],
                         [(str(frame), model) for frame in range(3) for model in ("first", "second")])
        for row in rows:
            for key, expected in zip(("m14", "m24", "m34"), shift_at(int(row["frame"]))):
                self.assertAlmostEqual(float(row[key]), expected, delta=0.3)
            self.assertEqual(row["decision"], "warn")
            self.assertIn("covariance_missing", row["code"])
            self.assertGreater(float(row["sigma_x_mm"]), 0)
        for name in ("bodies.csv", "smoothed.csv"):
            rows = self.table(name)
            self.assertEqual([(row["frame"], row["body"]) for row in rows],
                             [(str(frame), model) for frame in range(3) for model in ("first", "second")])
            self.assertEqual([float(rows[0][f"m{i}{i}"]) for i in range(1, 5)], 4 * [1])
            self.assertEqual(float(rows[0]["sigma_x_mm"]), 0)
            for key, expected in zip(("m14", "m24", "m34"), shift_at(2)):
                self.assertAlmostEqual(float(rows[5][key]), expected, delta=0.4)
            self.assertEqual((rows[5]["decision"], rows[5]["markers_used"], rows[5]["rms_mm"]), ("warn", "", ""))
            self.assertGreater(float(rows[5]["sigma_x_mm"]), 0)
        relative = self.table("relative.csv")
        self.assertEqual([(row["body"], row["reference"]) for row in relative], 3 * [("second", "first")])
        self.assertAlmostEqual(float(relative[2]["m11"]), 1, delta=1e-3)
        summary = json.loads((self.root / "out" / "sequence.json").read_text())
        self.assertEqual([(m["name"], m["warned"]) for m in summary["models"]], [("first", 3), ("second", 3)])
        self.assertIn("second against first", (self.root / "out" / "report.html").read_text())

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_films_give_the_poses_of_their_frames(self):
        options = ("--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(self.register(self.case, *options).returncode, 0)
        expected = [(self.root / "out" / name).read_bytes() for name in ("registration.csv", "smoothed.csv")]
        case = json.loads(json.dumps(self.case))
        for view in case["views"]:
            film = f"{view['name']}.mkv"
            subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-y", "-start_number", "0", "-i",
                            self.root / f"{view['name']}_%02d.png", "-c:v", "ffv1", "-pix_fmt", "gray16le", self.root / film],
                           check=True)
            view.update(image=film, frame_offset=1)  # a film begins at 1
        done = self.register(case, *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([(self.root / "out" / name).read_bytes() for name in ("registration.csv", "smoothed.csv")], expected)

    def test_distortion_map_beside_a_camera_is_used(self):
        shift = 3.0
        self.map_of(shift, "map")
        case = json.loads(json.dumps(self.case))
        for view in case["views"]:
            camera = json.loads((self.root / view["camera"]).read_text())
            camera["K"][0][2] -= shift
            view["camera"] = "undistorted_" + view["camera"]
            (self.root / view["camera"]).write_text(json.dumps(camera))
            view["map"] = "map/map.json"
        done = self.register(case, "--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(done.returncode, 0, done.stderr)
        for row in self.table("registration.csv"):
            for key, expected in zip(("m14", "m24", "m34"), shift_at(int(row["frame"]))):
                self.assertAlmostEqual(float(row[key]), expected, delta=0.3)
        self.assertIn("Seq_Frame0001_secondToWorldTransform = ", (self.root / "out" / "smoothed.seq.mha").read_text())

    def test_interrupted_and_resumed_gives_the_same_bytes(self):
        names = ("frames.jsonl", "registration.csv", "bodies.csv", "smoothed.csv", "relative.csv", "report.html")
        options = ("--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(self.register(self.case, *options).returncode, 0)
        out = self.root / "out"
        whole = {name: (out / name).read_bytes() for name in names}
        (out / "frames.jsonl").write_bytes(whole["frames.jsonl"][:-200])
        for name in names[1:]:
            (out / name).unlink()
        done = self.register(self.case, *options, "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({name: (out / name).read_bytes() for name in names}, whole)
        done = self.register(self.case, "--frames", "0-1", "--search-mm", 4, "--search-deg", 4, "--resume")
        self.assertEqual(done.returncode, 2)
        self.assertIn("another sequence", done.stderr)
        self.assertIn("--frames", self.register(self.case, "--resume").stderr)

        (out / "sequence.json").unlink()
        anew = self.register(self.case, "--frames", "0-0", "--search-mm", 4, "--search-deg", 4)
        self.assertIn("3 frames that an interrupted sequence left", anew.stderr)

    def map_of(self, shift, out):
        """A map of undistorted pixels to raw ones, displaced along u."""
        grid = [(u, v) for v in range(-16, SIZE + 17, 8) for u in range(-16, SIZE + 17, 8)]
        (self.root / "raw.csv").write_text("".join(f"{u + shift},{v}\n" for u, v in grid))
        (self.root / "straight.csv").write_text("".join(f"{u},{v}\n" for u, v in grid))
        done = run("rectify", "--xmalab", self.root / "raw.csv", self.root / "straight.csv", "--size", SIZE, SIZE,
                   "--out", self.root / out)
        self.assertEqual(done.returncode, 0, done.stderr)

    def landmarks(self, name, off):
        """The balls' centres, the first one displaced."""
        rows = [f"b{i},{x + (off if i == 0 else 0)},{y},{z}" for i, ((x, y, z), _) in enumerate(BALLS)]
        (self.root / name).write_text("name,x_mm,y_mm,z_mm\n" + "\n".join(rows) + "\n")

    def test_frames_of_other_files_of_the_same_names_are_not_resumed(self):
        options = ("--frames", "0-1", "--search-mm", 4, "--search-deg", 4)
        picks = []
        for view, axes in CAMERAS.items():
            for i, (centre, _) in enumerate(BALLS):
                x, y, z = (sum(a * c for a, c in zip(axis, centre)) for axis in axes)
                z += DISTANCE
                picks.append({"name": f"b{i}", "view": view,
                              "uv": [FOCUS * x / z + (SIZE - 1) / 2, FOCUS * y / z + (SIZE - 1) / 2]})
        views = [dict(view, map="same/map.json") for view in self.case["views"]]
        model = {"name": "balls", "volume": "same.nrrd", "window_hu": [100, 3000], "start": {"landmarks": "same.csv"}}
        case = dict(self.case, views=views, models=[model], picks=picks)
        ct = volume()
        changes = {"map": lambda: self.map_of(0.2, "same"), "start": lambda: self.landmarks("same.csv", 0.3),
                   "CT": lambda: (self.root / "same.nrrd").write_bytes(ct.replace(struct.pack("<h", 1000), struct.pack("<h", 1200), 9))}
        for what, change in changes.items():
            with self.subTest(what):
                self.map_of(0.0, "same")
                self.landmarks("same.csv", 0)
                (self.root / "same.nrrd").write_bytes(ct)
                self.assertEqual(self.register(case, *options).returncode, 0)
                self.assertEqual(self.register(case, *options, "--resume").returncode, 0)
                change()
                done = self.register(case, *options, "--resume")
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn("another sequence", done.stderr)

    def test_a_view_may_start_at_another_number(self):
        for frame in range(3):
            (self.root / f"later_{frame + 5}.png").write_bytes((self.root / f"B_{frame:02d}.png").read_bytes())
        views = [self.case["views"][0], dict(self.case["views"][1], image="later_{frame}.png", frame_offset=5)]
        case = dict(self.case, views=views, models=self.case["models"][:1])
        done = self.register(case, "--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertAlmostEqual(float(self.table("registration.csv")[2]["m14"]), shift_at(2)[0], delta=0.3)
        views[1]["frame_offset"] = -1
        self.assertIn("is image -1", self.register(case, "--frames", "0-2").stderr)

    def test_one_frame_that_looks_bright_has_the_polarity_of_its_run(self):
        views = []
        for name, axes in CAMERAS.items():
            for frame in range(3):
                spots = 1500 if frame == 1 else 0
                (self.root / f"spots{name}_{frame}.png").write_bytes(png(image(axes, shift_at(frame), spots)))
            views.append({"name": name, "image": f"spots{name}_{{frame}}.png", "camera": f"{name}.json"})
        self.assertIn("inverted", run("detect", self.root / "spotsA_1.png").stderr)
        case = dict(self.case, views=views, models=self.case["models"][:1])
        done = self.register(case, "--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("inverted", done.stderr)
        self.assertAlmostEqual(float(self.table("registration.csv")[1]["m14"]), shift_at(1)[0], delta=0.3)

    def test_frame_with_an_image_of_another_is_refused(self):
        for frame in range(3):
            (self.root / f"again_{frame}.png").write_bytes((self.root / f"B_{min(frame, 1):02d}.png").read_bytes())
        views = [self.case["views"][0], dict(self.case["views"][1], image="again_{frame}.png")]
        done = self.register(dict(self.case, views=views), "--frames", "0-2", "--search-mm", 4, "--search-deg", 4)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("cameras_not_in_step: B: 2 of 6 registrations are refused, the first in frame 2: "
                      "frame 2: the image of B is that of its frame 1 again", done.stderr)
        self.assertEqual([row["frame"] for row in self.table("registration.csv") if row["decision"] == "refuse"], ["2", "2"])

    def test_images_of_other_sizes_are_named_before_the_work(self):
        for frame in range(3):
            data = (self.root / f"B_{frame:02d}.png").read_bytes()
            if frame == 2:
                data = data[:16] + struct.pack(">II", 97, SIZE) + data[24:]
            (self.root / f"size_{frame}.png").write_bytes(data)
        views = [self.case["views"][0], dict(self.case["views"][1], image="size_{frame}.png")]
        done = self.register(dict(self.case, views=views), "--frames", "0-2")
        self.assertEqual(done.returncode, 2)
        self.assertIn("97 x 96", done.stderr)
        views[1]["frame"] = 1
        self.assertIn("names one image", self.register(dict(self.case, views=views), "--frames", "0-1").stderr)

    def test_a_missing_frame_is_named(self):
        done = self.register(self.case, "--frames", "2-3")
        self.assertEqual(done.returncode, 2)
        self.assertIn("A_03.png", done.stderr)

    def test_what_is_no_sequence_is_refused(self):
        for frames in ("3-1", "0-2:0", "x"):
            done = self.register(self.case, "--frames", frames)
            self.assertEqual(done.returncode, 2)
            self.assertIn(frames, done.stderr)
        landmarks = dict(self.case, models=[{"name": "points", "start": {"landmarks": "points.csv"}}])
        self.assertIn("needs a volume or a surface", self.register(landmarks, "--frames", "0-2").stderr)

    def test_a_sequence_needs_its_frames(self):
        done = self.register(self.case)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--frames", done.stderr)


if __name__ == "__main__":
    unittest.main()
