#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `register`. Usage: register_test.py PROGRAM"""

import json
import shutil
import unittest

from program import SimulatedCase, run


class Register(SimulatedCase):
    def case_with_landmarks(self, name):
        """A body of the check targets, 100 mm along x, with a planned tunnel."""
        folder = self.root / name
        shutil.copytree(self.root / "case", folder)
        truth = json.loads((folder / "truth.json").read_text())
        case = json.loads((folder / "case.json").read_text())
        rows = ["name,x_mm,y_mm,z_mm"]
        case["picks"] = []
        for name, (x, y, z) in truth["targets_in_calibrator"].items():
            rows.append(f"p{name},{x - 100},{y},{z}")
            for view in truth["views"]:
                raw = next(target["raw"] for target in view["targets"] if target["name"] == name)
                case["picks"].append({"name": f"p{name}", "view": view["name"], "uv": raw})
        (folder / "points.csv").write_text("\n".join(rows) + "\n")
        case["models"] = [{"name": "body", "start": {"landmarks": "points.csv"}}]
        points = [{"label": name, "position": place} for name, place in (("s", [-100, 0, 40]), ("e", [-100, 20, 60]))]
        (folder / "plan.mrk.json").write_text(json.dumps({"markups": [
            {"type": "Line", "name": "planned", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": points}]}))
        (folder / "case.json").write_text(json.dumps(case))
        return folder, case

    def test_landmarks_alone_register_a_model(self):
        folder, case = self.case_with_landmarks("landmarks")
        done = run("register", folder, "--out", self.root / "registered", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        model = json.loads(done.stdout)["models"][0]
        self.assertEqual(model["decision"], "accept")
        for row, expected in zip(model["world_from_model"], ((1, 0, 0, 100), (0, 1, 0, 0), (0, 0, 1, 0))):
            for value, wanted in zip(row, expected):
                self.assertAlmostEqual(value, wanted, delta=0.7 if abs(wanted) > 1 or wanted == 0 else 0.02)
        self.assertLess(model["landmarks"]["fre_mm"], 1)
        self.assertTrue((self.root / "registered/report.html").exists())

        case["models"][0]["plan"] = "plan.mrk.json"
        (folder / "case.json").write_text(json.dumps(case))
        done = run("run", folder, "--out", self.root / "run-models", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual([tunnel["name"] for tunnel in result["tunnels"]], ["planned"])
        self.assertEqual(json.loads((self.root / "run-models/result.json").read_text()), result)
        self.assertEqual(json.loads((self.root / "run-models/registration.json").read_text())["status"], "ok")

    def test_run_export_and_register_take_the_same_options(self):
        folder, case = self.case_with_landmarks("options")
        case["models"][0]["plan"] = "plan.mrk.json"
        (folder / "case.json").write_text(json.dumps(case))
        arm = self.root / "arm.json"
        for i, seed in enumerate((11, 12)):
            other = self.root / f"earlier{i}"
            self.assertEqual(run("simulate", other, "--size", 512, "--seed", seed, "--quiet").returncode, 0)
            done = run("run", other, "--out", self.root / "earlier-result", "--machine", arm, "--no-report")
            self.assertEqual(done.returncode, 0, done.stderr)
        covariances = set()
        for options in ((), ("--method", "paper"), ("--motion-sigma", 1), ("--machine", arm)):
            copy = self.root / "arm-copy.json"
            shutil.copy(arm, copy)
            given = [copy if value is arm else value for value in options]
            whole, alone = self.root / "whole", self.root / "alone"
            done = run("run", folder, "--out", whole, "--json", "--no-report", *given)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual([t["model"] for t in json.loads(done.stdout)["tunnels"]], ["body"])
            shutil.copy(arm, self.root / "arm-copy.json")
            done = run("register", folder, "--out", alone, "--json", *given)
            self.assertEqual(done.returncode, 0, done.stderr)
            model, same = (json.loads((out / "registration.json").read_text())["models"][0] for out in (whole, alone))
            self.assertEqual((model["world_from_model"], model["covariance"]), (same["world_from_model"], same["covariance"]))
            covariances.add(str(model["covariance"]))
        self.assertEqual(len(covariances), 4)
        exported = run("export", folder, "--out", self.root / "exported", "--as", "csv,slicer")
        self.assertEqual(exported.returncode, 0, exported.stderr)
        self.assertIn("\ns,plan,calibrator,", (self.root / "exported/points.csv").read_text())
        self.assertIn("tunnel planned", (self.root / "exported/points.mrk.json").read_text())
        for command in ("run", "register", "export"):
            done = run(command, folder, "--out", self.root / "limited", "--max-error", 0.02)
            self.assertEqual((done.returncode, "uncertain" in done.stderr), (3, True), done.stderr)
        self.assertFalse((self.root / "limited/points.csv").exists())

    def test_register_names_what_is_wrong_with_a_model(self):
        folder = self.root / "no-model"
        shutil.copytree(self.root / "case", folder)
        case = json.loads((folder / "case.json").read_text())
        for models, code in (([], "bad_value"), ([{"name": "femur"}], "bad_value"),
                             ([{"name": "femur", "surface": "none.stl"}], "bad_value"),
                             ([{"name": "femur", "surface": "../femur.stl"}], "path_outside"),
                             ([{"name": "femur", "surfaces": "x.stl"}], "bad_value")):
            (folder / "case.json").write_text(json.dumps(dict(case, models=models)))
            done = run("register", folder, "--out", self.root / "none")
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertFalse((self.root / "none/registration.json").exists())


if __name__ == "__main__":
    unittest.main()
