#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `rectify`. Usage: rectify_test.py PROGRAM"""

import json
import shutil
import struct
import unittest
import zlib

from program import SimulatedCase, run


def dot_png(size=64):
    """A grey image of 8 bits with one dark dot."""
    rows = b"".join(b"\0" + bytes(40 if (u - 30) ** 2 + (v - 30) ** 2 < 20 else 200 for u in range(size))
                    for v in range(size))

    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    header = struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Rectify(SimulatedCase):
    def test_simulated_test_grid_is_rectified_and_measured(self):
        folder = self.root / "grid"
        done = run("simulate", folder, "--kind", "grid", "--size", 512, "--seed", 2)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(path.name for path in folder.iterdir()),
                         ["GRID.dcm", "PLATE.dcm", "plate.json", "truth.json"])
        errors = {}
        for method in ("paper", "best"):
            out = self.root / f"grid-{method}"
            done = run("rectify", folder / "PLATE.dcm", "--plate", folder / "plate.json", "--method", method, "--out", out)
            self.assertEqual(done.returncode, 0, done.stderr)
            done = run("rectify", folder / "GRID.dcm", "--map", out / "map.json", "--test-grid", 20, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            errors[method] = json.loads(done.stdout)
        done = run("rectify", folder / "GRID.dcm", "--map", self.root / "grid-best/map.json", "--test-grid", 7)
        self.assertEqual(done.returncode, 2)
        self.assertIn("pitch 7 mm", done.stderr)
        self.assertGreater(errors["best"]["n"], 70)
        self.assertEqual(errors["best"]["n"], len(errors["best"]["crossings"]))
        self.assertEqual(errors["best"]["raw"], errors["paper"]["raw"])
        self.assertLess(errors["best"]["rectified"]["max_px"], 0.1 * errors["best"]["raw"]["max_px"])
        self.assertGreater(errors["paper"]["rectified"]["max_px"], 0.5 * errors["paper"]["raw"]["max_px"])
        self.assertEqual(run("simulate", folder, "--kind", "grid", "--size", 512, "--distance", "30,60").returncode, 0)
        self.assertEqual(sorted(path.name for path in folder.iterdir()),
                         ["GRID-30.dcm", "GRID-60.dcm", "PLATE.dcm", "plate.json", "truth.json"])
        for wrong in (("--kind", "grid", "--distance", 10), ("--distance", 45), ("--kind", "grid", "--preset", "paper-sim"),
                      ("--preset", "c-arm"), ("--kind", "grid", "--fault", "screws")):
            self.assertEqual(run("simulate", folder, *wrong).returncode, 2, wrong)

    def test_paper_stages_are_written_by_the_paper_method_only(self):
        out = self.root / "stages"
        image = self.root / "case/AP.dcm"
        done = run("rectify", image, "--plate", "plate48", "--method", "paper", "--stages", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("raw", "median", "edges", "circles", "inpainted"):
            self.assertTrue((out / f"stage-{name}.png").read_bytes().startswith(b"\x89PNG"), name)
        self.assertEqual(run("rectify", image, "--plate", "plate48", "--stages", "--out", out).returncode, 2)

    def test_rectify_writes_a_map_that_maps_both_ways(self):
        out = self.root / "rectified"
        done = run("rectify", self.root / "case/AP.dcm", "--plate", self.root / "case/plate.json", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((out / "rectified.dcm").exists())
        self.assertTrue((out / "residuals.csv").exists())
        points = self.root / "points.csv"
        points.write_text("u_px,v_px\n200.5,300.25\n256,256\n")
        there = run("rectify", "--map", out / "map.json", "--points", points)
        points.write_text(there.stdout)
        back = json.loads(run("rectify", "--map", out / "map.json", "--points", points, "--inverse", "--json").stdout)
        for (u, v), point in zip([(200.5, 300.25), (256, 256)], back["points"]):
            self.assertAlmostEqual(point["u"], u, 6)
            self.assertAlmostEqual(point["v"], v, 6)

    def test_rectify_fits_the_named_distortion_model(self):
        image, plate, out = self.root / "case/AP.dcm", self.root / "case/plate.json", self.root / "radial"
        done = run("rectify", image, "--plate", plate, "--model", "radial", "--out", out, "--json")
        self.assertEqual(json.loads(done.stdout)["model"], "radial", done.stderr)
        self.assertEqual(json.loads((out / "map.json").read_text())["kind"], "radial")
        self.assertEqual(run("rectify", image, "--map", out / "map.json", "--out", out).returncode, 0)
        refused = run("rectify", image, "--plate", plate, "--model", "spline", "--out", out)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("polynomial, radial, kriging", refused.stderr)
        self.assertEqual(run("rectify", image, "--map", out / "map.json", "--model", "radial").returncode, 2)

    def test_warnings_of_an_image_are_printed(self):
        image = self.root / "detected.png"
        image.write_bytes(dot_png())
        done = run("detect", image, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([warning["code"] for warning in json.loads(done.stdout)["warnings"]], ["spacing_missing"])
        self.assertIn("helicarm: warning: spacing_missing: detected.png: ", done.stderr)
        self.assertNotIn("warning", run("detect", image, "--quiet").stderr)
        out = self.root / "of-warned"
        done = run("rectify", self.root / "case/AP.dcm", "--plate", self.root / "case/plate.json", "--out", out, "--json")
        self.assertIsInstance(json.loads(done.stdout)["warnings"], list)

    def test_rectify_applies_a_map_to_the_images_of_a_folder(self):
        out, series = self.root / "fitted", self.root / "series"
        series.mkdir()
        for name in ("a", "b"):
            shutil.copy(self.root / "case/AP.dcm", series / f"{name}.dcm")
        run("rectify", self.root / "case/AP.dcm", "--plate", self.root / "case/plate.json", "--out", out)
        done = run("rectify", series, "--map", out / "map.json", "--out", self.root / "straight", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        names = [self.root / "straight" / f"{name}_rectified.dcm" for name in ("a", "b")]
        self.assertEqual(json.loads(done.stdout)["written"], [str(name) for name in names])
        pixels = 2 * 512 * 512  # at the end of the file
        self.assertEqual(names[0].read_bytes()[-pixels:], (out / "rectified.dcm").read_bytes()[-pixels:])

    def test_rectify_returns_null_for_points_outside_the_image(self):
        out = self.root / "rectified_twice"
        run("rectify", self.root / "case/AP.dcm", "--plate", self.root / "case/plate.json", "--out", out, "--quiet")
        points = self.root / "off.csv"
        points.write_text("u_px,v_px\n5000,5000\n256,256\n-40,200\n")
        for way in ((), ("--inverse",)):
            answer = json.loads(run("rectify", "--map", out / "map.json", "--points", points, "--json", *way).stdout)
            self.assertEqual([point["u"] is None for point in answer["points"]], [True, False, True])
            self.assertIsNone(answer["points"][0]["v"])


if __name__ == "__main__":
    unittest.main()
