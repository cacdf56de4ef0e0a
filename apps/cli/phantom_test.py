#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `phantom`. Usage: phantom_test.py PROGRAM"""

import json
import shutil
import unittest

from program import SimulatedCase, run


class Phantom(SimulatedCase):
    def test_phantom_is_designed_for_a_knee(self):
        done = run("phantom", "design", "--knee", "66.7,57.2", "--file", self.root / "knee.json", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        proposed = json.loads(done.stdout)
        self.assertEqual(proposed["cone"], {"base_diameter_mm": 133.4, "top_diameter_mm": 66.7, "height_mm": 85.80000000000001})
        self.assertEqual(proposed["broken_rules"], [])
        self.assertEqual(json.loads((self.root / "knee.json").read_text()), proposed["calibrator"])
        for wrong in ((), ("--knee", "66.7"), ("--knee", "66.7,5")):
            self.assertEqual(run("phantom", "design", *wrong).returncode, 2, wrong)

    def simulated_phantom(self, name):
        folder = self.root / name
        views = [argument for i in range(4) for argument in ("--view", f"V{i}:{20 * i},{10 * (i % 2)}")]
        done = run("simulate", folder, "--kind", "flat", "--no-knee", "--size", 512, "--seed", 5, "--quiet", *views)
        self.assertEqual(done.returncode, 0, done.stderr)
        return folder

    def test_phantom_is_measured_and_then_verified(self):
        folder = self.simulated_phantom("phantom")
        nominal = json.loads((folder / "calibrator.json").read_text())
        nominal["balls"][4]["xyz_mm"][1] += 1
        (folder / "nominal.json").write_text(json.dumps(nominal))
        case = json.loads((folder / "case.json").read_text())
        (folder / "nominal-case.json").write_text(json.dumps(dict(case, calibrator="nominal.json")))
        done = run("phantom", "verify", folder / "nominal-case.json", "--json", "--out", folder / "verified")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(json.loads(done.stdout)["failure"]["code"], "calibrator_mismatch")
        verified = json.loads((folder / "verified/result.json").read_text())
        states = {ball["label"]: ball["state"] for ball in verified["balls"]}
        self.assertEqual([label for label, state in states.items() if state != "as in the file"], ["P5"])
        done = run("phantom", "measure", folder / "nominal-case.json", "--out", folder / "measured", "--distance",
                   "P1,P3=113.12", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual((len(result["balls"]), result["scale"]["source"]), (12, "distances"))
        self.assertEqual([note["code"] for note in result["notes"]], ["scale_unverified"])
        self.assertAlmostEqual(result["scale"]["over_nominal"]["ratio"], 1, delta=0.01)
        self.assertTrue((folder / "measured/report.html").is_file())
        shutil.copy(folder / "measured/calibrator.json", folder / "measured.json")
        (folder / "measured-case.json").write_text(json.dumps(dict(case, calibrator="measured.json")))
        history = folder / "history.json"
        done = run("phantom", "verify", folder / "measured-case.json", "--history", history)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("the scale of the file is not verified", done.stdout)
        self.assertEqual(len(json.loads(history.read_text())["verifications"]), 1)
        done = run("phantom", "verify", folder / "measured-case.json", "--json")
        verified = json.loads(done.stdout)
        self.assertIs(verified["scale"]["verified"], False)
        self.assertAlmostEqual(verified["scale"]["file_over_true"], 1, delta=4 * verified["scale"]["relative_sigma"])
        self.assertEqual([note["code"] for note in verified["notes"]], ["scale_unverified"])

    def test_phantom_measure_refuses_what_it_cannot_use(self):
        folder = self.simulated_phantom("phantom-refused")
        case = json.loads((folder / "case.json").read_text())
        (folder / "two.json").write_text(json.dumps(dict(case, views=case["views"][:2])))
        out = folder / "out"
        done = run("phantom", "measure", folder / "two.json", "--out", out)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(json.loads((out / "result.json").read_text())["failure"]["code"], "too_few_views")
        self.assertFalse((out / "calibrator.json").exists())
        (folder / "bare.json").write_text(json.dumps(dict(case, calibrator=None)))
        for wrong in (("bare.json", "--from-scratch"), ("case.json", "--distance", "P1,P3"),
                      ("case.json", "--distance", "P1,P3=-4"), ("case.json", "--distance", "P1,Q9=80")):
            done = run("phantom", "measure", folder / wrong[0], "--out", out, *wrong[1:])
            self.assertEqual(done.returncode, 2, (wrong, done.stderr))
        (folder / "scratch.json").write_text(json.dumps(dict(case, calibrator=None, diameters_mm=[4])))
        done = run("phantom", "measure", folder / "scratch.json", "--from-scratch", "--out", out)
        self.assertEqual((done.returncode, "ambiguous_handedness" in done.stderr), (3, True), done.stderr)

    def test_mirrored_nominal_file_and_sizes_that_no_ball_has_are_refused(self):
        folder = self.simulated_phantom("phantom-mirrored")
        case = json.loads((folder / "case.json").read_text())
        mirrored = json.loads((folder / "calibrator.json").read_text())
        mirrored["targets"] = []
        for ball in mirrored["balls"]:
            ball["xyz_mm"][0] *= -1
        (folder / "mirrored.json").write_text(json.dumps(mirrored))
        (folder / "mirrored-case.json").write_text(json.dumps(dict(case, calibrator="mirrored.json")))
        views = [dict(view, mirrored=False) for view in case["views"]]
        (folder / "sizes.json").write_text(json.dumps(dict(case, calibrator=None, diameters_mm=[4, 5], views=views)))
        out = folder / "out"
        for name, options, code in (("mirrored-case.json", (), "ambiguous_handedness"),
                                    ("sizes.json", ("--from-scratch",), "uncertain")):
            done = run("phantom", "measure", folder / name, *options, "--out", out)
            self.assertEqual((done.returncode, code in done.stderr), (3, True), done.stderr)
            self.assertFalse((out / "calibrator.json").exists())

    def test_phantom_check_agrees_as_text_and_as_json(self):
        rules = json.loads(run("phantom", "check", "--json").stdout)["rules"]
        lines = run("phantom", "check").stdout.splitlines()
        self.assertEqual([rule["passed"] for rule in rules], [line.startswith("kept") for line in lines[:len(rules)]])


if __name__ == "__main__":
    unittest.main()
