#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `track` with discs of two bodies. Usage: track_test.py PROGRAM"""

import json
import math
import shutil
import struct
import subprocess
import unittest

from drawn_film import BODIES, CAMERAS, FRAMES, RADIUS, DrawnFilm, image, make_case, place, table
from program import PROGRAM, run


class Track(DrawnFilm):
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
