#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whatever its exit code, a command leaves nothing of its kind from an earlier run. Usage: earlier_results_test.py PROGRAM"""

import json
import pathlib
import shutil
import stat
import unittest
from concurrent.futures import ThreadPoolExecutor

from program import SimulatedCase, run


class EarlierResults(SimulatedCase):
    def names(self, folder):
        return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())

    def broken(self):
        folder = self.root / "broken"
        folder.mkdir(exist_ok=True)
        (folder / "case.json").write_text("{")
        return folder

    def renamed(self, name, views):
        """The case with other names of views."""
        folder = self.root / name
        if folder.exists():
            return folder
        shutil.copytree(self.root / "case", folder)
        file = folder / "case.json"
        text = file.read_text()
        for old, new in views.items():
            text = text.replace(f'"{old}"', f'"{new}"')
        file.write_text(text)
        return folder

    def test_run_without_models_removes_a_registration_and_overlays_of_others(self):
        out = self.root / "run"
        run("run", self.renamed("named", {"AP": "front", "LAT": "side"}), "--out", out, "--quiet")
        registration = json.dumps({"models": [{"name": "femur", "views": [{"name": "OBL"}]}]})
        for folder in (out, out / "registration"):
            folder.mkdir(exist_ok=True)
            (folder / "registration.json").write_text(registration)
            (folder / "OBL_overlay.png").write_text("earlier")
        (out / "notes.txt").write_text("the user's own")
        self.assertIn("front_overlay.png", self.names(out))
        self.assertEqual(run("run", self.root / "case", "--out", out, "--quiet").returncode, 0)
        self.assertEqual(self.names(out), ["AP_overlay.png", "LAT_overlay.png", "notes.txt", "report.html", "result.json"])

    def test_register_that_is_refused_leaves_nothing(self):
        out = self.root / "register"
        out.mkdir()
        (out / "registration.json").write_text(json.dumps({"models": [{"views": [{"name": "AP"}]}]}))
        for name in ("AP_overlay.png", "report.html", "registration.csv", "relative.csv", "bodies.csv",
                     "smoothed.csv", "frames.jsonl", "sequence.json", "notes.txt"):
            (out / name).write_text("earlier")
        self.assertEqual(run("register", self.root / "case", "--out", out).returncode, 2)
        self.assertEqual(self.names(out), ["notes.txt"])

    def test_export_that_is_refused_leaves_nothing(self):
        for number, (case, words, code) in enumerate((
                (self.root / "case", ("--max-error", 0.0001), 3), (self.broken(), (), 2),
                (self.root / "case", ("--as", "stl"), 2))):
            out = self.root / f"export{number}"
            run("export", self.renamed("named", {"AP": "front", "LAT": "side"}), "--out", out, "--quiet")
            self.assertEqual(len(self.names(out)), 15)
            kept = {"notes.txt": "x", "my_matrix.txt": "1 2 3", "my_rectified.dcm": "x"}
            for name, text in kept.items():
                (out / name).write_text(text)
            self.assertEqual(run("export", case, "--out", out, *words).returncode, code)
            self.assertEqual(self.names(out), sorted(kept))

    def test_export_keeps_files_of_others_with_its_names(self):
        out = self.root / "own"
        out.mkdir()
        landmarks = "name,x_mm,y_mm,z_mm\na,1,2,3\n"
        (out / "points.csv").write_text(landmarks)
        (out / "dlt.csv").write_text("a,b\n1,2\n")
        self.assertEqual(run("export", self.broken(), "--out", out).returncode, 2)
        self.assertEqual(self.names(out), ["dlt.csv", "points.csv"])
        self.assertEqual((out / "points.csv").read_text(), landmarks)

    def test_rectify_that_is_refused_leaves_nothing_but_what_it_reads(self):
        out, image, plate = self.root / "rectify", self.root / "case/AP.dcm", self.root / "case/plate.json"
        done = run("rectify", image, "--plate", plate, "--field", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        (out / "notes.txt").write_text("the user's own")
        self.assertEqual(run("rectify", image, "--map", out / "map.json", "--out", out).returncode, 0)
        self.assertEqual(self.names(out), ["map.json", "notes.txt", "rectified.dcm"])
        self.assertEqual(run("rectify", self.root / "nowhere.dcm", "--plate", plate, "--out", out).returncode, 2)
        self.assertEqual(self.names(out), ["notes.txt"])
        series = self.root / "series"
        series.mkdir()
        for name in ("a", "b"):
            shutil.copy(image, series / f"{name}.dcm")
        run("rectify", image, "--plate", plate, "--out", self.root / "fitted")
        run("rectify", series, "--map", self.root / "fitted/map.json", "--out", out)
        self.assertEqual(self.names(out), ["a_rectified.dcm", "b_rectified.dcm", "notes.txt"])
        self.assertEqual(run("rectify", self.root / "nowhere.dcm", "--plate", plate, "--out", out).returncode, 2)
        self.assertEqual(self.names(out), ["notes.txt"])

    def test_calibrate_mount_that_is_refused_leaves_no_mount(self):
        out = self.root / "mount.json"
        out.write_text("{}")
        done = run("tracker", "calibrate-mount", "--facet", "front", "--recorded", "A1=nowhere.mha", "--tip", self.root / "none.json",
                   "--out", out)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertFalse(out.exists())

    def test_phantom_measurement_that_is_refused_leaves_nothing_and_spares_the_nominal_file(self):
        out = self.root / "phantom"
        out.mkdir()
        for name in ("calibrator.json", "result.json", "report.html", "notes.txt"):
            (out / name).write_text("{}")
        self.assertNotEqual(run("phantom", "measure", self.root / "case", "--out", out).returncode, 0)
        self.assertEqual((out / "calibrator.earlier.json").read_text(), "{}")  # what was measured is not lost
        kept = ("notes.txt", "calibrator.earlier.json")
        self.assertNotIn("{}", [(out / name).read_text() for name in self.names(out) if name not in kept])
        own = self.root / "own-case"
        shutil.copytree(self.root / "case", own)
        nominal = (own / "calibrator.json").read_bytes()
        done = run("phantom", "measure", own, "--out", own)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("nominal file", done.stderr)
        self.assertEqual((own / "calibrator.json").read_bytes(), nominal)
        (out / "result.json").write_text("{}")
        self.assertEqual(run("phantom", "verify", self.broken(), "--out", out).returncode, 2)
        self.assertFalse((out / "result.json").exists())

    def test_predict_study_bundle_and_simulate_that_fail_leave_nothing(self):
        out = self.root / "files"
        out.mkdir()
        for name in ("tre.csv", "tre.vtk", "tre.svg", "number.csv", "number.json", "number.svg", "bundle.tar.gz",
                     "dots.csv", "notes.txt"):
            (out / name).write_text("earlier")
        self.assertEqual(run("predict", self.broken(), "--map", out).returncode, 2)
        self.assertEqual(run("bundle", self.broken(), "--out", out / "bundle.tar.gz").returncode, 2)
        self.assertEqual(run("detect", self.root / "nowhere.dcm", "--out", out / "dots.csv").returncode, 2)
        self.assertEqual(run("study", "number", "--draws", 5, "--out", out).returncode, 2)
        self.assertEqual(self.names(out), ["notes.txt"])
        simulated = self.root / "simulated"
        self.assertEqual(run("simulate", simulated, "--size", 512, "--quiet").returncode, 0)
        self.assertEqual(run("simulate", simulated, "--distance", 45).returncode, 2)
        self.assertEqual(self.names(simulated), [])

    def test_several_cases_leave_no_results_of_others(self):
        out = self.root / "several"
        first, second = self.renamed("one", {}), self.renamed("two", {})
        self.assertEqual(run("run", first, second, "--out", out, "--no-report").returncode, 0)
        self.assertEqual(run("run", second, self.broken(), "--out", out, "--no-report").returncode, 2)
        self.assertEqual(self.names(out), ["summary.csv", "two/result.json"])


class CArmHistory(SimulatedCase):
    def test_six_runs_at_once_keep_all_their_acquisitions(self):
        cases = []
        for seed in range(6):
            cases.append(self.root / f"case{seed}")
            run("simulate", cases[-1], "--size", 512, "--seed", 20 + seed, "--quiet")
        machine = self.root / "machine.json"
        with ThreadPoolExecutor(6) as pool:
            done = list(pool.map(lambda case: run("run", case, "--out", case / "out", "--no-report", "--threads", 1,
                                                  "--machine", machine), cases))
        self.assertEqual([each.returncode for each in done], [0] * 6, done)
        self.assertEqual(len(json.loads(machine.read_text())["shots"]), 12)
        self.assertFalse((self.root / "machine.json.lock").exists())

    def test_history_that_cannot_be_written_is_refused_before_anything_is_added(self):
        folder = self.root / "folder"
        folder.mkdir()
        done = run("run", self.root / "case", "--out", self.root / "none", "--machine", folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot_write", done.stderr)
        self.assertNotIn("added", done.stderr)
        self.assertFalse((self.root / "none/result.json").exists())


class Privacy(SimulatedCase):
    def test_copied_images_are_their_owners_only(self):
        def mode(path):
            return stat.S_IMODE(pathlib.Path(path).stat().st_mode)
        made = self.root / "new"
        done = run("new", self.root / "case/AP.dcm", self.root / "case/LAT.dcm", "--calibrator",
                   self.root / "case/calibrator.json", "--out", made)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((mode(made), mode(made / "AP.dcm")), (0o700, 0o600))
        out = self.root / "kept"
        done = run("rectify", self.root / "case/AP.dcm", "--plate", "plate48", "--keep-patient", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(mode(out / "rectified.dcm"), 0o600)
        bundle = self.root / "bundle.tar.gz"
        self.assertEqual(run("bundle", self.root / "case", "--no-run", "--out", bundle).returncode, 0)
        self.assertEqual(mode(bundle), 0o600)


if __name__ == "__main__":
    unittest.main()
