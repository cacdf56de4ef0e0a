# SPDX-License-Identifier: Apache-2.0
"""For drill_operation.py: programs with output to wait for, and `virtual-or` with `navigate`."""

import json
import math
import os
import pty
import queue
import re
import signal
import socket
import subprocess
import threading
import time

POSE_WINDOW_S = 2  # poses of an acquisition are taken from the 1.5 s before it
failures = []


def check(name, good, detail=""):
    print(f"{'ok  ' if good else 'FAIL'} {name}{' (' + detail + ')' if detail else ''}", flush=True)
    if not good:
        failures.append(name)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


class Program:
    """A running helicarm program with output to wait for."""

    def __init__(self, program, *words, **options):
        self.process = subprocess.Popen([program, *map(str, words)], text=True,
                                        **{"stdin": subprocess.PIPE, **options}, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)
        self.lines, self.output_lines = queue.Queue(), []
        for stream in (self.process.stdout, self.process.stderr):
            threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream):
        for line in stream:
            self.lines.put(line.rstrip())

    def wait_for(self, pattern, seconds=60):
        """The first new line that matches; TimeoutError after `seconds`."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            try:
                self.output_lines.append(self.lines.get(timeout=min(left, 0.1)))
            except queue.Empty:
                if self.process.poll() is not None and self.lines.empty():
                    break
                continue
            if re.search(pattern, self.output_lines[-1]):
                return self.output_lines[-1]
        raise TimeoutError(f"no \"{pattern}\" among:\n  " + "\n  ".join(self.output_lines[-8:]))

    def end(self, how=signal.SIGTERM, seconds=10):
        """Exit code and seconds until the end."""
        begun = time.monotonic()
        if self.process.poll() is None:
            self.process.send_signal(how)
        code = self.process.wait(seconds)
        return code, time.monotonic() - begun

    def output(self):
        self.process.wait(60)
        time.sleep(0.1)
        while not self.lines.empty():
            self.output_lines.append(self.lines.get())
        return "\n".join(self.output_lines)


class VirtualDevices:
    """`virtual-or` and a `navigate` connected to it, at a terminal if orders are confirmed by typing."""

    def __init__(self, program, folder, *options, virtual_or=(), begins="waiting for AP", terminal=False):
        self.program, self.folder = program, folder
        folder.mkdir()
        self.port, self.plan, self.session = free_port(), folder / "plan.json", folder / "session"
        self.virtual_or = Program(program, "virtual-or", "--size", 512, "--rate", 60, "--plan", self.plan,
                                  "--receiver-port", self.port, "--tracker-port", 0, "--rtde-port", 0,
                                  "--dashboard-port", 0, "--script-port", 0, "--primary-port", 0, *virtual_or)
        self.virtual_or.wait_for("^commands: ")
        self.terminal = pty.openpty() if terminal else None
        self.navigation = self.navigate(*options)
        self.navigation.wait_for(begins)
        time.sleep(POSE_WINDOW_S)

    def navigate(self, *options):
        # Python's ignored SIGXFSZ is inherited, so that a file size limit acts like a full disk.
        words = ["navigate", self.plan, "--out", self.session, "--port", self.port, *options]
        if self.terminal:
            return Program(self.program, *words, stdin=self.terminal[1], restore_signals=False)
        return Program(self.program, *words, "--yes", restore_signals=False)

    def type(self, words):
        os.write(self.terminal[0], words.encode())

    def confirm(self):
        """Types "go" after the prompt; earlier input is discarded."""
        self.navigation.wait_for("Type \"go\"", 120)
        self.type("go\n")

    def register(self):
        """Both acquisitions, and the robot's registration with each motion confirmed."""
        self.acquire_both()
        self.navigation.wait_for("^ *9: tip", 120)
        self.give_orders("register: pose 9")

    def plan_again(self, name, withdrawn=False):
        """After a refusal at the terminal, which waits for Enter, until the tool is at the femur's tunnel."""
        time.sleep(POSE_WINDOW_S)
        self.type("\n")
        if withdrawn:
            self.navigation.wait_for("femur: withdraw")
            self.confirm()
        self.navigation.wait_for("^preview: ", 120)
        self.confirm()
        check(f"{name}: {self.navigation.wait_for('femur: distance from', 120)}", True)
        self.navigation.end(signal.SIGKILL)

    def give_orders(self, until="$^", silence_s=120):
        """Confirms each order, and has it planned again after a late pose, state or heartbeat, until this line, another
        failure or the end of the program; how often it was planned again."""
        replans = 0
        while True:
            try:
                asked = self.navigation.wait_for(f"Type \"go\"|press Enter to unlock|{until}", silence_s)
            except TimeoutError:
                return replans
            if "press Enter to unlock" in asked and re.match("stale_(pose|state): ", self.navigation.output_lines[-2]):
                replans += 1
                self.type("\n")
            elif "Type \"go\"" in asked:
                self.type("go\n")
            else:
                return replans

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.virtual_or.process.poll() not in (None, 0):
            check(f"virtual-or ended with {self.virtual_or.process.poll()}", False)
        for each in (self.navigation, self.virtual_or):
            each.end(signal.SIGKILL)
        for end in self.terminal or ():
            os.close(end)

    def command(self, line, answer):
        self.virtual_or.process.stdin.write(line + "\n")
        self.virtual_or.process.stdin.flush()
        return self.virtual_or.wait_for(answer, 30)

    def acquire(self, view, then):
        """Acquires until accepted: on a loaded machine tracker data may be late."""
        for _ in range(5):
            self.command(f"shoot {view}", f"shot {view}")
            if "acquire this view again" not in self.navigation.wait_for(f"acquire this view again|{then}"):
                return
            time.sleep(POSE_WINDOW_S)
        raise TimeoutError(f"{view} was not accepted in 5 acquisitions")

    def touch(self, bone, then):
        """Touches a check point and presses Enter until the pointer is measured at rest."""
        self.command(f"touch {bone}", f"touching {bone}")
        for _ in range(5):
            time.sleep(POSE_WINDOW_S)
            self.navigation.process.stdin.write("\n")
            self.navigation.process.stdin.flush()
            if not self.navigation.wait_for(f"; again$|{then}").endswith("; again"):
                return
        raise TimeoutError(f"{bone}: no touch was accepted in 5 attempts")

    def acquire_both(self):
        self.acquire("AP", "waiting for LAT")
        self.acquire("LAT", "^measure: ")

    def rested_s(self):
        """Seconds at rest; None while the robot moves."""
        found = re.search(r"at rest for ([\d.]+) s", self.command("where", "^tip "))
        return float(found.group(1)) if found else None

    def tip_mm(self):
        return [float(number) for number in re.findall(r"-?\d+\.?\d*", self.command("where", "^tip "))[:3]]

    def wait_moving(self, distance_mm=0):
        """Until the robot moves, `distance_mm` from where it is now at least."""
        begin = self.tip_mm()
        for _ in range(1000):
            if "moving" in self.command("where", "^tip ") and math.dist(begin, self.tip_mm()) >= distance_mm:
                return
            time.sleep(0.005)
        raise TimeoutError(f"the robot did not move by {distance_mm} mm")

    def stop_s(self, begun):
        """Seconds from `begun` until the robot was at rest."""
        time.sleep(1)
        rested = self.rested_s()
        return 9.9 if rested is None else time.monotonic() - begun - rested

    def expect_end(self, name, reason, code=3):
        ended = self.navigation.process.wait(30)
        output = self.navigation.output()
        check(f"{name}: ends with {reason}", ended == code and reason in output, output.splitlines()[-1])

    def expect_replay(self, name, has_end=True):
        """`has_end`: else the program was killed, or its disk was full; everything up to there is reproduced."""
        replayed = subprocess.run([self.program, "replay", self.session, "--json"], capture_output=True, text=True)
        answer, _ = json.JSONDecoder().raw_decode(replayed.stdout)  # a failure follows
        check(f"{name}: the record is {'complete' if has_end else 'without an end'} and reproduced",
              replayed.returncode == (0 if has_end else 3) and answer["finished"] == has_end and not answer["differences"],
              (replayed.stdout + replayed.stderr).strip().splitlines()[-1])
