# SPDX-License-Identifier: Apache-2.0
"""The executable under test, named as the first argument of each test."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)


def run(*arguments, program=PROGRAM, **options):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, errors="replace",
                          stdin=subprocess.DEVNULL, **options)


class SimulatedCase(unittest.TestCase):
    """A simulated case of 512 pixels in `root / "case"`."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        done = run("simulate", cls.root / "case", "--size", 512, "--seed", 5, "--quiet")
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()
