#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the executable: exit codes, streams and files. Usage: cli_test.py PROGRAM"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = sys.argv.pop(1)


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, errors="replace")


class CommandLine(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        done = run("simulate", cls.root / "case", "--size", 512, "--seed", 5, "--quiet")
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_predict_decides_and_writes_a_map(self):
        done = run("predict", self.root / "case", "--at", "0,0,40", "--at", "400,0,40", "--max-error", "0.5",
                   "--map", self.root / "tre", "--half", 40, "--step", 20, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        near, far = json.loads(done.stdout)["points"]
        self.assertLess(near["error_95_mm"], far["error_95_mm"])
        self.assertEqual((near["decision"], far["decision"]), ("accept", "refuse"))
        self.assertEqual(len((self.root / "tre/tre.csv").read_text().splitlines()), 1 + 5 ** 3)
        self.assertIn("<svg", (self.root / "tre/tre.svg").read_text())
        self.assertEqual(run("predict", self.root / "case", "--at", "1,2").returncode, 2)

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

    def test_phantom_is_designed_for_a_knee(self):
        done = run("phantom", "design", "--knee", "66.7,57.2", "--file", self.root / "knee.json", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        proposed = json.loads(done.stdout)
        self.assertEqual(proposed["cone"], {"base_diameter_mm": 133.4, "top_diameter_mm": 66.7, "height_mm": 85.80000000000001})
        self.assertEqual(proposed["broken_rules"], [])
        self.assertEqual(json.loads((self.root / "knee.json").read_text()), proposed["calibrator"])
        for wrong in ((), ("--knee", "66.7"), ("--knee", "66.7,5")):
            self.assertEqual(run("phantom", "design", *wrong).returncode, 2, wrong)

    def test_study_biplane_takes_its_lengths_balls_and_noise(self):
        means = {}
        for degrees in (0.05, 0.5):
            done = run("study", "biplane", "--groups", 64, "--balls", 12, "--tracker-deg", degrees, "--far-plate", 880, "--json",
                       "--out", self.root / "biplane")
            self.assertEqual(done.returncode, 0, done.stderr)
            study = json.loads(done.stdout)
            self.assertEqual((study["balls_of_biplane"], study["plates_mm"]), (12, [830, 880]))
            means[degrees] = next(row["mm"]["mean"] for row in study["rows"]
                                  if (row["calibrator"], row["points"]) == ("biplane", "centre"))
        self.assertGreater(means[0.5], 1.2 * means[0.05])
        for wrong in (("--balls", 14), ("--tracker-deg", 11), ("--far-plate", 700), ("--tolerance", 0.1)):
            self.assertEqual(run("study", "biplane", *wrong, "--out", self.root / "biplane").returncode, 2, wrong)

    def test_history_contains_each_image_once(self):
        machine = self.root / "machine.json"
        for _ in range(2):
            done = run("run", self.root / "case", "--out", self.root / "known", "--no-report", "--machine", machine)
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([shot["view"] for shot in json.loads(machine.read_text())["shots"]], ["AP", "LAT"])
        machine.write_text("{}")
        self.assertEqual(run("run", self.root / "case", "--machine", machine).returncode, 2)

    def test_study_writes_the_same_bytes_on_any_number_of_threads(self):
        for threads in (1, 3):
            done = run("study", "limit", "--groups", 1, "--seed", 4, "--threads", threads, "--quiet",
                       "--out", self.root / f"limit{threads}")
            self.assertEqual(done.returncode, 0, done.stderr)
        for ending in ("csv", "json", "svg"):
            self.assertEqual((self.root / f"limit1/limit.{ending}").read_bytes(),
                             (self.root / f"limit3/limit.{ending}").read_bytes())
        done = run("study", "limit", "--groups", 1, "--out", self.root / "limit1")
        self.assertLess(done.stdout.count("\n"), 12)
        self.assertNotIn("\r", done.stderr)
        self.assertEqual(run("study", "fortune").returncode, 2)

    def test_studies_of_the_paper_write_table_figure_and_summary(self):
        for name, more in (("number", ("--balls", "6,12")), ("uniformity", ("--draws", 3)),
                           ("location", ("--calibrator", "udcsc")), ("biplane", ()), ("design", ("--surface", "dome"))):
            out = {}
            for threads in (1, 2):
                folder = self.root / f"{name}{threads}"
                done = run("study", name, "--groups", 70, *more, "--seed", 4, "--threads", threads, "--out", folder)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("the optimised design" if name == "design" else "Published (", done.stdout)
                out[threads] = {path.name: path.read_bytes() for path in folder.iterdir()}
            self.assertEqual(out[1], out[2])
            self.assertEqual(sorted(out[1]), [f"{name}.csv", f"{name}.json", f"{name}.svg"])
            written = json.loads(out[1][f"{name}.json"])
            self.assertEqual((written["format"], written["study"], written["groups"], written["seed"]),
                             ("helicarm-study/1", name, 70, 4))

    def test_study_refuses_options_it_does_not_have(self):
        for wrong in (("number", "--sigma", "variance"), ("number", "--draws", 3), ("number", "--balls", "5"),
                      ("number", "--balls", "7,7"), ("number", "--reading", "exact,exact"), ("uniformity", "--balls", "6,7"),
                      ("location", "--origin", "top"), ("location", "--calibrator", "none.json"), ("limit", "--fle", 1),
                      ("number", "--groups", 0)):
            done = run("study", *wrong, "--out", self.root / "refused")
            self.assertEqual(done.returncode, 2, wrong)
            self.assertTrue(done.stderr.strip(), wrong)

    @unittest.skipUnless(os.environ.get("HELICARM_MPIRUN"), "built without MPI")
    def test_study_writes_the_same_bytes_on_any_number_of_ranks(self):
        environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                        "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
                        "OMPI_MCA_plm_rsh_agent": "false"}  # local ranks only: no remote shell is needed
        for name, *more in (("number", "--groups", "3001", "--balls", "6,12"), ("limit", "--groups", "51"),
                            ("biplane", "--groups", "200"), ("location", "--groups", "300")):
            study = ("study", name, *more, "--seed", "4", "--out")
            self.assertEqual(run(*study, self.root / f"{name}0", "--quiet").returncode, 0)
            for ranks in ("1", "2", "3") if name == "number" else ("2",):
                folder = self.root / f"{name}{ranks}"
                done = subprocess.run([os.environ["HELICARM_MPIRUN"], "-n", ranks, PROGRAM, *study, str(folder)],
                                      capture_output=True, text=True, env=environment)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(done.stdout.count("written to"), 1)
                self.assertEqual(f"{ranks} ranks" in done.stderr, ranks != "1")
                for ending in ("csv", "json", "svg"):
                    self.assertEqual((folder / f"{name}.{ending}").read_bytes(),
                                     (self.root / f"{name}0/{name}.{ending}").read_bytes())
        done = subprocess.run([os.environ["HELICARM_MPIRUN"], "-n", "2", PROGRAM, "study", "number", "--fle", "no"],
                              capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 2, done.stderr)

    def test_killed_study_resumes_to_the_same_bytes(self):
        study = ("study", "uniformity", "--groups", 1000, "--seed", 3, "--quiet")
        folder = self.root / "killed"
        journal = folder / "uniformity.partial"
        killed = subprocess.Popen([PROGRAM, *map(str, study), "--threads", "1", "--out", str(folder)])
        while killed.poll() is None and not journal.exists():
            time.sleep(0.002)
        killed.kill()
        killed.wait()
        if not (folder / "uniformity.csv").exists():  # else the machine was too fast to be interrupted
            self.assertTrue(journal.exists())
            self.assertEqual(run(*study, "--draws", 99, "--resume", "--out", folder).returncode, 2)
        self.assertEqual(run(*study, "--resume", "--out", folder).returncode, 0)
        self.assertFalse(journal.exists())
        self.assertEqual(run(*study, "--out", self.root / "whole").returncode, 0)
        for ending in ("csv", "json", "svg"):
            self.assertEqual((folder / f"uniformity.{ending}").read_bytes(),
                             (self.root / f"whole/uniformity.{ending}").read_bytes())

    def test_run_writes_result_report_and_overlays(self):
        done = run("run", self.root / "case", "--out", self.root / "out", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        printed = json.loads(done.stdout)
        written = json.loads((self.root / "out/result.json").read_text())
        self.assertEqual(printed, written)
        self.assertEqual(written["status"], "ok")
        self.assertLess(written["accuracy"]["tre_mm"]["mean"], 0.2)
        for name in ("report.html", "AP_overlay.png", "LAT_overlay.png"):
            self.assertTrue((self.root / "out" / name).stat().st_size > 1000, name)

    def test_run_that_fails_leaves_no_overlay_of_an_earlier_result(self):
        out, broken = self.root / "again", self.root / "unreadable"
        run("run", self.root / "case", "--out", out, "--quiet")
        (out / "my_overlay.png").write_text("the user's own")
        broken.mkdir()
        (broken / "case.json").write_text("{")
        self.assertEqual(run("run", broken, "--out", out).returncode, 2)
        self.assertEqual([path.name for path in out.iterdir()], ["my_overlay.png"])

    def test_run_of_several_cases_goes_on_after_an_unusable_one(self):
        broken = self.root / "broken"
        broken.mkdir()
        (broken / "case.json").write_text("{")
        done = run("run", broken, self.root / "case", "--out", self.root / "both")
        self.assertEqual(done.returncode, 2)
        self.assertIn("1 of 2 cases", done.stderr)
        lines = (self.root / "both/summary.csv").read_text().splitlines()
        self.assertEqual([line.split(",")[:3] for line in lines[1:]], [["broken", "failed", "bad_json"], ["case", "ok", ""]])
        self.assertTrue((self.root / "both/case/report.html").exists())

    def test_export_writes_what_other_programs_read(self):
        out = self.root / "exported"
        done = run("export", self.root / "case", "--out", out, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        of_view = ["matrix.txt", "mayacam.txt", "opencv.yml", "pose.tfm", "rectified.dcm", "rtk.xml"]
        names = [f"{view}_{name}" for view in ("AP", "LAT") for name in of_view]
        names += ["dlt.csv", "points.csv", "points.mrk.json"]
        self.assertEqual(sorted(path.name for path in out.iterdir()), names)
        self.assertEqual(json.loads(done.stdout)["written"], [str(out / name) for name in names])
        back = [json.loads(run("import", out / f"AP_{name}", "--json").stdout)
                for name in ("mayacam.txt", "matrix.txt", "opencv.yml")]
        self.assertEqual(back[0]["image_size"], [512, 512])
        for camera in back[1:]:
            for row, other in zip(back[0]["projection"], camera["projection"]):
                for a, b in zip(row, other):
                    self.assertAlmostEqual(a, b, delta=1e-6 * max(1, abs(a)))
        pose = json.loads(run("import", out / "AP_pose.tfm", "--json").stdout)["moving_from_fixed"]
        for row, other, t in zip(pose, back[0]["R"], back[0]["t"]):
            self.assertEqual([round(a, 9) for a in row], [round(a, 9) for a in other + [t]])
        self.assertEqual({len(line.split(",")) for line in (out / "dlt.csv").read_text().splitlines()}, {2})
        some = self.root / "some"
        self.assertEqual(run("export", self.root / "case", "--out", some, "--as", "csv,dlt").returncode, 0)
        self.assertEqual(sorted(path.name for path in some.iterdir()), ["dlt.csv", "points.csv"])

    def test_export_refuses_as_the_measurement_does(self):
        out = self.root / "not-exported"
        done = run("export", self.root / "case", "--out", out, "--max-error", 0.0001)
        self.assertEqual(done.returncode, 3)
        self.assertIn("uncertain", done.stderr)
        self.assertFalse(out.exists())
        done = run("export", self.root / "case", "--as", "csv,stl", "--out", out)
        self.assertEqual(done.returncode, 2)
        self.assertIn("stl", done.stderr)
        (self.root / "only-result").mkdir()
        (self.root / "only-result/result.json").write_text("{}")
        self.assertIn("give the folder of the case", run("export", self.root / "only-result").stderr)

    def test_paper_method_gives_the_same_fields(self):
        outs = []
        for method in ("best", "paper"):
            done = run("run", self.root / "case", "--out", self.root / method, "--method", method, "--json", "--no-report")
            self.assertIn(done.returncode, (0, 3), done.stderr)
            outs.append(json.loads((self.root / method / "result.json").read_text()))
        self.assertEqual(list(outs[0]), list(outs[1]))

    def test_refusal_is_exit_3_with_a_result(self):
        done = run("run", self.root / "case", "--out", self.root / "strict", "--max-error", 0.0001, "--json")
        self.assertEqual(done.returncode, 3)
        self.assertTrue(done.stderr.startswith("helicarm: "), done.stderr)
        self.assertIn("uncertain", done.stderr)
        self.assertEqual(json.loads(done.stdout)["failure"]["code"], "uncertain")
        self.assertEqual(json.loads((self.root / "strict/result.json").read_text())["status"], "refused")

    def test_unusable_input_is_exit_2_and_leaves_no_old_result(self):
        out = self.root / "stale"
        out.mkdir()
        for name in ("result.json", "report.html"):
            (out / name).write_text("{}")
        done = run("run", self.root / "nowhere", "--out", out)
        self.assertEqual(done.returncode, 2)
        self.assertIn("missing_file", done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual(list(out.iterdir()), [])

    def test_wrong_usage_is_exit_2(self):
        for words in ([], ["run"], ["fly"], ["run", "x", "--colour"], ["demo", "--seed", "-1"], ["demo", "--seed", "1e30"],
                      ["run", "x", "--max-error", "nan"], ["run", "x", "--max-error", "1001"],
                      ["virtual-or", "--size", "700"], ["receive", "--port", "70000"], ["detect", "x", "--frame", "0"], ["rectify"],
                      ["run", "x", "--method", "worst"], ["detect", "x", "--kind", "cats"]):
            done = run(*words, "--json")
            self.assertEqual(done.returncode, 2, words)
            self.assertIn("helicarm: usage: ", done.stderr)
            self.assertEqual(json.loads(done.stdout)["failure"]["code"], "usage")

    def test_quiet_prints_only_failures(self):
        points = self.root / "solve.csv"
        points.write_text("label,x_mm,y_mm,z_mm,u_px,v_px\n" + "".join(
            f"P{i},{x},{y},{z},{5 * x * 1000 / (1000 + z)},{5 * y * 1000 / (1000 + z)}\n"
            for i, (x, y, z) in enumerate([(0, 0, 0), (50, 0, 0), (0, 50, 0), (0, 0, 50), (50, 50, 0), (50, 0, 50), (0, 50, 50)])))
        done = run("solve", "--points", points, "--quiet")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
        self.assertIn("intrinsics", json.loads(run("solve", "--points", points, "--quiet", "--json").stdout))

    def test_export_names_its_files_as_json(self):
        drawing = self.root / "calibrator.svg"
        done = run("phantom", "export", "--svg", drawing, "--json")
        self.assertEqual(json.loads(done.stdout), {"written": [str(drawing)]})

    def test_help_has_an_example(self):
        for command in ("demo", "run", "export", "solve", "locate", "rectify", "detect", "import", "simulate", "phantom"):
            done = run(command, "--help")
            self.assertEqual(done.returncode, 0)
            self.assertIn(f"Example:\n  helicarm {command}", done.stdout)

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

    def test_run_that_cannot_write_its_overlays_leaves_nothing(self):
        out = self.root / "blocked"
        (out / "LAT_overlay.png/in the way").mkdir(parents=True)
        done = run("run", self.root / "case", "--out", out, "--quiet")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("cannot_write", done.stderr)
        self.assertEqual([path.name for path in out.iterdir()], ["LAT_overlay.png"])

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
                   "P1,P3=110.55", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual((len(result["balls"]), result["scale"]["source"]), (12, "distances"))
        self.assertTrue((folder / "measured/report.html").is_file())
        shutil.copy(folder / "measured/calibrator.json", folder / "measured.json")
        (folder / "measured-case.json").write_text(json.dumps(dict(case, calibrator="measured.json")))
        history = folder / "history.json"
        done = run("phantom", "verify", folder / "measured-case.json", "--history", history)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(len(json.loads(history.read_text())["verifications"]), 1)

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

    def test_phantom_check_agrees_as_text_and_as_json(self):
        rules = json.loads(run("phantom", "check", "--json").stdout)["rules"]
        lines = run("phantom", "check").stdout.splitlines()
        self.assertEqual([rule["passed"] for rule in rules], [line.startswith("kept") for line in lines[:len(rules)]])

    def test_file_name_that_is_not_utf8_is_refused(self):
        done = run("detect", b"\xff.dcm".decode(errors="surrogateescape"), "--json")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(json.loads(done.stdout)["failure"]["code"], "missing_file")

    def test_message_contains_no_control_character_of_a_file(self):
        matrix = self.root / "matrix.txt"
        matrix.write_text("1 0 0 0\n0 1 0 0\n0 0 1 \x1b[31m\n")
        done = run("import", matrix)
        self.assertEqual(done.returncode, 2)
        self.assertIn("\"?", done.stderr)
        self.assertNotIn("\x1b", done.stderr)

    def test_detect_finds_the_metal(self):
        done = run("detect", self.root / "case/AP.dcm", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(len(json.loads(done.stdout)["dots"]), 40)

    def test_locate_reads_a_result(self):
        run("run", self.root / "case", "--out", self.root / "calibrated", "--no-report", "--quiet")
        result = json.loads((self.root / "calibrated/result.json").read_text())
        target = next(p for p in result["points"] if p["name"] == "T1")
        picks = self.root / "picks.csv"
        picks.write_text("name,view,u_px,v_px\n" + "".join(
            f"T1,{view},{seen['uv'][0]},{seen['uv'][1]}\n" for view, seen in target["seen"].items()))
        done = run("locate", "--calibration", self.root / "calibrated/result.json", "--picks", picks, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        for a, b in zip(json.loads(done.stdout)["points"][0]["xyz_mm"], target["xyz_mm"]):
            self.assertAlmostEqual(a, b, 2)

    def test_locate_agrees_with_run_on_raw_picks(self):
        case = self.root / "picked"
        shutil.copytree(self.root / "case", case)
        clicks = [("near", "AP", 250.3, 240.1, None), ("near", "LAT", 255.9, 241.7, 1.5),
                  ("apart", "AP", 300, 200, 0), ("apart", "LAT", 310, 260, 0.2)]
        description = json.loads((case / "case.json").read_text())
        description["picks"] = [{"name": name, "view": view, "uv": [u, v], "sigma_px": sigma}
                                for name, view, u, v, sigma in clicks]
        (case / "case.json").write_text(json.dumps(description))
        self.assertEqual(run("run", case, "--out", case / "out", "--no-report", "--quiet").returncode, 0)
        picks = self.root / "raw.csv"
        picks.write_text("name,view,u_px,v_px,sigma_px\n" + "".join(
            f"{name},{view},{u},{v},{'' if sigma is None else sigma}\n" for name, view, u, v, sigma in clicks))
        done = run("locate", "--calibration", case / "out/result.json", "--picks", picks, "--raw", "--json")
        known = json.loads((case / "out/result.json").read_text())["points"]
        for here, there in zip(json.loads(done.stdout)["points"], known):
            self.assertEqual(here["name"], there["name"])
            for a, b in zip(here["xyz_mm"] + sum(here["covariance_mm2"], []), there["xyz_mm"] + sum(there["covariance_mm2"], [])):
                self.assertAlmostEqual(a, b, delta=1e-6 * max(1, abs(b)))


class Tracker(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.file = pathlib.Path(cls.folder.name) / "poses.mha"
        lines = [f"Seq_Frame{i:04}_ToolToTrackerTransform = 1 0 0 {i % 7 / 100} 0 1 0 0 0 0 1 800 0 0 0 1\n"
                 f"Seq_Frame{i:04}_Timestamp = {i / 100}\n" for i in range(100)]
        cls.file.write_text("".join(lines) + "ElementDataFile = LOCAL\n")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def replay(self):
        server = subprocess.Popen([PROGRAM, "tracker", "replay", self.file, "--json"], text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(server.communicate)
        self.addCleanup(server.kill)
        return server, server.stderr.readline().split()[-1]

    def test_replay_is_watched_and_recorded_and_ends_at_once(self):
        server, port = self.replay()
        done = run("tracker", "watch", f"127.0.0.1:{port}", "--seconds", 1, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        seen = json.loads(done.stdout)
        self.assertEqual(seen["state"], "connected")
        self.assertEqual([tool["name"] for tool in seen["tools"]], ["ToolToTracker"])
        self.assertGreater(seen["tools"][0]["accepted"], 10)
        copy = self.file.with_name("copy.mha")
        done = run("tracker", "record", f"127.0.0.1:{port}", copy, "--seconds", 0.5, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("ToolToTrackerTransform", copy.read_text())
        server.terminate()
        self.assertEqual(server.wait(timeout=5), 0)

    def test_recording_is_watched_without_a_server(self):
        done = run("tracker", "watch", f"file:{self.file}", "--seconds", 0.5, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        seen = json.loads(done.stdout)
        self.assertEqual(seen["state"], "connected")
        self.assertGreater(seen["tools"][0]["accepted"], 5)
        done = run("tracker", "watch", "file:/nowhere.mha", "--seconds", 0.5)
        self.assertEqual(done.returncode, 2)
        self.assertIn("missing_file", done.stderr)

    def test_port_in_use_and_pivot_without_rotation_are_refused(self):
        _, port = self.replay()
        done = run("tracker", "replay", self.file, "--port", port)
        self.assertEqual(done.returncode, 2)
        self.assertIn("port_taken", done.stderr)
        done = run("tracker", "pivot", self.file, "--tool", "ToolToTracker")
        self.assertEqual(done.returncode, 3)
        self.assertIn("poses_too_alike", done.stderr)

    def recorded_touch(self, name, point_in_tracker):
        """A pointer at rest whose tip, 100 mm below its marker, touches a point of a calibrator at rest."""
        x, y, z = point_in_tracker
        lines = [f"Seq_Frame{i:04}_FacetTransform = 1 0 0 0 0 1 0 0 0 0 1 900 0 0 0 1\n"
                 f"Seq_Frame{i:04}_PointerTransform = 1 0 0 {x} 0 1 0 {y + 100} 0 0 1 {z} 0 0 0 1\n"
                 f"Seq_Frame{i:04}_Timestamp = {i / 50}\n" for i in range(12)]
        file = self.file.with_name(f"{name}.mha")
        file.write_text("".join(lines) + "ElementDataFile = LOCAL\n")
        return f"{name}={file}"

    def test_mount_is_found_from_recorded_touches(self):
        mount, divots = (10, 20, 30), {"D1": (60, 0, 0), "D2": (0, 45, 0), "D3": (-40, -20, 50), "D4": (0, 5, 80)}
        in_tracker = {name: [c - m + o for c, m, o in zip(at, mount, (0, 0, 900))] for name, at in divots.items()}
        tip, out = self.file.with_name("tip.json"), self.file.with_name("mount.json")
        tip.write_text(json.dumps({"tip_in_tool": [0, -100, 0]}))
        common = ["tracker", "calibrate-mount", "--facet", "Facet", "--pointer", "Pointer", "--tip", tip, "--out", out]
        for name, at in divots.items():
            common += ["--divot", f"{name}={','.join(map(str, at))}"]
        touches = [word for name, at in in_tracker.items() for word in ("--recorded", self.recorded_touch(name, at))]
        done = run(*common, *touches, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        found = json.loads(out.read_text())
        self.assertEqual(found, json.loads(done.stdout))
        for axis in range(3):
            self.assertAlmostEqual(found["facet"]["calibrator_from_facet"][axis][3], mount[axis], delta=0.01)
        self.assertLess(found["fre_mm"], 0.01)
        self.assertLess(found["tre_mm"]["D1"], 1)
        exchanged = run(*common, *touches[:-4], "--recorded", self.recorded_touch("D4", in_tracker["D3"]),
                        "--recorded", self.recorded_touch("D3", in_tracker["D4"]))
        self.assertEqual(exchanged.returncode, 3)
        self.assertIn("residual_too_large", exchanged.stderr)
        self.assertIn("exchanged", exchanged.stderr)
        few = run(*common, *touches[:4])
        self.assertEqual(few.returncode, 3)
        self.assertIn("poses_too_alike", few.stderr)

    def test_missing_or_invalid_arguments_are_named(self):
        for words, said in ((("tracker", "pivot", self.file, "--tool", "Pointer"), "which holds ToolToTracker"),
                            (("tracker", "calibrate-mount", "--facet", "F", "--recorded", "P1=x"), "need --tip"),
                            (("tracker", "calibrate-mount", "--facet", "F", "--divot", "D=1,2"), "xyz_mm"),
                            (("tracker", "calibrate-mount", "--facet", "F", "--touch", "P1"), "belong together"),
                            (("tracker", "watch", "127.0.0.1:70000"), "1 to 65535"),
                            (("tracker", "replay", self.file, "--port", "70000"), "0 to 65535"),
                            (("receive", "--watch", self.file.parent, "--port", "11112"), "excludes")):
            done = run(*words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn(said, done.stderr)


class Robot(unittest.TestCase):
    def test_robot_that_does_not_answer_is_refused(self):
        done = run("robot", "watch", "127.0.0.1", "--port", 9, "--seconds", 0.5)
        self.assertEqual(done.returncode, 3)
        self.assertIn("not_connected", done.stderr)


class Operate(unittest.TestCase):
    def test_stop_signal_is_reported(self):
        with tempfile.TemporaryDirectory() as folder:
            operate = subprocess.Popen([PROGRAM, "operate", "--cases", "1", "--size", "512", "--out", folder], text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.addCleanup(operate.kill)
            operate.stderr.readline()  # starting the virtual devices
            operate.send_signal(signal.SIGINT)
            _, said = operate.communicate(timeout=60)
            self.assertEqual(operate.returncode, 3)
            self.assertIn("interrupted", said)


if __name__ == "__main__":
    unittest.main()
