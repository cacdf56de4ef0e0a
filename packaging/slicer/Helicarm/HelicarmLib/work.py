# SPDX-License-Identifier: Apache-2.0
"""Measures a case beside the window: by the Python package where it is installed, else by the program."""
import importlib
import json
import os
import pathlib
import queue
import shutil
import subprocess
import threading


class Cancelled(Exception):
    """Raised inside the measurement by `Work.cancel`."""


def package():
    """The Python package of helicarm, or None."""
    try:
        return importlib.import_module("helicarm")
    except ImportError:
        return None


def find_program(chosen=""):
    """Path of the program: the chosen one, that of HELICARM_PROGRAM, or the one in the path; None if there is none."""
    for candidate in (chosen, os.environ.get("HELICARM_PROGRAM", "")):
        if candidate:
            return candidate if os.access(candidate, os.X_OK) and not os.path.isdir(candidate) else None
    return shutil.which("helicarm")


def views_with_cameras(case_folder):
    """The case's views that bring the camera of another program: such a case is registered, not calibrated."""
    case = json.loads((pathlib.Path(case_folder) / "case.json").read_text(encoding="utf-8"))
    return [view for view in case.get("views", []) if view.get("camera")]


class Work:
    """One measurement. `poll` in the window's thread returns the lines since the last call; `done` is then true once the
    work has ended, with `failure` None or a sentence."""

    def __init__(self, case_folder, result_folder, *, program=None, environment=None):
        self.case_folder, self.result_folder = pathlib.Path(case_folder), pathlib.Path(result_folder)
        self.done, self.failure = False, None
        self._lines, self._process, self._cancelled = queue.Queue(), None, threading.Event()
        self._environment = environment
        self._program = program
        self._thread = threading.Thread(target=self._guarded, daemon=True)
        self._thread.start()

    def poll(self, wait_s=0.01):
        """Waits shortly, so that the other thread gets its turn, and returns the new lines."""
        self._thread.join(wait_s)
        ended, lines = not self._thread.is_alive(), []
        while not self._lines.empty():
            lines.append(self._lines.get())
        self.done = ended
        return lines

    def cancel(self):
        self._cancelled.set()
        if self._process:
            self._process.terminate()

    def _guarded(self):
        try:
            views = views_with_cameras(self.case_folder)
            (self._by_program if self._program else self._by_package)("register" if views else "run")
            self._write_cameras(views)
        except Cancelled:
            pass
        except Exception as error:  # shown to the user
            self.failure = f"{type(error).__name__}: {error}"
        if self._cancelled.is_set():
            self.failure = "cancelled"

    def _by_package(self, command):
        helicarm = package()

        def progress(stage):
            self._lines.put(str(stage))
            if self._cancelled.is_set():
                raise Cancelled

        if command == "run":
            helicarm.run_case(str(self.case_folder), progress=progress).write(str(self.result_folder))
        else:
            helicarm.register(str(self.case_folder), out=str(self.result_folder), progress=progress)

    def _by_program(self, command):
        words = [str(self._program), command, str(self.case_folder), "--out", str(self.result_folder)]
        self._process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                         stderr=subprocess.STDOUT, text=True, errors="replace", env=self._environment)
        if self._cancelled.is_set():
            self._process.terminate()
        last = ""
        for line in self._process.stdout:
            last = line.rstrip() or last
            self._lines.put(line.rstrip())
        code = self._process.wait()
        if code:
            self.failure = f"exit code {code}: {last}"

    def _camera(self, file):
        if not self._program:
            camera = package().import_camera(str(file))
            height, width = camera.shape or (None, None)
            return {"K": camera.K.tolist(), "R": camera.R.tolist(), "t": camera.t.tolist(),
                    "image_size": width and [width, height]}
        done = subprocess.run([str(self._program), "import", str(file), "--json"], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, errors="replace", env=self._environment)
        if done.returncode:
            raise ValueError(done.stderr.strip())
        return json.loads(done.stdout)

    def _write_cameras(self, views):
        """cameras.json beside registration.json, which holds no cameras: to show them."""
        if not views or not self.result_folder.is_dir() or self._cancelled.is_set():
            return
        cameras = []
        for view in views:
            try:
                cameras.append({"name": view["name"], **self._camera(self.case_folder / view["camera"])})
            except Exception as error:  # the models can be shown without it
                self._lines.put(f"{view['name']}: camera not shown: {error}")
        (self.result_folder / "cameras.json").write_text(json.dumps({"views": cameras}), encoding="utf-8")
