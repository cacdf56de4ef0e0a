#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the executable with a user's own files: cases from images, picks. Usage: cases_test.py PROGRAM"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)


def run(*arguments, program=PROGRAM, **options):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, errors="replace",
                          stdin=subprocess.DEVNULL, **options)


class OwnFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        done = run("simulate", cls.root / "case", "--size", 512, "--seed", 5, "--quiet")
        assert done.returncode == 0, done.stderr
        cls.images = [cls.root / "IM0001", cls.root / "IM0002"]
        for name, image in zip(("LAT", "AP"), cls.images):
            shutil.copy(cls.root / "case" / f"{name}.dcm", image)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def made(self, name):
        out = self.root / name
        done = run("new", *self.images, "--calibrator", self.root / "case/calibrator.json", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        return out

    def test_new_case_of_files_is_picked_by_a_table_and_run(self):
        case = self.made("new")
        description = json.loads((case / "case.json").read_text())
        self.assertEqual([view["name"] for view in description["views"]], ["LAT", "AP"])
        self.assertEqual((description["plate"], description["calibrator"]), ("plate48", "calibrator.json"))
        self.assertIn("plate48", description["notes"])
        picks = self.root / "picks.csv"
        picks.write_text("name,view,u_px,v_px\nentry,AP,250,240\nentry,LAT,255,238\n")
        done = run("pick", case, "--csv", picks, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["added"], 2)
        done = run("run", case, "--out", self.root / "new-out", "--json", "--no-report")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("entry", [point["name"] for point in json.loads(done.stdout)["points"]])

    def test_new_names_the_option_that_is_missing_and_writes_nothing(self):
        out = self.root / "open"
        for words, said in ((self.images, "--calibrator"), (self.images[:1], "two or more")):
            done = run("new", *words, "--out", out)
            self.assertEqual(done.returncode, 2)
            self.assertIn(said, done.stderr)
        self.assertFalse(out.exists())

    def test_new_does_not_overwrite_a_case(self):
        case = self.made("kept")
        before = (case / "case.json").read_bytes()
        done = run("new", *self.images, "--calibrator", "udcsc", "--out", case)
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot_write", done.stderr)
        self.assertEqual((case / "case.json").read_bytes(), before)

    def test_pick_opens_the_desktop_or_says_how_to_install_it(self):
        case = self.made("picked")
        alone = self.root / "alone"
        alone.mkdir()
        program = shutil.copy(PROGRAM, alone / "helicarm")
        done = run("pick", case, program=program, env={**os.environ, "PATH": str(alone)})
        self.assertEqual(done.returncode, 2)
        self.assertIn("apt install helicarm-gui", done.stderr)
        desktop = alone / "helicarm-gui"
        desktop.write_text("#!/bin/sh\necho opened $1\n")
        desktop.chmod(0o755)
        self.assertEqual(run("pick", case, program=program).stdout.strip(), f"opened {case}")

    def test_pick_of_an_unknown_view_leaves_the_case_alone(self):
        case = self.made("alone-view")
        before = (case / "case.json").read_bytes()
        picks = self.root / "wrong.csv"
        picks.write_text("name,view,u_px,v_px\nentry,OBL,250,240\n")
        done = run("pick", case, "--csv", picks)
        self.assertEqual(done.returncode, 2)
        self.assertIn("OBL", done.stderr)
        self.assertEqual((case / "case.json").read_bytes(), before)


if __name__ == "__main__":
    unittest.main()
