#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of interrupted, resumed and corrected runs of `track`. Usage: track_resume_test.py PROGRAM"""

import math
import shutil
import signal
import subprocess
import unittest

from drawn_film import BODIES, CAMERAS, FRAMES, DrawnFilm, place, project, table
from program import PROGRAM


class TrackResume(DrawnFilm):
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

    def interrupted(self, name, handler):
        """Result folder, exit code and messages of a run that is sent SIGINT once it has begun; `handler`: what it inherits."""
        out = self.root / name
        process = subprocess.Popen([PROGRAM, "track", self.root / "case", "--frames", f"1-{FRAMES}", "--out", out],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, handler))
        while process.poll() is None and not (out / "sights.csv").exists():
            pass
        process.send_signal(signal.SIGINT)
        stderr = process.communicate()[1]
        return out, process.returncode, stderr

    def test_interruption_says_what_is_kept(self):
        out, code, stderr = self.interrupted("stopped", signal.SIG_DFL)
        if code == 0:
            return  # it was done before the signal
        self.assertEqual(code, -signal.SIGINT, stderr)
        self.assertIn(f"of {FRAMES} frames are kept in {out}", stderr)
        self.assertIn(f"--frames 1-{FRAMES} --out {out} --resume", stderr)
        done = self.track(self.root / "case", "stopped", f"1-{FRAMES}", "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((out / "markers.csv").read_bytes(), (self.root / "out/markers.csv").read_bytes())

    def test_signal_that_a_background_job_ignores_does_not_end_it(self):
        _, code, stderr = self.interrupted("background", signal.SIG_IGN)
        self.assertEqual(code, 0, stderr)
        self.assertNotIn("interrupted", stderr)


if __name__ == "__main__":
    unittest.main()
