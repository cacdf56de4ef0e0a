# SPDX-License-Identifier: Apache-2.0
"""For drill_operation.py: programs whose lines can be waited for, and a virtual room with a navigation in it."""

import os
import pty
import queue
import re
import signal
import socket
import subprocess
import threading
import time

EXPOSURE_S = 2  # an exposure's poses are taken from the second and a half before it
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
    """A running helicarm whose lines can be waited for."""

    def __init__(self, program, *words, **options):
        self.process = subprocess.Popen([program, *map(str, words)], text=True,
                                        **{"stdin": subprocess.PIPE, **options}, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)
        self.lines, self.heard = queue.Queue(), []
        for stream in (self.process.stdout, self.process.stderr):
            threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream):
        for line in stream:
            self.lines.put(line.rstrip())

    def wait_for(self, pattern, seconds=60):
        """The first line from now on that holds the pattern; fails the drill if none comes."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            try:
                self.heard.append(self.lines.get(timeout=min(left, 0.1)))
            except queue.Empty:
                if self.process.poll() is not None and self.lines.empty():
                    break
                continue
            if re.search(pattern, self.heard[-1]):
                return self.heard[-1]
        raise TimeoutError(f"no \"{pattern}\" among:\n  " + "\n  ".join(self.heard[-8:]))

    def end(self, how=signal.SIGTERM, seconds=10):
        """Its exit code and how long it took to end."""
        begun = time.monotonic()
        if self.process.poll() is None:
            self.process.send_signal(how)
        code = self.process.wait(seconds)
        return code, time.monotonic() - begun

    def said(self):
        self.process.wait(60)
        time.sleep(0.1)
        while not self.lines.empty():
            self.heard.append(self.lines.get())
        return "\n".join(self.heard)


class VirtualDevices:
    """A virtual room and a navigation in it; at a terminal where orders are to be confirmed by typing."""

    def __init__(self, program, folder, *options, room=(), begins="waiting for AP", terminal=False):
        self.program, self.folder = program, folder
        folder.mkdir()
        self.port, self.plan, self.session = free_port(), folder / "plan.json", folder / "session"
        self.room = Program(program, "virtual-or", "--size", 512, "--rate", 60, "--plan", self.plan, "--receiver-port",
                            self.port, "--tracker-port", 0, "--rtde-port", 0, "--dashboard-port", 0, "--script-port", 0, *room)
        self.room.wait_for("^commands: ")
        self.terminal = pty.openpty() if terminal else None
        self.navigation = self.navigate(*options)
        self.navigation.wait_for(begins)
        time.sleep(EXPOSURE_S)

    def navigate(self, *options):
        # So that SIGXFSZ stays ignored, as Python has it, and a limit on files is like a full disk.
        words = ["navigate", self.plan, "--out", self.session, "--port", self.port, *options]
        if self.terminal:
            return Program(self.program, *words, stdin=self.terminal[1], restore_signals=False)
        return Program(self.program, *words, "--yes", restore_signals=False)

    def type(self, words):
        os.write(self.terminal[0], words.encode())

    def confirm(self):
        """Types "go" once it is asked for: what is typed before is discarded."""
        self.navigation.wait_for("Type \"go\"", 120)
        self.type("go\n")

    def register(self):
        """Both X-rays, and each motion of the robot's registration confirmed."""
        self.expose()
        self.navigation.wait_for("^ *9: tip", 120)
        for pose in range(1, 10):
            self.confirm()
            self.navigation.wait_for(f"register: pose {pose}")

    def plan_again(self, name, withdrawn=False):
        """After a refusal at the terminal, which waits for Enter: until the tool is at the femur's tunnel."""
        time.sleep(EXPOSURE_S)
        self.type("\n")
        if withdrawn:
            self.navigation.wait_for("femur: withdraw")
            self.confirm()
        self.navigation.wait_for("^preview: ", 120)
        self.confirm()
        check(f"{name}: {self.navigation.wait_for('femur: distance from', 120)}", True)
        self.navigation.end(signal.SIGKILL)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.room.process.poll() not in (None, 0):
            check(f"virtual-or ended with {self.room.process.poll()}", False)
        for each in (self.navigation, self.room):
            each.end(signal.SIGKILL)
        for end in self.terminal or ():
            os.close(end)

    def say(self, line, answer):
        self.room.process.stdin.write(line + "\n")
        self.room.process.stdin.flush()
        return self.room.wait_for(answer, 30)

    def shoot(self, view, then):
        """Shoots until it is taken: on a busy machine the tracker may stutter."""
        for _ in range(5):
            self.say(f"shoot {view}", f"shot {view}")
            if "expose again" not in self.navigation.wait_for(f"expose again|{then}"):
                return
            time.sleep(EXPOSURE_S)
        raise TimeoutError(f"{view} is never taken")

    def touch(self, bone, then):
        """Holds the pointer there and presses Enter until it is seen at rest."""
        self.say(f"touch {bone}", f"touching {bone}")
        for _ in range(5):
            time.sleep(EXPOSURE_S)
            self.navigation.process.stdin.write("\n")
            self.navigation.process.stdin.flush()
            if not self.navigation.wait_for(f"; again$|{then}").endswith("; again"):
                return
        raise TimeoutError(f"{bone} is never seen touched")

    def expose(self):
        self.shoot("AP", "waiting for LAT")
        self.shoot("LAT", "^measure: ")

    def rested_s(self):
        """How long the arm has been at rest; nothing while it moves."""
        found = re.search(r"at rest for ([\d.]+) s", self.say("where", "^tip "))
        return float(found.group(1)) if found else None

    def wait_moving(self):
        for _ in range(1000):
            if "moving" in self.say("where", "^tip "):
                return
            time.sleep(0.005)
        raise TimeoutError("the robot never moves")

    def stop_s(self, begun):
        """How long the arm moved on after that moment."""
        time.sleep(1)
        rested = self.rested_s()
        return 9.9 if rested is None else time.monotonic() - begun - rested

    def expect_end(self, name, reason, code=3):
        ended = self.navigation.process.wait(30)
        said = self.navigation.said()
        check(f"{name}: ends with {reason}", ended == code and reason in said, said.splitlines()[-1])

    def expect_replay(self, name):
        replayed = subprocess.run([self.program, "replay", self.session], capture_output=True, text=True)
        check(f"{name}: the record is whole and comes out the same", replayed.returncode == 0,
              (replayed.stdout + replayed.stderr).strip().splitlines()[-1])
