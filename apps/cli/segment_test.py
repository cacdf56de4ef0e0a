#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `segment`, and of its masks as those of a model. Usage: segment_test.py PROGRAM"""

import json
import pathlib
import struct
import tempfile
import unittest

from program import run

SIZE = (30, 28, 50)
BONES = {"upper": ((15, 14, 33), (10, 9, 13)), "lower": ((14, 14, 12), (10, 10, 10))}


def volume(value_of):
    """NRRD of 16-bit voxels of 1 mm; the first is at (-15, -14, 100)."""
    header = ("NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: 30 28 50\nendian: little\n"
              "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-15,-14,100)\nencoding: raw\n\n").encode()
    values = [value_of((x, y, z)) for z in range(SIZE[2]) for y in range(SIZE[1]) for x in range(SIZE[0])]
    return header + struct.pack(f"<{len(values)}h", *values)


def depth(name, at):
    centre, radii = BONES[name]
    return 1 - sum(((a - c) / r) ** 2 for a, c, r in zip(at, centre, radii)) ** 0.5


def hu(at):
    inside = max(depth("upper", at), depth("lower", at))
    return 40 if inside < 0 else 1000 if inside < 0.25 else 60


def label(at):
    best = max(BONES, key=lambda name: depth(name, at))
    return 0 if depth(best, at) < 0 else {"upper": 4, "lower": 9}[best]


class Segment(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        cls.ct, cls.map = cls.root / "ct.nrrd", cls.root / "map.nrrd"
        cls.ct.write_bytes(volume(hu))
        cls.map.write_bytes(volume(label))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.out = self.root / self.id().split(".")[-1]

    def segment(self, *arguments):
        return run("segment", self.ct, *arguments, "--out", self.out)

    def test_one_click_gives_mask_surface_image_and_figures(self):
        done = self.segment("--seed", "upper=0,0,144", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        self.assertEqual(answer, json.loads((self.out / "segment.json").read_text()))
        true_cm3 = 4 / 3 * 3.14159 * 10 * 9 * 13 / 1000
        self.assertAlmostEqual(answer["bones"][0]["volume_cm3"], true_cm3, delta=0.1 * true_cm3)
        self.assertEqual({file.name for file in self.out.iterdir()},
                         {"upper.nrrd", "upper.stl", "segment.png", "segment.json"})
        self.assertTrue((self.out / "upper.stl").read_bytes().startswith(b"SPACE=LPS UNITS=mm"))

    def test_seeds_of_slicer_are_ras(self):
        self.assertEqual(self.segment("--seed", "upper=7,2,133", "--space", "RAS", "--quiet").returncode, 0)
        self.assertEqual(json.loads((self.out / "segment.json").read_text())["bones"][0]["seed_mm"], [-7, -2, 133])

    def test_a_refusal_replaces_earlier_results(self):
        self.assertEqual(self.segment("--seed", "upper=0,0,144").returncode, 0)
        done = self.segment("--seed", "upper=0,0,144", "--seed", "second=0,0,130")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("seeds_in_one_bone", done.stderr)
        self.assertEqual([file.name for file in self.out.iterdir()], ["segment.json"])
        self.assertEqual(json.loads((self.out / "segment.json").read_text())["failure"]["code"], "seeds_in_one_bone")
        self.assertEqual(self.segment("--seed", "upper=13,12,101").returncode, 3)

    def test_unusable_input_is_code_2(self):
        for wrong in ([], ["--seed", "upper"], ["--seed", "upper=0,0,900"], ["--seed", "a b=0,0,144"],
                      ["--seed", "upper=0,0,144", "--space", "scanner"], ["--seed", "upper=0,0,144", "--neck", "0.9"],
                      ["--seed", "upper=0,0,144", "--voxel", "1,1,1"], ["--label", "upper=4"],
                      ["--labels", self.map], ["--labels", self.map, "--label", "upper=5"],
                      ["--labels", self.map, "--label", "upper=4", "--seed", "upper=0,0,144"]):
            done = self.segment(*wrong)
            self.assertEqual(done.returncode, 2, (wrong, done.stderr))

    def test_a_label_of_another_programs_map(self):
        done = self.segment("--labels", self.map, "--label", "shin=9")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("shin: 4.", done.stdout)
        self.assertIn("4 (", self.segment("--labels", self.map).stderr)


if __name__ == "__main__":
    unittest.main()
