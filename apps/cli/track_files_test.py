#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the files that `track` shares with other programs. Usage: track_files_test.py PROGRAM"""

import json
import shutil
import subprocess
import unittest

from drawn_film import BODIES, CAMERAS, FRAMES, SIZE, DrawnFilm, place, project, table
from program import PROGRAM, run


class TrackFiles(DrawnFilm):
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


if __name__ == "__main__":
    unittest.main()
