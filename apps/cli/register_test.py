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

    def test_measures_of_a_model_are_those_of_measure(self):
        folder, case = self.case_with_landmarks("measures")
        located = case["picks"][0]["name"]
        rows = ["axis_medial,-135,0,50", "axis_lateral,-65,0,50", "anterior,-100,20,50", "posterior,-100,-25,50", "planned_start,,,",
                f"{located},,,"]
        (folder / "m.csv").write_text("measure,kind,model,name,x_mm,y_mm,z_mm\n" + "".join(f"t,tibia_ap,body,{row}\n" for row in rows))
        case["models"][0] |= {"plan": "plan.mrk.json", "measures": "m.csv"}
        (folder / "case.json").write_text(json.dumps(case))
        out = self.root / "measured"
        self.assertEqual(run("run", folder, "--out", out, "--no-report").returncode, 0)
        (of_run,) = json.loads((out / "registration.json").read_text())["models"][0]["measures"]
        done = run("measure", "--landmarks", folder / "m.csv", "--registration", out / "registration.json",
                   "--calibration", out / "result.json", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        (alone,) = json.loads(done.stdout)["measures"]
        self.assertEqual([p["point"] for p in of_run["positions"]], ["planned_start", located])
        for one, other in zip(of_run["positions"], alone["positions"]):
            self.assertAlmostEqual(one["percent"]["from_anterior"], other["percent"]["from_anterior"], delta=1e-6)
            self.assertEqual([zone["name"] for zone in one["zones"]], [zone["name"] for zone in other["zones"]])
        self.assertEqual([each["message"] for each in of_run["laterals"]], [each["message"] for each in alone["laterals"]])
        done = run("register", folder, "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"{located}: not located", done.stdout)
        (of_register,) = json.loads((out / "registration.json").read_text())["models"][0]["measures"]
        self.assertEqual(of_register["missing"], [located])
        self.assertIn("Quadrants and per cent", (out / "report.html").read_text())

    def test_a_dicom_registration_needs_a_dicom_ct(self):
        folder, case = self.case_with_landmarks("no-dicom")
        (folder / "case.json").write_text(json.dumps(case))
        done = run("register", folder, "--out", self.root / "no-dicom-out", "--dicom")
        self.assertEqual(done.returncode, 2)
        self.assertIn("Frame of Reference UID", done.stderr)
        self.assertEqual(run("register", folder, "--frames", "1-2", "--dicom").returncode, 2)

    def test_dicom_of_a_plan_without_a_dicom_ct_is_a_measurement_report(self):
        folder, case = self.case_with_landmarks("dicom")
        case["models"][0]["plan"] = "plan.mrk.json"
        (folder / "case.json").write_text(json.dumps(case))
        out = self.root / "dicom-out"
        for command in ("register", "run"):
            done = run(command, folder, "--out", out, "--dicom")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("note: --dicom: no \"volume\" is a folder", done.stderr)
            report = out / "measurements.dcm"
            self.assertEqual(report.stat().st_mode & 0o777, 0o600)
            self.assertIn(b"body: planned", report.read_bytes())
        self.assertEqual(run("register", folder, "--out", out).returncode, 0)
        self.assertFalse(report.exists())

    def test_several_cases_have_a_folder_each_and_one_table(self):
        folder, _ = self.case_with_landmarks("one")
        broken = self.root / "broken"
        broken.mkdir()
        (broken / "case.json").write_text("{")
        out = self.root / "several"
        done = run("register", broken, folder, "--out", out)
        self.assertEqual(done.returncode, 2)
        self.assertIn("1 of 2 cases", done.stderr)
        self.assertIn("one: 1 accepted, 0 warned, 0 refused", done.stderr)
        lines = (out / "summary.csv").read_text().splitlines()
        self.assertEqual(lines[0], "case,status,code,message,frames,accepted,warned,refused,warnings")
        self.assertEqual([line.split(",")[:3] for line in lines[1:]], [["broken", "failed", "bad_json"], ["one", "ok", ""]])
        self.assertTrue((out / "one/report.html").exists())
        self.assertEqual(run("register", folder, folder, "--out", out, "--quiet").returncode, 0)
        self.assertEqual(sorted(path.name for path in out.iterdir()), ["one", "one_2", "summary.csv"])

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
        self.assertIn("\nplanned_start,plan,calibrator,", (self.root / "exported/points.csv").read_text())
        self.assertIn("tunnel planned", (self.root / "exported/points.mrk.json").read_text())
        for command in ("run", "register", "export"):
            done = run(command, folder, "--out", self.root / "limited", "--max-error", 0.02)
            self.assertEqual((done.returncode, "uncertain" in done.stderr), (3, True), done.stderr)
        self.assertFalse((self.root / "limited/points.csv").exists())

    def landmark_case(self, name, targets=None):
        """A case whose check targets are landmarks of a model that lies 100 mm along x; and the landmarks in the model."""
        folder = self.root / name
        shutil.copytree(self.root / "case", folder)
        truth = json.loads((folder / "truth.json").read_text())
        case = json.loads((folder / "case.json").read_text())
        case["picks"], places = [], {}
        for target, (x, y, z) in truth["targets_in_calibrator"].items():
            if targets and target not in targets:
                continue
            places[f"p{target}"] = [x - 100, y, z]
            for view in truth["views"]:
                raw = next(t["raw"] for t in view["targets"] if t["name"] == target)
                case["picks"].append({"name": f"p{target}", "view": view["name"], "uv": raw, "sigma_px": 0.2})
        case["models"] = [{"name": "body", "start": {"landmarks": "points.csv"}}]
        return folder, case, places

    def registered(self, folder, case, places, *options):
        rows = ["name,x_mm,y_mm,z_mm"] + [f"{name},{','.join(map(str, at))}" for name, at in places.items()]
        (folder / "points.csv").write_text("\n".join(rows) + "\n")
        (folder / "case.json").write_text(json.dumps(case))
        out = folder.with_name(folder.name + "-out")
        done = run("register", folder, "--out", out, *options)
        file = out / "registration.json"
        return done, json.loads(file.read_text())["models"][0] if file.exists() else None

    @staticmethod
    def write_line(folder, *ends):
        points = [{"label": str(i), "position": list(at)} for i, at in enumerate(ends)]
        (folder / "plan.mrk.json").write_text(json.dumps({"markups": [
            {"type": "Line", "name": "planned", "coordinateSystem": "LPS", "controlPoints": points}]}))

    def test_exchanged_landmarks_are_refused_by_name(self):
        folder, case, places = self.landmark_case("exchanged")
        first, second = list(places)[:2]
        places[first], places[second] = places[second], places[first]
        done, model = self.registered(folder, case, places)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(model["failure"]["code"], "residual_too_large")
        self.assertIn(f'"{first}" and "{second}" exchanged', done.stderr)

    def test_three_landmarks_have_no_handedness(self):
        folder, case, places = self.landmark_case("three", ("T2", "T4", "T5"))
        done, model = self.registered(folder, case, places)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("ambiguous_handedness", [note["code"] for note in model["notes"]])

    def test_the_limit_holds_for_planned_points_in_the_tools_frame(self):
        folder, case, places = self.landmark_case("limit")
        case["models"][0]["plan"] = "plan.mrk.json"
        middle = [sum(at[i] for at in places.values()) / len(places) for i in range(3)]
        self.write_line(folder, middle, [middle[0], middle[1], middle[2] + 20])
        case["tracker"] = {"sigma_mm": 0.6, "sigma_deg": 0.1}
        marker = [[1, 0, 0, 10], [0, 1, 0, 20], [0, 0, 1, -900], [0, 0, 0, 1]]
        for view in case["views"]:
            view["poses"] = {"tracker_from_calibrator": marker}
        case["poses_now"] = {"tracker_from_tool": marker}
        done, model = self.registered(folder, case, places, "--max-error", 20)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(max(point["error_95_mm"] for point in model["points"]), 1.9)
        done, model = self.registered(folder, case, places, "--max-error", 1.9)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(model["failure"]["code"], "uncertain")
        self.assertIn("in the tool's frame", done.stderr)

    def test_a_plan_elsewhere_is_warned_of(self):
        folder, case, places = self.landmark_case("elsewhere")
        case["models"][0]["plan"] = "plan.mrk.json"
        self.write_line(folder, [100, 0, 40], [100, -20, 60])
        done, model = self.registered(folder, case, places)
        self.assertIn("outside_model", [warning["code"] for warning in model["warnings"]])
        self.assertIn("RAS?", done.stderr)

    def test_one_name_is_one_point(self):
        folder, case, places = self.landmark_case("clash")
        case["models"][0]["plan"] = "plan.mrk.json"
        case["models"].append({**case["models"][0], "name": "other"})
        self.write_line(folder, [-100, 0, 40], [-100, 20, 60])
        done, _ = self.registered(folder, case, places)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("name_clash", done.stderr)

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
