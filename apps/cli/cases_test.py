#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the executable with a user's own files: cases from images, picks. Usage: cases_test.py PROGRAM"""

import json
import os
import pathlib
import shutil
import subprocess
import tarfile
import unittest

from program import PROGRAM, SimulatedCase, run


class OwnFiles(SimulatedCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.images = [cls.root / "IM0001", cls.root / "IM0002"]
        for name, image in zip(("LAT", "AP"), cls.images):
            shutil.copy(cls.root / "case" / f"{name}.dcm", image)

    def made(self, name):
        out = self.root / name
        done = run("new", *self.images, "--calibrator", self.root / "case/calibrator.json", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        return out

    def test_of_one_image_its_camera_is_printed_and_where_it_stands(self):
        out, result = self.root / "one", self.root / "one-result"
        for words in (["new", self.images[1], "--calibrator", self.root / "case/calibrator.json", "--plate", "plate48", "--out", out],
                      ["run", out, "--out", result, "--no-report"]):
            done = run(*words)
            self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("Source x, y, z, mm", "K, R, t", str(result / "result.json"), f"helicarm export {out} --as opencv"):
            self.assertIn(words, done.stdout)

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
        for words, said in ((self.images, "--calibrator"), ([], "IMAGE")):
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
        screenless = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")}
        self.assertIn("there is no display", run("pick", case, program=program, env=screenless).stderr)
        opened = run("pick", case, program=program, env={**screenless, "DISPLAY": ":0"})
        self.assertEqual(opened.stdout.strip(), f"opened {case}")

    def test_pick_of_an_unknown_view_leaves_the_case_alone(self):
        case = self.made("alone-view")
        before = (case / "case.json").read_bytes()
        picks = self.root / "wrong.csv"
        picks.write_text("name,view,u_px,v_px\nentry,OBL,250,240\n")
        done = run("pick", case, "--csv", picks)
        self.assertEqual(done.returncode, 2)
        self.assertIn("wrong.csv: row 1", done.stderr)
        self.assertIn("OBL", done.stderr)
        self.assertEqual((case / "case.json").read_bytes(), before)

    def test_pick_outside_the_image_leaves_the_case_alone(self):
        case = self.made("outside")
        before = (case / "case.json").read_bytes()
        picks = self.root / "outside.csv"
        picks.write_text("name,view,u_px,v_px\nentry,AP,250,240\nentry,LAT,250,1240\n")
        done = run("pick", case, "--csv", picks)
        self.assertEqual(done.returncode, 2)
        self.assertIn("outside.csv: row 2: 250, 1240 lies outside the image of 512 x 512", done.stderr)
        self.assertEqual((case / "case.json").read_bytes(), before)

    def test_an_image_is_not_taken_for_a_case(self):
        done = run("run", self.images[0])
        self.assertEqual(done.returncode, 2)
        self.assertIn("is an image, not a case", done.stderr)
        self.assertIn("helicarm new", done.stderr)

    def test_a_result_is_not_taken_for_a_case(self):
        out = self.root / "result"
        self.assertEqual(run("run", self.root / "case", "--out", out, "--no-report", "--quiet").returncode, 0)
        done = run("run", out)
        self.assertEqual(done.returncode, 2)
        self.assertIn("holds a result", done.stderr)

    def test_new_says_what_it_takes_in_place_of_a_folder(self):
        done = run("new", self.root / "case", "--calibrator", "udcsc", "--out", self.root / "of-folder")
        self.assertEqual(done.returncode, 2)
        self.assertIn("name its images", done.stderr)

    def test_a_message_names_its_file_once(self):
        notes = self.root / "notes.txt"
        notes.write_text("no image")
        for file in (notes, self.root / "none.dcm"):
            for words in (["detect", file], ["rectify", file, "--plate", "plate48", "--out", self.root / "map"]):
                done = run(*words)
                self.assertEqual(done.returncode, 2)
                self.assertEqual(done.stderr.count(file.name), 1, done.stderr)

    def test_bundle_is_the_same_each_time_and_holds_no_name(self):
        case = self.root / "doe"
        shutil.copytree(self.root / "case", case)
        (case / "AP.dcm").rename(case / "doe_AP.dcm")
        description = json.loads((case / "case.json").read_text())
        description.update(notes="Jane Doe")
        description["views"][0]["image"] = "doe_AP.dcm"
        (case / "case.json").write_text(json.dumps(description))
        self.assertEqual(run("run", case, "--out", case / "out", "--no-report", "--quiet").returncode, 0)
        files = [self.root / f"{n}.tar.gz" for n in range(2)]
        for file in files:
            done = run("bundle", case, "--result", case / "out", "--out", file, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(files[0].read_bytes(), files[1].read_bytes())
        with tarfile.open(files[0]) as archive:
            self.assertEqual(archive.getnames(), [file["name"] for file in json.loads(done.stdout)["files"]])
            for member in archive.getmembers():
                self.assertEqual((member.mtime, member.uname), (0, ""))
                content = archive.extractfile(member).read()
                for word in (b"doe", b"Doe", b"SIM5", str(self.root).encode()):
                    self.assertNotIn(word, content, member.name)
            archive.extractall(self.root / "unpacked")
        self.assertEqual(run("run", self.root / "unpacked", "--out", self.root / "again", "--no-report").returncode, 0)

    def test_locate_takes_a_camera_file_for_each_view(self):
        run("run", self.root / "case", "--out", self.root / "calibrated", "--no-report", "--quiet")
        result = self.root / "calibrated/result.json"
        target = next(p for p in json.loads(result.read_text())["points"] if p["name"] == "T1")
        exported = self.root / "exported"
        self.assertEqual(run("export", self.root / "case", "--out", exported, "--as", "mayacam").returncode, 0)
        camera = self.root / "lat.json"
        camera.write_text(run("import", exported / "LAT_mayacam.txt", "--json").stdout)
        picks = self.root / "mixed.csv"
        picks.write_text("name,view,u_px,v_px\n" + "".join(
            f"T1,{view},{seen['uv'][0]},{seen['uv'][1]}\n" for view, seen in target["seen"].items()))
        done = run("locate", "--calibration", f"AP={result}", "--calibration", f"LAT={camera}", "--picks", picks, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        point = answer["points"][0]
        for a, b in zip(point["xyz_mm"], target["xyz_mm"]):
            self.assertAlmostEqual(a, b, 1)
        self.assertIsNone(point["covariance_mm2"])
        self.assertIsNotNone(point["ray_gap_mm"])
        self.assertEqual([warning["code"] for warning in answer["warnings"]], ["covariance_missing"])
        both = run("locate", "--calibration", f"AP={result}", "--calibration", f"LAT={result}", "--picks", picks, "--json")
        whole = run("locate", "--calibration", result, "--picks", picks, "--json")
        self.assertEqual(json.loads(both.stdout), json.loads(whole.stdout))
        self.assertEqual(run("locate", "--calibration", f"OBL={result}", "--picks", picks).returncode, 2)

    def test_detect_reads_folders_and_writes_a_table(self):
        folder = self.root / "series"
        folder.mkdir(exist_ok=True)
        for image in self.images:
            shutil.copy(image, folder)
        done = run("detect", folder, "--json", "--out", self.root / "dots.csv")
        self.assertEqual(done.returncode, 0, done.stderr)
        images = json.loads(done.stdout)["images"]
        self.assertEqual([pathlib.Path(one["image"]).name for one in images], ["IM0001", "IM0002"])
        self.assertIn("[2/2]", done.stderr)
        lines = (self.root / "dots.csv").read_text().splitlines()
        self.assertEqual(len(lines), 1 + sum(len(one["dots"]) for one in images))


class SeveralProcesses(SimulatedCase):
    """Cases measured by processes that share a word, or that mpirun started."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.cases = [cls.root / f"case{i}" for i in range(4)]
        for case in cls.cases:
            shutil.copytree(cls.root / "case", case)
        (cls.cases[2] / "case.json").write_text("{")
        cls.words = ("--no-report", "--threads", 1, "--quiet")
        cls.alone = cls.root / "alone"
        run("run", *cls.cases, "--out", cls.alone, *cls.words)

    def expect_as_alone(self, out):
        self.assertEqual((out / "summary.csv").read_text(), (self.alone / "summary.csv").read_text())
        self.assertEqual(sorted(path.name for path in out.iterdir()), ["case0", "case1", "case3", "summary.csv"])

    def test_processes_of_one_word_measure_each_case_once_and_one_reports(self):
        out = self.root / "word"
        words = [PROGRAM, "run", *map(str, self.cases), "--out", str(out), "--share", "night", *map(str, self.words)]
        both = [subprocess.Popen(words, stderr=subprocess.PIPE, text=True) for _ in range(2)]
        failures = [process.communicate()[1] for process in both]
        self.expect_as_alone(out)
        self.assertIn(2, [process.returncode for process in both])
        self.assertIn("1 of 4 cases", "".join(failures))

    @unittest.skipUnless(os.environ.get("HELICARM_MPIRUN"), "built without MPI")
    def test_ranks_share_the_cases(self):
        out = self.root / "ranks"
        environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                       "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_plm_rsh_agent": "false"}
        done = subprocess.run([os.environ["HELICARM_MPIRUN"], "-n", "2", PROGRAM, "run", *map(str, self.cases), "--out",
                               str(out), *map(str, self.words)], capture_output=True, text=True, env=environment)
        self.assertNotEqual(done.returncode, 0)
        self.assertEqual(done.stderr.count("1 of 4 cases"), 1, done.stderr)
        self.expect_as_alone(out)


if __name__ == "__main__":
    unittest.main()
