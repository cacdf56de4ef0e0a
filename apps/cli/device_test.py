#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of the commands for tracker, robot and operation. Usage: device_test.py PROGRAM"""

import json
import pathlib
import signal
import socket
import subprocess
import tempfile
import unittest

from program import PROGRAM, SimulatedCase, run


class Send(SimulatedCase):
    def test_images_and_cameras_of_a_case_reach_each_client(self):
        sender = subprocess.Popen([PROGRAM, "tracker", "send", self.root / "case", "--seconds", "60", "--json"], text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(sender.communicate)
        self.addCleanup(sender.kill)
        port = next(line for line in sender.stderr if " port " in line).split()[-1]
        expected = [("IMAGE", "AP"), ("TRANSFORM", "AP_camera"), ("IMAGE", "LAT"), ("TRANSFORM", "LAT_camera")]
        with socket.create_connection(("127.0.0.1", int(port)), 30) as client, client.makefile("rb") as stream:
            names = []
            while names[-4:] != expected and len(names) < 8:  # who comes while they are sent has them whole the next time
                header = stream.read(58)
                names.append(tuple(part.rstrip(b"\0").decode() for part in (header[2:14], header[14:34])))
                stream.read(int.from_bytes(header[42:50], "big"))
        self.assertEqual(names[-4:], expected)
        sender.terminate()
        self.assertEqual(sender.wait(timeout=30), 0)


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

    def test_replay_as_an_ndi_tracker_is_watched_by_its_own_protocol(self):
        server = subprocess.Popen([PROGRAM, "tracker", "replay", self.file, "--ndi"], text=True, stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE)
        self.addCleanup(server.communicate)
        self.addCleanup(server.kill)
        peer = server.stderr.readline().split()[-1]
        self.assertTrue(peer.startswith("ndi:127.0.0.1:"), peer)
        definition = self.file.with_name("tool.rom")
        definition.write_text("ToolToTracker")
        for options, name in (((), "ToolToTracker"), (("--definition", f"drill={definition}"), "drill")):
            done = run("tracker", "watch", peer, "--seconds", 1, "--json", *options)
            self.assertEqual(done.returncode, 0, done.stderr)
            seen = json.loads(done.stdout)
            self.assertEqual([tool["name"] for tool in seen["tools"]], [name])
            self.assertGreater(seen["tools"][0]["accepted"], 10)
        for wrong, why in (("drill", "NAME=FILE"), ("drill=/nowhere.rom", "missing_file")):
            done = run("tracker", "watch", peer, "--seconds", 1, "--definition", wrong)
            self.assertEqual(done.returncode, 2)
            self.assertIn(why, done.stderr)

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
        common += ["--tip-sigma", "0.05"]
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

    def test_tip_without_covariance_is_not_taken_as_exact(self):
        divots = {"D1": (60, 0, 0), "D2": (0, 45, 0), "D3": (-40, -20, 50), "D4": (0, 5, 80)}
        tip, out = self.file.with_name("bare_tip.json"), self.file.with_name("bare_mount.json")
        tip.write_text(json.dumps({"tip_in_tool": [0, -100, 0]}))
        words = ["tracker", "calibrate-mount", "--facet", "Facet", "--pointer", "Pointer", "--tip", tip, "--out", out]
        for name, (x, y, z) in divots.items():  # all touches with one direction of the pointer
            words += ["--divot", f"{name}={x},{y},{z}", "--recorded", self.recorded_touch(name, (x, y, z + 900))]
        done = run(*words)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("uncertain", done.stderr)
        self.assertIn("--tip-sigma", done.stderr)
        self.assertFalse(out.exists())
        stated = run(*words, "--tip-sigma", "0.4", "--json")
        self.assertEqual(stated.returncode, 0, stated.stderr)
        self.assertGreater(json.loads(stated.stdout)["facet"]["sigma_mm"], 0.4)
        tip.write_text(json.dumps({"tip_in_tool": [0, -100, 0],
                                   "covariance_mm2": [[0.01 * (i == j) for j in range(6)] for i in range(6)]}))
        self.assertEqual(run(*words).returncode, 0)
        both = run(*words, "--tip-sigma", "0.4")
        self.assertEqual((both.returncode, "omit one" in both.stderr), (2, True), both.stderr)

    def test_mount_in_a_plan_is_of_the_plans_calibrator(self):
        folder = self.file.parent / "mounts"
        folder.mkdir()
        mine, plan, tip = (folder / name for name in ("mine.json", "plan.json", "tip.json"))
        self.assertEqual(run("phantom", "export", "--file", mine).returncode, 0)
        calibrator = json.loads(mine.read_text())
        calibrator["name"] = "mine"
        mine.write_text(json.dumps(calibrator))
        tracker = {"address": "127.0.0.1", "port": 18944, "markers": {"femur": "F", "tibia": "T", "tool": "D"},
                   "facets": [], "sigma_mm": 0.1, "sigma_deg": 0.05}
        plan.write_text(json.dumps({"format": "helicarm-plan/2", "calibrator": "mine.json", "views": ["AP", "LAT"],
                                    "tracker": tracker, "tunnels": [], "max_error_mm": 2,
                                    "drill": {"tip_in_tool": [0, -140, 20], "back_in_tool": [0, -20, 20]}}))
        tip.write_text(json.dumps({"tip_in_tool": [0, -100, 0]}))
        words = ["tracker", "calibrate-mount", "--pointer", "Pointer", "--tip", tip, "--tip-sigma", "0.05",
                 "--out", folder / "mount.json", "--plan", plan]
        for name, (x, y, z) in {"D1": (60, 0, 0), "D2": (0, 45, 0), "D3": (-40, -20, 50), "D4": (0, 5, 80)}.items():
            words += ["--divot", f"{name}={x},{y},{z}", "--recorded", self.recorded_touch(name, (x, y, z + 900))]
        before = plan.read_text()
        other = run(*words, "--facet", "Facet", "--calibrator", "udcsc")
        self.assertEqual(other.returncode, 2, other.stderr)
        for word in ("bad_value", "udcsc", "plan.json", "mine.json"):
            self.assertIn(word, other.stderr)
        self.assertEqual(plan.read_text(), before)
        for stated in ((), ("--calibrator", mine)):
            done = run(*words, "--facet", "Facet", *stated)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads((folder / "mount.json").read_text())["calibrator"], "mine")
            self.assertEqual([facet["name"] for facet in json.loads(plan.read_text())["tracker"]["facets"]], ["Facet"])

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
