#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `migration`. Usage: migration_test.py PROGRAM"""

import csv
import json
import math
import pathlib
import random
import tempfile
import unittest

from program import run

SEGMENTS = {"tibia": [(-14, 3, -20), (11, 9, -26), (2, -13, -12), (-6, 12, -8)],
            "tray": [(-19, -4, 14), (20, -2, 16), (0, 18, 15), (4, -15, 24)]}


def exam(path, shift=(0, 0, 0), seed=0, names="{segment}{i}", segments=True, sigma=0.0):
    """Markers with the tray shifted, everything turned by a quarter about z; names in another order if asked."""
    noise = random.Random(seed)
    rows = []
    for segment, places in SEGMENTS.items():
        for i, place in enumerate(places):
            x, y, z = (p + (s if segment == "tray" else 0) + noise.gauss(0, sigma) for p, s in zip(place, shift))
            if seed % 2:
                x, y = -y, x
            rows.append([names.format(segment=segment, i=i), x, y, z] + ([segment] if segments else []))
    if not segments:
        noise.shuffle(rows)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "x_mm", "y_mm", "z_mm"] + (["segment"] if segments else []))
        writer.writerows(rows)
    return path


class Migration(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.out = self.root / "out"
        self.first = exam(self.root / "first.csv", seed=2, sigma=0.01)

    def tearDown(self):
        self.folder.cleanup()

    def migrate(self, *arguments):
        return run("migration", *arguments, "--out", self.out)

    def test_migration_is_found_by_geometry(self):
        second = exam(self.root / "second.csv", (0.4, -0.2, 1.0), seed=3, names="{i}of{segment}", segments=False, sigma=0.01)
        done = self.migrate(self.first, second, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        self.assertEqual(answer["reference"], "tibia")
        tray = answer["bodies"][0]
        for value, expected, limit in zip(tray["translation_mm"], (0.4, -0.2, 1.0), tray["limits_95"]["translation_mm"]):
            self.assertAlmostEqual(value, expected, delta=0.1)
            self.assertGreater(limit, 0.005)
        self.assertAlmostEqual(tray["mtpm_mm"], math.hypot(0.4, 0.2, 1.0), delta=0.1)
        self.assertEqual(answer["segments"][1]["markers"][2], {"first": "tray2", "second": "2oftray",
                         "residual_mm": answer["segments"][1]["markers"][2]["residual_mm"]})
        self.assertEqual(json.loads((self.out / "migration.json").read_text()), answer)
        self.assertIn("tray", (self.out / "report.html").read_text())

    def test_double_examinations_give_the_precision(self):
        doubles = []
        for pair in range(4):
            doubles += ["--double", *(exam(self.root / f"d{pair}{k}.csv", seed=10 * pair + 4 + k, sigma=0.03) for k in (0, 1))]
        done = self.migrate(self.first, exam(self.root / "second.csv", seed=3, sigma=0.01), *doubles)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("4 double examinations", done.stdout)
        precision = json.loads((self.out / "migration.json").read_text())["precision"][0]
        self.assertEqual((precision["name"], precision["n"]), ("tray", 4))
        self.assertTrue(0 < precision["ty_mm"]["sd"] < 0.15)
        self.assertGreater(precision["ty_mm"]["limit_95"], 3 * precision["ty_mm"]["sd"])
        with (self.out / "migration.csv").open() as file:
            self.assertEqual([row["kind"] for row in csv.DictReader(file)], ["migration"] + 4 * ["double"])

    def test_segments_may_be_named_on_the_command_line(self):
        plain = exam(self.root / "plain.csv", segments=False)
        self.assertIn("--segment", self.migrate(plain, plain).stderr)
        later = exam(self.root / "later.csv", seed=3, segments=False, sigma=0.01)
        done = self.migrate(plain, later, "--segment", "bone=tibia0,tibia1,tibia2,tibia3", "--segment", "tray=tray0,tray1,tray2",
                            "--reference", "tray")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("bone against tray", done.stdout)
        self.assertIn("tibia9", self.migrate(plain, plain, "--segment", "a=tibia0,tibia1,tibia9", "--segment",
                                             "b=tray0,tray1,tray2").stderr)

    def test_the_same_examination_twice_is_refused(self):
        copy = self.root / "one-year.csv"
        copy.write_bytes(self.first.read_bytes())
        self.assertIn("first.csv and one-year.csv are the same examination", self.migrate(self.first, copy).stderr)
        second = exam(self.root / "second.csv", seed=3, sigma=0.01)
        done = self.migrate(self.first, second, "--double", self.first, copy)
        self.assertEqual(done.returncode, 2)
        self.assertIn("double examination first.csv and one-year.csv: first.csv and", done.stderr)

    def test_a_double_examination_counts_once(self):
        second = exam(self.root / "second.csv", seed=3, sigma=0.01)
        done = self.migrate(self.first, second, *2 * ["--double", self.first, second])
        self.assertEqual(done.returncode, 2)
        self.assertIn("the same pair as first.csv and second.csv", done.stderr)

    def test_the_order_of_a_pair_does_not_count(self):
        second = exam(self.root / "second.csv", seed=3, sigma=0.01)
        done = self.migrate(self.first, second, "--double", self.first, second, "--double", second, self.first)
        self.assertEqual(done.returncode, 2)
        self.assertIn("the same pair as first.csv and second.csv", done.stderr)

    def test_warnings_of_a_double_examination_are_shown(self):
        pair = [exam(self.root / f"d{k}.csv", seed=4 + k, sigma=0.02) for k in (0, 1)]
        pair[1].write_text("\n".join(line for line in pair[1].read_text().splitlines() if not line.startswith("tray1,")))
        done = self.migrate(self.first, exam(self.root / "second.csv", seed=3, sigma=0.01), "--double", *pair)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("double examination d0.csv and d1.csv: segment", done.stderr)

    def test_a_refusal_is_written(self):
        (self.out).mkdir()
        (self.out / "migration.csv").write_text("earlier")
        second = self.root / "second.csv"
        second.write_text("name,x_mm,y_mm,z_mm\nA,0,0,0\nB,10,0,0\nC,0,12,0\n")
        done = self.migrate(self.first, second)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(json.loads((self.out / "migration.json").read_text())["failure"]["code"], "too_few_fiducials")
        self.assertFalse((self.out / "migration.csv").exists())


if __name__ == "__main__":
    unittest.main()
