#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the executable: exit codes, streams and files. Usage: cli_test.py PROGRAM"""

import json
import shutil
import unittest

import cv2
import pydicom

from program import SimulatedCase, run


class CommandLine(SimulatedCase):
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

    def test_history_contains_each_image_once(self):
        machine = self.root / "machine.json"
        for begins in (True, False):
            done = run("run", self.root / "case", "--out", self.root / "known", "--no-report", "--machine", machine)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual("did not exist" in done.stderr, begins)
        self.assertEqual([shot["view"] for shot in json.loads(machine.read_text())["shots"]], ["AP", "LAT"])
        machine.write_text("{}")
        self.assertEqual(run("run", self.root / "case", "--machine", machine).returncode, 2)

    def test_loss_of_jpeg_files_is_a_note_and_of_dicom_files_a_warning(self):
        jpeg = self.root / "jpeg"
        shutil.copytree(self.root / "case", jpeg)
        case = json.loads((jpeg / "case.json").read_text())
        ap, lat = case["views"]
        image = pydicom.dcmread(jpeg / ap["image"])
        cv2.imwrite(str(jpeg / "AP.jpg"), (image.pixel_array >> (image.BitsStored - 8)).astype("uint8"))
        ap.update(image="AP.jpg", pixel_mm=float(image.ImagerPixelSpacing[0]))
        lossy = pydicom.dcmread(jpeg / lat["image"])
        lossy.LossyImageCompression = "01"
        lossy.save_as(jpeg / lat["image"])
        (jpeg / "case.json").write_text(json.dumps(case))
        done = run("run", jpeg, "--out", self.root / "of_jpeg", "--no-report")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads((self.root / "of_jpeg/result.json").read_text())
        for findings, view in ((result["notes"], "AP"), (result["warnings"], "LAT")):
            self.assertEqual([each["view"] for each in findings if each["code"] == "lossy_image"], [view])

    def test_c_arm_is_recorded_reported_and_checked(self):
        record = self.root / "arm.json"
        other = self.root / "other"
        self.assertEqual(run("simulate", other, "--seed", 9, "--size", 512).returncode, 0)
        self.assertEqual(run("c-arm", "report", record, "--out", self.root / "arm").returncode, 2)  # no file yet
        missing = run("c-arm", "add", record, other, self.root / "nowhere")
        self.assertEqual(missing.returncode, 2)
        self.assertIn("nowhere", missing.stderr)
        self.assertFalse(record.exists())  # nothing is added before all are found
        done = run("c-arm", "add", record, other, "--json")
        self.assertEqual(json.loads(done.stdout)["added"][0]["added"], 2, done.stderr)
        self.assertEqual(run("c-arm", "check", record, other).returncode, 3)  # only its own acquisitions
        self.assertEqual(run("run", other, "--out", self.root / "measured", "--no-report").returncode, 0)
        self.assertEqual(run("c-arm", "add", self.root / "by_result.json", self.root / "measured/result.json").returncode, 0)
        self.assertEqual(json.loads((self.root / "by_result.json").read_text())["shots"],
                         json.loads(record.read_text())["shots"])
        done = run("c-arm", "check", record, self.root / "case", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(json.loads(done.stdout)["chi2"], json.loads(done.stdout)["limit"])
        self.assertEqual([each["code"] for each in json.loads(done.stdout)["warnings"]], ["plate_mismatch"])  # two maps do not tell
        self.assertEqual(run("c-arm", "report", record, "--out", self.root / "arm").returncode, 0)
        self.assertEqual(len((self.root / "arm/c_arm.csv").read_text().splitlines()), 3)
        self.assertEqual(run("c-arm", "report", self.root / "none.json", "--out", self.root / "arm").returncode, 2)
        self.assertEqual(list((self.root / "arm").iterdir()), [])
        moved = json.loads(record.read_text())
        for shot in moved["shots"]:
            shot["estimate_mm"][1] += 60
        record.write_text(json.dumps(moved))
        done = run("c-arm", "check", record, self.root / "case", "--json")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(json.loads(done.stdout)["failure"]["code"], "c_arm_changed")
        text = record.read_text()
        done = run("c-arm", "add", record, self.root / "case", "--json")
        self.assertEqual((done.returncode, json.loads(done.stdout)["failure"]["code"]), (3, "c_arm_changed"))
        done = run("run", self.root / "case", "--machine", record, "--out", self.root / "measured", "--no-report", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("c_arm_changed", [warning["code"] for warning in json.loads(done.stdout)["warnings"]])
        self.assertEqual(record.read_text(), text)
        moved["tolerances"] = {"focal_mm": 100, "principal_mm": 100}
        record.write_text(json.dumps(moved))
        self.assertEqual(run("c-arm", "check", record, self.root / "case").returncode, 0)

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

    def test_export_states_the_pixel_spacing_of_an_object(self):
        out = self.root / "spacing"
        done = run("export", self.root / "case", "--out", out, "--as", "images", "--at", "T1")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("helicarm: AP: T1 lies ", done.stderr)
        self.assertIn(b"GEOMETRY", (out / "AP_rectified.dcm").read_bytes())
        done = run("export", self.root / "case", "--out", out, "--at", "elsewhere")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there are: T1, ", done.stderr)
        self.assertEqual(run("export", self.root / "case", "--out", out, "--as", "csv", "--at", "T1").returncode, 2)

    def test_run_writes_a_dicom_measurement_report(self):
        out = self.root / "dicom"
        done = run("run", self.root / "case", "--out", out, "--dicom", "--no-report")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(b"Imaging Measurement Report", (out / "measurements.dcm").read_bytes())
        self.assertEqual(run("run", self.root / "case", "--out", out, "--no-report").returncode, 0)
        self.assertFalse((out / "measurements.dcm").exists())

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

    def test_version_names_the_commit(self):
        done = run("--version")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"^helicarm \d+\.\d+\.\d+( \([0-9a-f]{7,}(, changed)?\))?\n$")

    def test_help_lists_the_commands_by_subject(self):
        text = run("--help").stdout
        headings = [line[:-1] for line in text.splitlines() if line.endswith(":") and not line.startswith(" ")]
        for one, next_one in (("Measure", "Images and cameras"), ("Phantom", "Operation"), ("Operation", "Simulation and studies")):
            self.assertIn(one, headings)
            self.assertIn(next_one, headings)
        self.assertNotIn("Subcommands", headings)
        self.assertLess(text.index("Registration and motion:"), text.index("  register "))

    def test_help_has_an_example(self):
        for command in ("demo", "run", "export", "solve", "locate", "rectify", "detect", "import", "simulate", "phantom"):
            done = run(command, "--help")
            self.assertEqual(done.returncode, 0)
            self.assertIn(f"Example:\n  helicarm {command}", done.stdout)

    def test_a_misspelt_command_of_a_group_is_named(self):
        for words, said in ((["rn"], '"rn" is not a command; helicarm --help lists'),
                            (["c-arm", "chek"], '"chek" is not a command; helicarm c-arm --help lists'),
                            (["--threads", "1", "c-arm", "--quiet", "chek"], '"chek" is not a command'),
                            (["tracker"], "no command is given; helicarm tracker --help lists"),
                            (["phantom", "verfy"], '"verfy" is none of: show, check, export, design, measure, verify'),
                            (["schema", "cases"], '"cases" is none of: calibrator, case')):
            done = run(*words)
            self.assertEqual(done.returncode, 2)
            self.assertIn(said, done.stderr)
            self.assertEqual(json.loads(run(*words, "--json").stdout)["failure"]["code"], "usage")

    def test_help_of_a_group_needs_no_command(self):
        for words in (["c-arm", "--help"], ["c-arm", "--quiet", "--help"], ["tracker", "-h"], ["--version"]):
            self.assertEqual(run(*words).returncode, 0, words)

    def test_run_that_cannot_write_its_overlays_leaves_nothing(self):
        out = self.root / "blocked"
        (out / "LAT_overlay.png/in the way").mkdir(parents=True)
        done = run("run", self.root / "case", "--out", out, "--quiet")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("cannot_write", done.stderr)
        self.assertEqual([path.name for path in out.iterdir()], ["LAT_overlay.png"])

    def test_out_that_cannot_be_written_is_refused_before_the_work(self):
        file = self.root / "a-file"
        file.write_text("mine")
        for words in (["run", self.root / "case"], ["register", self.root / "case"], ["sweep", self.root / "case"],
                      ["track", self.root / "case", "--frames", "1-2"], ["migration", "none.csv", "none.csv"],
                      ["segment", "none.nrrd", "--seed", "a=1,2,3"], ["phantom", "measure", self.root / "case"]):
            done = run(*words, "--out", file / "below")
            self.assertEqual(done.returncode, 2, words)
            self.assertIn("cannot_write", done.stderr, words)
            self.assertIn("a-file: is not a folder", done.stderr, words)
        self.assertEqual(file.read_text(), "mine")

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


if __name__ == "__main__":
    unittest.main()
