#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fault injection in a whole operation with virtual devices, over sockets.

    tools/drills/drill_operation.py [--build build] [--only NAME]
    tools/drills/drill_operation.py --soak 30        minutes; prints memory and descriptors of each program

Runs `helicarm virtual-or` and `helicarm navigate`. After each fault the robot must stop within its limit, `navigate` must
report the reason and end, and `helicarm replay` must reproduce the record. Needs dcmtk. Exits 1 on a failed check.
"""

import argparse
import json
import math
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from drill_soak import drill_soak
from drill_virtual_devices import POSE_WINDOW_S, VirtualDevices, check, failures

ROOT = pathlib.Path(__file__).resolve().parents[2]
CANARY = "CANARYKNEE"


def drill_whole(program, folder):
    """A whole operation; the patient's name in the images must not occur in any other output."""
    case = folder / "canary"
    subprocess.run([program, "simulate", case, "--kind", "tunnels", "--size", "512", "--seed", "1", "--quiet"], check=True)
    with VirtualDevices(program, folder / "whole") as devices:
        check("second program on the same session is refused", devices.navigate().process.wait(10) == 2)
        devices.command("shoot AP wrong_title", "not_connected")
        devices.command("shoot AP breaks_off", "not_connected")
        for view, then in (("AP", "waiting for LAT"), ("LAT", "^measure: ")):
            image = case / f"{view}.dcm"
            subprocess.run(["dcmodify", "-nb", "-m", f"PatientName={CANARY}^A", "-m", f"PatientID={CANARY}", image],
                           check=True)
            subprocess.run(["storescu", "-aec", "HELICARM", "127.0.0.1", devices.port, image], check=True)
            devices.navigation.wait_for(then)
        devices.navigation.wait_for("tibia: withdraw", 300)
        check("whole operation ends with 0", devices.navigation.process.wait(60) == 0)
        devices.expect_replay("whole operation")
        output = devices.navigation.output()
        files = [file.name for file in devices.session.rglob("*")
                   if file.is_file() and file.suffix != ".dcm" and CANARY.encode() in file.read_bytes()]
        check("the patient's name is in the images only", CANARY not in output and not files, " ".join(files))


def drill_images(program, folder):
    with VirtualDevices(program, folder / "images") as devices:
        devices.command("fault frozen on", "frozen on")
        time.sleep(POSE_WINDOW_S)
        devices.command("shoot AP", "shot AP")
        devices.navigation.wait_for("(no|stale)_pose.*acquire this view again")
        devices.command("fault frozen off", "frozen off")
        time.sleep(POSE_WINDOW_S)
        devices.acquire("AP", "waiting for LAT")
        for fault, reason in (("same_picture", "views_too_close"), ("other_patient", "patient_mismatch")):
            devices.command(f"shoot LAT {fault}", "shot LAT")
            check(f"{fault}: acquire again", bool(devices.navigation.wait_for(f"{reason}.*acquire this view again")))
        devices.command("shoot LAT held_back", "shot LAT")
        check("image sent late while the leg moved: acquire again",
              bool(devices.navigation.wait_for("stale_pose.*later after its acquisition.*acquire this view again")))
        time.sleep(POSE_WINDOW_S)
        devices.acquire("LAT", "^measure: ")
        devices.navigation.end(signal.SIGKILL)
        devices.expect_replay("wrong images", has_end=False)
    with VirtualDevices(program, folder / "order") as devices:
        devices.acquire("LAT", "waiting for AP")
        check("lateral image first is assigned to LAT",
              any("LAT: assigned instead of AP" in line for line in devices.navigation.output_lines))
        devices.acquire("AP", "^measure: ")
    with VirtualDevices(program, folder / "hidden") as devices:
        devices.command("fault hide:femur on", "hide:femur on")
        time.sleep(POSE_WINDOW_S)
        devices.command("shoot AP", "shot AP")
        check("femur hidden during the acquisition: acquire again",
              bool(devices.navigation.wait_for("no_pose: AP: the marker of the femur.*acquire this view again")))


def drill_checks(program, folder):
    """A marker displaced between the acquisitions and the robot's first order to its bone."""
    with VirtualDevices(program, folder / "checks", virtual_or=["--check-points"], begins="touch \"femur notch\"") as devices:
        for bone in ("femur", "tibia"):
            devices.touch(bone, f"{bone} notch: recorded, deviation 0.00 mm")
        devices.navigation.wait_for("waiting for AP")
        devices.command("touch nothing", "touching nothing")
        devices.acquire_both()
        devices.navigation.wait_for("touch \"femur notch\"", 120)
        devices.command("bump femur 0 2.5 0", "bumped femur")
        devices.touch("femur", "residual_too_large")
        devices.expect_end("bumped marker", "residual_too_large")
        devices.expect_replay("bumped marker")


def drill_motion(program, folder):
    """Faults while the robot moves; limits include the greatest pose age of 0.1 s."""
    for fault, reason, limit_s in (("hide:tool", "stale_pose", 0.3), ("silent", "stale_pose", 0.3),
                                   ("cut_cable", "stale_state", 0.2), ("emergency_stop", "robot_stopped", 0.6),
                                   ("protective_stop", "robot_stopped", 0.6),
                                   ("frozen", "stale_pose", 0.4)):
        with VirtualDevices(program, folder / fault.replace(":", "_")) as devices:
            devices.acquire_both()
            devices.navigation.wait_for("register: pose 1")
            devices.wait_moving()
            begun = time.monotonic()
            devices.command(f"fault {fault} on", f"{fault} on")
            stop_s = devices.stop_s(begun)
            check(f"{fault} while the robot moves: at rest after {stop_s * 1000:.0f} ms", stop_s <= limit_s)
            devices.expect_end(fault, reason)
            devices.expect_replay(fault)
    for fault, reason in (("cut_cable", "stale_state"), ("protective_stop", "robot_stopped")):
        with VirtualDevices(program, folder / f"terminal_{fault}", terminal=True) as devices:
            devices.acquire_both()
            devices.confirm()
            devices.wait_moving()
            devices.command(f"fault {fault} on", f"{fault} on")
            devices.expect_end(f"{fault} at a terminal", reason)
            devices.expect_replay(f"{fault} at a terminal")
    with VirtualDevices(program, folder / "stopped_behind", terminal=True) as devices:
        devices.acquire_both()
        devices.confirm()
        devices.wait_moving()
        devices.command("fault hide:tool on", "hide:tool on")
        devices.navigation.wait_for("press Enter to unlock")
        devices.command("fault protective_stop on", "protective_stop on")
        time.sleep(6)  # from then on the robot permits its release
        devices.type("\n")
        devices.expect_end("protective stop behind a hidden tool", "robot_stopped")
        devices.expect_replay("protective stop behind a hidden tool")
    for terminal in (False, True):
        with VirtualDevices(program, folder / f"stopped_before_{terminal}", terminal=terminal) as devices:
            devices.acquire("AP", "waiting for LAT")
            devices.command("fault protective_stop on", "protective_stop on")
            time.sleep(6)
            devices.acquire("LAT", "^measure: ")
            if not terminal:
                devices.expect_end("protective stop before the registration, --yes", "robot_stopped")
                continue
            devices.navigation.wait_for("press Enter to unlock the robot and go on", 120)
            devices.type("\n")
            check("protective stop before the registration is released by Enter",
                  devices.navigation.wait_for("Type \"go\"", 120))
            devices.navigation.end(signal.SIGKILL)
    with VirtualDevices(program, folder / "bone") as devices:
        devices.acquire_both()
        devices.navigation.wait_for("navigate: femur", 120)
        devices.wait_moving()
        begun = time.monotonic()
        devices.command("fault hide:femur on", "hide:femur on")
        stop_s = devices.stop_s(begun)
        check(f"bone lost during the approach to its tunnel: at rest after {stop_s * 1000:.0f} ms", stop_s <= 0.3)
        devices.expect_end("bone lost", "stale_pose")
    with VirtualDevices(program, folder / "full") as devices:
        devices.acquire_both()
        devices.navigation.wait_for("register: pose 1")
        full = (devices.session / "session.log").stat().st_size + 100
        resource.prlimit(devices.navigation.process.pid, resource.RLIMIT_FSIZE, (full, full))
        devices.expect_end("disk full while the robot moves", "cannot_write", 2)
        time.sleep(0.2)
        check("     the robot is at rest", "moving" not in devices.command("where", "^tip "))
        devices.expect_replay("disk full", has_end=False)


def drill_stale(program, folder):
    """Motion of bone or robot base since planning: during the approach, and while the confirmation is open."""
    # command, repetitions, interval (s), repetition that exceeds a limit
    motions = {"creep 12 mm/s": ("move femur 2 0 0", 15, 1 / 6, 1), "drift 0.5 mm/s": ("move femur 0 0.05 0", 80, 0.1, 21),
               "jump": ("move femur 3 0 0", 1, 0, 1), "turn": ("turn femur 0.4", 8, 0.05, 3),
               "base": ("move base 0 3 0", 1, 0, 1)}
    for name, (words, times, apart_s, beyond) in motions.items():
        with VirtualDevices(program, folder / name.split()[0]) as devices:
            devices.acquire_both()
            devices.navigation.wait_for("navigate: femur", 120)
            devices.wait_moving()
            for number in range(1, times + 1):
                devices.command(words, words.split()[1])
                if number == beyond:
                    begun = time.monotonic()
                if number > beyond and devices.rested_s() is not None:
                    break
                time.sleep(apart_s)
            stop_s = devices.stop_s(begun)
            check(f"{name} during the approach: at rest after {stop_s * 1000:.0f} ms, {number} of {times} motions", stop_s <= 0.5)
            devices.expect_end(name, "plan_stale")
            devices.expect_replay(name)
    for name, options, words in (("femur 40 mm off", (), "move femur 40 0 0"), ("plan too old", ("--plan-age", 10), None)):
        with VirtualDevices(program, folder / name.split()[-1], *options, terminal=True) as devices:
            devices.register()
            devices.navigation.wait_for("^preview: ")
            devices.navigation.wait_for("Type \"go\"")
            rest = devices.command("where", "^tip ").split(",")[0]
            if words:
                devices.command(words, "moved")
            begun = time.monotonic()
            devices.navigation.wait_for("^plan_stale: ", 30)
            reported_s = time.monotonic() - begun
            check(f"{name} while the confirmation is open: reported after {reported_s:.1f} s", reported_s <= 15)
            devices.navigation.wait_for("press Enter")
            check("     the robot has not moved", devices.command("where", "^tip ").split(",")[0] == rest)
            if words:
                devices.plan_again("     planned again for the femur's new position")
            else:
                devices.type("\x04")
                devices.expect_end("     at the end of the input", "plan_stale")
            devices.expect_replay(name, has_end=not words)
    with VirtualDevices(program, folder / "again", terminal=True) as devices:
        devices.register()
        devices.navigation.wait_for("^preview: ")
        devices.confirm()
        devices.navigation.wait_for("navigate: femur", 120)
        devices.wait_moving(30)
        devices.command("move femur 3 0 0", "moved")
        devices.navigation.wait_for("^plan_stale: ", 30)
        devices.navigation.wait_for("press Enter")
        devices.plan_again("jump during the approach, at a terminal: unlocked, withdrawn, planned again", withdrawn=True)
        devices.expect_replay("jump during the approach, at a terminal", has_end=False)


def drill_record(program, folder):
    """The record or an image is removed or replaced by another program; nothing may move without it."""
    def remove(devices):
        (devices.session / "session.log").unlink()

    def replace(devices):
        log, copy = devices.session / "session.log", devices.session / "copy"
        shutil.copy(log, copy)
        copy.rename(log)

    def remove_folder(devices):
        shutil.rmtree(devices.session)

    for name, attack in (("record removed", remove), ("record replaced by its copy", replace),
                         ("folder removed", remove_folder)):
        with VirtualDevices(program, folder / f"open {name}", terminal=True) as devices:
            devices.register()
            devices.navigation.wait_for("^preview: ")
            devices.navigation.wait_for("Type \"go\"")
            rest = devices.tip_mm()
            attack(devices)
            devices.type("go\n")
            devices.expect_end(f"{name} while a confirmation is open", "record_lost")
            time.sleep(1)
            check(f"     the robot has moved by {math.dist(rest, devices.tip_mm()):.2f} mm", rest == devices.tip_mm())
    with VirtualDevices(program, folder / "moving") as devices:
        devices.acquire_both()
        devices.navigation.wait_for("navigate: femur", 120)
        devices.wait_moving()
        begun = time.monotonic()
        remove(devices)
        stop_s = devices.stop_s(begun)
        check(f"record removed during the approach: at rest after {stop_s * 1000:.0f} ms", stop_s <= 0.2)
        devices.expect_end("record removed during the approach", "record_lost")
    with VirtualDevices(program, folder / "image", "--picks", folder / "picks.json") as devices:
        picks = json.loads(devices.plan.read_text())["picks"]
        devices.acquire("AP", "waiting for LAT")
        devices.command("shoot LAT", "shot LAT")
        time.sleep(1)
        ap, lat = sorted((devices.session / "inbox").glob("*.dcm"), key=lambda file: file.stat().st_mtime)
        received = lat.read_bytes()
        shutil.copy(ap, lat)
        (folder / "picks.json").write_text(json.dumps({"picks": picks}))
        devices.expect_end("image replaced in the inbox before the measurement", "image_changed")
        lat.write_bytes(received)
        devices.expect_replay("image replaced in the inbox")


def drill_busy(program, folder, operations=10):
    """Whole operations beside a busy loop on each core, as a compiler would be: all must come to their end. The person at
    the terminal is a program that has an order planned again, and confirms it, where a pose, state or heartbeat is late."""
    loops = [subprocess.Popen(["bash", "-c", "while :; do :; done"]) for _ in range(os.cpu_count())]
    ended = []
    try:
        for number in range(operations):
            with VirtualDevices(program, folder / f"busy{number}", terminal=True) as devices:
                devices.acquire_both()
                replans = devices.give_orders()
                code = devices.navigation.process.poll()
                ended.append("done" if code == 0 else devices.navigation.output_lines[-1])
                print(f"     operation {number + 1}: {ended[-1]}, planned again {replans} times", flush=True)
                devices.expect_replay(f"operation {number + 1}", has_end=code is not None)
    finally:
        for loop in loops:
            loop.kill()
    check(f"{ended.count('done')} of {operations} operations beside {len(loops)} busy loops come to their end",
          ended.count("done") == operations)


def drill_scripts(program, folder):
    """A controller that starts a script 0.3 s late, or twice."""
    with VirtualDevices(program, folder / "late", terminal=True) as devices:
        devices.acquire_both()
        devices.command("fault late_script on", "late_script on")
        for pose in (1, 2):
            devices.confirm()
            check(f"script that starts late: {devices.navigation.wait_for(f'register: pose {pose}')}", True)
        devices.navigation.wait_for("Type \"go\"")
        rest = devices.command("where", "^tip ").split(",")[0]
        devices.type("go\n")
        time.sleep(0.15)
        before = devices.command("where", "^tip ")
        devices.navigation.end()
        time.sleep(1.5)
        after = devices.command("where", "^tip ")
        check("SIGTERM while the controller holds the script: the robot never moves",
              before.split(",")[0] == after.split(",")[0] == rest and "moving" not in after, f"{rest}; {before}; {after}")
        devices.expect_replay("script that starts late")
    with VirtualDevices(program, folder / "twice") as devices:
        devices.acquire_both()
        devices.navigation.wait_for("register: pose 1")
        devices.command("fault script_twice on", "script_twice on")
        devices.expect_end("script that is started again during its motion", "robot_stopped")
        time.sleep(0.5)
        check("     the robot is at rest", "moving" not in devices.command("where", "^tip "))
        devices.expect_replay("     script that is started again")


def drill_ends(program, folder):
    """SIGTERM in each step, SIGKILL while the robot moves."""
    steps = {"waiting for AP": None, "waiting for LAT": "AP", "^measure: ": "both", "^register: pose 2": "both",
             "^plan: ": "both", "^navigate: femur": "both", "^verify: ": "both"}
    for number, (step, views) in enumerate(steps.items()):
        with VirtualDevices(program, folder / f"term{number}") as devices:
            if views == "both":
                devices.acquire_both()
            elif views:
                devices.acquire(views, "waiting for LAT")
            if views == "both" and not step.startswith("^measure"):
                devices.navigation.wait_for(step, 120)
            code, seconds = devices.navigation.end()
            check(f"SIGTERM at \"{step.strip('^: ')}\" ends it in {seconds * 1000:.0f} ms with {code}",
                  seconds <= 1 and code == 3)
            time.sleep(0.2)
            check("     the robot is at rest", "moving" not in devices.command("where", "^tip "))
            devices.expect_replay("     SIGTERM")
    for number, step in enumerate(("^register: pose 1", "^register: pose 4", "^navigate: femur$")):
        with VirtualDevices(program, folder / f"kill{number}") as devices:
            devices.acquire_both()
            devices.navigation.wait_for(step, 120)
            devices.wait_moving()
            begun = time.monotonic()
            devices.navigation.end(signal.SIGKILL)
            stop_s = devices.stop_s(begun)
            check(f"SIGKILL while the robot moves: at rest after {stop_s * 1000:.0f} ms", stop_s <= 0.2)
            devices.expect_replay("SIGKILL", has_end=False)
    with VirtualDevices(program, folder / "virtual_or") as devices:
        code, seconds = devices.virtual_or.end()
        check(f"SIGTERM ends virtual-or in {seconds * 1000:.0f} ms with {code}", seconds <= 1 and code == 0)


def drill_system(program, folder):
    with VirtualDevices(program, folder / "ports") as devices:
        ports = json.loads(devices.plan.read_text())
        taken = {"--tracker-port": ports["tracker"]["port"], "--rtde-port": ports["robot"]["rtde_port"]}
        for option, port in taken.items():
            others = [word for name in ("--tracker-port", "--rtde-port", "--dashboard-port", "--script-port", "--primary-port")
                      if name != option for word in (name, "0")]
            done = subprocess.run([program, "virtual-or", option, str(port), *others], capture_output=True, text=True,
                                  stdin=subprocess.DEVNULL)
            check(f"{option} in use", done.returncode == 2 and "port_taken" in done.stderr, done.stderr.strip())
        done = subprocess.run([program, "navigate", devices.plan, "--yes", "--out", folder / "second", "--port",
                               devices.port],
                              capture_output=True, text=True)
        check("navigate's port in use", done.returncode == 2 and "port_taken" in done.stderr, done.stderr.strip())
        for name, out in (("folder that is not writable", "/proc/session"), ("path too long", folder / ("x" * 300))):
            done = subprocess.run([program, "navigate", devices.plan, "--yes", "--out", out, "--port", "0"], capture_output=True,
                                  text=True)
            check(name, done.returncode == 2 and "cannot_write" in done.stderr, done.stderr.strip()[-80:])
    case, not_loaded = folder / "memory", 127
    subprocess.run([program, "simulate", case, "--size", "512", "--quiet"], check=True)
    for megabytes in range(70, 150, 5):
        limit = megabytes << 20
        done = subprocess.run([program, "run", case, "--out", folder / f"memory{megabytes}", "--threads", "1"],
                              capture_output=True, text=True,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
        whole = (folder / f"memory{megabytes}" / "result.json").exists()
        check(f"{megabytes} MB of memory: ends with {done.returncode}",
              (done.returncode == 0) == whole and done.returncode in (0, 1, not_loaded), done.stderr.strip()[-80:])


def main():
    drills = {"whole": drill_whole, "images": drill_images, "checks": drill_checks, "motion": drill_motion,
              "stale": drill_stale, "record": drill_record, "busy": drill_busy,
              "scripts": drill_scripts, "ends": drill_ends, "system": drill_system}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=ROOT / "build", type=pathlib.Path)
    parser.add_argument("--only", choices=drills)
    parser.add_argument("--soak", metavar="MINUTES", type=float)
    arguments = parser.parse_args()
    program = arguments.build / "bin" / "helicarm"
    with tempfile.TemporaryDirectory() as name:
        if arguments.soak:
            drill_soak(program, pathlib.Path(name), arguments.soak)
        for drill in [] if arguments.soak else [arguments.only] if arguments.only else drills:
            try:
                drills[drill](program, pathlib.Path(name))
            except TimeoutError as error:
                check(f"{drill}: {error}", False)
    print(f"{len(failures)} failures")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
