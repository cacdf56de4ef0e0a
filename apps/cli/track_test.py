#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `track` with discs of two bodies, drawn here by area sampling. Usage: track_test.py PROGRAM"""

import csv
import json
import math
import pathlib
import shutil
import signal
import struct
import subprocess
import tempfile
import unittest
import zlib

from program import PROGRAM, run

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


class Track(unittest.TestCase):
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

    def test_processes_of_one_word_follow_each_sequence_once(self):
        sequences = [self.changed(name, lambda case, folder: None) for name in ("night-1", "night-2")]
        out = self.root / "nights"
        words = [PROGRAM, "track", *map(str, sequences), "--frames", f"1-{FRAMES}", "--out", str(out), "--share", "night"]
        both = [subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(2)]
        said = [process.communicate()[1] for process in both]
        self.assertEqual([process.returncode for process in both], [0, 0], said)
        lines = (out / "summary.csv").read_text().splitlines()
        self.assertEqual(lines[0], "case,status,code,message,frames,complete,repaired,warnings")
        self.assertEqual([line.split(",")[:2] + line.split(",")[4:5] for line in lines[1:]],
                         [["night-1", "ok", str(FRAMES)], ["night-2", "ok", str(FRAMES)]])
        self.assertEqual((out / "night-2/markers.csv").read_bytes(), (self.root / "out/markers.csv").read_bytes())

    def check_places(self, out):
        for row in table(out / "markers.csv"):
            body = "jaw" if row["name"][0] == "J" else "skull"
            truth = place(body, BODIES[body][row["name"]], int(row["frame"]))
            off = math.dist([float(row[f"{axis}_mm"]) for axis in "xyz"], truth)
            self.assertLess(off, 0.15, row)

    def test_places_and_poses_are_those_of_the_drawing(self):
        out = self.root / "out"
        self.check_places(out)
        rows = {(int(row["frame"]), row["name"]): row for row in table(out / "markers.csv")}
        self.assertEqual([rows[frame, "J1"]["status"] for frame in (4, 5, 7, 8)],
                         ["tracked", "one_view", "one_view", "tracked"])
        self.assertEqual(rows[5, "J1"]["views"], "A")
        for name in ("bodies.csv", "smoothed.csv"):
            last = [row for row in table(out / name) if row["body"] == "jaw"][-1]
            angle = 0.02 * (FRAMES - 1)
            self.assertAlmostEqual(float(last["m11"]), math.cos(angle), delta=0.002)
            self.assertAlmostEqual(float(last["m31"]), math.sin(angle), delta=0.006)
            self.assertEqual(last["decision"], "accept")
        answer = json.loads(self.done.stdout)
        self.assertEqual((answer["format"], answer["status"], answer["frames"]), ("helicarm-track/1", "ok", FRAMES))
        self.assertEqual(answer["complete_frames"], FRAMES - 3)
        self.assertEqual(answer["swaps_repaired"], 0)

    def test_files_of_other_programs_have_their_conventions(self):
        out = self.root / "out"
        lines = (out / "points2d.csv").read_text().splitlines()
        self.assertTrue(lines[0].startswith("J1_cam1_X,J1_cam1_Y,J1_cam2_X,J1_cam2_Y,J2_cam1_X"), lines[0])
        self.assertEqual(len(lines), 1 + FRAMES)
        u, v = project(CAMERAS["A"], place("jaw", BODIES["jaw"]["J1"], 1))
        self.assertAlmostEqual(float(lines[1].split(",")[0]), u, delta=0.2)
        self.assertAlmostEqual(float(lines[1].split(",")[1]), v, delta=0.2)
        self.assertEqual(lines[6].split(",")[2:4], ["NaN", "NaN"])
        self.assertTrue((out / "points3d.csv").read_text().startswith("J1_X,J1_Y,J1_Z,J2_X"))
        tra = (out / "jaw.tra").read_text().splitlines()
        self.assertEqual([len(line.split(",")) for line in tra], FRAMES * [16])
        self.assertEqual([float(x) for x in tra[0].split(",")], [float(i % 5 == 0) for i in range(16)])
        self.assertEqual(len(table(out / "relative.csv")), FRAMES)

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_film_gives_the_bytes_of_its_frames(self):
        def filmed(case, folder):
            for view, codec, first in ((case["views"][0], ("ffv1", "A.avi"), 1), (case["views"][1], ("png", "B.mov"), 101)):
                name = view["name"]
                subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-start_number", str(first), "-i", folder / f"{name}_%04d.png",
                                "-c:v", codec[0], folder / codec[1]], check=True)
                view["image"] = codec[1]
                view.pop("frame_offset")
                for path in folder.glob(f"{name}_*.png"):
                    path.unlink()
        folder = self.changed("film", filmed)
        done = self.track(folder, "film-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("markers.csv", "bodies.csv", "smoothed.csv", "points2d.csv"):
            self.assertEqual((self.root / "film-out" / name).read_bytes(), (self.root / "out" / name).read_bytes(), name)
        done = self.track(folder, "refused", f"1-{FRAMES + 1}")
        self.assertEqual(done.returncode, 2)
        self.assertIn(f"A.avi has the frames 1 to {FRAMES}", done.stderr)
        film = folder / "B.mov"
        film.write_bytes(film.read_bytes()[:3000])
        self.assertEqual(self.track(folder).returncode, 2)

    def of_points(self, name, images=True, **bodies):
        """The case without picks, or images."""
        def change(case, folder):
            case["picks"] = []
            if not images:
                del case["markers"]
                for path in folder.glob("*.png"):
                    path.unlink()
            for body in case["bodies"]:
                body.update(bodies)
        return self.changed(name, change)

    def test_points_of_xmalab_are_placed_without_images(self):
        points = self.root / "out" / "points2d.csv"
        folder = self.of_points("points", images=False)
        done = self.track(folder, "points-out", f"1-{FRAMES}", "--points", points)
        self.assertEqual(done.returncode, 0, done.stderr)
        out = self.root / "points-out"
        self.check_places(out)
        self.assertEqual((out / "points2d.csv").read_bytes(), points.read_bytes())
        rows = table(out / "markers.csv")
        self.assertEqual([row["status"] for row in rows if row["name"] == "J1"][4:7], ["one_view"] * 3)
        self.assertTrue(all(0 < float(row["sx_mm"]) < 0.5 for row in rows))
        # Rows that begin at another frame, and a part of them.
        done = self.track(folder, "points-part", "13-16", "--points", points, "--points-first", "11")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(table(self.root / "points-part" / "markers.csv")[0]["frame"], "13")

    def test_points_of_xmalab_are_read_as_they_count(self):
        names, *rows = (self.root / "out" / "points2d.csv").read_text().splitlines()
        other = self.root / "other.csv"
        other.write_text("cam0_offsetcam1_offset" + names + "\n" + "".join(
            "0,0," + ",".join(text if text == "NaN" else repr(float(text) + 1 if i % 2 == 0 else SIZE - float(text))
                              for i, text in enumerate(row.split(","))) + "\n" for row in rows))
        folder = self.of_points("points-up", images=False)
        done = self.track(folder, "points-up-out", f"1-{FRAMES}", "--points", other, "--points-y-up", "--points-from-one")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_places(self.root / "points-up-out")
        other.write_text(names + "\n" + "".join(  # upwards in the second camera alone
            ",".join(text if text == "NaN" or i % 4 != 3 else repr(SIZE - 1 - float(text))
                     for i, text in enumerate(row.split(","))) + "\n" for row in rows))
        done = self.track(folder, "refused", f"1-{FRAMES}", "--points", other)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("residual_too_large: other.csv: the rays of its points miss each other", done.stderr)

    def test_points_that_mirror_the_world_contradict_a_known_geometry(self):
        def known(case, folder):
            case["picks"] = []
            shutil.copyfile(self.root / "out" / "points3d.csv", folder / "known.csv")
            case["bodies"][0]["geometry"] = "known.csv"
        folder = self.changed("mirrored", known)
        points = self.root / "out" / "points2d.csv"
        self.assertEqual(self.track(folder, "known-points", f"1-{FRAMES}", "--points", points).returncode, 0)
        done = self.track(folder, "refused", f"1-{FRAMES}", "--points", points, "--points-y-up")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn('the markers of the body "jaw" differ from its geometry by', done.stderr)

    def test_first_points_of_xmalab_are_picks(self):
        points = self.root / "out" / "points2d.csv"
        folder = self.of_points("xmalab-picks")
        done = self.track(folder, "xmalab-picks-out", f"1-{FRAMES}", "--picks", points)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_places(self.root / "xmalab-picks-out")

    def test_points_that_do_not_suit_the_case_are_refused(self):
        points = self.root / "out" / "points2d.csv"
        folder = self.of_points("points-refused")
        for case, frames, options, word in (
                (self.root / "case", f"1-{FRAMES}", ("--points", points), '"picks" and a file of points'),
                (folder, f"1-{FRAMES + 1}", ("--points", points), f"frames 1 to {FRAMES}, but frame {FRAMES + 1}"),
                (folder, f"1-{FRAMES}", ("--points", points, "--resume"), "leave it out"),
                (folder, f"1-{FRAMES}", ("--points", points, "--picks", points), "excludes"),
                (folder, f"1-{FRAMES}", ("--points", self.root / "out" / "points3d.csv"), "is not NAME_cam1_X")):
            done = self.track(case, "refused", frames, *options)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(word, done.stderr)

    def test_geometry_of_a_body_is_that_of_points_of_xmalab(self):
        def known(case, folder):
            shutil.copyfile(self.root / "out" / "points3d.csv", folder / "known.csv")
            case["bodies"][0]["geometry"] = "known.csv"
        done = self.track(self.changed("known", known), "known-out", f"1-{FRAMES}", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([body["geometry"] for body in json.loads(done.stdout)["bodies"]], ["given", "learnt"])

    def test_smoothed_poses_are_a_sequence_of_slicer(self):
        fields = dict(line.split(" = ", 1) if " = " in line else line.split(" =", 1)
                      for line in (self.root / "out" / "smoothed.seq.mha").read_text().splitlines())
        self.assertEqual(fields["DimSize"], f"0 0 {FRAMES}")
        self.assertEqual(fields["ElementDataFile"], "LOCAL")
        for row in table(self.root / "out" / "smoothed.csv"):
            frame = int(row["frame"])
            name = f"Seq_Frame{frame - 1:04d}_{row['body']}ToWorldTransform"
            matrix = [float(number) for number in fields[name].split()]
            self.assertEqual(fields[name + "Status"], "OK")
            self.assertEqual(fields[f"Seq_Frame{frame - 1:04d}_Timestamp"], str(frame))
            for i, number in enumerate(matrix):
                sign = -1 if (i // 4 < 2) != (i % 4 < 2) else 1  # of RAS against LPS
                self.assertAlmostEqual(number, sign * float(row[f"m{i // 4 + 1}{i % 4 + 1}"]), places=9)

    def test_sequence_of_slicer_is_read_back(self):
        done = subprocess.run([PROGRAM, "import", self.root / "out" / "smoothed.seq.mha", "--json"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        read = json.loads(done.stdout)
        self.assertEqual(read["index"], list(range(1, FRAMES + 1)))
        rows = table(self.root / "out" / "smoothed.csv")
        self.assertEqual(set(read["transforms"]), {f"{row['body']}ToWorld" for row in rows})
        for row in rows:
            matrix = read["transforms"][f"{row['body']}ToWorld"][int(row["frame"]) - 1]
            for i in range(16):
                self.assertAlmostEqual(matrix[i // 4][i % 4], float(row[f"m{i // 4 + 1}{i % 4 + 1}"]), places=8)

    def test_distortion_map_beside_a_camera_is_used(self):
        grid = [(u, v) for v in range(-20, SIZE + 21, 9) for u in range(-20, SIZE + 21, 9)]

        def raw(u, v):
            x, y = (u - 80) / 80, (v - 80) / 80
            factor = 1 + 0.02 * (x * x + y * y)
            return 80 + 80 * x * factor, 80 + 80 * y * factor
        points = self.root / "grid"
        points.mkdir()
        (points / "a_INPTS.csv").write_text("".join("%r,%r\n" % raw(u, v) for u, v in grid))
        (points / "a_BSPTS.csv").write_text("".join(f"{u},{v}\n" for u, v in grid))
        done = run("rectify", "--xmalab", points / "a_INPTS.csv", points / "a_BSPTS.csv", "--size", SIZE, SIZE,
                   "--out", points, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(json.loads(done.stdout)["residual_rms_px"], 0.01)
        names, *rows = (self.root / "out" / "points2d.csv").read_text().splitlines()
        distorted = self.root / "distorted.csv"
        with open(distorted, "w") as file:
            file.write(names + "\n")
            for row in rows:
                numbers = row.split(",")
                pairs = [("NaN", "NaN") if u == "NaN" else tuple(map(repr, raw(float(u), float(v))))
                         for u, v in zip(numbers[::2], numbers[1::2])]
                file.write(",".join(",".join(pair) for pair in pairs) + "\n")

        def mapped(case, folder):
            case["picks"] = []
            for view in case["views"]:
                shutil.copyfile(points / "map.json", folder / "map.json")
                view["map"] = "map.json"
        folder = self.changed("mapped", mapped)
        done = self.track(folder, "mapped-out", f"1-{FRAMES}", "--points", distorted)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_places(self.root / "mapped-out")
        done = self.track(folder, "refused", f"1-{FRAMES}", "--points", distorted, "--points-undistorted")
        self.assertEqual(done.returncode, 2)
        self.assertIn("export the distorted ones", done.stderr)

    def test_interrupted_and_resumed_gives_the_same_bytes(self):
        out = self.root / "resumed"
        shutil.copytree(self.root / "out", out)
        text = (out / "sights.csv").read_text()
        (out / "sights.csv").write_text(text[:len(text) // 2])
        for name in ("markers.csv", "bodies.csv", "smoothed.csv", "report.html", "track.json"):
            (out / name).unlink()
        done = self.track(self.root / "case", "resumed", f"1-{FRAMES}", "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("sights.csv", "markers.csv", "bodies.csv", "smoothed.csv", "relative.csv", "points2d.csv",
                     "points3d.csv", "jaw.tra", "report.html"):
            self.assertEqual((out / name).read_bytes(), (self.root / "out" / name).read_bytes(), name)
        done = self.track(self.root / "case", "resumed", "1-5", "--resume")
        self.assertEqual(done.returncode, 2)
        self.assertIn("another sequence", done.stderr)

    def test_resumed_after_a_change_of_an_image_begins_there(self):
        folder = self.changed("changed-image", lambda case, folder: None)
        self.assertEqual(self.track(folder, "changed-out").returncode, 0)
        shutil.copyfile(folder / "A_0009.png", folder / "A_0008.png")
        done = self.track(folder, "changed-out", f"1-{FRAMES}", "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frame 8: the image of A is another than in the interrupted run", done.stderr)
        self.assertEqual(self.track(folder, "fresh-out").returncode, 0)
        for name in ("sights.csv", "markers.csv", "bodies.csv"):
            self.assertEqual((self.root / "changed-out" / name).read_bytes(), (self.root / "fresh-out" / name).read_bytes())

    def corrected(self, name, frame, spots):
        """The case with picks (marker, view, place) of a later frame."""
        def add(case, folder):
            for marker, view, (u, v) in spots:
                case["picks"].append({"name": marker, "view": view, "frame": frame, "uv": [round(u + 0.6), round(v - 0.7)]})
        return self.changed(name, add)

    def test_pick_of_a_later_frame_corrects_it_and_those_after_it(self):
        def follow_another(case, folder):
            for pick in case["picks"]:  # what is called J1 is S3, until frame 7
                if pick["name"] == "J1":
                    pick["uv"] = next(p["uv"] for p in case["picks"] if p["name"] == "S3" and p["view"] == pick["view"])
            case["picks"] = [pick for pick in case["picks"] if pick["name"] != "S3"]
            case["bodies"] = [{"name": "jaw", "markers": ["J2", "J3", "J4"]}]
            for view, axes in CAMERAS.items():
                at = place("jaw", BODIES["jaw"]["J1"], 8)
                case["picks"].append({"name": "J1", "view": view, "frame": 8, "uv": list(project(axes, at))})
        done = self.track(self.changed("follows", follow_another), "follows-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = {(int(row["frame"]), row["name"]): row for row in table(self.root / "follows-out" / "markers.csv")}
        for frame in (1, 7, 8, 9, FRAMES):
            at = [float(rows[frame, "J1"][f"{axis}_mm"]) for axis in "xyz"]
            body, marker = ("skull", "S3") if frame < 8 else ("jaw", "J1")
            self.assertLess(math.dist(at, place(body, BODIES[body][marker], frame)), 0.15, frame)

    def test_resumed_after_a_correction_begins_at_its_frame(self):
        at = project(CAMERAS["B"], place("jaw", BODIES["jaw"]["J2"], 8))
        folder = self.corrected("corrected", 8, [("J1", "B", at)])
        shutil.copytree(self.root / "out", self.root / "again-out")
        done = self.track(folder, "again-out", f"1-{FRAMES}", "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frame 8: its picks are others than before", done.stderr)
        self.assertEqual(self.track(folder, "whole-out").returncode, 0)
        for name in ("sights.csv", "markers.csv", "bodies.csv"):
            self.assertEqual((self.root / "again-out" / name).read_bytes(), (self.root / "whole-out" / name).read_bytes())
        seen = {(int(row["frame"]), row["marker"], row["view"]): row for row in table(self.root / "whole-out" / "sights.csv")}
        self.assertLess(math.dist([float(seen[8, "J1", "B"][f"{axis}_raw"]) for axis in "uv"], at), 0.2)
        self.assertEqual(seen[8, "J2", "B"]["u_raw"], "")  # a disc serves one marker

    def test_corrections_that_name_nothing_are_refused_or_warned_of(self):
        done = self.track(self.corrected("unknown", 8, [("J9", "B", (50, 50))]))
        self.assertEqual(done.returncode, 2)
        self.assertIn('"J9" of frame 8: the first frame, 1, has no such marker', done.stderr)
        folder = self.corrected("nowhere", 8, [("J1", "B", (12, 12))])
        self.assertEqual(self.track(folder, "refused", "1-11:2").returncode, 2)
        done = self.track(folder, "nowhere-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn('frame 8: no marker near the pick "J1"', done.stderr)

    def test_interruption_says_what_is_kept(self):
        out = self.root / "stopped"
        process = subprocess.Popen([PROGRAM, "track", self.root / "case", "--frames", f"1-{FRAMES}", "--out", out],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        while process.poll() is None and not (out / "sights.csv").exists():
            pass
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate()
        if process.returncode == 0:
            return  # it was done before the signal
        self.assertEqual(process.returncode, -signal.SIGINT, stderr)
        self.assertIn(f"of {FRAMES} frames are kept in {out}", stderr)
        self.assertIn(f"--frames 1-{FRAMES} --out {out} --resume", stderr)
        done = self.track(self.root / "case", "stopped", f"1-{FRAMES}", "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((out / "markers.csv").read_bytes(), (self.root / "out/markers.csv").read_bytes())

    def test_signal_that_a_background_job_ignores_does_not_end_it(self):
        out = self.root / "background"
        process = subprocess.Popen([PROGRAM, "track", self.root / "case", "--frames", f"1-{FRAMES}", "--out", out],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
        while process.poll() is None and not (out / "sights.csv").exists():
            pass
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate()
        self.assertEqual(process.returncode, 0, stderr)
        self.assertNotIn("interrupted", stderr)

    def test_markers_are_found_without_picks(self):
        def without(case, folder):
            del case["picks"], case["bodies"]
        done = self.track(self.changed("no-picks", without), "found", f"1-{FRAMES}", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        names = [marker["name"] for marker in json.loads(done.stdout)["markers"]]
        self.assertEqual(names, [f"M{i + 1}" for i in range(len(names))])
        self.assertGreaterEqual(len(names), 6)  # of 7: what is not certain is left out
        beads = [(body, xyz) for body, markers in BODIES.items() for xyz in markers.values()]
        is_of = {}
        for row in table(self.root / "found/markers.csv"):
            if row["status"] == "tracked":
                at, frame = [float(row[f"{axis}_mm"]) for axis in "xyz"], int(row["frame"])
                bead = min(beads, key=lambda each: math.dist(at, place(*each, frame)))
                self.assertLess(math.dist(at, place(*bead, frame)), 0.15, row)
                self.assertEqual(is_of.setdefault(row["name"], bead), bead)
        self.assertEqual(len(set(is_of.values())), len(names))

    def test_marker_picked_in_one_view_is_completed(self):
        def one_view(case, folder):
            case["picks"] = [p for p in case["picks"] if (p["name"], p["view"]) != ("J2", "B")]
        done = self.track(self.changed("one-pick", one_view), "one-pick-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_places(self.root / "one-pick-out")

    def test_wrong_diameter_is_named_with_both_numbers(self):
        def larger(case, folder):
            case["markers"]["diameter_mm"] = 1.5 * 2 * RADIUS
        done = self.track(self.changed("diameter", larger), "diameter-out")
        self.assertIn("scale_disagrees", done.stderr)
        self.assertIn('"diameter_mm" is 3, the markers\' images are those of', done.stderr)

    def test_smaller_diameter_than_the_markers_is_named(self):
        def smaller(case, folder):
            case["markers"]["diameter_mm"] = 0.7 * 2 * RADIUS
        done = self.track(self.changed("smaller", smaller), "smaller-out")
        self.assertIn('"diameter_mm" is 1.4, the markers\' images are those of', done.stderr)
        figures = next(w["figures"] for w in json.loads((self.root / "smaller-out" / "track.json").read_text())["warnings"]
                       if w["code"] == "scale_disagrees")
        self.assertLess(figures["low_mm"], 2 * RADIUS)
        self.assertGreater(figures["high_mm"], 2 * RADIUS)

    def test_marker_in_no_image_of_the_first_frame_is_named(self):
        def hide(case, folder):
            for name, axes in CAMERAS.items():
                (folder / f"{name}_{101 if name == 'B' else 1:04d}.png").write_bytes(image(axes, 1, False, ("J1",)))
        done = self.track(self.changed("first-hidden", hide), "first-hidden-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn('frame 1: "J1" is found in no image: its place is that of its picks', done.stderr)
        self.assertNotIn('"J2" is found in no image', done.stderr)
        self.check_places(self.root / "first-hidden-out")

    def test_markers_of_a_body_that_were_not_found_are_all_named(self):
        def found(case, folder):
            case["picks"] = []
            case["bodies"] = [{"name": "jaw", "markers": ["M1", "M2", "M8", "M9"]}]
        done = self.track(self.changed("not-found", found), "not-found-out")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn('"M8", "M9" are not among the 6 markers found in the first frame, M1 to M6: pick them', done.stderr)

    def test_joint_angles_are_those_of_the_drawing(self):
        axes = self.root / "axes.csv"
        axes.write_text("body,axis,x,y,z\n" + "".join(
            f"{body},{axis},{x},{y},{z}\n" for body in ("skull", "jaw")
            for axis, x, y, z in (("x", 1, 0, 0), ("y", 0, 1, 0), ("z", 0, 0, 1))))
        done = self.track(self.root / "case", "angles", f"1-{FRAMES}", "--axes", axes)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = table(self.root / "angles" / "angles.csv")
        self.assertEqual([(row["body"], row["reference"]) for row in rows], [("jaw", "skull")] * FRAMES)
        for row in rows[1:]:
            turned = math.degrees(-0.02 * (int(row["frame"]) - 1))
            for name, expected in (("flexion", 0), ("adduction", turned), ("rotation", 0)):
                sigma = float(row[f"sigma_{name}_deg"])
                self.assertLess(sigma, 0.5)
                self.assertLess(abs(float(row[f"{name}_deg"]) - expected), 4 * sigma + 0.02, row)
            self.assertEqual(row["lateral_mm"] + row["sigma_lateral_mm"], "")
        self.assertIn("Joint of skull and jaw", (self.root / "angles" / "report.html").read_text())
        axes.write_text("body,axis,x,y,z\nhip,x,1,0,0\n")
        done = self.track(self.root / "case", "no-angles", f"1-{FRAMES}", "--axes", axes)
        self.assertEqual(done.returncode, 2)
        self.assertIn('axes.csv: "hip" is no body of the case', done.stderr)

    def test_joint_translations_follow_from_markups_of_slicer(self):
        points = {"skull_origin": (0, 0, 0), "skull_z": (0, 0, 40), "skull_x": (30, 0, 7),
                  "jaw_origin": (0, 5, 0), "jaw_z": (0, 5, 9), "jaw_x": (9, 5, 0)}
        axes = self.root / "axes.mrk.json"
        axes.write_text(json.dumps({"markups": [{"type": "Fiducial", "coordinateSystem": "RAS", "controlPoints": [
            {"label": name, "position": [-x, -y, z]} for name, (x, y, z) in points.items()]}]}))
        done = self.track(self.root / "case", "translations", f"1-{FRAMES}", "--axes", axes)
        self.assertEqual(done.returncode, 0, done.stderr)
        for row in table(self.root / "translations" / "angles.csv"):
            frame = int(row["frame"]) - 1
            for name, expected in (("lateral", -0.3 * frame), ("anterior", 5 + 0.5 * frame), ("distraction", 0)):
                # The jaw turns about the world's y: a share of the lateral shift is along its z.
                lean = -0.3 * frame * math.sin(0.02 * frame) if name == "distraction" else 0
                self.assertLess(abs(float(row[f"{name}_mm"]) - expected - lean), 0.15, row)
                self.assertLess(float(row[f"sigma_{name}_mm"]), 0.3)
        self.assertIn("Joint translations", (self.root / "translations" / "report.html").read_text())

    def test_butterworth_filter_stays_near_the_places(self):
        def rated(case, folder):
            case["frame_rate_hz"] = 50
        folder = self.changed("rated", rated)
        done = self.track(folder, "filtered", f"1-{FRAMES}", "--butterworth", "8", "--butterworth-order", "2")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("butterworth.csv", [path.name for path in (self.root / "out").iterdir()])
        places = table(self.root / "filtered" / "markers.csv")
        for row, place_of in zip(table(self.root / "filtered" / "butterworth.csv"), places, strict=True):
            self.assertEqual((row["frame"], row["name"]), (place_of["frame"], place_of["name"]))
            self.assertLess(math.dist(*([float(each[f"{axis}_mm"]) for axis in "xyz"] for each in (row, place_of))), 0.3)
        for case, cut_off, word in ((self.root / "case", "8", '"frame_rate_hz" is not stated'),
                                    (folder, "25", "half the frame rate, 25 Hz")):
            done = self.track(case, "refused", f"1-{FRAMES}", "--butterworth", cut_off)
            self.assertEqual(done.returncode, 2)
            self.assertIn(word, done.stderr)

    def test_swap_in_mid_sequence_is_repaired_and_named(self):
        out = self.root / "swapped"
        shutil.copytree(self.root / "out", out)
        lines = (out / "sights.csv").read_text().splitlines()
        at = {tuple(line.split(",")[:3]): i for i, line in enumerate(lines)}
        for view in CAMERAS:
            first, second = at["9", "J2", view], at["9", "J4", view]
            tails = [lines[i].split(",", 3)[3] for i in (first, second)]
            lines[first], lines[second] = f"9,J2,{view},{tails[1]}", f"9,J4,{view},{tails[0]}"
        (out / "sights.csv").write_text("\n".join(lines) + "\n")
        done = self.track(self.root / "case", "swapped", f"1-{FRAMES}", "--resume", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        self.assertEqual(answer["swaps_repaired"], 1)
        self.assertIn('frame 9: the images of "J2" and "J4" were exchanged',
                      " ".join(warning["message"] for warning in answer["warnings"]))
        self.check_places(out)

    def test_bright_markers_are_followed(self):
        make_case(self.root / "bright", bright=True)
        done = self.track(self.root / "bright", "bright-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_places(self.root / "bright-out")

    def test_bright_gaps_do_not_invert_dark_markers(self):
        make_case(self.root / "gaps", gaps=True)
        done = self.track(self.root / "gaps", "gaps-out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("tag_disagrees", done.stderr)
        self.check_places(self.root / "gaps-out")
        case = json.loads((self.root / "gaps/case.json").read_text())
        del case["picks"], case["bodies"]
        (self.root / "gaps/case.json").write_text(json.dumps(case))
        found = self.track(self.root / "gaps", "gaps-found", f"1-{FRAMES}", "--json")
        self.assertEqual(found.returncode, 0, found.stderr)
        self.assertGreaterEqual(len(json.loads(found.stdout)["markers"]), 6)

    def test_exchanged_picks_are_refused_by_name(self):
        def exchange(case, folder):
            picks = {(p["name"], p["view"]): p for p in case["picks"]}
            a, b = picks["J1", "B"], picks["J3", "B"]
            a["uv"], b["uv"] = b["uv"], a["uv"]
        done = self.track(self.changed("exchanged", exchange))
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("markers_swapped", done.stderr)
        self.assertIn('"J1" and "J3"', done.stderr)
        refused = json.loads((self.root / "refused/track.json").read_text())
        self.assertEqual((refused["status"], refused["failure"]["code"]), ("refused", "markers_swapped"))

    def test_geometry_of_the_other_body_is_refused(self):
        def give(case, folder):
            for body, other in (("jaw", "skull"), ("skull", "jaw")):
                lines = ["name,x_mm,y_mm,z_mm"]
                places = list(BODIES[other].values())[:3]
                lines += [f"{name},{x},{y},{z}" for name, (x, y, z) in zip(list(BODIES[body])[:3], places)]
                (folder / f"{body}.csv").write_text("\n".join(lines) + "\n")
            for body in case["bodies"]:
                body["markers"] = body["markers"][:3]
                body["geometry"] = body["name"] + ".csv"
        done = self.track(self.changed("other-body", give))
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("bodies_exchanged", done.stderr)

    def test_wrong_input_is_named(self):
        def remove(case, folder):
            (folder / "B_0107.png").unlink()

        def shrink(case, folder):
            (folder / "A_0009.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 80, 80) +
                                                b"\x08\0\0\0\0\0\0\0\0")

        def unknown(case, folder):
            case["bodies"][0]["markers"].append("J9")

        def no_size(case, folder):
            del case["markers"]
        for name, change, word in (("gap", remove, "1 of 24 images do not exist, the first: B_0107.png; the numbers B: 107"),
                                   ("size", shrink, "image 9 has 80 x 80 pixels"), ("name", unknown, '"J9" has no pick'),
                                   ("no-size", no_size, '"markers" is missing')):
            done = self.track(self.changed(name, change), "wrong")
            self.assertEqual(done.returncode, 2, name + done.stderr)
            self.assertIn(word, done.stderr)
            self.assertFalse((self.root / "wrong/track.json").exists())
        done = self.track(self.root / "case", "wrong", "3-6")
        self.assertEqual(done.returncode, 2)
        self.assertIn("none is of the first frame, 3", done.stderr)

    def test_other_commands_name_this_one(self):
        for command in ("run", "register"):
            done = run(command, self.root / "case", "--out", self.root / command)
            self.assertEqual(done.returncode, 2)
            self.assertIn("helicarm track", done.stderr)


if __name__ == "__main__":
    unittest.main()
