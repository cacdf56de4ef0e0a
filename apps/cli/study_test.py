#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the studies. Usage: study_test.py PROGRAM"""

import json
import os
import subprocess
import time
import unittest

from program import PROGRAM, SimulatedCase, run


class Studies(SimulatedCase):
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


if __name__ == "__main__":
    unittest.main()
