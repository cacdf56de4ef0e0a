#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of `register`. Usage: register_test.py PROGRAM"""

import json
import shutil
import unittest

from program import SimulatedCase, run


class Register(SimulatedCase):
    def test_landmarks_alone_register_a_model(self):
        folder = self.root / "landmarks"
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
        (folder / "case.json").write_text(json.dumps(case))
        done = run("register", folder, "--out", self.root / "registered", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        model = json.loads(done.stdout)["models"][0]
        self.assertEqual(model["decision"], "accept")
        for row, expected in zip(model["world_from_model"], ((1, 0, 0, 100), (0, 1, 0, 0), (0, 0, 1, 0))):
            for value, wanted in zip(row, expected):
                self.assertAlmostEqual(value, wanted, delta=0.7 if abs(wanted) > 1 or wanted == 0 else 0.02)
        self.assertLess(model["landmarks"]["fre_mm"], 1)
        self.assertTrue((self.root / "registered/report.html").exists())

        points = [{"label": name, "position": place} for name, place in (("s", [-100, 0, 40]), ("e", [-100, 20, 60]))]
        (folder / "plan.mrk.json").write_text(json.dumps({"markups": [
            {"type": "Line", "name": "planned", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": points}]}))
        case["models"][0]["plan"] = "plan.mrk.json"
        (folder / "case.json").write_text(json.dumps(case))
        done = run("run", folder, "--out", self.root / "run-models", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual([tunnel["name"] for tunnel in result["tunnels"]], ["planned"])
        self.assertEqual(json.loads((self.root / "run-models/result.json").read_text()), result)
        self.assertEqual(json.loads((self.root / "run-models/registration.json").read_text())["status"], "ok")

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
