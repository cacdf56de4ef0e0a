#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `sweep` at its edges. Usage: sweep_test.py PROGRAM"""

import json
import struct
import unittest
import zlib

from program import SimulatedCase, run


def grey_png(grey, size=64):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress((b"\0" + bytes([grey]) * size) * size)) + chunk(b"IEND", b""))


class Sweep(SimulatedCase):
    def case_of(self, name, frames, **view):
        folder = self.root / name
        folder.mkdir()
        for number in range(1, 4):
            (folder / f"run_{number:02d}.png").write_bytes(grey_png(120))
        view = {"name": "RUN", "image": "run_{frame:02d}.png", "frames": frames, **view}
        (folder / "case.json").write_text(json.dumps(
            {"format": "helicarm-case/1", "calibrator": "udcsc", "plate": None, "views": [view]}))
        return folder

    def test_a_single_view_is_calibrated_and_its_geometry_written(self):
        case = json.loads((self.root / "case/case.json").read_text())
        case["views"] = case["views"][:1]
        case.pop("picks", None), case.pop("tunnels", None), case.pop("tool_lines", None)
        (self.root / "case/one.json").write_text(json.dumps(case))
        out = self.root / "one"
        done = run("sweep", self.root / "case/one.json", "--out", out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        self.assertEqual(answer, json.loads((out / "sweep.json").read_text()))
        self.assertEqual((answer["format"], answer["status"]), ("helicarm-sweep/1", "ok"))
        self.assertIn(answer["frames"][0]["decision"], ("accept", "warn"))
        self.assertEqual((out / "frames.csv").read_text().count("\n"), 2)
        for name in ("rtk.xml", "tigre.json", "leap.json", "astra.txt", "matrices.ompl", "matrices.csv", "matrices.npy",
                     "plastimatch/0001.txt"):
            self.assertTrue((out / "geometry" / name).exists(), name)
        blank = self.case_of("blank-after", "all")
        self.assertEqual(run("sweep", blank, "--out", out).returncode, 3)
        self.assertEqual(json.loads((out / "sweep.json").read_text())["status"], "refused")
        self.assertFalse((out / "geometry").exists())

    def test_several_runs_have_a_folder_each_and_one_table(self):
        runs = [self.case_of(name, "all") for name in ("blank-1", "blank-2")]
        out = self.root / "several"
        done = run("sweep", *runs, "--out", out, "--share", "word")
        self.assertEqual(done.returncode, 3)
        self.assertIn("2 of 2 cases", done.stderr)
        lines = (out / "summary.csv").read_text().splitlines()
        self.assertEqual(lines[0], "case,status,code,message,images,accepted,warnings")
        self.assertEqual([line.split(",")[:2] for line in lines[1:]], [["blank-1", "refused"], ["blank-2", "refused"]])
        self.assertEqual(json.loads((out / "blank-2/sweep.json").read_text())["status"], "refused")

    def test_options_of_a_check_are_refused_before_the_run_is_read(self):
        for options, reason in ((["--check", "ART"], "is not FDK"), (["--wire", "0,0,0;0,0,9"], "require --check FDK"),
                                (["--check", "FDK", "--wire", "0,0,0"], "is not x,y,z;x,y,z"),
                                (["--check", "FDK", "--against", self.root / "none.csv"], "none.csv")):
            done = run("sweep", self.root / "no-case", "--out", self.root / "no-out", *options)
            self.assertEqual(done.returncode, 2, options)
            self.assertIn(reason, done.stderr)

    def test_a_run_without_any_usable_image_is_refused(self):
        done = run("sweep", self.case_of("blank", "all"), "--out", self.root / "blank-out")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("blank_image: none of 3 images is accepted", done.stderr)
        frames = json.loads((self.root / "blank-out/sweep.json").read_text())["frames"]
        self.assertEqual([frame["failure"]["code"] for frame in frames], 3 * ["blank_image"])

    def test_a_simulated_run_is_found_within_its_regions(self):
        case, out = self.root / "run", self.root / "run-out"
        done = run("simulate", case, "--preset", "flat-panel", "--kind", "flat", "--no-knee", "--run", 16, "--arc", 60,
                   "--flex", 2, "--jitter", 0.05, "--size", 512, "--seed", 3, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("sweep", case, "--out", out, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        truth, found = (json.loads(path.read_text()) for path in (case / "truth.json", out / "sweep.json"))
        self.assertEqual([view["frame"] for view in truth["views"]], list(range(1, 17)))
        accepted = [frame for frame in found["frames"] if frame["projection"]]
        self.assertGreaterEqual(len(accepted), 15)
        within = 0
        for frame in accepted:
            true = truth["views"][frame["frame"] - 1]
            errors = [a - b for a, b in zip(frame["source_mm"], true["source_mm"])]
            within += all(abs(e) <= 2.4 * s for e, s in zip(errors, frame["source_sigma_mm"]))  # 95 %: three axes
            self.assertTrue(all(abs(e) <= 5 * s for e, s in zip(errors, frame["source_sigma_mm"])), (frame["frame"], errors))
        self.assertGreaterEqual(within, len(accepted) - 4)

    def test_a_run_without_plate_takes_its_distortion_from_the_record(self):
        case, out, record = self.root / "plated", self.root / "plated-out", self.root / "arm.json"
        done = run("simulate", case, "--preset", "ii-9in", "--no-knee", "--run", 8, "--arc", 60, "--size", 512, "--seed", 3,
                   "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(run("sweep", case, "--out", out, "--quiet").returncode, 0)
        done = run("c-arm", "add", record, out / "sweep.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreaterEqual(len([shot for shot in json.loads(record.read_text())["shots"] if "map" in shot]), 6)
        done = run("c-arm", "report", record, "--out", self.root / "arm")
        self.assertIn("off one map for all", done.stdout)
        rows = (self.root / "arm/c_arm_maps.csv").read_text().splitlines()
        self.assertEqual(rows[0], "view,date,primary_deg,secondary_deg,error_px,one_map_px,expected_px")
        bare = json.loads((case / "case.json").read_text())
        bare["plate"] = None
        (case / "case.json").write_text(json.dumps(bare))
        without = run("sweep", case, "--out", self.root / "without", "--quiet")
        self.assertEqual(without.returncode, 3, "the plate in the images shows that they are distorted")
        done = run("sweep", case, "--out", self.root / "by-record", "--quiet", "--machine", record)
        self.assertEqual(done.returncode, 0, done.stderr)
        by_plate, by_record = (json.loads((self.root / name / "sweep.json").read_text())["frames"]
                               for name in ("plated-out", "by-record"))
        for a, b in zip(by_plate, by_record):
            if a["projection"] and b["projection"]:
                self.assertLess(sum((p - q) ** 2 for p, q in zip(a["source_mm"], b["source_mm"])), 2 ** 2)
        self.assertGreaterEqual(len([frame for frame in by_record if frame["projection"]]), 7)
        self.assertEqual(run("sweep", case, "--out", out, "--machine", self.root / "none.json").returncode, 2)

    def test_wrong_input_is_named(self):
        out = self.root / "wrong"
        for name, frames, word in (("missing", "1-5", "2 of 5 images do not exist, the first: run_04.png; the frames 4-5."),
                                   ("words", "some", 'frames: "some" is neither A-B nor A-B:STEP')):
            done = run("sweep", self.case_of(name, frames), "--out", out)
            self.assertEqual((done.returncode, word in done.stderr), (2, True), done.stderr)
            self.assertFalse((out / "sweep.json").exists())
        done = run("sweep", self.root / "missing", "--path", "curved")
        self.assertEqual((done.returncode, "path:" in done.stderr), (2, True), done.stderr)
        done = run("run", self.root / "missing", "--out", out)
        self.assertEqual((done.returncode, "helicarm sweep" in done.stderr), (2, True), done.stderr)


if __name__ == "__main__":
    unittest.main()
