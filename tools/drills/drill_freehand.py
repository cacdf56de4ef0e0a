#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Drill: an operation with a hand-held drill, and the calibration of a mount, over the virtual devices.

Runs `helicarm virtual-or --freehand`, `helicarm navigate --json` and `helicarm tracker calibrate-mount` (about two
minutes; with --ndi the operation by a tracker on NDI's API alone). Not part of ./test.
"""

import argparse
import functools
import json
import pathlib
import subprocess
import sys
import tempfile
import time

from drill_virtual_devices import POSE_WINDOW_S, Program, VirtualDevices, check, failures

ROOT = pathlib.Path(__file__).resolve().parents[2]


def guidance(devices, decision, seconds=30):
    """The first line with this decision."""
    return json.loads(devices.navigation.wait_for(f'"decision":"{decision}"', seconds))


def enter(devices):
    devices.navigation.process.stdin.write("\n")
    devices.navigation.process.stdin.flush()


def drill_navigation(program, folder, ndi=False):
    words = ["--freehand", "--ndi"] if ndi else ["--freehand"]
    with VirtualDevices(program, folder / "freehand", "--json", virtual_or=words) as devices:
        devices.acquire("AP", "waiting for LAT")
        devices.acquire("LAT", "^measure: ")
        devices.navigation.wait_for('^{"points"', 60)
        first = guidance(devices, "off_target")["aim"]
        check(f"before the tunnel: {first['distance_mm']:.1f} +- {first['distance_sigma_mm']:.2f} mm, "
              f"{first['angle_deg']:.1f} +- {first['angle_sigma_deg']:.2f} deg, depth {first['depth_mm']:.1f} mm",
              first["depth_mm"] < 0)
        devices.command("drill femur 20", "drilling femur")
        aim = guidance(devices, "on_target")["aim"]
        check(f"on target: {aim['distance_mm']:.2f} mm, {aim['angle_deg']:.2f} deg", True)
        time.sleep(3)
        for name, on, decision in (("hide:femur", "fault hide:femur on", "(no|stale)_pose"),
                                   ("femur visible", "fault hide:femur off", "on_target"),
                                   ("frozen tracker", "fault frozen on", "(no|stale)_pose"),
                                   ("tracker again", "fault frozen off", "on_target"),
                                   ("drill aside", "drill femur 20 3", "off_target"),
                                   ("drill too deep", "drill femur 60", "off_target"),
                                   ("drill back", "drill femur 30", "on_target"),
                                   ("leg moved by 3 mm", "move femur 3 0 0", "plan_stale")):
            devices.command(on, {"fault": "(on|off)$", "drill": "^drilling", "move": "^moved"}[on.split()[0]])
            line = guidance(devices, decision)
            check(f"{name}: {line['decision']} {line['message'] or ''}", True)
        enter(devices)
        guidance(devices, "on_target")
        check("guidance begins again after the leg moved", True)
        enter(devices)
        verified(devices, "femur")
        devices.command("drill tibia 42", "drilling tibia")
        guidance(devices, "on_target")
        time.sleep(4)
        enter(devices)
        verified(devices, "tibia")
        check("freehand operation ends with 0", devices.navigation.process.wait(60) == 0)
        devices.expect_replay("freehand operation")


def verified(devices, tunnel):
    ends = json.loads(devices.navigation.wait_for('"start":{"distance_mm"', 60))
    check(f"{ends['tunnel']} verified: start {ends['start']['distance_mm']:.2f} mm (predicted "
          f"{ends['start']['predicted_mm']:.2f}), end {ends['end']['distance_mm']:.2f} mm (predicted "
          f"{ends['end']['predicted_mm']:.2f})", ends["tunnel"] == tunnel and ends["start"]["distance_mm"] < 2)


def drill_mount(program, folder):
    folder = folder / "mount"
    folder.mkdir()
    plan, tip, out = folder / "plan.json", folder / "tip.json", folder / "mount.json"
    virtual = Program(program, "virtual-or", "--freehand", "--size", 512, "--rate", 60, "--plan", plan, "--tracker-port", 0)
    try:
        port = virtual.wait_for("^tracker").split()[-1]
        virtual.wait_for("^commands: ")
        before = json.loads(plan.read_text())
        seen = subprocess.run([program, "tracker", "watch", f"127.0.0.1:{port}", "--seconds", "2", "--json"],
                              capture_output=True, text=True, check=True)
        name = next(tool["name"] for tool in json.loads(seen.stdout)["tools"]
                    if tool["name"].startswith("calibrator/") and tool["accepted"] > 30)
        facet = next(f for f in before["tracker"]["facets"] if f["name"] == name)
        tip.write_text(json.dumps({"tip_in_tool": before["tracker"]["pointer"]["tip_in_pointer"]}))
        mount = calibrated(program, virtual, ["tracker", "calibrate-mount", f"127.0.0.1:{port}", "--facet", name, "--tip", tip,
                                              "--tip-sigma", "0.01",
                                              "--out", out, "--plan", plan], out)
    finally:
        virtual.end()
    found, true = mount["facet"]["calibrator_from_facet"], facet["calibrator_from_facet"]
    off = sum((found[i][3] - true[i][3]) ** 2 for i in range(3)) ** 0.5
    sigma = sum(mount["covariance"][i][i] for i in range(3)) ** 0.5
    check(f"{name}: origin {off:.2f} mm from the truth, predicted {sigma:.2f} mm rms; FRE {mount['fre_mm']:.2f} mm; TRE at "
          f"most {max(mount['tre_mm'].values()):.2f} mm", off < 3 * sigma)
    after = json.loads(plan.read_text())
    check("the plan has the facet with its error",
          next(f for f in after["tracker"]["facets"] if f["name"] == name) == mount["facet"])


def calibrated(program, virtual, words, out):
    """Three touches of each of five balls."""
    touches = [label for label in ("P1", "P4", "P7", "P10", "P12") for _ in range(3)]
    calibration = Program(program, *words, "--touch", ",".join(touches))
    try:
        for label in touches:
            calibration.wait_for(f'touch "{label}"')  # after the last reading
            virtual.process.stdin.write(f"touch {label}\n")
            virtual.process.stdin.flush()
            virtual.wait_for(f"touching {label}")
            time.sleep(POSE_WINDOW_S)
            calibration.process.stdin.write("\n")
            calibration.process.stdin.flush()
        code = calibration.process.wait(30)
        check("calibrate-mount ends with 0", code == 0, calibration.output().splitlines()[-3])
    finally:
        calibration.end()
    return json.loads(out.read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=ROOT / "build", type=pathlib.Path)
    parser.add_argument("--ndi", action="store_true", help="the operation by a tracker on NDI's API")
    options = parser.parse_args()
    program = options.build / "bin" / "helicarm"
    drills = [functools.partial(drill_navigation, ndi=True)] if options.ndi else [drill_navigation, drill_mount]
    with tempfile.TemporaryDirectory() as name:
        for drill in drills:
            try:
                drill(program, pathlib.Path(name))
            except TimeoutError as error:
                check(f"{drill}: {error}", False)
    print(f"{len(failures)} failures")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
